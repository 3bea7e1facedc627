"""Claim    : a context that is lost costs a second try, and none at all costs shadow maps alone.

Setup    : a ball on the ground under three points, drawn by `fishlight render`'s own function: with
           OpenGL, with a context that fails after the picture is drawn or while shaders are made,
           and without EGL. Baked transport and the traced reference where OpenGL refuses.
Expected : after a loss the same bits as without; two losses are no OpenGL. Then rays draw the
           picture, which is said: 99 % of its pixels are within 2 % of the brightest. Transport and
           reference ask for no context at all; their mean light is that of rays within 2 %.
Measured : 99.9 % of the pixels.
"""

import moderngl
import numpy as np
import pytest

from render.baked.renderer import BakedRenderer
from render.opengl import context as opengl
from render.opengl.context import GlUnavailable
from render.opengl.renderer import Renderer
from render.reference.tracing import render_reference
from render.render_cli import draw
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.render.light_sets import random_lights

MATT = Material((0.6, 0.6, 0.6), specular=0.0)
SCENE = Scene((sphere((0.0, 0.5, 0.0), 0.5, MATT, 16),), Ground())
CAMERA = Camera(np.array([0.5, 3.0, 2.0]), np.array([0.0, 0.2, 0.0]), 0.8, (48, 36))
LIGHTS = random_lights(3, seed=7)


def picture():
    return draw(SCENE, CAMERA, LIGHTS, None)


def lost_after_drawing(renderer, lights, background):
    drawn = whole(renderer, lights, background)
    renderer._context.enable_direct(0x1234)  # leaves an error, as a lost context does
    return np.zeros_like(drawn)


def lost_while_drawing(*_arguments):
    raise moderngl.Error("cannot create program")


whole = Renderer.render


@pytest.mark.gl
@pytest.mark.parametrize("loses", [lost_after_drawing, lost_while_drawing])
def test_a_lost_context_changes_no_bit(monkeypatch, loses):
    expected, said = picture()
    assert said == ""
    ways = iter([loses, whole])
    monkeypatch.setattr(Renderer, "render", lambda *arguments: next(ways)(*arguments))
    again, said = picture()
    assert said == ""
    assert next(ways, None) is None
    np.testing.assert_array_equal(again, expected)


@pytest.mark.gl
def test_what_is_lost_twice_is_drawn_by_rays(monkeypatch):
    expected, _ = picture()
    monkeypatch.setattr(Renderer, "render", lost_after_drawing)
    again, said = picture()
    assert said == ", no OpenGL: drawn with rays"
    off = np.abs(again - expected).max(axis=-1) / expected.max()
    assert np.mean(off < 0.02) > 0.99


def test_transport_and_reference_need_no_opengl(monkeypatch):
    def refuse():
        raise GlUnavailable("no EGL")

    monkeypatch.setattr(opengl, "create_context", refuse)
    monkeypatch.setattr(moderngl, "create_context", refuse)
    by_rays, said = picture()
    assert "no OpenGL" in said
    with BakedRenderer(SCENE, CAMERA) as renderer:
        baked = renderer.render(LIGHTS)
    traced = render_reference(SCENE, CAMERA, LIGHTS, error=0.05).radiance
    for each in (baked, traced):
        assert each[..., :3].mean() == pytest.approx(by_rays[..., :3].mean(), rel=0.02)
