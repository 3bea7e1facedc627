"""The environment map's invariants, and what unseen cells are filled with."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from capture.errors import InputError
from lighting.blocks.fill import fill_unseen
from lighting.maps.environment import EnvironmentMap, luminance
from tests.environments import constant


def upper_half(radiance: NDArray[np.floating]) -> EnvironmentMap:
    """A map (N, 2N) of which only what lies above the horizon was seen."""
    height = len(radiance)
    seen = np.zeros(radiance.shape, bool)
    seen[: height // 2] = True
    colour = np.repeat(radiance[..., None], 3, axis=2).astype(np.float32)
    return EnvironmentMap(np.where(seen[..., None], colour, 0), seen, ~seen & False)


def test_the_integral_of_a_constant_is_4_pi_times_it() -> None:
    environment = constant(17)
    np.testing.assert_allclose(environment.integral(), 4 * np.pi, rtol=1e-12)


@pytest.mark.parametrize("shape", [(4, 4, 3), (4, 9, 3), (1, 2, 3), (4, 8), (4, 8, 4)])
def test_a_map_of_another_shape_is_refused(shape: tuple[int, ...]) -> None:
    mask = np.ones(shape[:2], bool)
    with pytest.raises(ValueError, match=r"\(N, 2N, 3\)|shape"):
        EnvironmentMap(np.ones(shape, np.float32), mask, ~mask)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1e-6])
def test_radiance_that_is_no_radiance_is_refused(bad: float) -> None:
    radiance = np.ones((4, 8, 3), np.float32)
    radiance[1, 2, 0] = bad
    mask = np.ones((4, 8), bool)
    with pytest.raises(ValueError, match="finite and at least 0"):
        EnvironmentMap(radiance, mask, ~mask)


def test_the_arrays_inside_cannot_be_written_to() -> None:
    with pytest.raises(ValueError, match="read-only"):
        constant().radiance[0, 0] = 5.0


def test_seen_share_is_by_solid_angle() -> None:
    # The upper quarter of the rows is the cap of 45°: (1 − cos 45°) / 2 of the sphere.
    seen = np.zeros((8, 16), bool)
    seen[:2] = True
    environment = replace(constant(8), valid=seen)
    assert environment.seen_share == pytest.approx((1 - np.sqrt(0.5)) / 2, rel=1e-12)


def test_luminance_of_white_is_one() -> None:
    assert luminance(np.ones(3)) == pytest.approx(1, abs=1e-12)


def test_black_leaves_unseen_cells_black() -> None:
    environment = upper_half(np.full((4, 8), 3.0))
    filled = fill_unseen(environment, "black")
    assert filled.radiance[2:].max() == 0
    np.testing.assert_array_equal(filled.valid, environment.valid)


def test_mean_is_weighted_by_solid_angle() -> None:
    # N = 4: rows 0 and 1 have solid angles in the ratio (1 − cos 45°) : (cos 45° − 0).
    radiance = np.zeros((4, 8))
    radiance[0] = 1.0
    filled = fill_unseen(upper_half(radiance), "mean")
    np.testing.assert_allclose(filled.radiance[2:], 1 - np.sqrt(0.5), rtol=1e-6)
    assert not filled.valid[2:].any()


def test_mirror_reflects_at_the_horizon_and_falls_back_to_the_mean() -> None:
    radiance = np.arange(32.0).reshape(4, 8)
    environment = upper_half(radiance)
    seen = environment.valid.copy()
    seen[0, 5] = False
    environment = replace(environment, valid=seen)
    filled = fill_unseen(environment, "mirror")
    np.testing.assert_array_equal(filled.radiance[2], environment.radiance[1])
    mean = fill_unseen(environment, "mean").radiance[3, 5]
    np.testing.assert_array_equal(filled.radiance[[0, 3], 5], [mean, mean])
    np.testing.assert_array_equal(filled.valid, seen)


def test_the_mirror_image_of_a_clipped_cell_is_a_lower_bound_too() -> None:
    environment = upper_half(np.ones((4, 8)))
    clipped = np.zeros((4, 8), bool)
    clipped[1, 3] = True
    filled = fill_unseen(replace(environment, clipped=clipped), "mirror")
    np.testing.assert_array_equal(np.argwhere(filled.clipped), [[1, 3], [2, 3]])


def test_a_map_that_saw_nothing_has_no_mean() -> None:
    environment = replace(constant(4), valid=np.zeros((4, 8), bool))
    assert fill_unseen(environment, "black").radiance.max() == 0
    with pytest.raises(InputError, match="no part of the map was seen"):
        fill_unseen(environment, "mean")
