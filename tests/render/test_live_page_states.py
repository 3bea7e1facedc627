"""What the page of a live session tells when something is missing, lost or moved."""

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from calibration.files import read_calibration
from capture.errors import CameraLost
from capture.frame import Bracket
from capture.live_source import LiveSource
from capture.v4l2.camera import CameraRequest
from render.live.access import Access
from render.live.desk import Desk, State
from render.live.models import load_models
from render.live.picture import LivePicture
from render.live.server import LiveServer
from render.live.session import LiveSession
from render.live.settings import Settings
from tests.capture.fake_camera import FakePort, scene
from tests.render.live_browser import (
    chromium,
    keep,
    number,
    opened,
    visited,
    wait_for_text,
    wait_until,
)
from tests.render.live_recording import make_recording

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def browser():
    with chromium() as launched:
        yield launched


@pytest.mark.parametrize(
    ("state", "told"),
    [
        ("starting", "starting"),
        ("away", "camera away"),
        ("no-camera", "no camera"),
        ("calibration", "no calibration"),
        ("clipped", "all clipped"),
        ("dark", "no light"),
        ("ended", "ended"),
    ],
)
def test_every_trouble_has_its_state_and_passes(browser, state, told):
    desk = Desk(Settings(), load_models(()))
    with LiveServer(desk, Access()) as server:
        desk.publish(State("running"), None, 0.0, {})
        for page in opened(browser, server.address, has_images=False):
            desk.publish(State(state, "What happened, and what to do."), None, 3.0, {})
            wait_for_text(page, "#chip-text", told)
            assert page.locator("#banner").inner_text() == "What happened, and what to do."
            keep(page, f"state-{state}")
            desk.publish(State("running"), None, 0.0, {})
            wait_for_text(page, "#chip-text", "live")
            assert page.locator("#banner").is_hidden()


def test_a_session_that_ended_is_told_and_not_as_a_lost_connection(browser):
    desk = Desk(Settings(), load_models(()))
    with LiveServer(desk, Access()) as server:
        desk.publish(State("running"), None, 0.0, {})
        pages = opened(browser, server.address, has_images=False)
        page = next(pages)
        wait_for_text(page, "#chip-text", "live")
        desk.publish(State("ended", "The session has ended."), None, 0.0, {})
    page.wait_for_timeout(1500)
    assert page.locator("#chip-text").inner_text() == "ended"
    assert next(pages, None) is None


def test_a_session_that_is_gone_is_told_and_found_again_when_it_is_back(browser):
    access, desk = Access(), Desk(Settings(), load_models(()))
    desk.publish(State("running"), None, 0.0, {})
    with LiveServer(desk, access) as server:
        port = int(server.address.partition("/?")[0].rpartition(":")[2])
        pages = opened(browser, server.address, has_images=False)
        page = next(pages)
        wait_for_text(page, "#chip-text", "live")
    wait_for_text(page, "#chip-text", "no connection")
    with LiveServer(desk, access, port):
        wait_for_text(page, "#chip-text", "live", 15.0)
        assert next(pages, None) is None


class InOurTime:
    """A live source whose brackets come at a pace, with the moments at which they come."""

    def __init__(self, source):
        self.name, self.size_px, self.sensor = source.name, source.size_px, source.sensor
        self._source = source

    @property
    def reopened_count(self):
        return self._source.reopened_count

    def __iter__(self):
        for item in self._source:
            time.sleep(0.05)
            if isinstance(item, Bracket):
                frames = (replace(each, timestamp_s=time.monotonic()) for each in item.frames)
                item = Bracket(tuple(frames), item.index)
            yield item


def test_an_unplugged_camera_is_told_and_the_page_goes_on_when_it_is_back(browser, tmp_path):
    port = FakePort(scene(48, 64))
    desk = Desk(Settings(count=9), load_models(()))
    calibration = read_calibration(make_recording(tmp_path / "r").calibration_path)
    request = CameraRequest("fake")
    with (
        LiveSource(request, exposures_s=(0.01, 0.001), open_camera=port.open) as source,
        LivePicture(desk.models, (64, 48)) as picture,
        LiveServer(desk, Access()) as server,
        ThreadPoolExecutor(1) as thread,
    ):
        ours = InOurTime(source)
        session = LiveSession(desk, ours, calibration, 32, picture, lambda *_: None)
        running = thread.submit(session.run)
        with visited(browser, server.address) as page:
            wait_for_text(page, "#chip-text", "live")
            port.faults = {port.brackets + 2: CameraLost("/dev/video9: unplugged")}
            wait_for_text(page, "#chip-text", "camera away")
            assert "unplugged" in page.locator("#banner").inner_text()
            assert page.locator(".panels.stale").count() == 1
            wait_until(page, lambda: page.locator("#latency").inner_text().endswith("s old"))
            assert page.locator("#picture-panel.has-image").count() == 1, "what was seen stays"
            keep(page, "unplugged")
            wait_for_text(page, "#chip-text", "live", 10.0)
            assert page.locator("#banner").is_hidden()
            assert page.locator(".panels.stale").count() == 0
            assert "reopened\n1" in page.locator("#counters").inner_text()
            first = number(page)
            wait_until(page, lambda: number(page) > first + 2)
        source.stop()
        counters = running.result(20)
    assert counters.failed >= 2
    assert counters.captured == counters.replaced + counters.rendered + counters.failed


def test_a_blend_shows_its_sources_and_moves_the_scene_among_them(browser):
    desk = Desk(Settings(), load_models(()))

    def blended(share, state="running"):
        sources = [
            {"name": "left", "place_m": [-1, 0, 0], "weight": share, "state": state, "age_s": 3.0},
            {"name": "right", "place_m": [1, 0, 0], "weight": 1 - share, "state": "running",
             "age_s": 0.1},
        ]  # fmt: skip
        desk.publish(State("running"), None, 0.0, {"sources": sources})

    with LiveServer(desk, Access()) as server:
        desk.publish(State("running"), None, 0.0, {})
        with visited(browser, server.address, has_images=False) as page:
            wait_for_text(page, "#chip-text", "live")
            assert page.locator("#blend").is_hidden()
            blended(0.75)
            wait_until(page, lambda: "75 %" in page.locator("#sources").inner_text())
            assert "live · at -1, 0, 0 m" in page.locator("#sources").inner_text()
            page.locator("#x_m").fill("0.5")
            wait_until(page, lambda: desk.settings.x_m == 0.5)
            blended(0.0, "away")
            wait_until(
                page, lambda: "camera away, 3.0 s old" in page.locator("#sources").inner_text()
            )
            assert (
                page.locator("#sources meter").nth(1).get_attribute("aria-label")
                == "Share of right"
            )
            keep(page, "blend")
