"""Claim    : rough metals are too dark, and smooth dielectrics a little too bright at their rims.

Setup    : a white sphere in uniform light of radiance 1 (1024 lights), where a lossless surface
           shows 1 everywhere.
Expected : a white metal shows at least 0.98, 0.87 and 0.40 on average at roughness 0.2, 0.5 and 1:
           light that one facet passes on to another is lost. A white dielectric stays within 4 %:
           its diffuse part is dimmed by the reflectance at the half vector, not by all that is.
Measured : metal 0.987, 0.881, 0.412; dielectric 1.036, 1.010, 0.975.
"""

import numpy as np
import pytest

from render.opengl.renderer import Renderer
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Material, Scene
from tests.render.light_sets import uniform_lights

pytestmark = pytest.mark.gl

CAMERA = Camera(np.array([0.0, 0.0, 4.0]), np.zeros(3), 0.6, (32, 32))


@pytest.mark.parametrize(
    ("roughness", "metalness", "least", "most"),
    [
        (0.2, 1, 0.98, 1.0),
        (0.5, 1, 0.87, 0.89),
        (1.0, 1, 0.40, 0.42),
        (0.2, 0, 1.0, 1.04),
        (0.5, 0, 1.0, 1.02),
        (1.0, 0, 0.96, 1.0),
    ],
)
def test_a_white_sphere_in_uniform_light(ctx, roughness, metalness, least, most):
    white = Material((1, 1, 1), roughness, metalness)
    scene = Scene((sphere((0, 0, 0), 1.0, white, rings=16),), None)
    with Renderer(ctx, scene, CAMERA) as renderer:
        picture = renderer.render(uniform_lights(1024))
    assert least <= picture[picture[..., 3] == 1][:, :3].mean() <= most
