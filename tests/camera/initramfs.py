"""The guest's first file system: busybox, kernel modules, and the script that mounts the rest.

Output : a cpio archive in the "newc" form that the kernel unpacks (kernel documentation,
         driver-api/early-userspace/buffer-format).
"""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

_FOLDERS = ("bin", "dev", "host", "modules", "proc", "root", "sys", "upper")

_INIT = """\
#!/bin/busybox sh
B=/bin/busybox
fail() {{ echo "guest: $1"; $B poweroff -f; }}
$B mount -t proc proc /proc
$B mount -t sysfs sys /sys
$B mount -t devtmpfs dev /dev
{boot_modules}
$B mount -t tmpfs tmpfs /upper
$B mkdir /upper/files /upper/work
P=trans=virtio,version=9p2000.L,msize=1048576
$B mount -t 9p -o $P,ro,cache=loose host /host || fail "the host's root cannot be mounted"
$B mount -t overlay -o lowerdir=/host,upperdir=/upper/files,workdir=/upper/work overlay /root \\
    || fail "the overlay cannot be mounted"
$B mount --move /dev /root/dev
$B mount --bind /proc /root/proc
$B mount --bind /sys /root/sys
$B mkdir -p /root/dev/shm /root/tmp /root{share}
$B mount -t tmpfs tmpfs /root/dev/shm
$B mount -t 9p -o $P share /root{share} || fail "the shared folder cannot be mounted"
{late_modules}
$B chroot /root /bin/sh {share}/command.sh
$B sync
$B poweroff -f
"""

_COMMAND = """\
cd {folder}
env -i {variables} {command} >{share}/output.log 2>&1 </dev/null
echo $? >{share}/status
"""


def command_script(
    command: Sequence[str | Path], folder: Path, share: Path, variables: Mapping[str, str]
) -> str:
    """Return the shell script that runs the command inside and notes its status."""
    return _COMMAND.format(
        folder=shlex.quote(str(folder)),
        variables=shlex.join(f"{name}={value}" for name, value in variables.items()),
        command=shlex.join(map(str, command)),
        share=shlex.quote(str(share)),
    )


def initramfs(
    busybox: bytes,
    boot_modules: Sequence[tuple[str, bytes]],
    late_modules: Sequence[tuple[str, bytes, str]],
    share: Path,
) -> bytes:
    """Return the archive.

    Parameters
    ----------
    busybox : bytes
        A static one.
    boot_modules : sequence of (name, ELF)
        Loaded before the host's files are mounted.
    late_modules : sequence of (name, ELF, parameters)
        Loaded after.
    share : Path
        Mounted writable, at the same place; its `command.sh` is run.
    """
    init = _INIT.format(
        boot_modules="\n".join(_insmod(name) for name, _ in boot_modules),
        late_modules="\n".join(_insmod(name, parameters) for name, _, parameters in late_modules),
        share=shlex.quote(str(share)),
    )
    entries = [_entry(name, 0o040755) for name in _FOLDERS]
    entries.append(_entry("dev/console", 0o020600, device=(5, 1)))
    entries.append(_entry("bin/busybox", 0o100755, busybox))
    entries.append(_entry("init", 0o100755, init.encode()))
    for name, elf in (*boot_modules, *((name, elf) for name, elf, _ in late_modules)):
        entries.append(_entry(f"modules/{name}.ko", 0o100644, elf))
    entries.append(_entry("TRAILER!!!", 0))
    return b"".join(entries)


def _insmod(name: str, parameters: str = "") -> str:
    return f'$B insmod /modules/{name}.ko {parameters} || fail "{name} cannot be loaded"'


def _entry(name: str, mode: int, data: bytes = b"", device: tuple[int, int] = (0, 0)) -> bytes:
    encoded = name.encode() + b"\0"
    # inode, mode, uid, gid, links, mtime, size, device (2), special device (2), name size, check
    fields = (0, mode, 0, 0, 1, 0, len(data), 0, 0, *device, len(encoded), 0)
    header = b"070701" + b"".join(b"%08X" % field for field in fields)
    return _padded(header + encoded) + _padded(data)


def _padded(data: bytes) -> bytes:
    return data + b"\0" * (-len(data) % 4)
