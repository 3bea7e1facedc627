"""The guest's runner, without a guest: what is missing is said, and nothing outlives its time."""

import lzma
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.camera import guest, guest_kernel
from tests.camera.guest import GuestFailed, qemu_command, run_bounded, run_in_guest
from tests.camera.guest_kernel import Kernel, cached_kernel
from tests.camera.unavailable import GuestUnavailable

PACKAGE = "linux-image-6.1.0-9-amd64"


def module(*depends: str) -> bytes:
    return b"\x7fELF\0license=GPL\0depends=" + ",".join(depends).encode() + b"\0"


def make_kernel(folder: Path, modules: dict[str, bytes], builtin: str = "") -> Kernel:
    base = folder / "lib/modules/6.1.0"
    (base / "kernel/drivers").mkdir(parents=True)
    (base / "modules.builtin").write_text(builtin)
    for name, data in modules.items():
        (base / "kernel/drivers" / name).write_bytes(data)
    (folder / "boot").mkdir()
    (folder / "boot/vmlinuz-6.1.0").write_bytes(b"MZ")
    return Kernel(folder)


@pytest.fixture
def tools(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
    """Return what puts a shell script into the place of a tool."""
    folder = tmp_path / "tools"
    folder.mkdir()
    monkeypatch.setenv("PATH", f"{folder}:{os.environ['PATH']}")

    def put(name: str, script: str) -> None:
        (folder / name).write_text(f"#!/bin/sh\n{script}\n")
        (folder / name).chmod(0o755)

    return put


@pytest.fixture
def package(tmp_path: Path, tools: Callable[[str, str], None]) -> Path:
    """Return the log of downloads of a kernel package that an apt of our own has."""
    root = tmp_path / "package"
    make_kernel(root, {"uvcvideo.ko": module()})
    (root / "lib/modules/6.1.0/kernel/drivers/gpu").mkdir()
    (root / "lib/modules/6.1.0/kernel/drivers/gpu/large.ko").write_bytes(module())
    (root / "DEBIAN").mkdir()
    (root / "DEBIAN/control").write_text(
        f"Package: {PACKAGE}\nVersion: 1\nArchitecture: all\nMaintainer: nobody\nDescription: -\n"
    )
    deb, log = tmp_path / f"{PACKAGE}.deb", tmp_path / "downloads"
    subprocess.run(["dpkg-deb", "-Znone", "--build", root, deb], check=True, capture_output=True)
    tools("apt-cache", f"echo '  Depends: {PACKAGE}'")
    tools("apt-get", f"echo once >> {log}; sleep 0.2; cp {deb} .")
    return log


needs_dpkg = pytest.mark.skipif(
    not Path("/usr/bin/dpkg-deb").exists(), reason="no dpkg-deb: not a Debian system"
)


@needs_dpkg
def test_kernel_is_downloaded_once_by_however_many_ask_at_once(
    package: Path, tmp_path: Path
) -> None:
    with ThreadPoolExecutor(4) as pool:
        kernels = list(pool.map(lambda _: cached_kernel(tmp_path / "cache"), range(4)))
    assert {kernel.folder.name for kernel in kernels} == {PACKAGE}
    assert package.read_text().split() == ["once"]
    assert kernels[0].image.read_bytes() == b"MZ"
    assert [name for name, _ in kernels[0].modules(["uvcvideo"])] == ["uvcvideo"]
    assert not list(kernels[0].folder.rglob("large.ko"))


def test_newest_kernel_of_the_cache_is_taken(tmp_path: Path) -> None:
    for version in ("6.1.0-9", "6.1.0-56", "6.1.0-100"):
        (tmp_path / f"linux-image-{version}-amd64").mkdir()
    assert cached_kernel(tmp_path).folder.name == "linux-image-6.1.0-100-amd64"


@needs_dpkg
@pytest.mark.parametrize(
    ("tool", "script", "reason"),
    [
        ("apt-cache", "exit 0", "apt knows no linux-image-amd64; try apt-get update"),
        ("apt-get", "echo noise >&2; echo 'E: no network' >&2; exit 100", "E: no network"),
        ("apt-get", "touch half.deb", "dpkg-deb"),
        (
            "dpkg-deb",
            '/usr/bin/dpkg-deb "$@"; echo "compressed data is corrupt" >&2; exit 2',
            "compressed data is corrupt",
        ),
        ("tar", "echo 'tar: No space left on device' >&2; exit 2", "No space left"),
    ],
)
def test_failed_fetch_says_why_and_leaves_nothing(
    package: Path,
    tools: Callable[[str, str], None],
    tmp_path: Path,
    tool: str,
    script: str,
    reason: str,
) -> None:
    tools(tool, script)
    with pytest.raises(GuestUnavailable, match=reason):
        cached_kernel(tmp_path / "cache")
    assert [path.name for path in (tmp_path / "cache").iterdir()] == ["lock"]


def test_what_cannot_be_fetched_here_is_said_before_the_download(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(guest_kernel, "NEEDED_BYTES", 2**62)
    with pytest.raises(GuestUnavailable, match="are free, the kernel needs"):
        cached_kernel(tmp_path / "cache")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(GuestUnavailable, match=r"no apt-get: .* Debian package"):
        cached_kernel(tmp_path / "cache")
    (tmp_path / "file").write_text("")
    with pytest.raises(GuestUnavailable, match="no kernel can be kept there"):
        cached_kernel(tmp_path / "file/cache")


def test_modules_come_after_those_they_depend_on(tmp_path: Path) -> None:
    kernel = make_kernel(
        tmp_path,
        {
            "uvcvideo.ko": module("videodev", "usb-core"),
            "usb-core.ko.xz": lzma.compress(module("inside")),
            "videodev.ko": module("mc"),
            "mc.ko": module(),
        },
        builtin="kernel/lib/inside.ko\n",
    )
    loaded = kernel.modules(["mc", "uvcvideo"])
    assert [name for name, _ in loaded] == ["mc", "videodev", "usb_core", "uvcvideo"]
    assert dict(loaded)["usb_core"].startswith(b"\x7fELF")
    with pytest.raises(GuestUnavailable, match="no module webcam"):
        kernel.modules(["webcam"])


def test_module_of_an_unknown_compression_is_refused(tmp_path: Path) -> None:
    kernel = make_kernel(tmp_path, {"mc.ko.zst": b"\x28\xb5\x2f\xfd"})
    with pytest.raises(GuestUnavailable, match=r"mc\.ko\.zst: compressed otherwise"):
        kernel.modules(["mc"])


def test_missing_tools_are_named_with_what_installs_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tools: Callable[[str, str], None]
) -> None:
    tools(guest.QEMU, "exit 0")
    (tmp_path / "tools/busybox").write_bytes(b"\x7fELF/lib64/ld-linux-x86-64.so.2")
    (tmp_path / "tools/busybox").chmod(0o755)
    with pytest.raises(GuestUnavailable, match="a static one is wanted; apt-get install"):
        run_in_guest(["true"], share=tmp_path, limit_s=1)
    monkeypatch.setenv("PATH", str(tmp_path / "tools"))
    (tmp_path / "tools/busybox").unlink()
    with pytest.raises(GuestUnavailable, match="no busybox; apt-get install"):
        run_in_guest(["true"], share=tmp_path, limit_s=1)
    (tmp_path / "tools" / guest.QEMU).unlink()
    with pytest.raises(GuestUnavailable, match=f"no {guest.QEMU}; apt-get install"):
        run_in_guest(["true"], share=tmp_path, limit_s=1)


def test_processor_of_another_kind_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    with pytest.raises(GuestUnavailable, match="this machine aarch64"):
        run_in_guest(["true"], share=tmp_path, limit_s=1)


@pytest.fixture
def emulator(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tools: Callable[[str, str], None]
) -> Callable[[str], None]:
    """Return what puts a shell script into QEMU's place; its working folder is the share."""
    boot = {f"{name}.ko": module() for name in guest.BOOT_MODULES}
    kernel = make_kernel(tmp_path / "kernel", boot)
    monkeypatch.setattr(guest, "cached_kernel", lambda: kernel)
    tools("busybox", "")

    def put(script: str) -> None:
        tools(guest.QEMU, f"cd {tmp_path}\n{script}")

    return put


def test_guest_passes_status_and_output(emulator: Callable[[str], None], tmp_path: Path) -> None:
    emulator("echo hello > output.log; echo 3 > status")
    run = run_in_guest(["false"], share=tmp_path, limit_s=5)
    assert (run.status, run.output) == (3, "hello\n")


def test_status_of_an_earlier_guest_is_not_taken(
    emulator: Callable[[str], None], tmp_path: Path
) -> None:
    (tmp_path / "status").write_text("0\n")
    emulator("echo Kernel panic > serial.log; echo no such machine >&2")
    with pytest.raises(GuestFailed, match="without a status") as failure:
        run_in_guest(["true"], share=tmp_path, limit_s=5)
    assert str(failure.value).splitlines()[1:] == ["no such machine", "Kernel panic"]


def test_guest_that_takes_too_long_is_killed(
    emulator: Callable[[str], None], tmp_path: Path
) -> None:
    emulator("echo still booting > serial.log; exec sleep 60")
    started_s = time.monotonic()
    with pytest.raises(GuestFailed, match=r"killed after 0\.2 s(.|\n)*still booting"):
        run_in_guest(["true"], share=tmp_path, limit_s=0.2)
    assert time.monotonic() - started_s < 10


def test_command_and_folder_are_quoted(emulator: Callable[[str], None], tmp_path: Path) -> None:
    strange = tmp_path / 'it\'s, a "share"'
    strange.mkdir()
    emulator(f"cd '{tmp_path}'/it*; sh ./command.sh")
    command = ["sh", "-c", 'echo "$HOME $1 $GREETING"; pwd; exit 7', "sh", "a  b'c"]
    run = run_in_guest(command, share=strange, environment={"GREETING": "hi; you"}, limit_s=5)
    assert run.status == 7
    assert run.output.splitlines() == ["/tmp a  b'c hi; you", os.getcwd()]


def test_emulator_shares_the_host_read_only_and_the_folder_writable() -> None:
    command = qemu_command(Path("/k/vmlinuz"), Path("/r"), Path("/a,b"))
    host, share = (command[i + 1] for i, word in enumerate(command) if word == "-virtfs")
    assert "path=/," in host
    assert "readonly=on" in host
    assert "path=/a,,b," in share
    assert "readonly" not in share
    assert command[command.index("-accel") + 1].startswith("tcg")


def ended(process_id: int) -> bool:
    """Whether a process is gone, or dead and only waits for its parent to notice."""
    try:
        state = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return True
    return state == "Z"


def wait_until(condition: Callable[[], bool], limit_s: float = 10.0) -> bool:
    end_s = time.monotonic() + limit_s
    while not condition() and time.monotonic() < end_s:
        time.sleep(0.02)
    return condition()


GRANDCHILD = "sleep 60 & echo $! > {}; wait"


def test_time_limit_ends_the_grandchildren_too(tmp_path: Path) -> None:
    note = tmp_path / "id"
    assert not run_bounded(["sh", "-c", GRANDCHILD.format(note)], tmp_path / "log", 0.5)
    assert wait_until(lambda: ended(int(note.read_text())), 2)


def test_command_that_ends_in_time_is_not_killed(tmp_path: Path) -> None:
    assert run_bounded(["sh", "-c", "echo done; echo why >&2"], tmp_path / "log", 5)
    assert (tmp_path / "log").read_text() == "done\nwhy\n"


def test_nothing_outlives_a_runner_that_is_killed(tmp_path: Path) -> None:
    note = tmp_path / "id"
    code = (
        "from pathlib import Path; from tests.camera import guest; guest.GRACE_S = 0.5\n"
        f"guest.run_bounded(['sh', '-c', {GRANDCHILD.format(note)!r}], Path('{tmp_path}/log'), 0.5)"
    )
    with subprocess.Popen([sys.executable, "-c", code]) as runner:
        assert wait_until(lambda: note.exists() and note.read_text().strip() != "")
        runner.send_signal(signal.SIGKILL)
    assert wait_until(lambda: ended(int(note.read_text())), 5)
