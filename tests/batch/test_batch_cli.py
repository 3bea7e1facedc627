"""The command: what it says, how it ends, and what it shows while it works."""

import io
import json
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from distributed import LocalCluster

from capture.errors import InputError
from lighting.measures.sequence_table import read_sequence_table
from render import batch_cli
from tests.batch.turning_sky import record
from tests.capture.command_line import run


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0"
    ) as cluster:
        yield cluster.scheduler_address


@pytest.fixture(scope="module")
def sky(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("sky") / "sky", 2)


def test_a_summary_names_what_failed_and_the_code_says_that_something_did(
    sky, scheduler, tmp_path, capsys
):
    wishes = ["-o", tmp_path / "out", "--scheduler", scheduler]
    wishes += ["--height", 16, "--count", 4, "--stages", "remap, lights"]
    run("batch", sky, *wishes)
    assert "recordings 1, 0 of them stopped; frames made 2" in capsys.readouterr().out
    with pytest.raises(SystemExit) as end:
        run("batch", sky, tmp_path / "none", *wishes)
    assert end.value.code == 1
    told = capsys.readouterr()
    assert "recordings 2, 1 of them stopped; frames made 0" in told.out
    assert "kept 2, failed 0" in told.out
    assert "none holds no manifest.json" in told.err
    assert json.loads((tmp_path / "out" / "report.json").read_text())["kept"] == 2
    rows = read_sequence_table(tmp_path / "out" / "index.sqlite")
    assert [row.light_count for row in rows] == [4, 4]
    assert rows[0].preview_file is None


def test_a_scheduler_without_workers_is_told_at_once_and_waited_for(sky, tmp_path, monkeypatch):
    with LocalCluster(
        n_workers=0, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0"
    ) as cluster:

        class Starting(io.StringIO):
            """What starts a worker when it is told that there is none."""

            def write(self, text: str) -> int:
                cluster.scale(1)
                return super().write(text)

        monkeypatch.setattr("sys.stderr", Starting())
        wishes = ["--height", 16, "--count", 4, "--stages", "lights"]
        unasked = threading.Timer(20.0, cluster.scale, [1])  # or it would wait for ever
        unasked.start()
        run("batch", sky, "-o", tmp_path, "--scheduler", cluster.scheduler_address, *wishes)
        unasked.cancel()
        (line,) = sys.stderr.getvalue().splitlines()
        assert f"dask worker {cluster.scheduler_address}" in line
    rows = read_sequence_table(tmp_path / "index.sqlite")
    assert [row.light_count for row in rows] == [4, 4]


def test_what_cannot_be_done_is_refused_before_anything_is_begun(sky, tmp_path):
    out = tmp_path / "out"
    for wishes, told in (
        ([], "nothing to do"),
        ([sky, "--stages", "lights,shine"], "stages are some of"),
        ([sky, "--height", 1], "--height must be"),
        ([sky, "--count", "auto", "--method", "cells"], "--count auto is for"),
    ):
        with pytest.raises(InputError, match=told):
            run("batch", *wishes, "-o", out)
    assert not out.exists()


def test_a_terminal_shows_frames_their_rate_and_no_time_for_what_was_there(monkeypatch):
    terminal = io.StringIO()
    terminal.isatty = lambda: True  # type: ignore[method-assign]
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setenv("COLUMNS", "100")
    with batch_cli._progress(10) as on_frames:
        on_frames(4, True)
        on_frames(3, False)
    assert "3/6" in terminal.getvalue()
    assert "4/10" not in terminal.getvalue()
