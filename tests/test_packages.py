"""What is installed: pyproject.toml names each package, or an installed fishlight lacks it."""

import tomllib
from pathlib import Path

import pytest

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


@pytest.mark.parametrize("package", ["lighting", "render"])
def test_every_folder_has_its_place_among_the_layers(package):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    [contract] = [
        contract
        for contract in project["tool"]["importlinter"]["contracts"]
        if contract.get("containers") == [package]
    ]
    placed = {name.strip(" ()") for layer in contract["layers"] for name in layer.split("|")}
    folders = {path.parent.name for path in (ROOT / package).glob("*/__init__.py")}
    assert folders - {"viewer"} <= placed  # a folder of files to serve, without code
