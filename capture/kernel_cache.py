"""Compiled kernels on disk, kept only while everything they were made from stays as it was.

numba keeps a kernel as long as its own file does not change, though code of other modules is
compiled into it: after an update it would go on computing as before the update.

Cost   : a look at the date of every source file; after a change also a second of parsing.
Fails  : where source has no dates, or where numba may not write beside it and keeps its kernels
         elsewhere.
"""

import ast
from contextlib import suppress
from pathlib import Path

PACKAGES = ("capture", "calibration", "lighting", "render")


def drop_stale_kernels(root: Path = Path(__file__).parents[1]) -> None:
    """Remove the kernels of modules that import, by any way, source newer than the kernels are.

    `root` is the folder that holds the packages. Kernels are made anew when they are next called.
    """
    sources = {_module_name(path, root): path for path in _source_files(root)}
    changed_ns = {name: path.stat().st_mtime_ns for name, path in sources.items()}
    looked = root / PACKAGES[0] / "__pycache__" / "kernels.looked-at"
    with suppress(OSError):
        if looked.stat().st_mtime_ns > max(changed_ns.values()):
            return
    imports = {name: _imports(path, sources) for name, path in sources.items()}
    for name, path in sources.items():
        newest_ns = max(changed_ns[each] for each in _reachable(name, imports))
        kernels = [
            kernel
            for suffix in ("nbi", "nbc")
            for kernel in (path.parent / "__pycache__").glob(f"{path.stem}.*.{suffix}")
        ]
        with suppress(FileNotFoundError):  # another command that starts may be at the same work
            if any(kernel.stat().st_mtime_ns < newest_ns for kernel in kernels):
                for kernel in kernels:
                    kernel.unlink(missing_ok=True)
    with suppress(OSError):
        looked.parent.mkdir(exist_ok=True)
        looked.touch()


def _source_files(root: Path) -> list[Path]:
    return [path for package in PACKAGES for path in (root / package).rglob("*.py")]


def _module_name(path: Path, root: Path) -> str:
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _imports(path: Path, sources: dict[str, Path]) -> set[str]:
    """Return the modules among `sources` that a file imports, in functions too."""
    named: set[str] = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            named.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            named.add(node.module)
            named.update(f"{node.module}.{alias.name}" for alias in node.names)
    return named & sources.keys()


def _reachable(name: str, imports: dict[str, set[str]]) -> set[str]:
    """Return a module and all that it imports, by way of others too."""
    found, left = {name}, [name]
    while left:
        new = imports[left.pop()] - found
        found |= new
        left += new
    return found
