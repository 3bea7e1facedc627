"""The door of light reduction: what it refuses, and what it marks."""

import numpy as np
import pytest

from capture.errors import InputError
from lighting.maps.environment import EnvironmentMap
from lighting.reduce import reduce_to_lights
from lighting.sphere.latlong import solid_angles
from tests.environments import constant, outdoors


@pytest.mark.parametrize("count", [0, -1, 65537])
def test_a_count_out_of_range_is_refused(count):
    with pytest.raises(InputError, match=f"1 to 65536, got {count}"):
        reduce_to_lights(constant(), count)


@pytest.mark.parametrize("error", [0, -0.1, 1, np.nan])
def test_an_error_out_of_range_is_refused(error):
    with pytest.raises(InputError, match="between 0 and 1"):
        reduce_to_lights(constant(), 4, error=error)


def test_only_the_adaptive_method_can_be_asked_for_an_error():
    with pytest.raises(InputError, match=r"only the adaptive method.*'cells'"):
        reduce_to_lights(constant(), 4, "cells", error=0.1)


def test_an_unknown_method_is_refused_with_the_known_ones():
    with pytest.raises(InputError, match=r"'median'.*inverse-cdf"):
        reduce_to_lights(constant(), 4, "median")


def test_the_largest_count_is_served():
    assert len(reduce_to_lights(outdoors(16), 65536, "inverse-cdf")) == 65536


def test_clipped_fraction_is_the_share_of_the_light_from_clipped_cells():
    # Two rows of 16 cells, one twice as bright as the other and of equal solid angle: of 3 shares
    # of light the clipped half row of the brighter holds 1.
    radiance = np.zeros((8, 16, 3), np.float32)
    radiance[1], radiance[6] = 2.0, 1.0
    clipped = np.zeros((8, 16), bool)
    clipped[1, :8] = True
    lights = reduce_to_lights(EnvironmentMap(radiance, ~clipped, clipped), 4)
    assert lights.clipped_fraction == pytest.approx(1 / 3)


def test_clipped_fraction_of_dark_clipped_cells_is_zero():
    radiance = np.zeros((8, 16, 3), np.float32)
    marked = np.ones((8, 16), bool)
    assert reduce_to_lights(EnvironmentMap(radiance, marked, marked), 4).clipped_fraction == 0


def test_unseen_cells_count_as_what_they_hold():
    radiance = np.ones((8, 16, 3), np.float32)
    nothing = np.zeros((8, 16), bool)
    lights = reduce_to_lights(EnvironmentMap(radiance, nothing, nothing), 4)
    expected = 16 * solid_angles(8).sum()
    np.testing.assert_allclose(lights.integral(), expected)


def test_marks_of_the_map_travel_with_the_lights():
    seen = np.ones((8, 16), bool)
    radiance = np.ones((8, 16, 3), np.float32)
    environment_map = EnvironmentMap(radiance, seen, ~seen, scale="W·sr⁻¹·m⁻²")
    lights = reduce_to_lights(environment_map, 4, "cells", timestamp_s=2.5, source="a.exr")
    assert lights.scale == "W·sr⁻¹·m⁻²"
    assert lights.timestamp_s == 2.5
    assert lights.source == "a.exr: 4 lights by cells"
