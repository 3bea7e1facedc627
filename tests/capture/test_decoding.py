"""A decoder that crashes, hangs or is too greedy costs its file and no more."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from capture import decoding
from capture.decoding import decode
from capture.errors import InputError, UnreadableFrame
from capture.exr import read_exr, write_exr

Ask = Callable[[str], tuple[dict[str, Any], dict[str, Any]]]

ROOT = Path(__file__).resolve().parents[2]
PIXELS = np.random.default_rng(5).random((30, 40)).astype(np.float32)

DECODERS = """
import os, signal, sys, time
import numpy as np
from capture import decoding_worker
from capture.errors import InputError

def decode(path):
    word = path.read_text()
    if word == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if word == "leave":
        os._exit(3)
    if word == "hang":
        time.sleep(60)
    if word == "eat":
        bytearray(2**40)
    if word in ("left", "right"):  # waits for the other one, which has to be decoded meanwhile
        path.with_suffix(".here").touch()
        both = [path.with_name(name) for name in ("left.here", "right.here")]
        end_s = time.monotonic() + 20
        while not all(each.exists() for each in both) and time.monotonic() < end_s:
            time.sleep(0.01)
    if word == "refuse":
        raise InputError(f"{path}: not of a kind that is read")
    if word == "print":
        os.write(1, b"noise"), os.write(2, b"noise")
    if word == "fail":
        {}["a key that is not there"]
    return {"process": os.getpid(), "word": word}, {"pixels": np.arange(6.0).reshape(2, 3)}

decoding_worker.DECODERS["test"] = "__main__:decode"
decoding_worker.main()
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Where workers start whose decoder does what the file says."""
    folder = tmp_path_factory.mktemp("workers")
    (folder / "decoders.py").write_text(DECODERS)
    idle: list[Any] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(decoding, "_COMMAND", (sys.executable, "-P", str(folder / "decoders.py")))
        patch.setattr(decoding, "_idle", idle)
        yield folder
        for worker in idle:
            worker.end()


@pytest.fixture
def ask(folder: Path) -> Ask:
    def ask(word: str) -> tuple[dict[str, Any], dict[str, Any]]:
        path = folder / f"{word}.txt"
        path.write_text(word)
        return decode("test", path)

    return ask


def test_one_process_decodes_file_after_file(ask: Ask) -> None:
    first, arrays = ask("one")
    np.testing.assert_array_equal(arrays["pixels"], [[0, 1, 2], [3, 4, 5]])
    second, _ = ask("two")
    assert (first["word"], second["word"]) == ("one", "two")
    assert first["process"] == second["process"] != os.getpid()


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("crash", r"crashed \(SIGSEGV\); the file is damaged"),
        ("leave", "ended with code 3"),
        ("eat", "more memory"),
    ],
)
def test_a_decoder_that_fails_costs_its_file(ask: Ask, word: str, told: str) -> None:
    with pytest.raises(UnreadableFrame, match=rf"{word}\.txt: .*{told}"):
        ask(word)
    assert ask("next")[0]["word"] == "next"


def test_a_decoder_that_hangs_is_stopped(ask: Ask, monkeypatch: pytest.MonkeyPatch) -> None:
    ask("one")
    with monkeypatch.context() as patch:
        patch.setattr(decoding, "_TIMEOUT_S", 0.2)
        with pytest.raises(UnreadableFrame, match=r"hang\.txt: not decoded within 0\.2 s"):
            ask("hang")
    assert ask("next")[0]["word"] == "next"


def test_a_refusal_stays_one_and_keeps_the_process(ask: Ask) -> None:
    process = ask("one")[0]["process"]
    with pytest.raises(InputError, match="not of a kind") as caught:
        ask("refuse")
    assert not isinstance(caught.value, UnreadableFrame)
    assert ask("two")[0]["process"] == process


def test_what_libraries_print_is_neither_shown_nor_taken_for_an_answer(
    ask: Ask, capfd: pytest.CaptureFixture[str]
) -> None:
    assert ask("print")[0]["word"] == "print"
    assert capfd.readouterr() == ("", "")


def test_a_defect_of_ours_keeps_its_traceback(ask: Ask) -> None:
    with pytest.raises(RuntimeError, match="a key that is not there"):
        ask("fail")


def test_a_process_that_died_meanwhile_is_not_blamed_on_the_next_file(ask: Ask) -> None:
    process = ask("one")[0]["process"]
    os.kill(process, signal.SIGKILL)
    decoding._idle[0]._process.wait()
    assert ask("two")[0]["process"] != process


def test_threads_have_a_process_each(ask: Ask) -> None:
    with ThreadPoolExecutor(2) as pool:
        answers = pool.map(ask, ["left", "right"])
    assert len({facts["process"] for facts, _ in answers}) == 2


def test_a_crash_inside_an_exr_sequence_is_one_bad_frame(tmp_path: Path) -> None:
    # The real worker is killed by another hand while it is at a file.
    path = tmp_path / "a.exr"
    write_exr(path, {"R": PIXELS}, {})
    read_exr(path)
    process = decoding._idle[-1]._process.pid
    os.kill(process, signal.SIGSTOP)

    def crash() -> None:
        os.kill(process, signal.SIGSEGV)  # dealt with as soon as it goes on
        os.kill(process, signal.SIGCONT)

    threading.Timer(0.1, crash).start()
    with pytest.raises(UnreadableFrame, match=r"a\.exr: its decoder crashed \(SIGSEGV\)"):
        read_exr(path)
    np.testing.assert_array_equal(read_exr(path).channels["R"], PIXELS)


def test_no_process_outlives_the_command(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    write_exr(path, {"R": PIXELS}, {})
    program = (
        "import sys; from pathlib import Path; from capture import decoding, exr\n"
        "exr.read_exr(Path(sys.argv[1])); print(decoding._idle[0]._process.pid)"
    )
    ran = subprocess.run(
        [sys.executable, "-W", "error", "-c", program, str(path)],
        capture_output=True,
        check=True,
        cwd=ROOT,
    )
    assert ran.stderr == b""
    with pytest.raises(ProcessLookupError):
        os.kill(int(ran.stdout), 0)
