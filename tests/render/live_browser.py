"""A browser for the live session's page, and what is asked of it."""

import os
import shutil
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

IN_FLIGHT = 2


def _chromium_path():
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    if found is None and os.environ.get("FISHLIGHT_REQUIRE_BROWSER"):
        pytest.fail("no Chromium, and FISHLIGHT_REQUIRE_BROWSER is set; run make browser")
    if found is None:
        pytest.skip("no Chromium; run make browser")
    return found


@contextmanager
def chromium():
    """Yield a browser; where there is none the test is skipped, or fails if that was asked for."""
    path = _chromium_path()
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as driver:
        launched = driver.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield launched
        launched.close()


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
