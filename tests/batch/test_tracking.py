"""Runs dealt out: lights in order, few runs at a time, and trouble that stays where it is."""

from collections.abc import Iterator

import pytest
from distributed import Client, LocalCluster

from render.batch.frames import RunRecord
from render.batch.steps import Steps
from render.batch.tracking import Tracker
from tests.batch import watched_steps as watched
from tests.benchmarks.million_frames import SleepingSequence

RUNS = 12
FRAMES = 16 * RUNS


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    with (
        LocalCluster(
            n_workers=2, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0"
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


def track(client: Client, *names: str, frames: int = FRAMES) -> tuple[list[RunRecord], list[str]]:
    watched.forget()
    concluded: list[RunRecord] = []
    failed: list[str] = []
    tracker = Tracker(
        client,
        concluded.append,
        lambda sequence, error: failed.append(f"{sequence.job}: {error}"),
        steps=Steps(watched.prepare, watched.light, watched.preview),
    )
    tracker.run_all(iter([SleepingSequence(name, frames) for name in names]))
    return concluded, failed


def test_every_run_is_prepared_once_and_lit_after_the_one_before(client):
    concluded, failed = track(client, "a", "b", "c")
    assert len(concluded) == 3 * RUNS
    assert not failed
    for name in "abc":
        starts = list(range(0, FRAMES, 16))
        assert sorted(start for job, start in watched.prepared if job == name) == starts
        assert [start for job, start in watched.lit if job == name] == starts
    assert watched.counts["most preparing"] <= 2


def test_previews_follow_where_there_are_lights_to_show(client):
    concluded, _ = track(client, "shown", "dark")
    assert len(concluded) == 2 * RUNS
    assert sorted(watched.previewed) == sorted(f"shown{16 * run}" for run in range(RUNS))


def test_a_sequence_that_cannot_go_on_stops_alone_and_is_told_once(client):
    concluded, failed = track(client, "bad", "good")
    assert failed == ["bad: no space left"]
    assert len(concluded) == 5 + RUNS
    assert [start for job, start in watched.lit if job == "bad"] == list(range(0, 6 * 16, 16))


def test_previews_that_fail_after_the_last_lights_are_told(client):
    concluded, failed = track(client, "full", frames=4 * 16)
    assert len(concluded) == 3
    assert failed == ["full: no space left"]


def test_nothing_to_do_is_done_at_once(client):
    assert track(client) == ([], [])
