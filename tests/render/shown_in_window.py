"""Shows pictures in a window of a process of its own, as in life, and keeps what stood in it."""

import sys

import numpy as np

from lighting.light_set import LightSet
from render.live.desk import Desk, Seen, State
from render.live.models import load_models
from render.live.settings import Settings
from render.live.window import PictureWindow

LIGHTS = LightSet(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
SIZE_PX = 200, 120


def seen(picture):
    return Seen(LIGHTS, None, None, picture, 0.0, False)


def main(picture_path, shown_path):
    picture = np.load(picture_path)
    desk, read = Desk(Settings(), load_models(())), []

    with PictureWindow(SIZE_PX) as window:

        def is_over():
            assert desk.is_watched
            if not read:
                desk.publish(State("running"), seen(1 - picture), 0.0, {})
            if len(read) == 2:
                desk.publish(State("away", "unplugged"), seen(picture), 0.0, {})
            pixels = np.frombuffer(window._context.screen.read(components=3), np.uint8)
            read.append(pixels.reshape(*SIZE_PX[::-1], 3)[::-1])
            return len(read) == 5

        window.show(desk, is_over)
        print(window._window.title)
    assert not desk.is_watched
    np.save(shown_path, read[-1])


if __name__ == "__main__":
    main(*sys.argv[1:])
