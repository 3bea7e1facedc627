"""A batch: the replay's results to the byte, whatever is cut, lost, damaged or done before."""

import json
import os
import shutil
import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest
from distributed import LocalCluster

from capture.errors import InputError
from capture.output import PARTIAL_PREFIX
from capture.recording import open_recording
from lighting.light_files import read_lights
from lighting.measures.sequence_table import SequenceTable, read_sequence_table
from lighting.stream.light_stream import LightPlan
from render.batch import frames
from render.batch.batch import INDEX_NAME, BatchSummary, run_batch
from render.batch.runs import Settings
from tests.batch.turning_sky import damage, record, replayed, results
from tests.capture.command_line import run

FRAMES = 7
SETTINGS = Settings(("merge", "remap", "lights"), LightPlan(6), 16)


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """Two workers that are threads of this process: quick to start, and seen by monkeypatch."""
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0"
    ) as cluster:
        yield cluster.scheduler_address


@pytest.fixture(scope="module")
def sky(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("sky") / "sky", FRAMES)


@pytest.fixture(scope="module")
def expected(sky: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[bytes]]:
    return replayed(sky, SETTINGS, tmp_path_factory.mktemp("replay") / "out")


@pytest.fixture
def batch(scheduler: str):
    def run_here(*recordings: Path, output: Path, run_length: int = 3, **wishes) -> BatchSummary:
        settings = wishes.pop("settings", SETTINGS)
        return run_batch(
            recordings, output, settings, scheduler=scheduler, run_length=run_length, **wishes
        )

    return run_here


@pytest.mark.parametrize("run_length", [1, 3, FRAMES])
def test_wherever_it_is_cut_it_is_the_replay_to_the_byte(
    batch, sky, expected, tmp_path, run_length
):
    summary = batch(sky, output=tmp_path, run_length=run_length)
    assert (summary.made, summary.kept, summary.has_failures) == (FRAMES, 0, False)
    assert results(tmp_path, sky) == expected


@pytest.mark.gl
def test_fishlight_replay_writes_the_same_files(sky, expected, tmp_path):
    mesh = tmp_path / "triangle.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    small = ["--count", 6, "--height", 16, "--size", "16x16", "--mesh", mesh]
    run("replay", sky, "-o", tmp_path / "out", *small)
    for kind, suffix in (("maps", "exr"), ("lights", "json")):
        paths = sorted((tmp_path / "out" / kind).glob(f"*.{suffix}"))
        assert [path.read_bytes() for path in paths] == expected[kind]


def test_a_method_that_takes_maps_is_the_replay_too(batch, sky, tmp_path):
    settings = Settings(("remap", "lights"), LightPlan(6, "inverse-cdf"), 16)
    batch(sky, output=tmp_path / "batch", settings=settings)
    assert results(tmp_path / "batch", sky) == replayed(sky, settings, tmp_path / "replay")


def written(output: Path) -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in output.glob("*/*/*") if path.is_file()}


def test_what_is_done_is_not_done_again(batch, sky, tmp_path):
    batch(sky, output=tmp_path)
    before = written(tmp_path)
    summary = batch(sky, output=tmp_path)
    assert (summary.made, summary.kept) == (0, FRAMES)
    assert written(tmp_path) == before


def test_a_batch_whose_client_is_killed_goes_on_where_it_was(batch, sky, expected, tmp_path):
    class Killed(BaseException):
        pass

    def kill(_count: int, _is_kept: bool) -> None:
        raise Killed

    with pytest.raises(Killed):
        batch(sky, output=tmp_path, on_frames=kill)
    left = tmp_path / next(tmp_path.glob("sky-*")).name / "maps" / ".partial-left.exr"
    left.write_text("half of a map")
    summary = batch(sky, output=tmp_path)
    assert summary.kept >= 3
    assert summary.made + summary.kept == FRAMES
    assert results(tmp_path, sky) == expected
    assert len(read_sequence_table(tmp_path / INDEX_NAME)) == FRAMES


def test_a_result_that_is_gone_is_made_again_alone(batch, sky, expected, tmp_path):
    batch(sky, output=tmp_path)
    before = written(tmp_path)
    gone = sorted(tmp_path.glob("sky-*/maps/*"))[4]
    gone.unlink()
    summary = batch(sky, output=tmp_path)
    assert (summary.made, summary.kept) == (3, FRAMES - 3)
    assert results(tmp_path, sky) == expected
    changed = {path for path, time_ns in written(tmp_path).items() if before[path] != time_ns}
    assert {path for path in changed if path.parent.name != "runs"} == {gone}


def test_a_recording_that_has_grown_keeps_its_lights(batch, sky, expected, tmp_path):
    grown = tmp_path / "sky"
    shutil.copytree(sky, grown)
    manifest = json.loads((grown / "manifest.json").read_text())
    frames_before = manifest["frames"]
    manifest["frames"] = [frame for frame in frames_before if frame["bracket"] < 4]
    (grown / "manifest.json").write_text(json.dumps(manifest))
    batch(grown, output=tmp_path / "out")
    before = written(tmp_path / "out")
    manifest["frames"] = frames_before
    (grown / "manifest.json").write_text(json.dumps(manifest))
    summary = batch(grown, output=tmp_path / "out")
    assert (summary.made, summary.kept) == (FRAMES - 3, 3)
    assert results(tmp_path / "out", grown) == expected
    after = written(tmp_path / "out")
    assert all(after[path] == time_ns for path, time_ns in before.items())


def test_a_damaged_frame_is_left_out_and_told_and_done_once_it_is_whole(
    batch, sky, expected, tmp_path
):
    damaged = tmp_path / "sky"
    shutil.copytree(sky, damaged)
    damage(damaged, 4)
    output = tmp_path / "out"
    summary = batch(damaged, output=output)
    assert (summary.made, summary.failed_frames) == (FRAMES - 1, 1)
    assert "bracket 4" in summary.reasons[0]
    assert "SHA-256 differs" in summary.reasons[0]
    assert results(output, damaged) == replayed(damaged, SETTINGS, tmp_path / "replay")
    [failed] = [row for row in read_sequence_table(output / INDEX_NAME) if row.failure]
    assert (failed.bracket, failed.lights_file) == (4, None)

    # The frames after it follow another one now: they alone have other lights.
    damage(damaged, 4)
    summary = batch(damaged, output=output)
    assert (summary.made, summary.kept, summary.failed_frames) == (FRAMES - 3, 3, 0)
    rows = read_sequence_table(output / INDEX_NAME)
    assert [(output / row.lights_file).read_bytes() for row in rows] == expected["lights"]


def test_a_recording_that_cannot_be_used_costs_the_others_nothing(batch, sky, expected, tmp_path):
    summary = batch(tmp_path / "none", sky, sky, output=tmp_path / "out")
    assert (summary.made, summary.stopped_recordings) == (FRAMES, 2)
    assert "none holds no manifest.json" in summary.reasons[0]
    assert "same recording" in summary.reasons[1]
    assert results(tmp_path / "out", sky) == expected
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["reasons"] == summary.reasons


def test_a_full_disk_costs_nothing_that_was_done(batch, sky, expected, tmp_path, monkeypatch):
    write = frames.write_environment
    room = [4]

    def write_until_full(path: Path, **what) -> None:
        if not room[0]:
            raise InputError(f"{path}: cannot be written (No space left on device)")
        room[0] -= 1
        write(path, **what)

    monkeypatch.setattr(frames, "write_environment", write_until_full)
    summary = batch(sky, output=tmp_path)
    assert summary.stopped_recordings == 1
    assert "No space left" in summary.reasons[0]
    before = {
        path: time_ns
        for path, time_ns in written(tmp_path).items()
        if path.parent.name == "maps" and not path.name.startswith(PARTIAL_PREFIX)
    }
    assert len(before) == 4
    monkeypatch.undo()
    assert not batch(sky, output=tmp_path).has_failures
    assert results(tmp_path, sky) == expected
    assert {
        path: time_ns for path, time_ns in written(tmp_path).items() if path in before
    } == before


def test_an_index_that_cannot_be_written_ends_in_a_summary_too(batch, sky, tmp_path, monkeypatch):
    def fail(*_: object) -> None:
        raise InputError("index.sqlite: database or disk is full")

    monkeypatch.setattr(SequenceTable, "put", fail)
    summary = batch(sky, output=tmp_path)
    assert summary.reasons == ["index.sqlite: database or disk is full"]
    monkeypatch.undo()
    assert not batch(sky, output=tmp_path).has_failures
    assert len(read_sequence_table(tmp_path / INDEX_NAME)) == FRAMES


def test_a_scheduler_that_goes_away_ends_in_a_summary_too(batch, sky, expected, tmp_path):
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0"
    ) as cluster:
        summary = run_batch(
            [sky],
            tmp_path,
            SETTINGS,
            scheduler=cluster.scheduler_address,
            run_length=3,
            on_frames=lambda *_: cluster.close(),
        )
    assert summary.made == 3
    assert "the scheduler is gone" in summary.reasons[0]
    assert batch(sky, output=tmp_path).kept == 3
    assert results(tmp_path, sky) == expected


def test_a_frame_that_fails_for_no_known_reason_is_tried_three_times(
    batch, sky, tmp_path, monkeypatch
):
    merge, tries = frames.merge_bracket, []

    def merge_all_but_one(bracket, *others):
        if bracket.index == 2:
            tries.append(bracket.index)
            raise ZeroDivisionError("nobody knows why")
        return merge(bracket, *others)

    monkeypatch.setattr(frames, "merge_bracket", merge_all_but_one)
    summary = batch(sky, output=tmp_path)
    assert len(tries) == 3
    assert (summary.made, summary.failed_frames) == (FRAMES - 1, 1)
    assert "ZeroDivisionError in test_batch.py" in summary.reasons[0]


def test_the_index_tells_of_every_frame_what_its_files_do(batch, sky, tmp_path):
    settings = Settings(plan=LightPlan(6), map_height=16)
    batch(sky, output=tmp_path, settings=settings)
    rows = read_sequence_table(tmp_path / INDEX_NAME)
    recording = open_recording(sky)
    assert [row.time_s for row in rows] == list(recording.bracket_timestamps_s)
    for row in rows:
        lights = read_lights(tmp_path / row.lights_file)
        assert row.predicted_error == lights.predicted_error
        assert row.total_irradiance == lights.integral() @ (0.2126, 0.7152, 0.0722)
        assert (row.shortest_s, row.longest_s, row.exposure_count) == (1 / 1000, 1 / 30, 2)
        for name in (row.radiance_file, row.map_file, row.preview_file):
            assert (tmp_path / name).is_file()
    with sqlite3.connect(tmp_path / INDEX_NAME) as connection:  # as pandas and DuckDB do
        [(total,)] = connection.execute("SELECT sum(light_count) FROM frames")
    connection.close()
    assert total == sum(row.light_count for row in rows)


def test_only_what_was_asked_for_is_written(batch, sky, tmp_path):
    batch(sky, output=tmp_path, settings=Settings(("merge",)))
    [folder] = tmp_path.glob("sky-*")
    assert sorted(os.listdir(folder)) == ["attempts", "radiance", "runs"]
    assert len(os.listdir(folder / "radiance")) == FRAMES


def test_a_batch_needs_a_folder_and_a_scheduler_that_answers(sky, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file is a file"):
        run_batch([sky], tmp_path / "file", SETTINGS)
    with pytest.raises(InputError, match="no scheduler"):
        run_batch([sky], tmp_path / "out", SETTINGS, scheduler="tcp//nowhere")
