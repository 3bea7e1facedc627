"""The picture in a local window: whole, the right way up, until it is closed; or one line."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from capture.errors import InputError
from render.live.window import PictureWindow
from render.main import main
from render.output.view import to_display

ROOT = Path(__file__).resolve().parents[2]


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


@pytest.mark.gl
def test_the_newest_picture_fills_the_window_as_it_is(display, tmp_path):
    random = np.random.default_rng(3)
    blocks = random.random((3, 4, 4)).astype(np.float32)
    picture = blocks.repeat(20, axis=0).repeat(20, axis=1)  # 80 × 60
    np.save(tmp_path / "picture.npy", picture)
    command = [sys.executable, "-m", "tests.render.shown_in_window", "picture.npy", "shown.npy"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "fishlight live · away · unplugged"
    last = np.load(tmp_path / "shown.npy")
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
