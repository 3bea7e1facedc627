"""Structured importance sampling: the metric and the strata, by hand."""

import numpy as np
import pytest

from lighting.methods.structured import structured
from lighting.sphere.latlong import cell_directions, solid_angles
from tests.environments import constant, environment, one_hot, outdoors, sun_in_sky, turned


def lamps_in_the_dark(small, large):
    """Return two square lamps of brightness 1 on the horizon, their sides in cells of 0.7°."""
    radiance = np.zeros((256, 512))
    radiance[128 : 128 + small, 100 : 100 + small] = 1.0
    radiance[128 : 128 + large, 300 : 300 + large] = 1.0
    return environment(radiance)


@pytest.mark.parametrize(
    ("small", "large", "count", "of_small"),
    [
        # Below 0.01 sr the lights are as L Δω^¼: sides as 1 : 3 make 9^1.25 = 15.6, so 1.2 of 20
        # where light alone would make 2; and as 3 : 8 11.6, so 3.97 of 50. An exponent of 0.35
        # would make 3.3, one of 0.15 4.7.
        (2, 6, 20, 1),
        (3, 8, 50, 4),
        # Above, they are as L: sides of 10 and 20 cells (0.015 and 0.06 sr) make 4, so 4 of 20
        # where the fourth root would make 3.
        (10, 20, 20, 4),
    ],
)
def test_lights_are_as_the_metric(small, large, count, of_small):
    directions, _, _ = structured(lamps_in_the_dark(small, large), count)
    # The small lamp stands on the left, at φ > 0, so toward +X.
    assert (directions[:, 0] > 0).sum() == of_small


@pytest.mark.parametrize(("threshold", "columns"), [(2, 58), (3, 20), (4, 11), (5, 7)])
def test_lights_do_not_mix_what_a_threshold_parts(threshold, columns):
    # A red field of luminance threshold − ½ touches a blue one of + ½. They are so wide that the
    # deviation is 1.
    radiance = np.zeros((64, 128, 3))
    radiance[24:40, 5 : 5 + columns, 0] = (threshold - 0.5) / 0.2126
    radiance[24:40, 5 + columns : 5 + 2 * columns, 2] = (threshold + 0.5) / 0.0722
    _, irradiance, _ = structured(environment(radiance), 15)
    assert (irradiance[:, [0, 2]] == 0).any(axis=1).all()


@pytest.mark.parametrize("columns", [0, 5, 26, 27, 40])
def test_a_lamp_is_one_light_wherever_it_stands(columns):
    # Two lights, a lamp and the sky: also when the lamp lies on the seam (columns 26, 27 roll its
    # cells 4 to 6 of 32 across it).
    radiance = np.ones((16, 32))
    radiance[5:7, 4:7] = 200.0
    lamp = turned(environment(radiance), columns)
    _, irradiance, angular_radius_rad = structured(lamp, 2)
    of_the_lamp = lamp.radiance[..., 0] == 200
    expected = 200 * (solid_angles(16) @ of_the_lamp.sum(axis=1))
    assert irradiance[:, 0].max() == pytest.approx(expected, rel=1e-6)
    # 2 cells high and 3 wide, 0.39 × 0.59 rad: spread as a disc of about 0.28 rad.
    assert 0.25 < angular_radius_rad.min() < 0.3


def test_a_lamp_at_the_pole_is_one_light():
    radiance = np.ones((16, 32))
    radiance[0] = 200.0
    directions, irradiance, _ = structured(environment(radiance), 2)
    np.testing.assert_allclose(directions[np.argmax(irradiance[:, 0])], [0, 1, 0], atol=1e-12)
    expected = 200 * 2 * np.pi * (1 - np.cos(np.pi / 16))
    assert irradiance[:, 0].max() == pytest.approx(expected, rel=1e-6)


def test_a_sun_of_one_cell_is_one_light_and_leaves_the_others_to_the_sky():
    _, irradiance, _ = structured(sun_in_sky(sun=1e6), 64)
    assert len(irradiance) == 64
    order = np.sort(irradiance[:, 0])
    assert order[-1] == pytest.approx(1e6 * solid_angles(16)[4])
    # The sky is one region: its strata are within a factor of a few of 4π/63.
    assert order[-2] < 4 * 4 * np.pi / 63


def test_strata_of_an_even_sky_are_about_equally_wide():
    # Hochbaum and Shmoys: no stratum is wider than twice the best covering, and no two centres are
    # nearer than its radius. 64 discs that cover the sphere have at least 4π/64 each, a radius of
    # 0.25; the light's own radius is that of a disc spread as the stratum is.
    directions, irradiance, angular_radius_rad = structured(constant(64), 64)
    assert angular_radius_rad.max() < 0.5
    assert irradiance[:, 0].max() < 3 * 4 * np.pi / 64
    apart = np.arccos(np.clip(directions @ directions.T - 2 * np.eye(64), -1, 1)).min()
    assert apart > 0.2


def test_one_cell_is_one_light_of_its_size():
    directions, irradiance, angular_radius_rad = structured(one_hot(16, (5, 7)), 9)
    assert len(directions) == 1
    np.testing.assert_allclose(directions[0], cell_directions(16)[5, 7], atol=2e-3)
    np.testing.assert_allclose(irradiance[0], one_hot(16, (5, 7)).integral(), rtol=1e-6)
    assert angular_radius_rad[0] == pytest.approx(0.11, abs=0.004)


@pytest.mark.parametrize("height", [257, 515])
def test_blocks_at_the_end_of_a_map_may_be_smaller(height):
    # The last of 129 rows of blocks has one row of 2, the last of 172 has two of 3 and the last of
    # 344 columns one of 3. A lamp of 100 cells makes the deviation 0.8: were these blocks taken
    # for whole ones, their sky would be below the threshold and get lights of its own.
    radiance = np.ones((height, 2 * height))
    middle = np.s_[height // 2 : height // 2 + 10, height - 5 : height + 5]
    radiance[middle] = 0.8 / np.sqrt(100 * np.pi / (4 * height**2))
    _, irradiance, angular_radius_rad = structured(environment(radiance), 64)
    assert len(irradiance) == 64
    sky = np.sort(irradiance[:, 0])[:-2]
    assert sky[0] > 0.2 * sky.mean()
    assert angular_radius_rad.max() < 0.5


def test_the_largest_count_is_served_on_a_large_map():
    directions, irradiance, _ = structured(outdoors(256), 65536)
    assert len(directions) == 65536
    np.testing.assert_allclose(irradiance.sum(axis=0), outdoors(256).integral(), rtol=1e-6)
