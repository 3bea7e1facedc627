"""Discs that horizons cut: against exact integrals over their outlines (lighting.sphere.caps)."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from lighting.sphere import caps
from render.lights.discs import cut_at_horizon, irradiance_curves, moment_above
from tests.environments import normals

UP = np.array([[0.0, 1.0, 0.0]])
RADII = [0.0, 2e-4, 0.0047, 0.1, 0.35, 0.8, 1.05, 1.5, np.pi / 2]


def seen(surfaces, direction, radius_rad, *, above_ground):
    """Exact irradiance (n,) from one disc of unit ∫L dω, all of it or what is above the ground."""
    count = len(surfaces)
    openings = np.tile(UP, (count, 1, 1, 1)) if above_ground else np.empty((count, 1, 0, 3))
    disc = direction[None], np.ones((1, 1)), np.array([radius_rad])
    return caps.received(surfaces, openings, np.pi / 2, *disc)[:, 0]


def at_elevation(elevation_rad):
    level = np.cos(elevation_rad)
    return np.array([0.6 * level, np.sin(elevation_rad), 0.8 * level])


@pytest.mark.parametrize("radius_rad", RADII)
def test_level_ground_gets_the_height_of_the_moment(radius_rad):
    directions = np.concatenate([normals(100), UP, -UP])
    # A disc on a turned surface is a turned disc on level ground.
    expected = [seen(UP, d, radius_rad, above_ground=False)[0] for d in directions]
    moment = moment_above(directions, np.full(len(directions), radius_rad))
    assert_allclose(moment[:, 1], expected, atol=1e-9)


@settings(deadline=None, max_examples=60)
@given(st.floats(-1.5, 1.5), st.floats(1e-3, 1.5))
def test_what_is_left_above_the_horizon(elevation_rad, radius_rad):
    direction = at_elevation(elevation_rad)
    cut = cut_at_horizon(direction[None], np.ones((1, 3)), np.array([radius_rad]))
    directions, irradiance, radii = cut
    assume(abs(abs(elevation_rad) - radius_rad) > 1e-9)  # at the very edge rounding decides
    if elevation_rad > radius_rad:
        assert_array_equal(directions[0], direction)
        assert_array_equal([irradiance[0, 0], radii[0]], [1, radius_rad])
        return
    if elevation_rad < -radius_rad:
        assert len(directions) == 0
        return
    surfaces = np.concatenate([UP, directions])
    sees_all = directions[0] @ direction > np.sin(radius_rad)
    expected = seen(surfaces, direction, radius_rad, above_ground=True)
    received = [
        irradiance[0, 0] * seen(surface[None], directions[0], radii[0], above_ground=False)[0]
        for surface in surfaces
    ]
    assert directions[0, 1] > 0
    assert np.arcsin(directions[0, 1]) >= radii[0] - 1e-12
    assert_allclose(received[0], expected[0], rtol=1e-3, atol=1e-8)
    if sees_all:
        assert_allclose(received[1], expected[1], atol=1e-8)
    # Of the whole disc's light, no more than it has.
    assert irradiance[0, 0] <= 1


def evaluated(curve, cosine):
    """The curve as shade.frag evaluates it."""
    half, s, slope, p, q = curve
    t = np.maximum(1 + cosine**2 * slope, 0)
    return half * (cosine + np.maximum(np.abs(cosine), s - t * (p + t * q)))


@pytest.mark.parametrize("radius_rad", RADII)
def test_the_curve_is_the_irradiance(radius_rad):
    surfaces = normals(400)
    exact = seen(surfaces, UP[0], radius_rad, above_ground=False)
    received = evaluated(irradiance_curves(np.array([radius_rad]))[0], surfaces[:, 1])
    assert_allclose(received, exact, atol=6e-4 if radius_rad <= 1.05 else 3e-3)
    # Wherever the horizon does not cut the disc it is exact, and below it nothing.
    whole = np.abs(surfaces[:, 1]) >= np.sin(radius_rad)
    assert_allclose(received[whole], exact[whole], atol=1e-9)


def test_a_point_keeps_the_clamped_cosine_to_the_bit():
    cosine = np.linspace(-1, 1, 101, dtype=np.float32)
    curve = irradiance_curves(np.array([0.0]))[0].astype(np.float32)
    assert_array_equal(evaluated(curve, cosine), np.maximum(cosine, 0))
