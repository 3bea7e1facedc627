"""The picture in a local window: whole, the right way up, until it is closed; or one line."""

import os
import shutil
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from capture.errors import InputError
from lighting.light_set import LightSet
from render.live.desk import Desk, Seen, State
from render.live.models import load_models
from render.live.settings import Settings
from render.live.window import PictureWindow
from render.main import main
from render.output.view import to_display

LIGHTS = LightSet(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))


@pytest.fixture(scope="module")
def display():
    """Name a display of our own in the environment; skips where there is no Xvfb."""
    if shutil.which("Xvfb") is None:
        pytest.skip("no Xvfb")
    pytest.importorskip("moderngl_window", reason="moderngl-window is not installed")
    reading, writing = os.pipe()
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", "320x240x24"]
    process = subprocess.Popen(command, pass_fds=[writing], stderr=subprocess.DEVNULL)
    os.close(writing)
    with os.fdopen(reading) as answer:
        name = answer.readline().strip()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DISPLAY", f":{name}")
        patch.delenv("WAYLAND_DISPLAY", raising=False)
        yield
    process.terminate()
    process.wait(10)


def seen(picture):
    return Seen(LIGHTS, None, None, picture, 0.0, False)


@pytest.mark.gl
def test_the_newest_picture_fills_the_window_as_it_is(display):
    random = np.random.default_rng(3)
    blocks = random.random((3, 4, 4)).astype(np.float32)
    picture = blocks.repeat(20, axis=0).repeat(20, axis=1)  # 80 × 60
    desk, read = Desk(Settings(), load_models(())), []

    with PictureWindow((200, 120)) as window:

        def is_over():
            assert desk.is_watched
            if not read:
                desk.publish(State("running"), seen(1 - picture), 0.0, {})
            if len(read) == 2:
                desk.publish(State("away", "unplugged"), seen(picture), 0.0, {})
            pixels = np.frombuffer(window._context.screen.read(components=3), np.uint8)
            read.append(pixels.reshape(120, 200, 3)[::-1])
            return len(read) == 5

        window.show(desk, is_over)
        title = window._window.title
    assert not desk.is_watched
    assert title == "fishlight live · away · unplugged"
    last = read[-1]
    middles = last[20:120:40, 40:200:40]  # twice as large, between bars of 20 columns
    np.testing.assert_array_equal(middles, to_display(picture, 0.0)[10::20, 10::20])
    assert not last[:, :20].any()
    assert not last[:, 180:].any()


def test_without_a_display_it_is_one_line(tmp_path, monkeypatch, capsys):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    with pytest.raises(SystemExit) as end:
        main(["live", str(tmp_path), "--window", "--port", "0"])
    assert end.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "--window: there is no display" in line


def test_without_its_library_or_a_display_that_answers_it_is_one_line(monkeypatch):
    class Refused:
        def __init__(self, **_):
            raise RuntimeError('Cannot connect to ":4099"')

    monkeypatch.setenv("DISPLAY", ":4099")
    name = "moderngl_window.context.pyglet.window"
    for module, message in (
        (None, "pip install moderngl-window"),
        (SimpleNamespace(Window=Refused), r"no window can be opened \(Cannot connect"),
    ):
        monkeypatch.setitem(sys.modules, name, module)
        with pytest.raises(InputError, match=message):
            PictureWindow((20, 10))
