"""The page in a real browser, before a real session: `fishlight live` in a process of its own.

Skips where there is no Chromium (`make browser` installs it); FISHLIGHT_REQUIRE_BROWSER=1 fails
instead. Screenshots are kept where FISHLIGHT_SCREENSHOTS says.
"""

import re
import signal
import subprocess
import sys

import pytest

from tests.render.live_browser import (
    IN_FLIGHT,
    chromium,
    keep,
    number,
    opened,
    pixels,
    settings_of,
    wait_until,
    within_frames,
)
from tests.render.live_recording import make_recording

pytestmark = pytest.mark.slow

LIVE = [sys.executable, "-c", "from render.main import main; main()", "live"]
WIDTHS = [(1440, 900), (1024, 768), (390, 844)]
PANELS = ["#picture-panel", "#map-panel", "#camera-panel", ".strip", "#controls"]
NAMED = "[...document.querySelectorAll('button, input, select, [tabindex]')].filter(e => !({name}))"


@pytest.fixture(scope="module")
def browser():
    with chromium() as launched:
        yield launched


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
