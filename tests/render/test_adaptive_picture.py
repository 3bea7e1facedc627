"""Pictures under a few lights against those under every cell of the map that they stand for.

A matt sphere on the ground, in the first map of each bundled recording. The truth is ray-cast: the
sun or lamp with its extent, and of the map without it a point in every cell of 32 rows. Mean
absolute difference over the mean, outlines left out, every pixel looking at all lights:

| 64 lights                            | outdoor | indoor |
|--------------------------------------|---------|--------|
| adaptive: key lights, cells and fill | 0.26 %  | 0.65 % |
| cells, drawn with their extents      | 0.33 %  | 0.69 % |
| cells, drawn as points               | 0.90 %  | 1.68 % |
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.reduce import reduce_to_lights
from lighting.simulation.scenario import Moment
from lighting.simulation.truth import read_truth
from lighting.sphere.latlong import cell_directions, solid_angles
from render.opengl.renderer import Renderer
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.render.brute_force import SphereScene, as_points, away_from_outlines, trace

pytestmark = pytest.mark.gl

RECORDINGS = Path(__file__).parents[2] / "recordings"
ROWS = 32
BALL = SphereScene(
    (0.0, 0.5, 0.0), 0.5, Material((0.6, 0.6, 0.6), specular=0.0), Ground(0.0, (0.5, 0.5, 0.5), 20)
)
CAMERA = Camera(np.array([1.0, 1.2, 2.5]), np.array([0.0, 0.4, 0.0]), 0.7, (40, 30))
INSIDE = away_from_outlines(BALL, CAMERA)


def cells_above_ground(environment: EnvironmentMap) -> LightSet:
    """A point light in each of the cells of 32 rows, those above the ground."""
    height = environment.height
    light = environment.radiance * solid_angles(height)[:, None, None]
    blocks = light.reshape(ROWS, height // ROWS, 2 * ROWS, height // ROWS, 3).sum(axis=(1, 3))
    directions = cell_directions(ROWS)[: ROWS // 2].reshape(-1, 3)
    return LightSet(directions, blocks[: ROWS // 2].reshape(-1, 3), np.zeros(ROWS**2))


def true_picture(moment: Moment):
    (source,) = moment.discs
    disc = LightSet(
        source.direction[None], source.irradiance[None], np.array([source.angular_radius_rad])
    )
    parts = cells_above_ground(moment.environment), as_points(disc, 64)
    return sum(trace(BALL, CAMERA, part)[INSIDE, :3] for part in parts)


@pytest.mark.parametrize(
    ("name", "bound"), [("outdoor", 0.0035), pytest.param("indoor", 0.008, marks=pytest.mark.slow)]
)
def test_adaptive_lights_are_nearer_to_the_truth_than_points(ctx, name, bound):
    moment = read_truth(RECORDINGS / name / "truth").moments[0]
    view = moment.true_map()
    truth = true_picture(moment)
    cells = reduce_to_lights(view, 64, "cells")
    points = replace(cells, angular_radius_rad=np.zeros(64))
    ball = sphere(BALL.centre, BALL.radius_m, BALL.material, 64)
    with Renderer(ctx, Scene((ball,), BALL.ground), CAMERA, interleaving=1) as renderer:

        def error(lights: LightSet) -> float:
            return np.abs(renderer.render(lights)[INSIDE, :3] - truth).mean() / truth.mean()

        adaptive = reduce_to_lights(view, 64)
        assert adaptive.is_key.any()
        assert adaptive.fill.any()
        assert error(adaptive) < bound
        assert error(adaptive) < 0.6 * error(points)
        assert error(cells) < error(points)
