"""A live session by itself: every bracket accounted for, every change shown."""

import time

import numpy as np
import pytest

from calibration.files import read_calibration
from capture.errors import UnreadableFrame
from capture.reopening import CameraAway
from render.live.desk import Desk, State
from render.live.session import LiveSession
from render.live.settings import Settings
from tests.render.live_recording import make_recording
from tests.render.live_run import MODELS, Drawer, Source, run


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
