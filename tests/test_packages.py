"""What is installed: pyproject.toml names each package, or an installed fishlight lacks it."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_every_package_is_installed():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    stages = project["tool"]["importlinter"]["root_packages"]
    found = {
        ".".join(path.parent.relative_to(ROOT).parts)
        for stage in stages
        for path in (ROOT / stage).rglob("__init__.py")
    }
    assert set(project["tool"]["setuptools"]["packages"]) == found


def test_every_folder_of_lighting_has_its_place_among_the_layers():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    [contract] = [
        contract
        for contract in project["tool"]["importlinter"]["contracts"]
        if contract.get("containers") == ["lighting"]
    ]
    placed = {name.strip() for layer in contract["layers"] for name in layer.split("|")}
    assert {path.parent.name for path in (ROOT / "lighting").glob("*/__init__.py")} <= placed
