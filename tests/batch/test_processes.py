"""A batch on a real scheduler and processes of their own: the same, whoever dies."""

import os
import signal
from pathlib import Path

import pytest
from distributed import Client, LocalCluster

from lighting.measures.sequence_table import read_sequence_table
from lighting.stream.light_stream import LightPlan
from render.batch.batch import INDEX_NAME, run_batch
from render.batch.runs import Settings
from tests.batch.turning_sky import damage, record, replayed, results

pytestmark = pytest.mark.slow

FRAMES = 17
SETTINGS = Settings(("remap", "lights"), LightPlan(6), 16)

POISON = """
import os
from capture.merge import merge_bracket as merge
from render.batch import frames

def die_at_five(bracket, *others):
    if bracket.index == 5:
        os._exit(1)
    return merge(bracket, *others)

frames.merge_bracket = die_at_five
"""


@pytest.fixture(scope="module")
def sky(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("sky") / "sky", FRAMES)


@pytest.fixture(scope="module")
def expected(sky: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[bytes]]:
    return replayed(sky, SETTINGS, tmp_path_factory.mktemp("replay") / "out")


@pytest.mark.parametrize(("workers", "run_length"), [(1, 5), (4, 4)])
def test_any_number_of_workers_makes_the_replay_to_the_byte(
    sky, expected, tmp_path, workers, run_length
):
    summary = run_batch([sky], tmp_path, SETTINGS, worker_count=workers, run_length=run_length)
    assert (summary.made, summary.has_failures) == (FRAMES, False)
    assert results(tmp_path, sky) == expected


def test_two_workers_make_the_replay_to_the_byte_also_when_one_is_killed(sky, expected, tmp_path):
    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0"
    ) as cluster:
        address = cluster.scheduler_address
        calm = run_batch([sky], tmp_path / "calm", SETTINGS, scheduler=address, run_length=7)
        killed = []

        def kill_one(_count: int, _is_kept: bool) -> None:
            if not killed:
                with Client(cluster) as client:
                    killed.append(sorted(client.run(os.getpid).values())[0])
                os.kill(killed[0], signal.SIGKILL)

        summary = run_batch(
            [sky],
            tmp_path / "killed",
            SETTINGS,
            scheduler=address,
            run_length=3,
            on_frames=kill_one,
        )
        with Client(cluster) as client:
            assert killed[0] not in client.run(os.getpid).values()
    for name, done in (("calm", calm), ("killed", summary)):
        assert (done.made, done.has_failures) == (FRAMES, False)
        assert results(tmp_path / name, sky) == expected


def test_a_frame_that_kills_its_worker_is_given_up_and_the_others_are_not(sky, tmp_path):
    preload = tmp_path / "poison.py"
    preload.write_text(POISON)
    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", preload=[str(preload)]
    ) as cluster:
        summary = run_batch(
            [sky], tmp_path / "out", SETTINGS, scheduler=cluster.scheduler_address, run_length=6
        )
    assert (summary.made, summary.failed_frames) == (FRAMES - 1, 1)
    assert "bracket 5: given up: 3 processes that worked on it died" in summary.reasons[0]
    rows = read_sequence_table(tmp_path / "out" / INDEX_NAME)
    assert [row.bracket for row in rows if row.failure] == [5]
    # As if it had been damaged.
    damage(sky, 5)
    try:
        assert results(tmp_path / "out", sky) == replayed(sky, SETTINGS, tmp_path / "replay")
    finally:
        damage(sky, 5)
