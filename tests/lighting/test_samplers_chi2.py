"""Samplers against their density: chi-square over the sphere, and the bias of an integral.

Stratified draws come in many small sets, as their points are independent only between sets. Within
a set they avoid each other, so their counts vary less than the tests allow for, never more.
"""

from functools import cache

import numpy as np
import pytest

from lighting.maps.environment import luminance
from lighting.methods import hierarchical, inverse_cdf, stratified
from lighting.sphere.latlong import direction_to_grid, solid_angles
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
SET, SETS = 97, 1000
DRAWS = SET * SETS
HEIGHTS, AZIMUTHS = 53, 101  # primes: no border of a cell coincides with one of the map's


def stratified_sets(environment, generator):
    drawn = [stratified.sample_directions(environment, SET, generator) for _ in range(SETS)]
    return tuple(np.concatenate(parts) for parts in zip(*drawn, strict=True))


SAMPLERS = {
    "inverse-cdf": lambda environment, generator: inverse_cdf.sample_directions(
        environment, generator.random((DRAWS, 2))
    ),
    "stratified-random": stratified_sets,
    "hierarchical": lambda environment, generator: hierarchical.sample_directions(
        environment, generator.random((DRAWS, 2))
    ),
}
TESTS = len(SAMPLERS) * len(MAPS)

each_sampler_and_map = pytest.mark.parametrize(
    ("sampler", "name"), [(sampler, name) for sampler in SAMPLERS for name in MAPS]
)


@cache
def draw(sampler, name):
    """Return directions and densities; a seed of its own for each sampler and map."""
    seed = [list(SAMPLERS).index(sampler), list(MAPS).index(name)]
    return SAMPLERS[sampler](MAPS[name], np.random.default_rng(seed))


def set_means(values):
    """Return the mean of each set, which is independent of the others for every sampler."""
    return values.reshape(SETS, SET).mean(axis=1)


@each_sampler_and_map
def test_directions_follow_the_light(sampler, name):
    environment = MAPS[name]
    directions, _ = draw(sampler, name)
    counts = sphere_counts(directions, HEIGHTS, AZIMUTHS)
    shares = sphere_shares(luminance(environment.radiance), HEIGHTS, AZIMUTHS)
    assert chi_square_p_value(counts, DRAWS * shares) > sidak(LEVEL, TESTS)


@each_sampler_and_map
def test_directions_are_even_within_a_cell(sampler, name):
    environment = MAPS[name]
    # Folding every cell onto the unit square must give a uniform square.
    directions, _ = draw(sampler, name)
    height = environment.height
    column, row = np.moveaxis(direction_to_grid(directions, height) + 0.5, -1, 0)
    edges = np.cos(np.linspace(0, np.pi, height + 1))
    index = np.clip(row.astype(int), 0, height - 1)
    depth = (edges[index] - directions[:, 1]) / (edges[index] - edges[index + 1])
    counts, _, _ = np.histogram2d(depth, column % 1, bins=(10, 10), range=((0, 1), (0, 1)))
    assert counts.sum() >= DRAWS - 5  # rounding may put a few just outside
    assert chi_square_p_value(counts, np.full(100, counts.sum() / 100)) > sidak(LEVEL, TESTS)


@each_sampler_and_map
def test_density_is_the_luminance_over_its_integral(sampler, name):
    environment = MAPS[name]
    directions, density = draw(sampler, name)
    cell_luminance = luminance(environment.radiance)
    power = float(solid_angles(environment.height) @ cell_luminance.sum(axis=1))
    column, row = np.moveaxis(direction_to_grid(directions, environment.height), -1, 0)
    inside = (np.abs(row - np.round(row)) < 0.49) & (np.abs(column - np.round(column)) < 0.49)
    expected = cell_luminance[
        np.round(row[inside]).astype(int), np.round(column[inside]).astype(int)
    ]
    np.testing.assert_allclose(density[inside], expected / power, rtol=1e-6)


@each_sampler_and_map
def test_density_integrates_to_one(sampler, name):
    environment = MAPS[name]
    # E[1/p] is the solid angle on which p > 0, if and only if ∫ p = 1 there.
    _, density = draw(sampler, name)
    lit = luminance(environment.radiance) > 0
    support = float(solid_angles(environment.height) @ lit.sum(axis=1))
    if np.ptp(density) < 1e-9 * density.max():
        assert 1 / density[0] == pytest.approx(support, rel=1e-6)
    else:
        assert abs(z_score(set_means(1 / density), support)) < 4


NORMAL = np.array([0.48, 0.6, 0.64])


@cache
def luminous_irradiance(name):
    """Return ∫ max(0, d·n) Y dω with n = NORMAL: a sum over 1024 rows, as d changes in a cell."""
    environment = MAPS[name]
    height = environment.height
    fine = 1024 // height
    edges = np.cos(np.linspace(0, np.pi, height + 1))
    y = edges[:-1, None] + np.diff(edges)[:, None] * (np.arange(fine) + 0.5) / fine
    y = y.reshape(-1, 1)
    phi = np.pi - np.pi * (np.arange(2 * height * fine) + 0.5) / (height * fine)
    x, z = np.sqrt(1 - y * y) * np.sin(phi), np.sqrt(1 - y * y) * np.cos(phi)
    facing = np.clip(NORMAL[0] * x + NORMAL[1] * y + NORMAL[2] * z, 0, None)
    mean = facing.reshape(height, fine, 2 * height, fine).mean(axis=(1, 3))
    return float(solid_angles(height) @ (mean * luminance(environment.radiance)).sum(axis=1))


@each_sampler_and_map
def test_estimate_of_the_irradiance_is_unbiased(sampler, name):
    # Σ max(0, d·n) Y/(n p) estimates the irradiance. Y/p = Φ for every sample: the weights are
    # bounded even for a one-cell map.
    environment = MAPS[name]
    directions, _ = draw(sampler, name)
    light = luminance(environment.radiance)
    power = float(solid_angles(environment.height) @ light.sum(axis=1))
    estimates = set_means(np.clip(directions @ NORMAL, 0, None) * power)
    assert abs(z_score(estimates, luminous_irradiance(name))) < 4


def test_chi_square_sees_a_density_that_is_off_by_a_fifth():
    # The same draws against a map whose lower half is a fifth too bright must fail.
    environment = constant()
    points = np.random.default_rng(0).random((200_000, 2))
    directions, _ = inverse_cdf.sample_directions(environment, points)
    wrong = luminance(environment.radiance)
    wrong[8:] *= 1.2
    shares = sphere_shares(wrong, HEIGHTS, AZIMUTHS)
    counts = sphere_counts(directions, HEIGHTS, AZIMUTHS)
    assert chi_square_p_value(counts, len(points) * shares) < 1e-12


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
