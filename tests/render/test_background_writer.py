"""Writing behind the loop's back."""

import threading

import pytest

from render.output.background_writer import OUTSTANDING, BackgroundWriter


def test_calls_are_made_in_order_and_all_of_them():
    made = []
    with BackgroundWriter() as writer:
        for number in range(50):
            writer.call(lambda number=number: made.append(number))
    assert made == list(range(50))


def test_the_loop_goes_on_while_a_call_lasts_and_waits_when_too_many_do():
    go_on, begun = threading.Event(), threading.Event()
    made = []
    with BackgroundWriter() as writer:
        writer.call(lambda: (begun.set(), go_on.wait(10), made.append("first")))
        for _ in range(OUTSTANDING - 1):
            writer.call(lambda: made.append("later"))
        assert begun.wait(10)
        assert made == []
        one_more = threading.Thread(target=lambda: writer.call(lambda: made.append("last")))
        one_more.start()
        one_more.join(0.05)
        assert one_more.is_alive()
        go_on.set()
        one_more.join(10)
        assert not one_more.is_alive()
    assert made == ["first", *["later"] * (OUTSTANDING - 1), "last"]


def _fail():
    raise OSError("no space left")


def test_an_error_reaches_the_loop():
    def go_on_writing():
        with BackgroundWriter() as writer:
            writer.call(_fail)
            for _ in range(OUTSTANDING):
                writer.call(lambda: None)
            pytest.fail("the loop went on for too long")

    with pytest.raises(OSError, match="no space left"):
        go_on_writing()


def test_an_error_of_the_last_call_is_not_lost():
    with pytest.raises(OSError, match="no space left"), BackgroundWriter() as writer:
        writer.call(_fail)


def test_after_an_error_of_the_loop_no_further_call_is_made():
    go_on, made = threading.Event(), []

    def interrupted():
        with BackgroundWriter() as writer:
            writer.call(lambda: go_on.wait(10) and made.append("begun"))
            writer.call(lambda: made.append("waiting"))
            threading.Timer(0.05, go_on.set).start()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert made in ([], ["begun"])
