"""Parts of one small source become one light, and nothing else does."""

import numpy as np
import pytest

from render.lights.gathered_parts import gathered_parts
from render.lights.narrow_lights import PEAK_RAD


def parts_of_a_disc(radius_rad, count, axis=(0.0, 0.6, 0.8)):
    """Return `count` small lights that make up a disc of even radiance."""
    axis = np.array(axis)
    right = np.cross(axis, [1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    index = np.arange(count)
    off = radius_rad * np.sqrt((index + 0.5) / count)
    turn = index * np.pi * (3 - np.sqrt(5))
    across = np.cos(turn)[:, None] * right + np.sin(turn)[:, None] * np.cross(axis, right)
    directions = axis + off[:, None] * across
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions, np.full((count, 3), 1 / count), np.full(count, radius_rad / np.sqrt(count))


def with_one(lights, direction, irradiance, radius_rad):
    return tuple(
        np.concatenate([each, [one]])
        for each, one in zip(lights, (direction, np.full(3, irradiance), radius_rad), strict=True)
    )


@pytest.mark.parametrize("count", [3, 30, 100])
def test_a_lamp_in_parts_is_one_disc_of_its_size(count):
    lamp = parts_of_a_disc(0.8 * PEAK_RAD, count)
    [direction], [irradiance], [radius_rad] = gathered_parts(*lamp)
    assert direction @ [0.0, 0.6, 0.8] > np.cos(0.2 * PEAK_RAD)
    np.testing.assert_allclose(irradiance, 1.0)
    assert radius_rad == pytest.approx(0.8 * PEAK_RAD, rel=0.5 / count + 0.02)


def test_a_sun_keeps_its_edge_in_a_bright_sky():
    sky = parts_of_a_disc(0.8 * PEAK_RAD, 20)
    lights = with_one(sky, (0.0, 0.6, 0.8), 0.3, 0.005)  # 20 times their radiance
    directions, irradiance, radius_rad = gathered_parts(*lights)
    assert min(radius_rad) == 0.005
    assert len(directions) == 2
    np.testing.assert_allclose(irradiance.sum(axis=0), 1.3)


def test_two_lamps_stay_two():
    one, other = (parts_of_a_disc(0.02, 10, axis) for axis in ((0, 0.6, 0.8), (0.6, 0, 0.8)))
    lights = tuple(np.concatenate(each) for each in zip(one, other, strict=True))
    directions, irradiance, _ = gathered_parts(*lights)
    assert len(directions) == 2
    np.testing.assert_allclose(irradiance, 1.0)


def test_a_glow_wider_than_a_narrow_light_becomes_several():
    glow = parts_of_a_disc(3 * PEAK_RAD, 200)
    directions, irradiance, radius_rad = gathered_parts(*glow)
    assert 9 <= len(directions) <= 40  # 9 discs of that radius have the same area
    assert radius_rad.max() <= PEAK_RAD
    np.testing.assert_allclose(irradiance.sum(axis=0), 1.0)
    np.testing.assert_allclose(irradiance.T @ directions, glow[1].T @ glow[0], atol=2e-3)
    centre = np.array([0.0, 0.6, 0.8])
    before, after = (
        each[1][:, 0] @ (each[2] ** 2 + 4 * (1 - each[0] @ centre))
        for each in (glow, (directions, irradiance, radius_rad))
    )
    assert after == pytest.approx(before, rel=1e-3)


@pytest.mark.parametrize(
    "lights",
    [
        (*parts_of_a_disc(0.02, 10)[:2], np.zeros(10)),  # points
        (np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0)),
        (np.eye(3)[:1], np.zeros((1, 3)), np.array([0.01])),  # dark
    ],
    ids=["points", "none", "dark"],
)
def test_everything_else_stays_as_it_is(lights):
    for before, after in zip(lights, gathered_parts(*lights), strict=True):
        np.testing.assert_array_equal(before, after)
