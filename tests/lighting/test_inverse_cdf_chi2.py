"""The sampler against its density: chi-square over the sphere, and the bias of an integral."""

import numpy as np
import pytest

from lighting.environment import luminance
from lighting.latlong import direction_to_grid, solid_angles
from lighting.methods.inverse_cdf import sample_directions
from tests.chi2 import chi_square_p_value, sidak, sphere_counts, sphere_shares, z_score
from tests.environments import bright_poles, constant, one_hot, outdoors, sun_in_sky, two_cells

MAPS = {
    "one-hot": one_hot(),
    "one-hot at the pole": one_hot(cell=(0, 31)),
    "constant": constant(),
    "two cells": two_cells(),
    "bright poles": bright_poles(),
    "sun in sky": sun_in_sky(sun=1e3),
    "outdoors": outdoors(),
}
LEVEL = 1e-3
DRAWS = 200_000
HEIGHTS, AZIMUTHS = 53, 101  # primes: no border of a cell coincides with one of the map's

parametrize_maps = pytest.mark.parametrize(
    ("environment", "seed"),
    [(environment, seed) for seed, environment in enumerate(MAPS.values())],
    ids=list(MAPS),
)


def draw(environment, seed):
    return sample_directions(environment, np.random.default_rng(seed).random((DRAWS, 2)))


@parametrize_maps
def test_directions_follow_the_light(environment, seed):
    directions, _ = draw(environment, seed)
    counts = sphere_counts(directions, HEIGHTS, AZIMUTHS)
    shares = sphere_shares(luminance(environment.radiance), HEIGHTS, AZIMUTHS)
    assert chi_square_p_value(counts, DRAWS * shares) > sidak(LEVEL, len(MAPS))


@parametrize_maps
def test_directions_are_even_within_a_cell(environment, seed):
    # Folding every cell onto the unit square must give a uniform square.
    directions, _ = draw(environment, seed)
    height = environment.height
    column, row = np.moveaxis(direction_to_grid(directions, height) + 0.5, -1, 0)
    edges = np.cos(np.linspace(0, np.pi, height + 1))
    index = np.clip(row.astype(int), 0, height - 1)
    depth = (edges[index] - directions[:, 1]) / (edges[index] - edges[index + 1])
    counts, _, _ = np.histogram2d(depth, column % 1, bins=(10, 10), range=((0, 1), (0, 1)))
    assert counts.sum() >= DRAWS - 5  # rounding may put a few just outside
    assert chi_square_p_value(counts, np.full(100, counts.sum() / 100)) > sidak(LEVEL, len(MAPS))


@parametrize_maps
def test_density_is_the_luminance_over_its_integral(environment, seed):
    directions, density = draw(environment, seed)
    cell_luminance = luminance(environment.radiance)
    power = float(solid_angles(environment.height) @ cell_luminance.sum(axis=1))
    column, row = np.moveaxis(direction_to_grid(directions, environment.height), -1, 0)
    inside = (np.abs(row - np.round(row)) < 0.49) & (np.abs(column - np.round(column)) < 0.49)
    expected = cell_luminance[
        np.round(row[inside]).astype(int), np.round(column[inside]).astype(int)
    ]
    np.testing.assert_allclose(density[inside], expected / power, rtol=1e-6)


@parametrize_maps
def test_density_integrates_to_one(environment, seed):
    # E[1/p] is the solid angle on which p > 0, if and only if ∫ p = 1 there.
    _, density = draw(environment, seed)
    lit = luminance(environment.radiance) > 0
    support = float(solid_angles(environment.height) @ lit.sum(axis=1))
    if np.ptp(density) < 1e-9 * density.max():
        assert 1 / density[0] == pytest.approx(support, rel=1e-6)
    else:
        assert abs(z_score(1 / density, support)) < 4


@parametrize_maps
def test_estimate_of_the_irradiance_is_unbiased(environment, seed):
    # f = max(0, d·n) over n: Σ f L/(n p) estimates ∫ f L dω, whose truth is a sum over a grid 16
    # times finer than the map, for the cosine changes within a cell.
    normal = np.array([0.48, 0.6, 0.64])
    directions, _ = draw(environment, seed)
    cosine = np.clip(directions @ normal, 0, None)
    fine = 16
    height = environment.height
    theta = np.linspace(0, np.pi, height + 1)
    inner = (
        np.cos(theta)[:-1, None] + np.diff(np.cos(theta))[:, None] * (np.arange(fine) + 0.5) / fine
    )
    y = inner.reshape(-1, 1)
    phi = np.pi - np.pi * (np.arange(2 * height * fine) + 0.5) / (height * fine)
    x, z = np.sqrt(1 - y * y) * np.sin(phi), np.sqrt(1 - y * y) * np.cos(phi)
    facing = np.clip(normal[0] * x + normal[1] * y + normal[2] * z, 0, None)
    mean = facing.reshape(height, fine, 2 * height, fine).mean(axis=(1, 3))
    light = luminance(environment.radiance)
    truth = float(solid_angles(height) @ (mean * light).sum(axis=1))
    power = float(solid_angles(height) @ light.sum(axis=1))
    # L/p = Φ for every sample: the weights are bounded even for a one-cell map.
    assert abs(z_score(cosine * power, truth)) < 4


def test_chi_square_sees_a_density_that_is_off_by_a_fifth():
    # The same draws against a map whose lower half is a fifth too bright must fail.
    environment = constant()
    directions, _ = draw(environment, 0)
    wrong = luminance(environment.radiance)
    wrong[8:] *= 1.2
    shares = sphere_shares(wrong, HEIGHTS, AZIMUTHS)
    counts = sphere_counts(directions, HEIGHTS, AZIMUTHS)
    assert chi_square_p_value(counts, DRAWS * shares) < 1e-12


def test_chi_square_fails_at_once_on_a_hit_where_none_can_be():
    assert chi_square_p_value(np.array([99, 1]), np.array([100.0, 0.0])) == 0


def test_chi_square_p_value_is_uniform_for_a_right_density():
    # 400 tests at the level 0.1 reject 40 ± 6 times; the bound is four deviations.
    rng = np.random.default_rng(5)
    expected = np.full(50, 40.0)
    p_values = [
        chi_square_p_value(np.bincount(rng.integers(0, 50, 2000), minlength=50), expected)
        for _ in range(400)
    ]
    assert abs(np.sum(np.array(p_values) < 0.1) - 40) < 24


@pytest.mark.parametrize(
    ("statistic_at_5_percent", "freedom"), [(18.307, 10), (67.505, 50), (124.342, 100)]
)
def test_chi_square_p_value_meets_the_tables(statistic_at_5_percent, freedom):
    # Critical values of χ² at 5 %, as printed in any table of it. Two cells are moved apart from an
    # expectation of 1000 by the amount that makes the statistic.
    step = np.sqrt(1000 * statistic_at_5_percent / 2)
    observed = np.full(freedom + 1, 1000.0)
    observed[:2] += [step, -step]
    expected = np.full(freedom + 1, 1000.0)
    assert chi_square_p_value(observed, expected) == pytest.approx(0.05, rel=0.01)


def test_sidak_makes_the_level_of_the_family():
    assert 1 - (1 - sidak(0.01, 7)) ** 7 == pytest.approx(0.01)
