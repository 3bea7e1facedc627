"""A live session by itself: every bracket accounted for, every change shown, trouble told."""

import resource
import time
from dataclasses import dataclass, field, replace

import cv2
import moderngl
import numpy as np
import pytest

from calibration.files import read_calibration
from capture.errors import CameraLost, UnreadableFrame
from capture.frame import Bracket
from capture.live_source import LiveSource
from capture.recording import Recording, open_recording
from capture.reopening import CameraAway
from capture.v4l2.camera import CameraRequest
from lighting.light_files import read_lights
from lighting.maps.environment_files import read_environment
from render.live import running
from render.live.desk import Desk, State
from render.live.models import load_models
from render.live.picture import LivePicture
from render.live.results import Results
from render.live.running import LiveRequest, Stop, run_live
from render.live.session import LiveSession
from render.live.settings import Settings
from tests.capture.fake_camera import FakePort, scene
from tests.render.live_recording import make_recording

MODELS = load_models(())


class Source:
    """A recording's brackets as they can be taken, or what stands in the place of some.

    `before` is called with the number of each, when the one before it was done with.
    """

    name = "simulated"
    reopened_count = 0

    def __init__(self, recording, count, before, instead):
        self.size_px, self.sensor = recording.size_px, recording.sensor
        self.done = 0
        self._recording, self._count = recording, count
        self._before, self._instead = before, instead

    def __iter__(self):
        for number in range(self._count):
            while self.done < number:
                time.sleep(0.001)
            self._before(number)
            if number in self._instead:
                self.done += 1
                yield self._instead[number]
                continue
            bracket = self._recording.read_bracket(number % len(self._recording))
            now_s = time.monotonic()
            frames = tuple(replace(frame, timestamp_s=now_s) for frame in bracket.frames)
            yield Bracket(frames, number)


@dataclass
class Drawer:
    """Draws white, and remembers what of."""

    size_px: tuple = (64, 48)
    is_draft: bool = False
    is_settled: bool = True
    takes_s: float = 0.0
    asked: list = field(default_factory=list)

    def render(self, settings, lights, background, wanted_px=None):
        wanted_px = wanted_px or self.size_px
        self.asked.append((settings, lights, background))
        time.sleep(self.takes_s * wanted_px[0] / self.size_px[0])
        return np.ones((*wanted_px[::-1], 4), np.float32)


@dataclass
class Ran:
    counters: object
    moments: list
    drawn: list
    desk: Desk

    @property
    def states(self):
        return [moment.state.name for moment in self.moments]


def run(
    recording, count=6, *, before=None, instead=None, settings=None, watched=True, work=None,
    drawer=None,
):  # fmt: skip
    """Return what came of a session of `count` brackets; `before` takes the desk and a number."""
    desk = Desk(settings or Settings(count=20), MODELS)
    desk.watchers = int(watched)
    moments = {}
    desk.listen(lambda: desk.newest and moments.setdefault(desk.newest.number, desk.newest))
    act = before or (lambda _desk, _number: None)
    source = Source(recording, count, lambda number: act(desk, number), instead or {})
    drawer = drawer or Drawer()

    def done(bracket, seen):
        if work is not None:
            work(desk, bracket, seen)
        source.done += 1

    calibration = read_calibration(recording.calibration_path)
    counters = LiveSession(desk, source, calibration, 32, drawer, done).run()
    return Ran(counters, list(moments.values()), drawer.asked, desk)


@pytest.fixture
def recording(tmp_path):
    return make_recording(tmp_path / "r")


def test_every_bracket_is_published_and_counted(recording):
    ran = run(recording)
    assert (ran.counters.captured, ran.counters.replaced, ran.counters.rendered) == (6, 0, 6)
    assert ran.states == ["running"] * 6 + ["ended"]
    account = ran.moments[-1].account
    assert account["counters"]["rendered"] == 6
    assert {"merge", "remap", "blocks", "lights", "render"} < set(account["times_ms"])
    assert account["latency_ms"] > 0


def test_a_frame_rate_is_held_by_smaller_pictures_and_told(recording):
    """Twenty lights are sixteen after three frames, and then the picture becomes smaller."""
    wanted = Settings(count=20, frame_rate_hz=100.0)
    ran = run(recording, 12, settings=wanted, drawer=Drawer(takes_s=0.03))
    seen = [moment.seen.picture.shape[1] for moment in ran.moments[:-1]]
    assert seen[:4] == [64] * 4
    assert seen[-1] < 64
    height, width = ran.moments[-1].seen.picture.shape[:2]
    assert ran.moments[-1].account["pace"] == f"16 lights, picture {width}×{height}"
    assert run(recording).moments[-1].account["pace"] is None


def test_pictures_that_are_drafts_or_traced_beside_say_nothing_of_the_pace(recording):
    wanted = Settings(count=20, frame_rate_hz=100.0)
    drawer = Drawer(takes_s=0.03, is_settled=False)
    ran = run(recording, 12, settings=wanted, drawer=drawer)
    assert all(moment.seen.picture.shape[1] == 64 for moment in ran.moments[:-1])


def test_where_nobody_watches_nothing_is_drawn(recording):
    ran = run(recording, watched=False)
    assert ran.drawn == []
    assert ran.moments[0].seen.environment is None
    assert len(ran.moments[0].seen.lights) > 0


@pytest.mark.parametrize(
    ("changes", "is_shown"),
    [
        ({"count": 5}, lambda seen, _: len(seen.lights) == 5),
        ({"method": "median-cut"}, lambda seen, _: "median-cut" in seen.lights.source),
        ({"method": "inverse-cdf"}, lambda seen, _: "inverse-cdf" in seen.lights.source),
        ({"is_auto": True, "error": 0.5}, lambda seen, _: len(seen.lights) < 20),
        ({"view_ev": -3.0}, lambda seen, _: seen.view_ev == -3.0),
        ({"is_background": False}, lambda _, asked: asked[2] is None),
        ({"model": "ring"}, lambda _, asked: asked[0].model == "ring"),
        ({"azimuth_rad": 1.0}, lambda _, asked: asked[0].azimuth_rad == 1.0),
    ],
)
def test_a_change_is_seen_in_the_next_frame(recording, changes, is_shown):
    ran = run(recording, before=lambda desk, number: number == 3 and desk.change(changes))
    seen = [moment.seen for moment in ran.moments[:-1]]
    shown = [is_shown(*pair) for pair in zip(seen, ran.drawn, strict=True)]
    assert shown == [False] * 3 + [True] * 3


def test_a_turn_of_the_light_turns_lights_and_map(recording):
    still = run(recording, 1)
    turned = run(recording, 1, settings=Settings(count=20, yaw_rad=np.pi / 2))
    x, y, z = still.moments[0].seen.lights.directions.T
    np.testing.assert_allclose(
        turned.moments[0].seen.lights.directions, np.stack([z, y, -x], axis=1), atol=1e-12
    )
    # A quarter of the map's 64 columns to the left, where +X is.
    np.testing.assert_array_equal(
        turned.moments[0].seen.environment.radiance,
        np.roll(still.moments[0].seen.environment.radiance, -16, axis=1),
    )


def test_frozen_light_stays_and_is_still_reduced_anew(recording):
    def before(desk, number):
        if number == 2:
            desk.change({"is_frozen": True, "is_steady": False})
        if number == 4:
            desk.change({"count": 7})

    ran = run(recording, 8, before=before)
    maps = [moment.seen.environment.radiance for moment in ran.moments[:-1]]
    assert [np.array_equal(maps[2], each) for each in maps[2:]] == [True] * 6
    assert not np.array_equal(maps[1], maps[2])
    assert len(ran.moments[4].seen.lights) == 7
    assert ran.counters.rendered == 8


def test_a_damaged_bracket_is_counted_and_passed_over(recording):

    def before(_desk, number):
        if number == 2:
            time.sleep(0.05)  # until it was told: the next bracket would take its place

    ran = run(recording, 4, before=before, instead={1: UnreadableFrame("damaged")})
    assert ran.states == ["running"] * 3 + ["ended"]
    assert (ran.counters.failed, ran.counters.rendered) == (1, 3)


def test_while_the_camera_is_away_the_last_lights_stay_and_age(recording):
    away = CameraAway("/dev/video0: the last bracket is 3 s old; unplugged", 3.0)

    def before(_desk, number):
        if number == 3:
            time.sleep(0.05)

    ran = run(recording, 4, before=before, instead={2: away})
    assert ran.states == ["running", "running", "away", "running", "ended"]
    assert ran.moments[2].seen is ran.moments[1].seen
    assert ran.moments[2].age_s > ran.moments[1].age_s
    assert "unplugged" in ran.moments[2].state.message


def test_a_session_that_begins_without_its_camera_shows_what_was_seen_before(recording):
    earlier = run(recording, 1).moments[0].seen
    desk = Desk(Settings(count=5), MODELS)
    desk.publish(State("no-camera"), earlier, 2.0, {})
    source = Source(recording, 1, lambda _: None, {0: CameraAway("away", 3.0)})
    calibration = read_calibration(recording.calibration_path)
    LiveSession(desk, source, calibration, 32, None, lambda *_: None).run()
    assert desk.newest.seen is earlier
    assert desk.newest.age_s >= 2.0


def test_all_clipped_is_a_state_and_so_is_darkness(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    assert run(make_recording(tmp_path / "a/r", level=255), 1).states[0] == "clipped"
    dark = make_recording(tmp_path / "b/r", level=0, lamp=False)
    assert run(dark, 1).states[0] == "dark"


def test_the_camera_s_picture_shows_what_is_unseen(recording):
    camera = run(recording, 1).moments[0].seen.camera
    assert camera.size_px == (64, 48)
    assert camera.valid[24, 32]
    assert not camera.valid[0, 0], "beyond the valid angle"


def test_snapshot_export_and_recording_can_be_read_again(recording, tmp_path):
    output = tmp_path / "results"

    def before(desk, number):
        for request in {1: ("snapshot", "export-usda", "record"), 4: ("record",)}.get(number, ()):
            desk.ask(request)

    results, said = [], []

    def work(desk, bracket, seen):
        if not results:
            results.append(
                Results(
                    desk, output, "cam", recording.sensor, recording.calibration_path, said.append
                )
            )
        results[0].look_at(bracket, seen)
        results[0]._thread.submit(lambda: None).result()  # what was asked for is done

    ran = run(recording, 6, before=before, work=work)
    with results[0]:
        pass
    assert not ran.desk.notice.is_error
    lights = read_lights(output / "snapshot-0001.json")
    np.testing.assert_array_equal(lights.directions, ran.moments[1].seen.lights.directions)
    environment, _ = read_environment(output / "snapshot-0001.exr")
    np.testing.assert_array_equal(environment.radiance, ran.moments[1].seen.environment.radiance)
    assert (output / "snapshot-0001.png").is_file()
    assert (output / "lights-0001.usda").is_file()
    recorded = open_recording(output / "recording-0001")
    counts = [frame.counts for bracket in recorded for frame in bracket.frames]
    original = [
        recording.read_bracket(number % 3).frames for number in (2, 3)
    ]  # from the next one on
    expected = [frame.counts for frames in original for frame in frames]
    np.testing.assert_array_equal(counts, expected)
    assert not ran.desk.is_recording


def results_of(desk, folder, recording, say):
    return Results(desk, folder, "", recording.sensor, recording.calibration_path, say)


def test_a_result_that_cannot_be_written_is_told_and_the_session_goes_on(recording, tmp_path):
    (tmp_path / "file").write_text("")
    desk, said = Desk(Settings(), MODELS), []
    seen = run(recording, 1).moments[0].seen
    desk.ask("snapshot")
    with results_of(desk, tmp_path / "file/x", recording, said.append) as results:
        results.look_at(recording.read_bracket(0), seen)
    assert desk.notice.is_error
    assert desk.notice.text.startswith("snapshot: ")
    assert said == [desk.notice.text]


def test_a_defect_ends_a_recording_with_its_traceback(recording, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cv2, "imencode", lambda *_: None)
    desk, said = Desk(Settings(count=5), MODELS), []
    seen, bracket = run(recording, 1).moments[0].seen, recording.read_bracket(0)
    desk.ask("record")
    with results_of(desk, tmp_path / "out", recording, said.append) as results:
        for number in range(3):
            results.look_at(replace(bracket, index=number), seen)
            results._thread.submit(lambda: None).result()
        assert not desk.is_recording
    assert "Traceback" in capsys.readouterr().err
    assert desk.notice.text == "record: failed by a defect of fishlight; see the terminal"


def test_a_bracket_that_is_shown_again_is_recorded_once(recording, tmp_path):
    # As a played recording gives one when settings change before the next is due.
    desk, seen = Desk(Settings(count=5), MODELS), run(recording, 1).moments[0].seen
    first, second = recording.read_bracket(0), recording.read_bracket(1)
    desk.ask("record")
    with results_of(desk, tmp_path / "out", recording, lambda _text: None) as results:
        for bracket in (first, first, second, second):
            results.look_at(bracket, seen)
            results._thread.submit(lambda: None).result()
    recorded = open_recording(tmp_path / "out/recording-0001")
    assert [len(each.frames) for each in recorded] == [2, 2]


@pytest.mark.parametrize("limit", [2000, 9750])
def test_a_full_disk_ends_a_recording_and_not_the_session(recording, tmp_path, limit):
    # A limit on the size of a file fails as a full disk does. A frame has 9.4 kB: under the smaller
    # limit none fits, under the larger the journal is full after some, in mid-bracket.
    desk, said = Desk(Settings(count=5), MODELS), []
    seen, bracket = run(recording, 1).moments[0].seen, recording.read_bracket(0)
    older = resource.getrlimit(resource.RLIMIT_FSIZE)
    with results_of(desk, tmp_path / "out", recording, said.append) as results:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, older[1]))
        try:
            desk.ask("record")
            for number in range(40):
                results.look_at(replace(bracket, index=number), seen)
                results._thread.submit(lambda: None).result()
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, older)
        assert not desk.is_recording
        assert desk.notice.is_error
        assert "cannot be written (File too large)" in desk.notice.text
        assert "the session goes on" in desk.notice.text
        assert [text.partition(":")[0] for text in said] == [
            f"Recording to {tmp_path}/out/recording-0001",
            "record",
        ]
        desk.ask("snapshot")  # there is room again
        results.look_at(bracket, seen)
    assert not desk.notice.is_error
    written = int(said[1].partition("recording-0001: ")[2].partition(" ")[0])
    assert (written > 5) == (limit > 9000)
    if written:
        recorded = open_recording(tmp_path / "out/recording-0001")
        assert [len(each.frames) for each in recorded] == [2] * written


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
