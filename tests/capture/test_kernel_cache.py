"""Kernels that numba keeps, and the changes that it does not notice."""

import os
from pathlib import Path

import pytest

from capture.kernel_cache import PACKAGES, drop_stale_kernels

OLD_NS, KERNEL_NS, NEW_NS = (10**18 + day * 86_400 * 10**9 for day in range(3))
SOURCES = {
    "capture/loops.py": "from lighting import sums\n",
    "capture/others.py": "x = 1\n",
    "lighting/sums.py": "def f():\n    import render.deep.inner as inner\n",
    "lighting/near.py": "from render.deep.inner import g\n",
    "render/deep/inner.py": "g = 1\n",
}
KERNELS = ("capture/loops", "capture/others", "lighting/near", "render/deep/inner")


@pytest.fixture
def tree(tmp_path):
    for package in PACKAGES:
        (tmp_path / package).mkdir()
    for name, text in SOURCES.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        os.utime(path, ns=(OLD_NS, OLD_NS))
    for name in KERNELS:
        for ending in ("f-1.py311.nbi", "f-1.py311.1.nbc"):
            kernel = tmp_path / name
            kernel = kernel.parent / "__pycache__" / f"{kernel.name}.{ending}"
            kernel.parent.mkdir(exist_ok=True)
            kernel.write_text("code")
            os.utime(kernel, ns=(KERNEL_NS, KERNEL_NS))
    return tmp_path


def kept(tree):
    """Modules with kernels; either both files of one are there, or none."""
    names = [
        str(path.parent.parent.relative_to(tree) / path.name.split(".")[0])
        for path in tree.rglob("*.nb?")
    ]
    assert all(names.count(name) == 2 for name in names)
    return set(names)


def change(path, when_ns=NEW_NS):
    os.utime(path, ns=(when_ns, when_ns))


def test_nothing_changed_and_nothing_goes(tree):
    drop_stale_kernels(tree)
    assert kept(tree) == set(KERNELS)


def test_kernels_go_whose_module_imports_what_changed(tree):
    """Directly, by way of another module, and in a function."""
    change(tree / "render/deep/inner.py")
    drop_stale_kernels(tree)
    assert kept(tree) == {"capture/others"}


def test_kernels_stay_that_do_not_import_it(tree):
    change(tree / "lighting/sums.py")
    drop_stale_kernels(tree)
    assert kept(tree) == set(KERNELS) - {"capture/loops"}


def test_one_old_overload_is_enough(tree):
    """Numba adds a kernel for new types and renews the index; the older ones stay as they are."""
    change(tree / "render/deep/inner.py")
    change(tree / "lighting/__pycache__/near.f-1.py311.nbi", NEW_NS + 1)
    drop_stale_kernels(tree)
    assert "lighting/near" not in kept(tree)


def test_it_looks_closely_only_after_a_change(tree, monkeypatch):
    drop_stale_kernels(tree)
    monkeypatch.setattr("ast.parse", lambda *_: pytest.fail("looked closely"))
    drop_stale_kernels(tree)
    monkeypatch.undo()
    os.utime(tree / "render/deep/inner.py")
    drop_stale_kernels(tree)
    assert kept(tree) == {"capture/others"}


def test_kernels_that_another_command_removes_meanwhile_do_no_harm(tree, monkeypatch):
    glob = Path.glob

    def gone_after(folder, pattern):
        found = list(glob(folder, pattern))
        for path in found:
            path.unlink()
        return found

    change(tree / "render/deep/inner.py")
    monkeypatch.setattr("pathlib.Path.glob", gone_after)
    drop_stale_kernels(tree)
    monkeypatch.undo()
    assert kept(tree) == set()


def test_where_it_may_not_write_it_does_no_harm(tree, monkeypatch):
    def refuse(*_args, **_more):
        raise PermissionError

    monkeypatch.setattr("pathlib.Path.touch", refuse)
    drop_stale_kernels(tree)
    assert kept(tree) == set(KERNELS)
