"""The page in a real browser, before a real session: `fishlight live` in a process of its own.

Skips where there is no Chromium (`make browser` installs it); FISHLIGHT_REQUIRE_BROWSER=1 fails
instead. Screenshots are kept where FISHLIGHT_SCREENSHOTS says.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

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
from tests.render.live_recording import make_recording

pytestmark = pytest.mark.slow

LIVE = [sys.executable, "-c", "from render.main import main; main()", "live"]
IN_FLIGHT = 2
WIDTHS = [(1440, 900), (1024, 768), (390, 844)]
PANELS = ["#picture-panel", "#map-panel", "#camera-panel", ".strip", "#controls"]
NAMED = "[...document.querySelectorAll('button, input, select, [tabindex]')].filter(e => !({name}))"


def chromium_path():
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    if found is None and os.environ.get("FISHLIGHT_REQUIRE_BROWSER"):
        pytest.fail("no Chromium, and FISHLIGHT_REQUIRE_BROWSER is set; run make browser")
    if found is None:
        pytest.skip("no Chromium; run make browser")
    return found


@pytest.fixture(scope="module")
def browser():
    path = chromium_path()
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as driver:
        launched = driver.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield launched
        launched.close()


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """Yield the address of a session of a small recording, and the folder of its results."""
    folder = tmp_path_factory.mktemp("live")
    recording = make_recording(folder / "r", brackets=20)
    output = folder / "out"
    options = ["--rate", "12", "--size", "160x120", "--height", "32", "--port", "0"]
    process = subprocess.Popen(
        [*LIVE, str(recording.folder), *options, "-o", str(output), "--count", "20", "--headless"],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    yield process.stdout.readline().strip(), output
    process.send_signal(signal.SIGINT)
    rest = process.stdout.read()
    process.stdout.close()
    assert process.wait(10) == 0
    counts = {name: int(count) for count, name in re.findall(r"(\d+) (\w+)", rest)}
    assert counts["captured"] == sum(counts[n] for n in ("replaced", "rendered", "failed"))


@pytest.fixture
def page(browser, session):
    yield from opened(browser, session[0])


def opened(browser, address, size_px=(1440, 900), scheme="dark", has_images=True):
    context = browser.new_context(
        viewport={"width": size_px[0], "height": size_px[1]}, color_scheme=scheme
    )
    page = context.new_page()
    trouble = []
    page.on("console", lambda message: message.type == "error" and trouble.append(message.text))
    page.on("pageerror", lambda error: trouble.append(str(error)))
    page.goto(address)
    if has_images:
        page.wait_for_selector("#picture-panel.has-image", timeout=20_000)
    yield page
    context.close()
    assert [each for each in trouble if "ERR_CONNECTION" not in each] == []


visited = contextmanager(opened)


def number(page):
    return int(page.evaluate("document.body.dataset.number ?? 0"))


def settings_of(page):
    """Return what the session has, from a socket of its own."""
    return page.evaluate(
        """() => new Promise((resolve) => {
          const socket = new WebSocket(`ws://${location.host}/view`);
          socket.binaryType = "arraybuffer";
          socket.onmessage = ({ data }) => {
            const length = new DataView(data).getUint32(0, true);
            socket.close();
            resolve(JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length))).settings);
          };
        })"""
    )


def wait_until(page, holds, timeout_s=5.0):
    """Wait for a state of the page; its policy forbids Playwright's own way, which evaluates."""
    end_s = time.monotonic() + timeout_s
    while not holds():
        assert time.monotonic() < end_s, "the page did not get there"
        page.wait_for_timeout(30)


def wait_for_text(page, selector, text, timeout_s=5.0):
    wait_until(page, lambda: page.locator(selector).inner_text() == text, timeout_s)


def within_frames(page, holds, frames=3):
    """Assert that something is seen in so many moments after those that were under way."""

    def shown():
        return int(page.evaluate("document.body.dataset.shown"))

    first = shown()
    wait_until(page, holds)
    assert shown() - first <= frames + IN_FLIGHT


def pixels(page, name):
    """Return a canvas as a data address, which tells pictures apart."""
    return page.evaluate(f"document.getElementById('{name}').toDataURL()")


def keep(page, name):
    folder = os.environ.get("FISHLIGHT_SCREENSHOTS")
    if folder:
        Path(folder).mkdir(parents=True, exist_ok=True)
        page.screenshot(path=Path(folder) / f"{name}.png", full_page=True)


def test_frames_arrive_and_change_and_the_token_leaves_the_address(page):
    assert "token" not in page.url
    first, camera = number(page), pixels(page, "camera")
    wait_until(page, lambda: number(page) > first + 2)
    assert pixels(page, "camera") != camera, "the lamp wanders"
    assert page.locator("#chip-text").inner_text() == "live"
    assert page.locator("#counters").inner_text().startswith("captured")


@pytest.mark.parametrize("size_px", WIDTHS, ids=lambda size_px: str(size_px[0]))
@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_at_every_width_all_is_there_and_nothing_overflows(browser, session, size_px, scheme):
    for page in opened(browser, session[0], size_px, scheme):
        assert page.evaluate("document.documentElement.scrollWidth") <= size_px[0]
        assert page.evaluate("document.documentElement.dataset.theme") == scheme
        boxes = [page.locator(panel).bounding_box() for panel in PANELS]
        for box in boxes:
            assert box["width"] > 150
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= size_px[0]
        for index, one in enumerate(boxes):
            for other in boxes[:index]:
                assert (
                    one["x"] + one["width"] <= other["x"] + 1
                    or other["x"] + other["width"] <= one["x"] + 1
                    or one["y"] + one["height"] <= other["y"] + 1
                    or other["y"] + other["height"] <= one["y"] + 1
                ), "panels overlap"
        keep(page, f"{size_px[0]}-{scheme}")


def test_every_control_has_a_name_and_can_be_reached_by_keyboard(page):
    page.get_by_text("Tolerance").click()
    wait_until(page, lambda: page.locator("#error").is_visible())
    unnamed = "e.labels?.length || e.ariaLabel || e.textContent.trim()"
    assert page.evaluate(NAMED.format(name=unnamed) + ".map(e => e.outerHTML)") == []
    page.evaluate("document.body.focus()")
    reached = set()
    for _ in range(60):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id || document.activeElement.outerHTML"))
    for name in ("freeze", "snapshot", "record", "theme", "picture", "map", "method", "error"):
        assert name in reached
    for name in ("frame_rate_hz", "view_ev", "model", "material", "yaw", "reset-view", "export"):
        assert name in reached
    page.get_by_text("Count", exact=True).click()
    wait_until(page, lambda: page.locator("#count").is_visible())


def test_the_number_of_lights_is_what_was_asked_for_and_survives_a_reload(page):
    exact = page.get_by_label("Number, exactly")
    exact.fill("7")
    within_frames(page, lambda: page.locator("#count-now").inner_text() == "7")
    page.reload()
    page.wait_for_selector("#picture-panel.has-image")
    wait_until(page, lambda: exact.input_value() == "7")
    exact.fill("20")
    within_frames(page, lambda: page.locator("#count-now").inner_text() == "20")


@pytest.mark.parametrize(
    ("control", "name", "choice", "before"),
    [
        ("#method", "method", "median-cut", "adaptive"),
        ("#model", "model", "ring", "objects"),
        ("#material", "material", "gold", "own"),
    ],
)
def test_a_choice_reaches_the_session_and_the_picture(page, control, name, choice, before):
    picture = pixels(page, "picture")
    page.select_option(control, choice)
    wait_until(page, lambda: settings_of(page)[name] == choice)
    wait_until(page, lambda: pixels(page, "picture") != picture)
    page.select_option(control, before)
    wait_until(page, lambda: settings_of(page)[name] == before)


def test_sliders_and_switches_say_what_they_mean(page):
    for label, value, name, expected in (
        ("Turn in degrees, exactly", "90", "yaw_rad", 1.5708),
        ("View exposure, exactly", "-2.5", "view_ev", -2.5),
    ):
        page.get_by_label(label).fill(value)
        wait_until(page, lambda e=expected, n=name: settings_of(page)[n] == pytest.approx(e, 1e-4))
    within_frames(page, lambda: "-2.5 EV" in page.locator("#counters").inner_text())
    for label, name in (("Stand it in the room", "is_background"), ("Steady", "is_steady")):
        page.get_by_text(label).click()
        wait_until(page, lambda n=name: settings_of(page)[n] is False)
        page.get_by_text(label).click()
    page.get_by_text("View exposure by itself").click()
    page.get_by_label("Turn in degrees, exactly").fill("0")
    wait_until(page, lambda: settings_of(page)["view_ev"] is None)
    wait_until(page, lambda: settings_of(page)["yaw_rad"] == 0)


def test_a_tolerance_and_a_frame_rate_can_be_asked_for(page):
    page.get_by_text("Tolerance").click()
    page.get_by_label("Error in per cent, exactly").fill("20")
    wait_until(page, lambda: settings_of(page)["error"] == pytest.approx(0.2))
    page.get_by_label("Keep a frame rate").check(force=True)
    wait_until(page, lambda: settings_of(page)["frame_rate_hz"] == 25)
    page.locator("#frame_rate_hz").fill("10")
    wait_until(page, lambda: settings_of(page)["frame_rate_hz"] == 10)
    page.get_by_text(" lights, picture ").wait_for()
    page.reload()
    page.wait_for_selector("#picture-panel.has-image")
    wait_until(page, lambda: page.get_by_label("Tolerance").is_checked())
    assert page.locator("#frame_rate_hz").input_value() == "10"
    page.get_by_label("Keep a frame rate").uncheck(force=True)
    page.get_by_text("Count", exact=True).click()
    wait_until(page, lambda: not settings_of(page)["is_auto"])
    assert settings_of(page)["frame_rate_hz"] is None
    page.wait_for_selector("#pace", state="hidden")


def test_the_picture_is_walked_around_by_mouse_and_by_keys(page):
    before = settings_of(page)
    box = page.locator("#picture").bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 50, box["y"] + 110, steps=4)
    page.mouse.up()
    wait_until(page, lambda: settings_of(page)["azimuth_rad"] > before["azimuth_rad"] + 0.3)
    page.locator("#picture").focus()
    page.keyboard.press("+")
    wait_until(page, lambda: settings_of(page)["distance"] == pytest.approx(0.9))
    page.keyboard.press("Home")
    wait_until(page, lambda: settings_of(page)["distance"] == 1)
    assert settings_of(page)["azimuth_rad"] == pytest.approx(before["azimuth_rad"])


def test_frozen_light_stands_still(page):
    page.get_by_label("View exposure, exactly").fill("-3")  # or it would adapt meanwhile
    wait_until(page, lambda: settings_of(page)["view_ev"] == -3)
    page.locator("#map").focus()  # letters in a field are no commands
    page.keyboard.press("f")
    wait_until(page, lambda: page.locator("#freeze").get_attribute("aria-pressed") == "true")
    first = number(page)
    wait_until(page, lambda: number(page) > first + IN_FLIGHT)
    camera, first = pixels(page, "camera"), number(page)
    wait_until(page, lambda: number(page) > first + 2)
    assert pixels(page, "camera") == camera
    page.keyboard.press("f")
    wait_until(page, lambda: pixels(page, "camera") != camera)
    page.get_by_text("View exposure by itself").click()


def test_lights_on_the_map_are_told_one_by_one(page):
    page.locator("#map").focus()
    page.keyboard.press("ArrowRight")
    assert "% of all lights" in page.locator("#tip").inner_text()
    first = page.locator("#tip").inner_text()
    page.keyboard.press("ArrowRight")
    assert page.locator("#tip").inner_text() != first


def test_snapshot_export_and_recording_are_written_and_told(page, session):
    _, output = session
    page.get_by_role("button", name="Snapshot").click()
    wait_until(page, lambda: "snapshot-0001.json" in page.locator("#toast").inner_text())
    page.locator("#record").click()
    wait_until(page, lambda: page.locator("#record").get_attribute("aria-pressed") == "true")
    first = number(page)
    wait_until(page, lambda: number(page) > first + 2)
    page.locator("#record").click()
    wait_until(page, lambda: "brackets" in page.locator("#toast").inner_text())
    page.select_option("#format", "export-glb")
    page.locator("#export").click()
    wait_until(page, lambda: "lights-0001.glb" in page.locator("#toast").inner_text())
    for name in ("snapshot-0001.exr", "snapshot-0001.png", "recording-0001", "lights-0001.glb"):
        assert (output / name).exists()


def test_the_page_can_be_turned_light_and_stays_so(page):
    page.locator("#theme").click()
    assert page.evaluate("document.documentElement.dataset.theme") == "light"
    page.reload()
    assert page.evaluate("document.documentElement.dataset.theme") == "light"


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
