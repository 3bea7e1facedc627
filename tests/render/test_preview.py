"""The picture of a map and its lights: what is marked is seen, and where."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere.latlong import cell_directions
from render.output.preview import CLIPPED_RGB, UNSEEN_RGB, preview
from tests.render.light_sets import one_light

OUTLINE_PX = 5  # wider than the circle through the middle of the line, both sides together
NO_LIGHTS = LightSet(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))


def grey_map(height=64):
    seen = np.ones((height, 2 * height), bool)
    radiance = np.full((height, 2 * height, 3), 0.18, np.float32)
    return EnvironmentMap(radiance, seen, np.zeros_like(seen))


def is_colour(picture, colour):
    return np.all(picture == colour, axis=-1)


def test_without_lights_the_picture_is_the_map():
    picture = preview(grey_map(), NO_LIGHTS, 0.0, width_px=256)
    assert picture.shape == (128, 256, 3)
    assert_array_equal(picture, 118)  # middle grey


def test_the_exposure_brightens():
    assert preview(grey_map(), NO_LIGHTS, 1.0, width_px=256).min() > 150


@pytest.mark.parametrize(("width_px", "height"), [(256, 64), (128, 64), (128, 512)])
def test_a_single_clipped_cell_is_seen_at_every_size(width_px, height):
    environment = grey_map(height)
    clipped = np.zeros((height, 2 * height), bool)
    clipped[height // 4, height // 2] = True
    environment = EnvironmentMap(environment.radiance, environment.valid, clipped)
    marked = is_colour(preview(environment, NO_LIGHTS, 0.0, width_px), CLIPPED_RGB)
    rows, columns = np.nonzero(marked)
    assert len(rows) > 0
    scale = width_px / (2 * height)
    assert abs(rows.mean() + 0.5 - (height // 4 + 0.5) * scale) <= max(0.5, scale / 2)
    assert abs(columns.mean() + 0.5 - (height // 2 + 0.5) * scale) <= max(0.5, scale / 2)


def test_unseen_cells_look_like_no_radiance_whatever_they_are_filled_with():
    environment = grey_map()
    valid = environment.valid.copy()
    valid[32:] = False
    environment = EnvironmentMap(environment.radiance, valid, environment.clipped)
    picture = preview(environment, NO_LIGHTS, 0.0, width_px=128)
    assert_array_equal(picture[:32], 118)
    below = picture[32:]
    assert is_colour(below, UNSEEN_RGB).any()
    hatch = is_colour(below, np.add(UNSEEN_RGB, 25))
    assert hatch.any()
    assert np.all(is_colour(below, UNSEEN_RGB) | hatch)


def ring_mask(lights, width_px):
    """Where a light's ring changes the grey map."""
    return ~is_colour(preview(grey_map(), lights, 0.0, width_px), 118)


@pytest.mark.parametrize("cell", [(20, 40), (50, 100), (32, 64)])
def test_a_ring_stands_around_its_light(cell):
    light = one_light(cell_directions(64)[cell])
    rows, columns = np.nonzero(ring_mask(light, 512))
    centre = 4 * (np.array(cell) + 0.5) - 0.5
    distance = np.hypot(rows - centre[0], columns - centre[1])
    assert distance.mean() == pytest.approx(0.06 * 512, abs=0.5)
    assert np.ptp(distance) < 8
    assert np.abs([rows.mean() - centre[0], columns.mean() - centre[1]]).max() < 0.5
    red, _, blue = np.moveaxis(preview(grey_map(), light, 0.0, width_px=512).astype(int), -1, 0)
    assert np.count_nonzero(red - blue > 150) > 100


def test_the_area_of_a_ring_is_its_share():
    directions = cell_directions(64)[[20, 20], [30, 90]]
    lights = LightSet(directions, np.array([[0.2] * 3, [0.8] * 3]), np.zeros(2))
    ring = ring_mask(lights, 1024)
    widths = [
        np.ptp(np.nonzero(half.any(axis=0))[0]) - OUTLINE_PX
        for half in (ring[:, :512], ring[:, 512:])
    ]
    assert widths[1] / widths[0] == pytest.approx(2, abs=0.06)


def test_a_ring_across_the_seam_goes_on_at_the_other_edge():
    ring = ring_mask(one_light(cell_directions(64)[32, 0]), 512)
    inside = ring_mask(one_light(cell_directions(64)[32, 64]), 512)
    assert_array_equal(ring, np.roll(inside, 256, axis=1))


def test_lights_without_power_have_the_smallest_ring():
    ring = ring_mask(one_light((0, 0, 1), irradiance=(0.0, 0.0, 0.0)), 512)
    assert np.ptp(np.nonzero(ring.any(axis=0))[0]) - OUTLINE_PX == pytest.approx(6, abs=1)


@pytest.mark.parametrize(
    "cell", [(20, 40), (32, 0), (2, 100)], ids=["", "at the seam", "at a pole"]
)
def test_a_line_runs_along_the_edge_of_a_disc(cell):
    directions = cell_directions(64)[cell][None]
    disc = LightSet(directions, np.ones((1, 3)), np.array([0.5]))
    edge = ring_mask(disc, 512) & ~ring_mask(replace(disc, angular_radius_rad=np.zeros(1)), 512)
    angle = np.arccos(cell_directions(256)[edge] @ directions[0])
    assert np.abs(angle - 0.5).max() < 2 * np.pi / 256
    # It is closed: it crosses every half plane through the light.
    across = np.linalg.svd(directions)[2][1:]
    turn = np.arctan2(*(across @ cell_directions(256)[edge].T))
    assert np.diff(np.sort(turn)).max() < 0.1


def test_key_lights_have_a_colour_of_their_own():
    light = one_light((0, 0, 1))
    colours = [
        preview(grey_map(), replace(light, is_key=np.array([is_key])), 0.0, width_px=512)
        for is_key in (False, True)
    ]
    red_less_blue = [np.int64(picture[..., 0]) - picture[..., 2] for picture in colours]
    assert red_less_blue[0].max() > 150
    assert red_less_blue[1].min() < -150
    assert red_less_blue[1].max() == 0
