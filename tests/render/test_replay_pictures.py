"""Pictures of a replay: those of their renderers, each by its name, none lost."""

from collections import deque
from dataclasses import replace
from itertools import chain

import moderngl
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from capture.errors import InputError
from lighting.maps.environment import EnvironmentMap
from lighting.stream.light_stream import LightPlan
from render import replay as replaying
from render import replay_pictures
from render.opengl.context import GlUnavailable
from render.opengl.picture_stream import PictureStream
from render.opengl.renderer import Renderer
from render.replay_pictures import OpenGLPictures, RayPictures
from render.scene_renderer import SceneRenderer
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Material, Scene
from render.session import StageClock
from tests.render.light_sets import random_lights
from tests.render.live_recording import make_recording

SCENE = Scene((sphere((0, 0.5, 0), 0.5, Material(roughness=0.2, metalness=1.0), 8),))
CAMERA = Camera(np.array([1.0, 1.2, 2.5]), np.array([0.0, 0.4, 0.0]), size_px=(24, 16))
SMALLER = replace(CAMERA, size_px=(12, 8))
MAP = EnvironmentMap(
    np.ones((8, 16, 3), np.float32), np.ones((8, 16), bool), np.zeros((8, 16), bool)
)
LIGHTS = [random_lights(5, seed) for seed in range(7)]
CAMERAS = [CAMERA, CAMERA, CAMERA, SMALLER, SMALLER, SMALLER, SMALLER]


def drawn(pictures):
    clock, there = StageClock(deque()), []
    for number, (camera, lights) in enumerate(zip(CAMERAS, LIGHTS, strict=True)):
        clock.begin_frame()
        there.append(pictures.draw(number, camera, lights, MAP, clock))
    return there, pictures.rest(), clock


@pytest.mark.gl
def test_opengl_hands_out_each_picture_later_and_all_before_a_smaller_one(ctx):
    with OpenGLPictures(SCENE, None) as pictures:
        there, rest, clock = drawn(pictures)
        assert pictures.rest() == []
    named = [[name for name, _ in each] for each in (*there, rest)]
    assert named == [[], [], [0], [1, 2], [], [3], [4], [5, 6]]
    assert "device lights" in clock.frames[2]
    assert "device lights" not in clock.frames[0]
    with ctx, Renderer(ctx, SCENE, CAMERA) as large, Renderer(ctx, SCENE, SMALLER) as small:
        for name, picture in chain(*there, rest):
            renderer = large if CAMERAS[name] is CAMERA else small
            assert_array_equal(picture, renderer.render(LIGHTS[name], MAP))


class Losing(PictureStream):
    """Loses its context with some of its pictures, counted over all streams."""

    at: tuple[int, ...] = ()
    by_error = False
    count = 0

    def draw(self, lights, background=None):
        Losing.count += 1
        if Losing.count - 1 in Losing.at:
            if Losing.by_error:
                raise moderngl.Error("cannot create buffer")
            self._context.enable_direct(0x1234)  # leaves an error, as a lost context does
        return super().draw(lights, background)


@pytest.fixture
def losing(monkeypatch):
    monkeypatch.setattr(replay_pictures, "PictureStream", Losing)
    monkeypatch.setattr(Losing, "count", 0)
    return lambda *at, by_error=False: (
        monkeypatch.setattr(Losing, "at", at),
        monkeypatch.setattr(Losing, "by_error", by_error),
    )


@pytest.mark.gl
@pytest.mark.parametrize("by_error", [False, True])
@pytest.mark.parametrize("at", [0, 2, 3])
def test_pictures_that_a_lost_context_took_are_drawn_in_another(losing, at, by_error):
    with OpenGLPictures(SCENE, None) as pictures:
        whole, rest, _ = drawn(pictures)
    losing(7 + at, by_error=by_error)
    Losing.count = 7
    with OpenGLPictures(SCENE, None) as pictures:
        again, again_rest, _ = drawn(pictures)
    for one, other in zip((*whole, rest), (*again, again_rest), strict=True):
        assert [name for name, _ in one] == [name for name, _ in other]
        for (_, picture), (_, twice) in zip(one, other, strict=True):
            assert_array_equal(picture, twice)


@pytest.mark.gl
def test_a_second_context_that_is_lost_is_no_opengl(losing):
    losing(1, 5)
    with OpenGLPictures(SCENE, None) as pictures, pytest.raises(GlUnavailable, match="twice"):
        drawn(pictures)


def test_rays_draw_each_picture_at_once():
    with RayPictures(SCENE, through_ground=False) as pictures:
        there, rest, _ = drawn(pictures)
    assert rest == []
    assert [[name for name, _ in each] for each in there] == [[number] for number in range(7)]
    with SceneRenderer(still_pictures=0) as renderer:
        expected = renderer.render(SCENE, CAMERA, LIGHTS[0], MAP)
    assert_array_equal(there[0][0][1], expected)


@pytest.mark.gl
def test_a_bracket_that_cannot_be_read_holds_the_picture_of_the_one_before_it(
    tmp_path, monkeypatch
):
    written = []

    class Noted(replaying.ReplayFolder):
        def write(self, index, environment, lights, radiance):
            written.append(index)

        def hold(self):
            written.append("held")

    recording = make_recording(tmp_path / "r", brackets=4)
    broken = sorted((recording.folder / "frames").iterdir())[4]  # the third bracket's first
    broken.write_bytes(b"")
    monkeypatch.setattr(replaying, "ReplayFolder", Noted)
    (tmp_path / "out").mkdir()
    replaying.replay(
        recording.folder, tmp_path / "out", LightPlan(4), scene=SCENE, camera=CAMERA,
        map_height=16, with_opengl=True,
    )  # fmt: skip
    assert written == [0, 1, "held", 3]


def test_a_floor_that_only_carries_shadows_is_not_drawn_with_opengl(tmp_path):
    with pytest.raises(InputError, match="with rays, not with OpenGL"):
        replaying.replay(
            tmp_path, tmp_path / "out", LightPlan(4), scene=SCENE, camera=CAMERA,
            through_ground=True, with_opengl=True,
        )  # fmt: skip
