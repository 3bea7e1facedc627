"""The main job, from a recording to lights and pictures, through the command line."""

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from lighting.environment_files import read_environment
from lighting.light_files import read_lights
from render.main import main

pytestmark = pytest.mark.gl

RECORDINGS = Path(__file__).resolve().parents[2] / "recordings"
FISHLIGHT = [sys.executable, "-c", "from render.main import main; main()"]
SMALL = ["--count", "12", "--height", "64", "--size", "96x64"]


def fishlight(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*FISHLIGHT, *map(str, arguments)], capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def short_recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first four brackets of the bundled outdoor recording."""
    folder = tmp_path_factory.mktemp("recording") / "short"
    shutil.copytree(RECORDINGS / "outdoor", folder, ignore=shutil.ignore_patterns("truth"))
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["frames"] = [frame for frame in manifest["frames"] if frame["bracket"] < 4]
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder


@pytest.fixture(scope="module")
def replayed(short_recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("replay") / "out"
    timings = output.parent / "t.json"
    done = fishlight("replay", short_recording, "-o", output, *SMALL, "--timings", timings)
    assert done.returncode == 0, done.stderr
    assert "4 brackets captured, 0 replaced, 4 merged, 4 rendered, 0 failed" in done.stdout
    return output


def test_every_bracket_leaves_a_map_lights_and_a_picture(replayed: Path) -> None:
    names = [f"{index:06d}" for index in range(4)]
    for folder, suffix in (("maps", ".exr"), ("lights", ".json"), ("pictures", ".png")):
        assert sorted(path.stem for path in (replayed / folder).glob(f"*{suffix}")) == names
    assert (replayed / "video.mp4").stat().st_size > 1000
    session = json.loads((replayed / "session.json").read_text())
    assert session["status"] == "complete"
    assert session["counters"]["rendered"] == 4


def test_the_lights_hold_the_energy_of_their_map(replayed: Path) -> None:
    for path in sorted((replayed / "maps").glob("*.exr")):
        environment, _ = read_environment(path)
        lights = read_lights(replayed / "lights" / f"{path.stem}.json")
        assert len(lights) == 12
        np.testing.assert_allclose(lights.irradiance.sum(axis=0), environment.integral(), rtol=1e-5)


def test_timings_name_every_stage_of_every_frame(replayed: Path) -> None:
    timings = json.loads((replayed.parent / "t.json").read_text())
    stages = ["decode", "merge", "remap", "lights", "render", "write"]
    assert list(timings["stages"]) == stages
    assert [list(frame) for frame in timings["frames"]] == [stages] * 4
    assert all(ms >= 0 for frame in timings["frames"] for ms in frame.values())


def test_a_second_replay_gives_the_same_bytes(
    short_recording: Path, replayed: Path, tmp_path: Path
) -> None:
    again = tmp_path / "again"
    assert fishlight("replay", short_recording, "-o", again, *SMALL).returncode == 0
    made = {path.relative_to(replayed) for path in replayed.rglob("*") if path.is_file()}
    assert made == {path.relative_to(again) for path in again.rglob("*") if path.is_file()}
    different = [
        name for name in made if (replayed / name).read_bytes() != (again / name).read_bytes()
    ]
    assert different == []


def test_an_existing_output_is_kept_unless_forced(
    short_recording: Path, replayed: Path, tmp_path: Path
) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(replayed, copy)
    refused = fishlight("replay", short_recording, "-o", copy, *SMALL)
    assert refused.returncode == 2
    assert "--force" in refused.stderr
    assert len(refused.stderr.splitlines()) == 1
    assert fishlight("replay", short_recording, "-o", copy, *SMALL, "--force").returncode == 0


def test_force_leaves_a_folder_alone_that_no_replay_made(
    short_recording: Path, tmp_path: Path
) -> None:
    treasure = tmp_path / "photographs" / "maps"
    treasure.mkdir(parents=True)
    (treasure / "alps.exr").write_text("mine")
    refused = fishlight("replay", short_recording, "-o", treasure.parent, "--force")
    assert refused.returncode == 2
    assert (treasure / "alps.exr").read_text() == "mine"


def test_a_damaged_frame_costs_its_bracket_and_no_more(
    short_recording: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "damaged"
    shutil.copytree(short_recording, folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    victim = next(frame for frame in manifest["frames"] if frame["bracket"] == 2)
    path = folder / victim["file"]
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    output = tmp_path / "out"
    done = fishlight("replay", folder, "-o", output, *SMALL)
    assert done.returncode == 0
    assert "3 rendered, 1 failed" in done.stdout
    assert path.name in done.stderr
    made = sorted(path.stem for path in (output / "maps").glob("*.exr"))
    assert made == ["000000", "000001", "000003"]


def test_a_recording_of_which_nothing_is_usable_fails(
    short_recording: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "empty"
    shutil.copytree(short_recording, folder, ignore=shutil.ignore_patterns("frames"))
    done = fishlight("replay", folder, "-o", tmp_path / "out", *SMALL)
    assert done.returncode == 2
    assert "none of its 4 brackets is usable" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("signal_number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_replay_that_is_stopped_leaves_only_whole_files(
    short_recording: Path, tmp_path: Path, signal_number: signal.Signals
) -> None:
    output = tmp_path / "out"
    child = subprocess.Popen(
        [*FISHLIGHT, "replay", str(short_recording), "-o", str(output), *SMALL[:4]],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    deadline_s = time.monotonic() + 60
    while not list((output / "lights").glob("*.json")) and time.monotonic() < deadline_s:
        assert child.poll() is None, "the replay ended before it could be stopped"
        time.sleep(0.01)
    child.send_signal(signal_number)
    child.wait(timeout=30)
    assert json.loads((output / "session.json").read_text())["status"] == "running"
    for path in (output / "lights").glob("[0-9]*.json"):
        assert len(read_lights(path)) == 12
    for path in (output / "maps").glob("[0-9]*.exr"):
        read_environment(path)
    if signal_number is not signal.SIGKILL:
        assert list(output.rglob(".partial-*")) == []
    assert fishlight("replay", short_recording, "-o", output, *SMALL, "--force").returncode == 0
    assert list(output.rglob(".partial-*")) == []


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (["--method", "magic"], "magic"),
        (["--count", "0"], "number of lights"),
        (["--height", "0"], "--height"),
        (["--size", "640"], "WIDTHxHEIGHT"),
        (["--timings", "nowhere/t.json"], "nowhere is not a folder"),
        (["--mesh", "none.obj"], "none.obj"),
        (["--calibration", "none.json"], "none.json"),
    ],
)
def test_wrong_arguments_change_nothing(
    short_recording: Path,
    replayed: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    wrong: list[str],
    message: str,
) -> None:
    before = {path: path.stat().st_mtime_ns for path in replayed.rglob("*")}
    for output, force in ((tmp_path / "out", []), (replayed, ["--force"])):
        with pytest.raises(SystemExit, match="2"):
            main(["replay", str(short_recording), "-o", str(output), *wrong, *force])
        printed = capsys.readouterr().err
        assert message in printed
        assert printed.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
    assert {path: path.stat().st_mtime_ns for path in replayed.rglob("*")} == before


def test_an_output_that_the_system_refuses_is_one_line(
    short_recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["replay", str(short_recording), "-o", "/proc/replayed", *SMALL])
    assert capsys.readouterr().err.count("\n") == 1
