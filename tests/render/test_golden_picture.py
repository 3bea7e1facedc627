"""A picture of everything that OpenGL draws, as it was when somebody last looked at it.

Laws and closed forms are tested elsewhere: this sees what nobody thought of. Where the golden
picture is missing it is made anew, to be looked at and committed.
"""

from pathlib import Path

import cv2
import numpy as np
import pytest

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.opengl.context import describe
from render.opengl.renderer import Renderer
from render.output.pictures import write_picture
from render.scenes.default_scene import default_scene
from tests.render.light_sets import random_lights, uniform_fill

pytestmark = pytest.mark.gl

GOLDEN = Path(__file__).parent / "golden" / "opengl.png"
_NOTICED = 2  # of 255
_OUTLINES = 0.003  # of all pixels: where a sample falls depends on the release of Mesa


def test_a_picture_is_as_it_was(ctx, tmp_path):
    """Metal, glossy and matt objects under a sun, wide lights and a fill, before a map."""
    scene, camera = default_scene((160, 120))
    lights = random_lights(24, seed=3, lowest=0.2)
    radius_rad = np.full(24, 0.1)
    irradiance = 0.15 * lights.irradiance
    irradiance[0], radius_rad[0] = (2.0, 1.8, 1.5), 0.005
    lights = LightSet(lights.directions, irradiance, radius_rad, fill=uniform_fill(0.1))
    row, column = np.mgrid[:64, :128]
    radiance = np.stack([0.2 + 0.004 * row, 0.3 + 0.002 * row, 0.6 - 0.003 * column], axis=-1)
    seen = np.ones(row.shape, bool)
    background = EnvironmentMap(radiance.astype(np.float32), seen, ~seen)
    with Renderer(ctx, scene, camera) as renderer:
        write_picture(tmp_path / "drawn.png", renderer.render(lights, background), 0.0)
    if "llvmpipe" not in ctx.info["GL_RENDERER"]:
        pytest.skip(f"the golden picture is llvmpipe's, and this is {describe(ctx)}")
    if not GOLDEN.exists():
        GOLDEN.parent.mkdir(exist_ok=True)
        GOLDEN.write_bytes((tmp_path / "drawn.png").read_bytes())
        pytest.fail(f"look at {GOLDEN}, which is new")
    drawn, golden = (cv2.imread(str(path)).astype(int) for path in (tmp_path / "drawn.png", GOLDEN))
    differs = np.abs(drawn - golden).max(axis=-1) > _NOTICED
    assert differs.mean() <= _OUTLINES
