"""From a camera's picture to lights: which way is taken, what travels along, what is refused."""

import numpy as np
import pytest

from calibration.camera import UP, Calibration
from calibration.models.equidistant import Equidistant
from capture.errors import InputError
from capture.radiance import RadianceImage
from lighting.blocks.block_sums import BlockSums
from lighting.blocks.fill import fill_blocks, fill_unseen
from lighting.blocks.source_blocks import picture_blocks
from lighting.blocks.summed_area import block_sums
from lighting.maps.remap_image import remap_image
from lighting.reduce import (
    BLOCK_METHODS,
    METHODS,
    reduce_to_lights,
)
from lighting.reduce_picture import reduce_picture_to_lights
from tests.environments import outdoors

CAMERA = Calibration(Equidistant((31.5, 31.5), 64 / np.pi), (64, 64), np.pi / 2, UP)


def picture(valid=True, clipped=False, scale="relative"):
    rng = np.random.default_rng(0)
    radiance = rng.lognormal(0, 1, (64, 64, 3)).astype(np.float32) * valid
    marks = (np.full((64, 64), mark) for mark in (valid, clipped))
    return RadianceImage(radiance, np.zeros_like(radiance), *marks, scale)


def assert_equal(lights, expected):
    np.testing.assert_array_equal(lights.directions, expected.directions)
    np.testing.assert_array_equal(lights.irradiance, expected.irradiance)
    np.testing.assert_array_equal(lights.angular_radius_rad, expected.angular_radius_rad)
    assert lights.clipped_fraction == expected.clipped_fraction


def test_cells_come_straight_from_the_source():
    lights = reduce_picture_to_lights(CAMERA, picture(), 16, "cells", fill="mirror")
    blocks = fill_blocks(picture_blocks(CAMERA, picture()), "mirror")
    assert_equal(lights, reduce_to_lights(blocks, 16, "cells"))


def test_methods_that_need_a_map_get_one():
    lights = reduce_picture_to_lights(CAMERA, picture(), 16, "inverse-cdf", fill="mean")
    environment = fill_unseen(remap_image(CAMERA, picture(), 512), "mean")
    assert_equal(lights, reduce_to_lights(environment, 16, "inverse-cdf"))


@pytest.mark.parametrize("method", BLOCK_METHODS)
def test_blocks_of_a_map_give_the_lights_of_the_map(method):
    world = outdoors(16)
    sums = block_sums(world.radiance)
    blocks = BlockSums(sums, np.zeros((16, 32)), np.zeros((16, 32)))
    assert_equal(reduce_to_lights(blocks, 20, method), reduce_to_lights(world, 20, method))


def test_block_methods_are_methods():
    assert BLOCK_METHODS.keys() <= METHODS.keys()


@pytest.mark.parametrize("method", ["cells", "inverse-cdf"])
def test_marks_travel_with_the_lights(method):
    lights = reduce_picture_to_lights(
        CAMERA,
        picture(clipped=True, scale="cd·m⁻²"),
        4,
        method,
        timestamp_s=2.5,
        source="a.exr",
    )
    assert lights.clipped_fraction == pytest.approx(1)
    assert lights.scale == "cd·m⁻²"
    assert lights.timestamp_s == 2.5
    assert lights.source == f"a.exr: 4 lights by {method}"


@pytest.mark.parametrize("method", ["cells", "inverse-cdf"])
def test_a_picture_without_a_valid_pixel_is_refused(method):
    with pytest.raises(InputError, match=r"valid pixel.* belong together"):
        reduce_picture_to_lights(CAMERA, picture(valid=False), 4, method)


def test_a_method_that_needs_a_map_is_refused_for_blocks():
    blocks = picture_blocks(CAMERA, picture(), 8)
    with pytest.raises(InputError, match=r"block sums is called 'inverse-cdf'.*cells"):
        reduce_to_lights(blocks, 4, "inverse-cdf")
    with pytest.raises(InputError, match="1 to 65536, got 0"):
        reduce_to_lights(blocks, 0)
