"""The main job, from a recording to lights and pictures, through the command line."""

import json
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from calibration.files import read_calibration
from capture.merge import merge_bracket
from capture.pictures import read_picture
from capture.recording import open_recording
from lighting.blocks.block_sums import BlockSums
from lighting.blocks.source_blocks import apply_source_blocks, build_source_blocks
from lighting.light_files import read_lights
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import read_environment
from lighting.maps.remap import apply_remap, build_remap
from lighting.stream.light_stream import LightPlan, next_lights
from render.main import main
from render.session import END_TO_END

pytestmark = pytest.mark.gl

RECORDINGS = Path(__file__).resolve().parents[2] / "recordings"
FISHLIGHT = [sys.executable, "-c", "from render.main import main; main()"]
SMALL = ["--count", "12", "--height", "64", "--size", "96x64"]


def fishlight(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*FISHLIGHT, *map(str, arguments)], capture_output=True, text=True, check=False
    )


def replay_here(*arguments: object) -> None:
    """Replay in this process: it takes a second to start another."""
    with pytest.raises(SystemExit) as end:
        main(["replay", *map(str, arguments)])
    assert not end.value.code


def expected_lights(
    recording_folder: Path, plan: LightPlan, brackets: Sequence[int]
) -> list[LightSet]:
    """Return the lights of these brackets, one after the other, as a replay should find them."""
    recording = open_recording(recording_folder)
    assert recording.calibration_path is not None
    calibration = read_calibration(recording.calibration_path)
    source_blocks = build_source_blocks(calibration, plan.block_rows)
    remap = build_remap(calibration, 64)
    memory, result = None, []
    for index in brackets:
        bracket = recording.read_bracket(index)
        image = merge_bracket(bracket, recording.sensor)
        view: BlockSums | EnvironmentMap = apply_source_blocks(source_blocks, image)
        if plan.method == "inverse-cdf":
            view = apply_remap(remap, image)
        lights, memory = next_lights(view, plan, memory, timestamp_s=bracket.timestamp_s)
        result.append(lights)
    return result


def assert_same_lights(output: Path, brackets: Sequence[int], expected: list[LightSet]) -> None:
    for index, lights in zip(brackets, expected, strict=True):
        written = read_lights(output / "lights" / f"{index:06d}.json")
        assert written.timestamp_s == lights.timestamp_s
        assert written.predicted_error == lights.predicted_error
        np.testing.assert_array_equal(written.directions, lights.directions)
        np.testing.assert_array_equal(written.irradiance, lights.irradiance)
        np.testing.assert_array_equal(written.fill, lights.fill)


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
    assert "brackets: 4 captured, 0 replaced, 4 merged, 4 rendered, 0 failed" in done.stdout
    return output


def test_every_bracket_leaves_a_map_lights_and_a_picture(replayed: Path) -> None:
    names = [f"{index:06d}" for index in range(4)]
    for folder, suffix in (("maps", ".exr"), ("lights", ".json"), ("pictures", ".png")):
        assert sorted(path.stem for path in (replayed / folder).glob(f"*{suffix}")) == names
    assert (replayed / "video.mp4").stat().st_size > 1000
    session = json.loads((replayed / "session.json").read_text())
    assert session["status"] == "complete"
    assert session["counters"]["rendered"] == 4


def test_every_bracket_is_reduced_at_the_source_remembered_and_made_steady(
    short_recording: Path, replayed: Path
) -> None:
    expected = expected_lights(short_recording, LightPlan(12), range(4))
    assert_same_lights(replayed, range(4), expected)
    steps_s = np.diff([lights.timestamp_s for lights in expected])
    np.testing.assert_allclose(steps_s, 0.5)


@pytest.mark.parametrize(("method", "rtol"), [("adaptive", 2e-3), ("inverse-cdf", 1e-5)])
def test_without_smoothing_the_lights_hold_the_energy_of_their_map(
    short_recording: Path, tmp_path: Path, method: str, rtol: float
) -> None:
    # The map of 64 rows is another way to sum up the same pixels than the blocks.
    output = tmp_path / "out"
    wishes = ["--method", method, "--no-steady"]
    replay_here(short_recording, "-o", output, *SMALL, *wishes)
    for path in sorted((output / "maps").glob("*.exr")):
        environment, _ = read_environment(path)
        lights = read_lights(output / "lights" / f"{path.stem}.json")
        assert len(lights) == 12
        np.testing.assert_allclose(lights.integral(), environment.integral(), rtol=rtol)
    plan = LightPlan(12, method, is_steady=False)
    assert_same_lights(output, range(4), expected_lights(short_recording, plan, range(4)))


def test_auto_is_counted_in_the_account(
    short_recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "out"
    wishes = [*SMALL[2:], "--count", "auto", "--error", "0.04"]
    replay_here(short_recording, "-o", output, *wishes)
    found = expected_lights(short_recording, LightPlan(512, error=0.04, is_steady=False), range(4))
    session = json.loads((output / "session.json").read_text())
    assert session["median_lights"] == np.median([len(lights) for lights in found])
    predicted_error = np.median([lights.predicted_error for lights in found])
    assert session["median_predicted_error"] == predicted_error
    assert 0 < predicted_error < 0.04
    printed = capsys.readouterr().out
    assert (
        f"median lights {session['median_lights']:g}, predicted error {predicted_error:.2%}"
        in printed
    )


@pytest.mark.parametrize(("budget_ms", "last_count"), [("1e-6", 16), ("1e9", 64)])
def test_a_budget_bounds_the_lights(
    short_recording: Path, tmp_path: Path, budget_ms: str, last_count: int
) -> None:
    output = tmp_path / "out"
    wishes = ["--count", "auto", "--error", "1e-5", "--budget-ms", budget_ms, "--no-steady"]
    replay_here(short_recording, "-o", output, *SMALL[2:], *wishes)
    counts = [len(read_lights(path)) for path in sorted((output / "lights").glob("*.json"))]
    # Three frames are timed; then it halves, or doubles.
    assert counts == [32, 32, 32, last_count]


def test_opengl_draws_the_same_pictures(
    short_recording: Path, replayed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "out"
    wishes = ["--renderer", "opengl", "--timings", tmp_path / "t.json"]
    replay_here(short_recording, "-o", output, *SMALL, *wishes)
    printed = capsys.readouterr().out
    assert "4 merged, 4 rendered, 0 failed" in printed
    assert "device lights" in printed
    assert "drawn with OpenGL, 2 brackets behind: " in printed
    for picture in sorted((replayed / "pictures").iterdir()):
        other = read_picture(output / "pictures" / picture.name)
        difference = np.abs(read_picture(picture).astype(float) - other)
        assert np.median(difference) < 3  # but at outlines and in shadows
        assert np.mean(difference) < 6


def test_a_frame_rate_draws_smaller_pictures_and_says_so(
    short_recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "out"
    replay_here(short_recording, "-o", output, *SMALL, "--fps", "1e6")
    # Twelve lights are few already; three frames are timed, and then two steps taken.
    drawn = json.loads((output / "session.json").read_text())["drawn_px"]
    assert drawn == [[96, 64]] * 3 + [[68, 45]]
    printed = capsys.readouterr().out
    assert "for 1e+06 brackets a second: median lights 12, pictures drawn in 96×64\n" in printed
    pictures = [read_picture(path) for path in sorted((output / "pictures").iterdir())]
    assert [picture.shape for picture in pictures] == [(64, 96, 3)] * 4
    # The same scene in nearly the same light, but for outlines.
    difference = np.abs(pictures[3].astype(float) - pictures[2])
    assert np.median(difference) < 3
    assert difference.mean() < 6


def test_timings_name_every_stage_of_every_frame(replayed: Path) -> None:
    timings = json.loads((replayed.parent / "t.json").read_text())
    stages = ["decode", "merge", "blocks", "remap", "lights", "render", "write", END_TO_END]
    assert list(timings["stages"]) == stages
    assert [list(frame) for frame in timings["frames"]] == [stages] * 4
    assert all(ms >= 0 for frame in timings["frames"] for ms in frame.values())


def test_a_second_replay_gives_the_same_bytes(
    short_recording: Path, replayed: Path, tmp_path: Path
) -> None:
    again = tmp_path / "again"
    replay_here(short_recording, "-o", again, *SMALL)
    made = {path.relative_to(replayed) for path in replayed.rglob("*") if path.is_file()}
    assert made == {path.relative_to(again) for path in again.rglob("*") if path.is_file()}
    different = [
        name for name in made if (replayed / name).read_bytes() != (again / name).read_bytes()
    ]
    assert different == []


@pytest.mark.slow
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
    short_recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    treasure = tmp_path / "photographs" / "maps"
    treasure.mkdir(parents=True)
    (treasure / "alps.exr").write_text("mine")
    with pytest.raises(SystemExit, match="2"):
        main(["replay", str(short_recording), "-o", str(treasure.parent), "--force"])
    assert capsys.readouterr().err.count("\n") == 1
    assert (treasure / "alps.exr").read_text() == "mine"


def test_a_damaged_frame_costs_its_bracket_and_no_more(
    short_recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
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
    replay_here(folder, "-o", output, *SMALL)
    printed = capsys.readouterr()
    assert "3 rendered, 1 failed" in printed.out
    assert path.name in printed.err
    made = sorted(path.stem for path in (output / "maps").glob("*.exr"))
    assert made == ["000000", "000001", "000003"]
    # What is remembered outlives it, and the time that passed counts.
    assert_same_lights(output, (0, 1, 3), expected_lights(folder, LightPlan(12), (0, 1, 3)))


def test_a_recording_of_which_nothing_is_usable_fails(
    short_recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "empty"
    shutil.copytree(short_recording, folder, ignore=shutil.ignore_patterns("frames"))
    with pytest.raises(SystemExit, match="2"):
        main(["replay", str(folder), "-o", str(tmp_path / "out"), *SMALL])
    assert "not one bracket of 4 is usable" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("signal_number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_replay_that_is_stopped_leaves_only_whole_files(
    short_recording: Path, tmp_path: Path, signal_number: signal.Signals
) -> None:
    """Its files take far longer to write than the first of them to be seen."""
    output = tmp_path / "out"
    child = subprocess.Popen(
        [*FISHLIGHT, "replay", str(RECORDINGS / "indoor"), "-o", str(output), "--size", "320x240"],
        # Tests may run in the background, whose children ignore an interrupt.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
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
        assert len(read_lights(path)) >= 12
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
        (["--error", "0.1"], "give --count auto"),
        (["--count", "auto", "--method", "cells"], "not for cells"),
        (["--count", "auto", "--budget-ms", "0"], "above 0 ms"),
        (["--budget-ms", "30"], "--budget-ms limits --count auto"),
        (["--fps", "0"], "above 0"),
        (["--count", "auto", "--budget-ms", "9", "--fps", "30"], "leave out --budget-ms"),
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
