"""Claim    : a shadow is as wide as it should be up to a texel; thinner casters may lose theirs.

Setup    : an upright plate 1 m square, seen edge-on by the light, over white ground; thickness from
           a half to four texels, at nine positions within a texel. A texel is 2.8 mm wide.
Expected : the shadow's width is off by one texel at most: samples are a texel apart. So a plate of
           half a texel keeps or loses all of its shadow with its position.
Measured : off by at most 0.7 texels; at half a texel the width is 0 or 1.
"""

import math

import numpy as np
import pytest

from render.opengl.renderer import KEY_MAP_PX, Renderer
from render.opengl.shadows import texel_width
from render.scenes.casters import gather_casters
from render.scenes.scene import Camera, Ground, Scene
from tests.render.boxes import box
from tests.render.light_sets import one_light

pytestmark = pytest.mark.gl

LIGHT = one_light((math.cos(0.7), math.sin(0.7), 0.0), (math.pi,) * 3)
# A strip of ground that the plate's shadow crosses from end to end.
CAMERA = Camera(np.array([-1.2, 4.0, 0.001]), np.array([-1.2, 0.0, 0.0]), 0.02, (16, 400))
PIXEL_M = 2 * 4 * math.tan(0.01) / 400
# Keeps the maps in place while the plate moves.
ANCHOR = box((-0.5, 0.2, -0.1), (-0.49, 0.21, 0.1))
TEXEL_M = texel_width(
    gather_casters([box((-0.5, 0.2, -0.1), (0.5, 1.2, 0.1))]).radius_m, KEY_MAP_PX
)


def shadow_width_m(ctx, thickness_m, shift_m):
    plate = box((-0.5, 0.2, shift_m - thickness_m / 2), (0.5, 1.2, shift_m + thickness_m / 2))
    with Renderer(ctx, Scene((plate, ANCHOR), Ground(reflectance=(1, 1, 1))), CAMERA) as renderer:
        lit = renderer.render(LIGHT)[..., 0] / LIGHT.directions[0, 1]
    return (1 - lit).sum(axis=0).mean() * PIXEL_M


@pytest.mark.parametrize("texels", [0.5, 1.3, 2.7, 4])
def test_width_of_the_shadow(ctx, texels):
    shifts_m = TEXEL_M * np.linspace(0, 1, 9)
    widths = [shadow_width_m(ctx, texels * TEXEL_M, shift_m) / TEXEL_M for shift_m in shifts_m]
    assert np.abs(np.array(widths) - texels).max() < 1
    if texels < 1:
        assert min(widths) < 1e-3
