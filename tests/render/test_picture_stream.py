"""Pictures that come back later: the same, in order, with times."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from render.opengl import renderer as renderer_module
from render.opengl.picture_stream import BEHIND, PictureStream, _Slot
from render.opengl.renderer import Renderer
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Material, Scene
from tests.render.light_sets import random_lights, uniform_fill

pytestmark = pytest.mark.gl

SCENE = Scene((sphere((0, 0.5, 0), 0.5, Material(), 8),))
CAMERA = Camera(np.array([1.0, 1.2, 2.5]), np.array([0.0, 0.4, 0.0]), size_px=(24, 16))


def test_each_picture_comes_two_later_and_none_is_lost(ctx):
    sets = [random_lights(6, seed) for seed in range(5)]
    with Renderer(ctx, SCENE, CAMERA, 2) as renderer:
        expected = [renderer.render(lights) for lights in sets]
        with PictureStream(ctx, renderer) as stream:
            drawn = [stream.draw(lights) for lights in sets]
            rest = list(stream.rest())
            assert list(stream.rest()) == []
    assert drawn[:BEHIND] == [None, None]
    got = [each.picture for each in (*drawn[BEHIND:], *rest)]
    assert len(got) == len(expected)
    for picture, other in zip(got, expected, strict=True):
        assert_array_equal(picture, other)


def test_parts_are_timed_on_both_clocks(ctx):
    lights = replace(random_lights(6, 0), fill=uniform_fill(0.5))
    with Renderer(ctx, SCENE, CAMERA) as renderer, PictureStream(ctx, renderer) as stream:
        stream.draw(lights)
        [streamed] = stream.rest()
    parts = {"background", "shadow maps", "lights", "copy"}
    assert set(streamed.device_ms) == set(streamed.issue_ms) == parts
    assert all(0 <= ms < 60e3 for ms in streamed.device_ms.values())
    assert streamed.device_ms["lights"] > 0
    assert all(ms > 0 for ms in streamed.issue_ms.values())


def test_maps_wait_where_there_is_no_time(ctx):
    first, second = random_lights(8, 1), random_lights(8, 2)
    with Renderer(ctx, SCENE, CAMERA) as renderer:
        renderer.draw(first)
        assert renderer.draw(second, most_maps=5) == 5
        held = renderer.render(second)  # the other three
        assert renderer.draw(second) == 0
        assert renderer.draw(first, most_maps=0) == 0
    assert np.isfinite(held).all()


def test_maps_of_lights_that_take_turns_in_the_atlas_do_not_wait(ctx, monkeypatch):
    monkeypatch.setattr(renderer_module, "ATLAS_SIDE_PX", 256)  # four maps
    lights = random_lights(12, 3)
    with Renderer(ctx, SCENE, CAMERA) as renderer:
        expected = renderer.render(lights)
        renderer.draw(lights, most_maps=0)
        drawn = renderer.as_picture(renderer.framebuffer.read(components=4, dtype="f4"))
    assert_array_equal(drawn, expected)


@pytest.mark.parametrize("device_ms", [100.0, 0.1])
def test_a_frame_rate_is_held_by_drawing_fewer_maps(ctx, monkeypatch, device_ms):
    monkeypatch.setattr(_Slot, "device_ms", lambda slot: {"shadow maps": device_ms})
    sets = [random_lights(40, seed) for seed in (3, 4)]
    with (
        Renderer(ctx, SCENE, CAMERA) as renderer,
        PictureStream(ctx, renderer, frame_rate_hz=30.0) as stream,
    ):
        drawn = [stream.draw(sets[turn % 2]) for turn in range(24)]
    chosen = [each.most_maps for each in drawn if each is not None]
    assert chosen[0] == 32
    if device_ms > 1e3 / 30:
        assert chosen[-1] <= 2
        assert np.all(np.diff(chosen) <= 0)
    else:
        assert chosen[-1] >= 40
        assert np.all(np.diff(chosen) >= 0)


def test_without_a_rate_all_maps_are_drawn(ctx):
    with Renderer(ctx, SCENE, CAMERA) as renderer, PictureStream(ctx, renderer) as stream:
        stream.draw(random_lights(3, 0))
        [streamed] = stream.rest()
    assert streamed.most_maps is None
