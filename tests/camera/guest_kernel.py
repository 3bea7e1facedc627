"""Debian's stock kernel, fetched once with apt and unpacked into a cache, never installed.

Output : Kernel, an image to boot and the modules that a guest asks for, in loading order.
Cost   : the first call on a machine downloads about 70 MB and keeps about 165; later ones, 10 ms.
"""

import fcntl
import lzma
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.camera.unavailable import GuestUnavailable

META_PACKAGE = "linux-image-amd64"
"""Depends on the newest kernel of the distribution."""

DOWNLOAD_LIMIT_S = 120
NEEDED_BYTES = 700 * 2**20

_UNUSED = (
    *(
        f"drivers/{name}"
        for name in ("ata", "gpu", "hwmon", "iio", "infiniband", "mtd", "net", "scsi", "staging")
    ),
    "net/[!9]*",
    "sound/[!c]*",
)
"""Folders of modules that no camera and no file system of the guest depends on."""


@dataclass(frozen=True)
class Kernel:
    """An unpacked kernel package."""

    folder: Path

    @property
    def image(self) -> Path:
        """The bzImage."""
        return next(self.folder.glob("boot/vmlinuz-*"))

    def modules(self, wanted: Sequence[str]) -> list[tuple[str, bytes]]:
        """Return (name, ELF) of these modules, each after those that it depends on.

        Raises
        ------
        GuestUnavailable
            If this kernel has no such module, or keeps it compressed other than by xz.
        """
        files = {
            _plain(path.name.partition(".ko")[0]): path
            for path in self.folder.glob("lib/modules/*/kernel/**/*.ko*")
        }
        (builtin_list,) = self.folder.glob("lib/modules/*/modules.builtin")
        builtin = {_plain(Path(line).stem) for line in builtin_list.read_text().splitlines()}
        loaded: dict[str, bytes] = {}

        def load(name: str) -> None:
            if name in loaded or name in builtin:
                return
            if name not in files:
                raise GuestUnavailable(f"the kernel {self.folder.name} has no module {name}")
            elf = _module(files[name])
            for dependency in dependencies(elf):
                load(dependency)
            loaded[name] = elf

        for name in wanted:
            load(_plain(name))
        return list(loaded.items())


def dependencies(elf: bytes) -> list[str]:
    """Return the modules that a module names in its .modinfo."""
    found = re.search(rb"\0depends=([^\0]*)\0", elf)
    names = found.group(1).decode() if found else ""
    return [_plain(name) for name in names.split(",") if name]


def cached_kernel(cache: Path | None = None) -> Kernel:
    """Return the newest kernel of the cache, which is filled first if it holds none.

    Parameters
    ----------
    cache : Path or None
        A folder; by default `fishlight/guest` of the user's cache. Processes that come here at
        once wait for the one that downloads.

    Raises
    ------
    GuestUnavailable
        If apt is absent, knows no kernel or cannot download it, or the disk is full.
    """
    cache = cache or _user_cache()
    try:
        cache.mkdir(parents=True, exist_ok=True)
        with _locked(cache / "lock"):
            if not _kernels(cache):
                _fetch(cache)
            return Kernel(_kernels(cache)[-1])
    except OSError as error:
        raise GuestUnavailable(f"{cache}: no kernel can be kept there ({error})") from error


def _user_cache() -> Path:
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "fishlight/guest"


def _kernels(cache: Path) -> list[Path]:
    """Complete kernels, the oldest version first."""
    return sorted(
        cache.glob("linux-image-*"),
        key=lambda path: [int(number) for number in re.findall(r"\d+", path.name)],
    )


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)  # the system lets go of it whatever ends this process
        yield


def _fetch(cache: Path) -> None:
    """Download and unpack the newest kernel into `cache`; nothing incomplete stays."""
    for tool in ("apt-get", "apt-cache", "dpkg-deb", "tar"):
        if shutil.which(tool) is None:
            raise GuestUnavailable(f"no {tool}: the guest's kernel is a Debian package")
    free = shutil.disk_usage(cache).free
    if free < NEEDED_BYTES:
        raise GuestUnavailable(
            f"{cache}: {free >> 20} MiB are free, the kernel needs {NEEDED_BYTES >> 20} to unpack"
        )
    facts = _run("apt-cache", "depends", META_PACKAGE, folder=cache)
    named = re.search(r"Depends: (linux-image-\S+)", facts)
    if named is None:
        raise GuestUnavailable(f"apt knows no {META_PACKAGE}; try apt-get update")
    with tempfile.TemporaryDirectory(prefix="partial-", dir=cache) as scratch:
        folder = Path(scratch)
        _run("apt-get", "-q", "download", named.group(1), folder=folder)
        package = next(folder.glob("*.deb"))
        kernel = folder / "kernel"
        kernel.mkdir()
        excluded = " ".join(f"--exclude='./lib/modules/*/kernel/{name}'" for name in _UNUSED)
        unpack = f"tar -x -C '{kernel}' {excluded} ./boot ./lib"
        pipe = f"set -o pipefail; dpkg-deb --fsys-tarfile '{package}' | {unpack}"
        _run("bash", "-c", pipe, folder=folder)
        kernel.rename(cache / named.group(1))


def _run(*command: str, folder: Path) -> str:
    """Return what the command printed; GuestUnavailable with its last line if it fails."""
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
            timeout=DOWNLOAD_LIMIT_S,
            env={**os.environ, "LC_ALL": "C"},
        )
    except subprocess.TimeoutExpired:
        raise GuestUnavailable(f"{command[0]} took longer than {DOWNLOAD_LIMIT_S} s") from None
    if done.returncode:
        complaint = (done.stderr.strip() or "no message").splitlines()[-1]
        raise GuestUnavailable(f"{' '.join(command[:3])} failed: {complaint}")
    return done.stdout


def _module(path: Path) -> bytes:
    data = path.read_bytes()
    if path.suffix == ".xz":
        return lzma.decompress(data)
    if path.suffix != ".ko":
        raise GuestUnavailable(f"{path.name}: compressed otherwise than by xz")
    return data


def _plain(name: str) -> str:
    return name.replace("-", "_")
