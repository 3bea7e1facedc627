"""The session loop: every bracket is accounted for, threads end, errors reach the caller."""

import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from capture.errors import UnreadableFrame
from capture.frame import Bracket, Exposure, Frame
from render.session import END_TO_END, Counters, Policy, StageClock, run_session


def bracket(index: int) -> Bracket:
    frame = Frame(np.zeros((2, 2, 3), np.uint8), Exposure(0.1), float(index), index)
    return Bracket((frame,), index)


def rendering(seen: list[int], pause_s: float = 0.0):
    def process(item: Bracket, clock: StageClock, counters: Counters) -> None:
        with clock.stage("work"):
            time.sleep(pause_s)
        counters.merged += 1
        counters.rendered += 1
        seen.append(item.index)

    return process


def no_threads_left() -> bool:
    return not any(thread.name == "fishlight-producer" for thread in threading.enumerate())


def test_every_bracket_is_processed_in_order_and_timed() -> None:
    seen: list[int] = []
    counters, clock = run_session(map(bracket, range(20)), rendering(seen))
    assert seen == list(range(20))
    assert counters == Counters(captured=20, merged=20, rendered=20)
    assert len(clock.frames) == 20
    assert set(clock.frames[0]) == {"decode", "work", END_TO_END}
    for frame in clock.frames:
        assert frame[END_TO_END] >= frame["decode"] + frame["work"]
    assert no_threads_left()


def test_brackets_are_prepared_by_the_producer_and_timed() -> None:
    seen: list[tuple[int, str]] = []
    told: list[str] = []

    def prepare(item: Bracket, clock: StageClock) -> tuple[int, str]:
        with clock.stage("merge"):
            time.sleep(0.002)
        return item.index, threading.current_thread().name

    def process(item: tuple[int, str], _clock: StageClock, _counters: Counters) -> None:
        seen.append(item)

    source = [bracket(0), UnreadableFrame("frame 1 is truncated"), bracket(2)]
    _, clock = run_session(
        source, process, prepare=prepare, on_failure=lambda error: told.append(str(error))
    )
    assert seen == [(0, "fishlight-producer"), (2, "fishlight-producer")]
    assert told == ["frame 1 is truncated"], "what cannot be read is not prepared"
    for frame in clock.frames:
        assert frame["merge"] >= 2.0 > frame["decode"]
        assert frame[END_TO_END] >= frame["decode"] + frame["merge"]


def test_an_exception_of_the_preparation_is_raised_here() -> None:
    def prepare(item: Bracket, _clock: StageClock) -> Bracket:
        if item.index == 1:
            raise ValueError("white level")
        return item

    seen: list[int] = []
    with pytest.raises(ValueError, match="white level"):
        run_session(map(bracket, range(3)), rendering(seen), prepare=prepare)
    assert seen == [0]
    assert no_threads_left()


def test_a_slow_consumer_of_a_live_source_sees_the_newest_and_counts_the_rest() -> None:
    seen: list[int] = []

    def live() -> Iterator[Bracket]:
        for index in range(30):
            time.sleep(0.002)
            yield bracket(index)

    counters, _ = run_session(live(), rendering(seen, pause_s=0.02), policy=Policy.NEWEST)
    assert counters.captured == 30
    assert counters.replaced > 5
    assert counters.captured == counters.replaced + counters.failed + counters.rendered
    assert seen == sorted(seen)
    assert seen[-1] == 29, "the newest bracket is never the one that is dropped"


def test_a_bracket_is_asked_for_while_the_one_before_it_is_processed() -> None:
    asked = [threading.Event() for _ in range(6)]
    early: list[int] = []

    def source() -> Iterator[Bracket]:
        for index, event in enumerate(asked):
            event.set()
            yield bracket(index)

    def process(item: Bracket, _clock: StageClock, counters: Counters) -> None:
        if item.index < 5:
            assert asked[item.index + 1].wait(2.0), "the next one is decoded beside this one"
        time.sleep(0.01)
        early.extend(index for index in range(item.index + 2, 6) if asked[index].is_set())
        counters.rendered += 1

    counters, _ = run_session(source(), process)
    assert counters.rendered == 6
    assert not early, "what is decoded earlier only waits, and is late when it is shown"


def test_an_unreadable_bracket_is_counted_and_told() -> None:
    seen: list[int] = []
    told: list[str] = []
    source = [bracket(0), UnreadableFrame("frame 1 is truncated"), bracket(2)]
    counters, _ = run_session(
        source, rendering(seen), on_failure=lambda error: told.append(str(error))
    )
    assert seen == [0, 2]
    assert told == ["frame 1 is truncated"]
    assert counters == Counters(captured=3, merged=2, rendered=2, failed=1)


def test_an_exception_of_the_source_is_raised_here() -> None:
    def source() -> Iterator[Bracket]:
        yield bracket(0)
        raise OSError("the disk is gone")

    seen: list[int] = []
    with pytest.raises(OSError, match="the disk is gone"):
        run_session(source(), rendering(seen))
    assert seen == [0], "what came before the failure is still processed"
    assert no_threads_left()


@pytest.mark.parametrize("policy", Policy)
def test_an_exception_of_the_consumer_ends_an_endless_source(policy: Policy) -> None:
    def endless() -> Iterator[Bracket]:
        index = 0
        while True:
            yield bracket(index)
            index += 1

    def process(_item: Bracket, _clock: StageClock, _counters: Counters) -> None:
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        run_session(endless(), process, policy=policy)
    assert no_threads_left()


def test_an_empty_source_ends_at_once() -> None:
    counters, clock = run_session([], rendering([]))
    assert counters == Counters()
    assert not clock.frames
