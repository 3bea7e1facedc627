"""Several sessions as one: weights are shares whoever comes and goes, and all is accounted for."""

import time
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from capture.errors import CameraLost
from capture.v4l2.camera import CameraRequest
from lighting.stream import blending
from render.live import running
from render.live.blend import Blend
from render.live.blend_parts import PlacedSource
from render.live.desk import Desk, State
from render.live.models import load_models
from render.live.running import LiveRequest, Missing, Stop
from render.live.settings import Settings
from render.live.stream import stream_message
from render.session import Counters
from tests.render.live_recording import make_recording
from tests.render.live_run import Drawer

MODELS = load_models(())
LEFT, RIGHT = (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(running, "RETRY_S", 0.01)
    monkeypatch.setattr(blending, "FADE_S", 0.2)


def recording(tmp_path, name, brackets=3, **options):
    folder = tmp_path / name
    folder.mkdir()
    return make_recording(folder / "r", brackets, lamp=False, **options).folder


def request(folder, tmp_path, *, once=False, calibration=None):
    return LiveRequest(
        CameraRequest(str(folder), frame_rate_hz=50.0),
        calibration,
        None,
        once,
        32,
        tmp_path / "out",
    )


class Watched:
    """A desk whose moments are kept, and acted upon."""

    def __init__(self, settings=None, act=lambda _desk, _stop: None):
        self.desk, self.stop = Desk(settings or Settings(count=5), MODELS), Stop()
        self.desk.begin_watching()
        self.moments = []
        self._act = act
        self._end_s = time.monotonic() + 60
        self.desk.listen(self._take)

    def _take(self):
        newest = self.desk.newest
        if newest is not None and newest not in self.moments[-1:]:
            self.moments.append(newest)
            self._act(self.desk, self.stop)
        if time.monotonic() > self._end_s:
            self.stop.set()

    def run(self, requests, tmp_path, places=(LEFT, RIGHT), is_patient=True, say=lambda _: None):
        placed = [PlacedSource(*pair) for pair in zip(requests, places, strict=True)]
        self.blend = Blend(placed, self.desk, Drawer(), tmp_path / "out", say)
        return self.blend.run(self.stop, is_patient=is_patient)

    @property
    def weights(self):
        """Return those of each moment in which there was something."""
        return np.array(
            [[each["weight"] for each in m.account["sources"]] for m in self.moments if m.seen]
        )


def flux(moment):
    return moment.seen.lights.integral().sum()


def shares(desk):
    return [each["weight"] for each in desk.newest.account["sources"]]


def test_a_blend_has_the_light_of_each_by_where_it_stands(tmp_path):
    bright = request(recording(tmp_path, "a", level=200), tmp_path)
    dim = request(recording(tmp_path, "b", level=60), tmp_path)
    alone = []
    for each in (bright, dim):
        desk = Desk(Settings(count=5), MODELS)
        running.run_live(replace(each, once=True), desk, None, Stop(), is_patient=False)
        alone.append(flux(desk.newest))

    def act(desk, stop):
        if desk.newest.seen and shares(desk) == [0.9, 0.1]:
            stop.set()

    watched = Watched(Settings(count=5, x_m=-0.5), act)  # at distances of 0.5 and 1.5
    counters = watched.run([bright, dim], tmp_path)
    last = watched.moments[-1]
    assert last.state.name == "ended"
    assert shares(watched.desk) == [0.9, 0.1]
    assert flux(last) == pytest.approx(0.9 * alone[0] + 0.1 * alone[1], rel=1e-3)
    assert last.seen.environment.valid.any()
    assert last.seen.picture is not None
    assert counters.captured == counters.replaced + counters.rendered + counters.failed > 0
    times_s = [moment.seen.lights.timestamp_s for moment in watched.moments if moment.seen]
    assert times_s == sorted(times_s)


def test_a_source_that_is_lost_fades_out_and_the_weights_stay_shares(tmp_path):
    sources = [request(recording(tmp_path, name), tmp_path) for name in "ab"]

    def act(desk, stop):
        if desk.newest.seen and shares(desk) == [0.5, 0.5]:
            watched.blend._parts[0].stop.set()
        if desk.newest.seen and watched.weights.max(axis=0)[0] >= 0.5 and shares(desk)[0] == 0:
            stop.set()

    watched = Watched(act=act)
    watched.run(sources, tmp_path)
    weights = watched.weights
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=2e-4)  # rounded as they are shown
    assert np.array_equal(weights[-1], [0.0, 1.0])
    last_whole = np.flatnonzero(weights[:, 0] == 0.5)[-1]
    fading = weights[last_whole:, 0]
    assert len(fading) > 3
    assert np.all(np.diff(fading) <= 0)
    told = watched.moments[-2]  # the last is the end of the blend
    assert (told.state.name, told.state.message) == ("running", "r: The session has ended.")
    sent = msgspec.json.decode(stream_message(told))
    assert (sent["stale"], sent["valid"]) == (False, True)
    assert [each["state"] for each in sent["sources"]] == ["ended", "running"]


def test_a_source_that_comes_later_fades_in_and_the_scene_may_be_moved(tmp_path):
    first = request(recording(tmp_path, "a"), tmp_path)
    source = recording(tmp_path, "b")
    calibration = tmp_path / "later.json"
    later = request(source, tmp_path, calibration=calibration)
    wanted = [[1.0, 0.0], [0.5, 0.5], [0.0, 1.0]]

    def act(desk, stop):
        if desk.newest.seen is None:
            return
        if wanted and shares(desk) == wanted[0]:
            wanted.pop(0)
            if len(wanted) == 2:
                calibration.write_bytes((tmp_path / "a/cal.json").read_bytes())
            elif wanted:
                desk.change({"x_m": 1.0})
            else:
                stop.set()

    said = []
    watched = Watched(act=act)
    watched.run([first, later], tmp_path, say=said.append)
    assert wanted == []
    np.testing.assert_allclose(watched.weights.sum(axis=1), 1.0, atol=2e-4)
    assert len(said) == 1
    assert "later.json" in said[0]


def test_settings_reach_every_source_and_what_is_asked_for_is_saved(tmp_path):
    sources = [request(recording(tmp_path, name), tmp_path) for name in "ab"]
    sources = [
        replace(each, output=tmp_path / f"out/source-{number}")
        for number, each in enumerate(sources)
    ]
    said, asked = [], []

    def act(desk, stop):
        if desk.newest.seen is None or len(desk.newest.account["sources"]) < 2:
            return
        if not asked:
            asked.append(desk.change({"method": "median-cut", "count": 4}))
        if len(asked) == 1 and desk.newest.seen.lights.source.count("median-cut") == 2:
            asked.append([desk.ask(each) for each in ("snapshot", "record")])
        if len(asked) == 2 and desk.is_recording:
            asked.append(desk.ask("record"))
        if sum("Recorded" in text for text in said) == 2:
            stop.set()

    watched = Watched(act=act)
    watched.run(sources, tmp_path, say=said.append)
    assert any(text.startswith("Saved snapshot-0001.json, snapshot-0001.exr") for text in said)
    for number in (0, 1):
        assert (tmp_path / f"out/source-{number}/recording-0001/manifest.json").exists()
    assert not watched.desk.is_recording


def test_what_a_source_counted_before_it_was_lost_is_not_forgotten(tmp_path, monkeypatch):
    sources = [PlacedSource(request(tmp_path / name, tmp_path), LEFT) for name in "ab"]
    blend = Blend(sources, Desk(Settings(), MODELS), None, tmp_path, lambda _text: None)

    def run_live(_request, desk, *_, is_patient, **__):
        if is_patient:
            return Counters(captured=5, rendered=5)
        desk.publish(State("running"), "something", 0.0, {})
        raise Missing("no-camera", CameraLost("unplugged"), Counters(captured=3, rendered=3))

    monkeypatch.setattr("render.live.blend.run_live", run_live)
    assert blend._run_part(blend._parts[0], False) == Counters(captured=8, rendered=8)


def test_what_is_missing_from_the_start_is_refused_without_a_watcher(tmp_path):
    first = request(recording(tmp_path, "a"), tmp_path)
    with pytest.raises(Missing, match="nothing"):
        Watched().run([first, request(tmp_path / "nothing", tmp_path)], tmp_path, is_patient=False)
