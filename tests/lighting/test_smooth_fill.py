"""The fill: never negative, below the map, and never more light than there is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.adaptive.smooth_fill import FIT_ROWS, FillShape, fit_fill, less_fill
from lighting.blocks.block_grid import block_grid
from lighting.blocks.summed_area import block_sums
from lighting.methods.adaptive import SHAPES
from lighting.sphere import harmonics
from lighting.sphere.latlong import cell_directions, solid_angles
from tests.environments import (
    bright_poles,
    constant,
    environment,
    one_hot,
    outdoors,
    sun_in_sky,
    two_cells,
)

MAPS = {
    "outdoors": outdoors(32),
    "constant": constant(),
    "bright poles": bright_poles(),
    "one cell": one_hot(),
    "two cells": two_cells(),
    "sun": sun_in_sky(),
    "smallest": constant(2),
    "odd": outdoors(50),
}
each_map = pytest.mark.parametrize("view", MAPS.values(), ids=MAPS)
each_shape = pytest.mark.parametrize("shape", SHAPES, ids=str)


def blocks_of(view):
    return block_sums(view.radiance), block_grid(view.height)


@each_map
@each_shape
def test_a_fill_is_nowhere_negative_and_of_its_order(view, shape):
    fill = fit_fill(*blocks_of(view), shape)
    assert np.isfinite(fill).all()
    assert (harmonics.lowest(fill) >= -1e-9 * (fill[0] + 1e-30)).all()
    assert not fill[(shape.order + 1) ** 2 :].any()


@each_map
@each_shape
def test_rest_and_fill_are_the_map(view, shape):
    blocks, grid = blocks_of(view)
    fill = fit_fill(blocks, grid, shape)
    rest, positive = less_fill(blocks, grid, fill)
    given_back = rest[..., 4:] + (grid.functions @ fill) * grid.area[..., :1]
    np.testing.assert_allclose(given_back, blocks[..., 4:], rtol=1e-9, atol=1e-9 * blocks.max())
    assert (positive[..., 0] >= 0).all()
    assert (positive[..., 0] <= blocks[..., 0] * (1 + 1e-12)).all()


@each_shape
def test_a_constant_map_is_all_fill(shape):
    blocks, grid = blocks_of(constant(32))
    fill = fit_fill(blocks, grid, shape)
    np.testing.assert_allclose(harmonics.integral(fill), 4 * np.pi, rtol=1e-9)
    np.testing.assert_allclose(fill[1:], 0, atol=1e-9)


@each_shape
@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 2**16))
def test_a_map_of_no_more_than_its_order_is_all_fill(shape, seed):
    random = np.random.default_rng(seed)
    coefficients = np.zeros((9, 3))
    coefficients[0] = random.uniform(1, 2, 3)
    inner = slice(1, (shape.order + 1) ** 2)
    coefficients[inner] = random.uniform(-0.12, 0.12, coefficients[inner].shape)
    sky = environment(harmonics.evaluate(coefficients, cell_directions(64)))
    fill = fit_fill(*blocks_of(sky), shape)
    # The fit takes the mean over a coarse block for the value at its middle: smoother by its size.
    np.testing.assert_allclose(fill, coefficients, atol=0.012)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_the_heavier_it_weighs_the_less_a_fill_is_too_bright(order):
    blocks, grid = blocks_of(outdoors(64))
    too_bright = []
    for weight in (10.0, 100.0, 1000.0):
        fill = fit_fill(blocks, grid, FillShape(order, weight))
        too_bright.append(-less_fill(blocks, grid.coarser(64), fill)[0][..., 0].clip(max=0).sum())
    assert too_bright[0] > too_bright[1] > too_bright[2] > 0


@each_shape
def test_a_fit_is_where_its_weights_say(shape):
    # The oracle: what minimises Σ w (f − L)² with weights told by f itself has no gradient.
    blocks, grid = blocks_of(outdoors(16))
    coarse = grid.coarser(FIT_ROWS)
    solid_angle = np.repeat(solid_angles(16), 32)
    radiance = blocks[..., 4:].reshape(-1, 3) / solid_angle[:, None]
    most = 4 * (radiance * solid_angle[:, None]).sum(axis=0) / (4 * np.pi)
    values = np.minimum(radiance, most)
    functions = coarse.functions.reshape(-1, 9)[:, : (shape.order + 1) ** 2]
    expected = np.zeros((9, 3))
    for channel in range(3):
        solution = np.zeros(functions.shape[1])
        solution[0] = -1e9
        for _ in range(8):
            over = functions @ solution > values[:, channel]
            weight = np.sqrt(solid_angle * np.where(over, shape.overshoot_weight, 1.0))[:, None]
            solution = np.linalg.lstsq(
                functions * weight, values[:, channel] * weight[:, 0], rcond=None
            )[0]
        expected[: len(solution), channel] = solution
    expected = harmonics.windowed(expected)
    np.testing.assert_allclose(fit_fill(blocks, grid, shape), expected, atol=1e-7)


def test_what_is_even_about_an_axis_is_windowed_to_zero_too():
    # A lamp below the ground: two eigenvalues of the fill are alike but for rounding, its linear
    # part has a trace along them, and its least value is on a ring.
    cosine = cell_directions(64)[..., 1]
    blocks, grid = blocks_of(environment(0.05 + 100 * np.exp(-(cosine + 1) / 0.1**2)))
    fill = fit_fill(blocks, grid, FillShape(2, 10.0))
    directions = cell_directions(200)
    assert harmonics.evaluate(fill, directions).min() >= -1e-9 * fill[0, 0]
    lowest = harmonics.evaluate(fill, directions)[..., 0].min()
    assert abs(harmonics.lowest(fill)[0] - lowest) < 1e-4 * fill[0, 0]
