"""Which renderer draws a picture, by what changed since the last one."""

from dataclasses import replace

import numpy as np
import pytest

from render import scene_renderer
from render.scene_renderer import SceneRenderer
from render.scenes.scene import Camera, Ground, Scene
from tests.render.light_sets import one_light

SCENE = Scene((), Ground())
CAMERA = Camera(np.array([0.0, 2.0, 2.0]), np.zeros(3), size_px=(8, 8))
LIGHT = one_light((0, 1, 0))


@pytest.fixture
def drawn(monkeypatch):
    """Return the list of what was done, by renderers that draw nothing."""
    done = []

    class Fake:
        def __init__(self, name, shown):
            self.name, self.shown = name, shown
            done.append(f"make {name}")

        def move(self, *shown):
            self.shown = shown

        def render(self, *shown, through_ground):
            done.append(self.name)
            return (*self.shown, *shown[:-2])

        def release(self):
            done.append(f"free {self.name}")

    monkeypatch.setattr(scene_renderer, "BakedRenderer", lambda *shown: Fake("baked", shown))
    monkeypatch.setattr(scene_renderer, "RoamingRenderer", lambda *shown: Fake("roaming", shown))
    monkeypatch.setattr(scene_renderer, "MovingRenderer", lambda *shown: Fake("moving", shown))
    return done


def test_what_stands_is_baked_after_some_pictures(drawn):
    with SceneRenderer(still_pictures=2) as renderer:
        for _ in range(4):
            renderer.render(SCENE, CAMERA, LIGHT)
    assert drawn == [
        "make moving", "moving", "moving", "make baked", "baked", "baked",
        "free baked", "free moving",
    ]  # fmt: skip


def test_what_is_known_to_stand_is_baked_at_once(drawn):
    with SceneRenderer(still_pictures=0) as renderer:
        renderer.render(SCENE, CAMERA, LIGHT)
    assert drawn == ["make baked", "baked", "free baked"]


def test_what_moves_is_drawn_as_it_is_now(drawn):
    with SceneRenderer(still_pictures=1) as renderer:
        for _ in range(2):
            renderer.render(SCENE, CAMERA, LIGHT)
        other = replace(SCENE)
        assert renderer.render(other, CAMERA, LIGHT) == (other, CAMERA)
    assert drawn[3:] == ["baked", "free baked", "moving", "free moving"]


def test_from_a_camera_that_moves_a_scene_that_stands_is_traced_once(drawn):
    cameras = [replace(CAMERA, target=np.array([0.0, 0.1 * step, 0.0])) for step in range(4)]
    with SceneRenderer(still_pictures=2) as renderer:
        for camera in cameras:
            assert renderer.render(SCENE, camera, LIGHT) == (SCENE, camera)
        renderer.render(replace(SCENE), CAMERA, LIGHT)
    assert drawn == [
        "make moving", "moving", "moving", "make roaming", "roaming", "roaming", "free roaming",
        "moving", "free moving",
    ]  # fmt: skip


def test_a_camera_that_comes_to_stand_is_baked(drawn):
    with SceneRenderer(still_pictures=2) as renderer:
        for target in (0.0, 0.1, 0.2):
            renderer.render(SCENE, replace(CAMERA, target=np.array([0, target, 0])), LIGHT)
        for _ in range(3):
            renderer.render(SCENE, CAMERA, LIGHT)
    assert drawn[4:-3] == ["roaming", "roaming", "roaming", "make baked", "baked"]


@pytest.mark.parametrize("still_pictures", [0, 1])
def test_either_way_draws_the_picture(still_pictures):
    with SceneRenderer(still_pictures) as renderer:
        picture = renderer.render(SCENE, CAMERA, LIGHT)
    np.testing.assert_allclose(picture[..., :3], 0.5 / np.pi, rtol=1e-5)
