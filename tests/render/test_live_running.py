"""A live session from its start to its end: what is missing, waited for and lost."""

import moderngl
import numpy as np
import pytest

from calibration.files import read_calibration
from capture.errors import CameraLost
from capture.live_source import LiveSource
from capture.recording import Recording
from capture.v4l2.camera import CameraRequest
from render.live import running
from render.live.desk import Desk
from render.live.picture import LivePicture
from render.live.running import LiveRequest, Stop, run_live
from render.live.session import LiveSession
from render.live.settings import Settings
from tests.capture.fake_camera import FakePort, scene
from tests.render.live_recording import make_recording
from tests.render.live_run import MODELS, Drawer, run


@pytest.fixture
def recording(tmp_path):
    return make_recording(tmp_path / "r")


def live_request(device, calibration=None):
    return LiveRequest(CameraRequest(str(device)), calibration, None, True, 32, device / "out")


@pytest.mark.parametrize("is_patient", [True, False])
def test_what_is_missing_is_waited_for_or_refused(recording, monkeypatch, is_patient):
    """First there is no calibration, and then there is."""
    monkeypatch.setattr(running, "RETRY_S", 0.01)
    calibration = recording.folder.parent / "later.json"
    desk = Desk(Settings(), MODELS)
    states = []

    def listen():
        if desk.newest is None or states[-1:] == [desk.newest.state.name]:
            return
        states.append(desk.newest.state.name)
        if states[-1] == "calibration":
            calibration.write_bytes(recording.calibration_path.read_bytes())

    desk.listen(listen)
    request = live_request(recording.folder, calibration)
    if not is_patient:
        with pytest.raises(running.Missing, match=r"later\.json"):
            run_live(request, desk, None, Stop(), is_patient=False)
        return
    counters = run_live(request, desk, None, Stop(), is_patient=True)
    assert states == ["starting", "calibration", "running", "ended"]
    assert counters.captured == counters.replaced + counters.rendered == 3


def test_a_calibration_for_another_size_and_a_camera_that_is_not_there_are_states(
    recording, tmp_path
):
    text = recording.calibration_path.read_text()
    other = tmp_path / "other.json"
    other.write_text(text.replace("[64,48]", "[32,24]").replace("[64, 48]", "[32, 24]"))
    for request, name in (
        (live_request(recording.folder, other), "calibration"),
        (live_request(tmp_path / "nothing"), "no-camera"),
    ):
        desk, stop = Desk(Settings(), MODELS), Stop()
        desk.listen(
            lambda desk=desk, stop=stop, name=name: desk.newest.state.name == name and stop.set()
        )
        run_live(request, desk, None, stop, is_patient=True)
        assert desk.newest.state.name == name


def test_a_camera_exposes_as_is_asked_for_and_says_what_it_cannot_do(recording):
    port = FakePort(scene(48, 64))
    desk = Desk(Settings(exposures_s=(0.01, 0.001)), MODELS)
    calibration = read_calibration(recording.calibration_path)
    times_s = []

    def work(bracket, _seen):
        times_s.append([frame.exposure.time_s for frame in bracket.frames])
        changes = {1: {"exposures_s": [0.02]}, 6: {"exposures_s": [1.0]}}
        if len(times_s) in changes:
            desk.change(changes[len(times_s)])
        if len(times_s) == 12:
            source.stop()

    with LiveSource(
        CameraRequest("fake"), exposures_s=(0.01, 0.001), open_camera=port.open
    ) as source:
        counters = LiveSession(desk, source, calibration, 32, Drawer(), work).run()
    assert times_s[0] == [0.01, 0.001]
    assert [0.02] in times_s[:5]
    assert times_s[-1] == [0.02], "what cannot be done changes nothing"
    assert desk.notice.is_error
    assert "cannot expose for 1 s" in desk.notice.text
    assert counters.captured == counters.replaced + counters.rendered


def test_without_opengl_a_picture_is_drawn_all_the_same(recording, monkeypatch):
    def unavailable(*_, **__):
        raise RuntimeError("no driver")

    monkeypatch.setattr(moderngl, "create_context", unavailable)
    desk = Desk(Settings(count=5), MODELS)
    desk.begin_watching()
    pictures = []
    desk.listen(lambda: desk.newest.seen and pictures.append(desk.newest.seen.picture))
    with LivePicture(MODELS, (32, 24)) as picture:
        run_live(live_request(recording.folder), desk, picture, Stop(), is_patient=False)
    assert len(pictures) >= 3
    assert all(np.count_nonzero(drawn[..., :3]) > 300 for drawn in pictures)


def test_what_was_seen_last_ages_while_the_camera_is_looked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(running, "RETRY_S", 0.01)
    desk, stop, ages_s = Desk(Settings(), MODELS), Stop(), []

    def listen():
        ages_s.append(desk.newest.age_s)
        if len(ages_s) == 4:
            stop.set()

    desk.listen(listen)
    said = []
    run_live(live_request(tmp_path / "nothing"), desk, None, stop, is_patient=True, say=said.append)
    assert len(said) == 1
    assert "nothing" in said[0]
    assert ages_s == sorted(ages_s)
    assert ages_s[-1] >= 0.02


def test_what_was_counted_before_a_camera_was_lost_is_not_forgotten(recording, monkeypatch):
    """It is lost in its fourth bracket, and found again."""
    desk, numbers = Desk(Settings(count=5), MODELS), iter(range(1000))
    monkeypatch.setattr(running, "RETRY_S", 0.01)
    read = Recording.read_bracket

    def lost_once(self, position):
        if next(numbers) == 3:
            raise CameraLost("unplugged")
        return read(self, position)

    monkeypatch.setattr(Recording, "read_bracket", lost_once)
    longer = make_recording(recording.folder.parent / "longer", brackets=5)
    moments = []
    desk.listen(lambda: moments.append(desk.newest))
    counters = run_live(live_request(longer.folder), desk, None, Stop(), is_patient=True)
    assert counters.captured == 3 + 5
    assert counters.captured - 1 <= counters.replaced + counters.rendered <= counters.captured
    first = next(number for number, moment in enumerate(moments) if moment.seen)
    assert all(moment.seen for moment in moments[first:]), "what was seen stays meanwhile"


def test_a_lost_camera_ends_the_session_with_its_error(recording):
    def lost(_desk, number):
        if number == 2:
            raise CameraLost("gone for good")

    with pytest.raises(CameraLost, match="gone for good"):
        run(recording, before=lost)
