"""A turn of lights, fill and map is one and the same turn."""

import numpy as np
import pytest

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere import harmonics
from lighting.sphere.latlong import cell_directions
from render.live.turning import turned_lights, turned_map

FILL = np.array([3.0, 0.2, 0.3, -0.1, 0.05, 0.1, -0.08, 0.02, 0.06])[:, None] * [1.0, 0.5, 0.2]


def lights(directions):
    directions = np.asarray(directions, float)
    count = len(directions)
    return LightSet(directions, np.ones((count, 3)), np.zeros(count), fill=FILL)


def test_a_quarter_turn_takes_z_to_x_and_leaves_up_alone():
    turned = turned_lights(lights([[0, 0, 1], [1, 0, 0], [0, 1, 0]]), np.pi / 2)
    np.testing.assert_allclose(
        turned.directions, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], rtol=0, atol=1e-15
    )


@pytest.mark.parametrize("yaw_rad", [0.4, -2.0, np.pi])
def test_the_fill_turns_with_the_lights(yaw_rad):
    random = np.random.default_rng(3)
    directions = random.standard_normal((50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    before = lights(directions)
    after = turned_lights(before, yaw_rad)
    np.testing.assert_allclose(
        harmonics.evaluate(after.fill, after.directions),
        harmonics.evaluate(before.fill, before.directions),
        rtol=1e-12,
    )
    np.testing.assert_allclose(after.integral(), before.integral(), rtol=1e-12)


@pytest.mark.parametrize("cells", [1, 5, -7])
def test_the_map_turns_with_the_lights(cells):
    height = 16
    yaw_rad = cells * np.pi / height
    radiance = np.random.default_rng(1).random((height, 2 * height, 3)).astype(np.float32)
    valid = radiance[..., 0] > 0.3
    environment = EnvironmentMap(radiance, valid, radiance[..., 1] > 0.8)
    turned = turned_map(environment, yaw_rad)
    brightest = turned.radiance.sum(axis=2).argmax()
    direction = cell_directions(height).reshape(-1, 3)[radiance.sum(axis=2).argmax()]
    expected = turned_lights(lights([direction]), yaw_rad).directions[0]
    found = cell_directions(height).reshape(-1, 3)[brightest]
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert (turned.valid == (turned.radiance[..., 0] > 0.3)).all()
    assert (turned.clipped == (turned.radiance[..., 1] > 0.8)).all()
