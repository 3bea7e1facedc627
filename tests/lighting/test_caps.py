"""Irradiance from discs that edges cut, against closed forms and brute force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.sphere.caps import received

UP = np.array([0.0, 1.0, 0.0])
angles = st.floats(-np.pi, np.pi)
radii = st.floats(0.001, 3.1)


def unit(polar_rad, azimuth_rad=0.4):
    level = np.sin(polar_rad)
    return np.array([level * np.sin(azimuth_rad), np.cos(polar_rad), level * np.cos(azimuth_rad)])


def from_disc(direction, radius_rad, openings=None, opening_radius_rad=np.pi / 2, normal=UP):
    """Return what a surface gets from a disc of ∫L dω = 1, seen through (m, k, 3) openings."""
    openings = np.empty((1, 0, 3)) if openings is None else np.asarray(openings, np.float64)
    light = received(
        normal[None],
        openings[None],
        opening_radius_rad,
        np.asarray(direction)[None],
        np.ones((1, 1)),
        np.array([radius_rad]),
    )
    return light[0, 0]


def cap_at_the_horizon(polar_rad, radius_rad):
    """Return ∫ n·d dω over the part above the horizon of a cap that the horizon cuts.

    On its circle d(t) = cos a c + sin a (u cos t + v sin t), u upward, the part above is
    |t| < τ, cos τ = −cot a cot θ, and ½ ∫ n·(d × d′) dt = τ sin²a cos θ − sin a cos a sin τ sin θ.
    The horizon inside the cap is an arc of length 2 arccos(cos a/sin θ), of which half counts.
    """
    tau = np.arccos(-1 / (np.tan(radius_rad) * np.tan(polar_rad)))
    return (
        tau * np.sin(radius_rad) ** 2 * np.cos(polar_rad)
        - np.sin(radius_rad) * np.cos(radius_rad) * np.sin(tau) * np.sin(polar_rad)
        + np.arccos(np.cos(radius_rad) / np.sin(polar_rad))
    )


def brute_force(direction, radius_rad, openings, opening_radius_rad, count=60_000):
    """Return the same from a golden spiral of points over the disc."""
    index = np.arange(count) + 0.5
    along = 1 - (1 - np.cos(radius_rad)) * index / count
    across = np.sqrt(1 - along**2)
    turn = index * np.pi * (3 - np.sqrt(5))
    u = np.cross(direction, [0.3, 0.5, 0.1])
    u /= np.linalg.norm(u)
    v = np.cross(direction, u)
    points = (
        along[:, None] * direction
        + (across * np.cos(turn))[:, None] * u
        + (across * np.sin(turn))[:, None] * v
    )
    inside = points @ np.swapaxes(openings, 1, 2) > np.cos(opening_radius_rad)  # (m, count, k)
    return float(np.mean(np.clip(points @ UP, 0, None) * inside.all(axis=-1).any(axis=0)))


@pytest.mark.parametrize("radius", [0.0, 1e-5, 1e-3, 0.3, 1.2, np.pi / 2])
def test_a_facing_surface_gets_less_from_a_wider_disc(radius):
    # ∫ cos θ dω over the cap is π sin²a, its solid angle 2π (1 − cos a).
    assert from_disc(UP, radius) == pytest.approx((1 + np.cos(radius)) / 2, rel=1e-9)


@pytest.mark.parametrize("radius", [0.05, 0.5, 1.0, 1.5])
@pytest.mark.parametrize("share", [-0.9, -0.3, 0.0, 0.5, 0.99])
def test_the_horizon_cuts_a_disc(radius, share):
    polar = np.pi / 2 + share * min(radius, np.pi / 2)
    expected = cap_at_the_horizon(polar, radius) / (2 * np.pi * (1 - np.cos(radius)))
    assert from_disc(unit(polar), radius) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_half_of_the_sky_from_the_side():
    # A hemisphere around the horizon holds half of what the surface sees: π/2 of 2π.
    assert from_disc(unit(np.pi / 2), np.pi / 2) == pytest.approx(0.25, rel=1e-12)


@settings(max_examples=30, deadline=None)
@given(polar=st.floats(0, np.pi), radius=radii)
def test_a_disc_and_what_it_leaves_are_the_whole_sky(polar, radius):
    # π is what a surface gets from a sky of radiance 1; a disc has 2π (1 − cos a).
    disc = 2 * np.pi * (1 - np.cos(radius)) * from_disc(unit(polar), radius)
    rest = 2 * np.pi * (1 + np.cos(radius)) * from_disc(-unit(polar), np.pi - radius)
    assert disc + rest == pytest.approx(np.pi, abs=1e-7)


@settings(max_examples=30, deadline=None)
@given(polar=angles, azimuth=angles, radius=radii, edge=angles, tilt=angles)
def test_the_two_sides_of_a_wall_are_all_there_is(polar, azimuth, radius, edge, tilt):
    wall = unit(edge, tilt)
    direction = unit(polar, azimuth)
    one = from_disc(direction, radius, [[wall]])
    other = from_disc(direction, radius, [[-wall]])
    assert one >= -1e-12
    assert one + other == pytest.approx(from_disc(direction, radius), abs=1e-9)


def test_a_wall_through_a_disc_overhead_hides_half_of_it():
    assert from_disc(UP, 0.7, [[unit(np.pi / 2)]]) == pytest.approx(
        from_disc(UP, 0.7) / 2, rel=1e-12
    )


def test_a_sphere_before_a_wider_disc_leaves_a_ring():
    # π (sin²a − sin²r) of 2π (1 − cos a): no arc of either circle crosses the other.
    disc, sphere = 0.9, 0.4
    expected = (np.sin(disc) ** 2 - np.sin(sphere) ** 2) / (2 * (1 - np.cos(disc)))
    assert from_disc(UP, disc, [[-UP]], np.pi - sphere) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("gaps", [2, 5, 8])
def test_a_comb_around_a_disc_overhead_hides_half_of_it(gaps):
    # By symmetry: every gap is a sector from the axis out, all together half the turn.
    begin = 2 * np.pi * np.arange(gaps) / gaps
    sides = (begin + np.pi / 2, begin + np.pi / gaps - np.pi / 2)
    openings = np.stack([[unit(np.pi / 2, azimuth) for azimuth in side] for side in sides], axis=1)
    assert from_disc(UP, 1.1, openings) == pytest.approx(from_disc(UP, 1.1) / 2, rel=1e-12)


@settings(max_examples=25, deadline=None)
@given(
    polar=st.floats(0, np.pi),
    azimuth=angles,
    radius=st.sampled_from([0.01, 0.2, 0.8, 1.5, 2.5]),
    edges=st.lists(st.tuples(st.floats(0.1, 3.0), angles), min_size=1, max_size=3, unique=True),
    opening_radius=st.sampled_from([0.6, np.pi / 2, 2.5]),
)
def test_where_several_caps_overlap(polar, azimuth, radius, edges, opening_radius):
    openings = np.array([[unit(*edge) for edge in edges]])
    direction = unit(polar, azimuth)
    measured = from_disc(direction, radius, openings, opening_radius)
    # 60,000 points resolve an edge to about 1/250 of the disc's width.
    expected = brute_force(direction, radius, openings, opening_radius)
    assert measured == pytest.approx(expected, abs=1e-3)


@settings(max_examples=25, deadline=None)
@given(polar=angles, azimuth=angles, edge=angles)
def test_a_tiny_disc_is_a_point_unless_an_edge_cuts_it(polar, azimuth, edge):
    direction, wall = unit(polar, azimuth), unit(edge)
    if min(abs(direction @ UP), abs(direction @ wall)) > 2e-4:
        seen = direction @ UP > 0 and direction @ wall > 0
        for radius in (0.0, 2e-4):
            expected = direction @ UP if seen else 0.0
            assert from_disc(direction, radius, [[wall]]) == pytest.approx(expected, abs=1e-7)


def test_discs_add_up_channel_by_channel():
    directions = np.array([unit(0.3), unit(0.9), unit(2.0)])
    light = np.array([[1.0, -2.0], [3.0, 0.0], [5.0, 7.0]])
    total = received(
        UP[None], np.empty((1, 1, 0, 3)), np.pi / 2, directions, light, np.array([0.1, 0.2, 0.3])
    )
    each = [from_disc(*disc) for disc in zip(directions, (0.1, 0.2, 0.3), strict=True)]
    np.testing.assert_allclose(total[0], each @ light, rtol=1e-12)
