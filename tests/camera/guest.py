"""One command in a throw-away Debian guest that shares this machine's files.

QEMU emulates the processor (TCG), so neither /dev/kvm nor a right to it is needed. The host's root
is mounted read-only under a tmpfs; what is written outside one shared folder is lost.

Domain : the guest's clock counts instructions, 4 ns each, and leaps over idle time: what happens
         there does not depend on how busy this machine is. It leaps ahead, too, while the guest
         waits for the host, so programs that measure time first load all that they need.
Input  : a command, the kernel modules that it needs, a folder to share.
Output : its exit status; its output and the serial log lie in the shared folder.
Cost   : 8 s of a processor for booting, 8 for Python with numpy and OpenCV. Pauses cost nothing.
Fails  : on processors other than x86-64, and where a tool is missing: GuestUnavailable says which.
"""

import os
import platform
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.camera.guest_kernel import Kernel, cached_kernel
from tests.camera.initramfs import command_script, initramfs
from tests.camera.unavailable import GuestUnavailable

QEMU = "qemu-system-x86_64"
INSTALL = "apt-get install --no-install-recommends qemu-system-x86 busybox-static"
BOOT_MODULES = ("virtio_pci", "9pnet_virtio", "9p", "overlay")

PROCESSOR = "Nehalem"
"""The oldest that numpy's wheels run on: emulating later vector units costs more than it saves."""

MEMORY_MIB = 1024

GRACE_S = 5.0
"""How long after its time limit a guest dies whose runner is not there to kill it."""


class GuestFailed(Exception):
    """The guest ended without the command's status; the message ends with its last words."""


@dataclass(frozen=True)
class GuestRun:
    """What a command in the guest came to."""

    status: int
    output: str
    duration_s: float


def run_in_guest(
    command: Sequence[str | Path],
    *,
    share: Path,
    modules: Sequence[str] = (),
    environment: Mapping[str, str] | None = None,
    limit_s: float,
) -> GuestRun:
    """Return the result of a command that runs as root in a new guest.

    Parameters
    ----------
    command : sequence of str
        Runs in this process's working folder, which the guest sees as all of the host's files.
    share : Path
        An existing folder, at the same path in the guest: what is written there is kept.
        `output.log` (the command's), `serial.log` (the guest's) and `qemu.log` are put into it.
    modules : sequence of str
        Kernel modules, loaded with those that they depend on; "vivid n_devs=1" gives parameters.
    environment : mapping or None
        Variables beside PATH and HOME. Nothing else of the host's environment is passed on.
    limit_s : float
        The guest is killed after this time, also if this process is itself killed meanwhile.

    Raises
    ------
    GuestUnavailable
        If the guest cannot be started here.
    GuestFailed
        If it took longer than `limit_s` or ended without a status.
    """
    busybox = _require_tools()
    kernel = cached_kernel()
    share = share.resolve()
    variables = {"PATH": os.environ["PATH"], "HOME": "/tmp", "LANG": "C.UTF-8"}
    variables |= {"PYTHONDONTWRITEBYTECODE": "1", **(environment or {})}
    script = command_script(command, Path.cwd(), share, variables)
    (share / "command.sh").write_text(script)
    status_file = share / "status"
    status_file.unlink(missing_ok=True)
    started_s = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="fishlight-guest-") as scratch:
        ramdisk = Path(scratch) / "initramfs"
        try:
            ramdisk.write_bytes(_ramdisk(kernel, busybox, modules, share))
        except OSError as error:
            raise GuestUnavailable(f"{ramdisk}: {error.strerror}") from error
        in_time = run_bounded(
            qemu_command(kernel.image, ramdisk, share), share / "qemu.log", limit_s
        )
    duration_s = time.monotonic() - started_s
    if not status_file.exists() or not status_file.read_text().strip():
        reason = "ended without a status" if in_time else f"was killed after {limit_s:g} s"
        raise GuestFailed(f"the guest {reason}; its logs are in {share}\n{_last_words(share)}")
    output = (share / "output.log").read_text(errors="replace")
    return GuestRun(int(status_file.read_text()), output, duration_s)


def qemu_command(image: Path, ramdisk: Path, share: Path) -> list[str]:
    """Return QEMU's command line."""
    return [
        *(QEMU, "-machine", "q35,vmport=off", "-accel", "tcg", "-cpu", PROCESSOR),
        *("-smp", "1", "-icount", "shift=2,sleep=off", "-m", str(MEMORY_MIB)),
        *("-nodefaults", "-no-user-config", "-no-reboot", "-display", "none"),
        *("-serial", f"file:{share / 'serial.log'}"),
        *("-kernel", str(image), "-initrd", str(ramdisk)),
        *("-append", "console=ttyS0 quiet panic=-1 mitigations=off nokaslr tsc=reliable"),
        *("-virtfs", "local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap"),
        *("-virtfs", f"local,path={_escaped(share)},mount_tag=share,security_model=none"),
    ]


def run_bounded(command: Sequence[str], log: Path, limit_s: float) -> bool:
    """Run a command and whatever it starts for at most `limit_s`; whether it ended by itself.

    coreutils' timeout stands between: it ends the command if this process is killed and cannot.
    """
    with log.open("wb") as output:
        process = subprocess.Popen(
            ["timeout", "--signal=KILL", f"{limit_s + GRACE_S:g}", *command],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            process.wait(limit_s)
        except subprocess.TimeoutExpired:
            return False
        finally:  # an interrupt, or a test's own time-out, comes this way too
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
    return True


def _require_tools() -> Path:
    """Return busybox; GuestUnavailable if anything that starts a guest is missing."""
    if platform.machine() != "x86_64":
        raise GuestUnavailable(f"the guest is x86-64, this machine {platform.machine()}")
    busybox = shutil.which("busybox")
    for name, found in ((QEMU, shutil.which(QEMU)), ("busybox", busybox)):
        if found is None:
            raise GuestUnavailable(f"no {name}; {INSTALL}")
    assert busybox is not None
    if b"/ld-linux" in Path(busybox).read_bytes()[:4096]:
        raise GuestUnavailable(
            f"{busybox} needs shared libraries, a static one is wanted; {INSTALL}"
        )
    return Path(busybox)


def _ramdisk(kernel: Kernel, busybox: Path, modules: Sequence[str], share: Path) -> bytes:
    boot = kernel.modules(BOOT_MODULES)
    present = {name for name, _ in boot}
    parameters = {name: rest for name, _, rest in (module.partition(" ") for module in modules)}
    late = [
        (name, elf, parameters.get(name, ""))
        for name, elf in kernel.modules([*BOOT_MODULES, *parameters])
        if name not in present
    ]
    return initramfs(busybox.read_bytes(), boot, late, share)


def _escaped(path: Path) -> str:
    """A path as QEMU's options want it: they are separated by commas."""
    return str(path).replace(",", ",,")


def _last_words(share: Path) -> str:
    """The ends of the logs."""
    texts = (
        (share / name).read_text(errors="replace").strip()
        for name in ("qemu.log", "serial.log", "output.log")
        if (share / name).exists()
    )
    return "\n".join("\n".join(text.splitlines()[-12:]) for text in texts if text)
