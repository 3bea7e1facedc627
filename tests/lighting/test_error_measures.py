"""The errors of light sets: closed forms, the map itself as lights, and laws."""

import numpy as np
import pytest

from lighting.light_set import LightSet
from lighting.measures.error_measures import (
    behind_combs,
    behind_occluders,
    behind_spheres,
    errors,
    received,
    received_from_map,
    relative_rms,
    spread_directions,
    standard_receivers,
    truth,
)
from lighting.reduce import reduce_to_lights
from lighting.sphere import harmonics
from lighting.sphere.latlong import cell_directions, solid_angles
from tests.environments import constant, environment, irradiance, outdoors

KINDS = standard_receivers()
each_kind = pytest.mark.parametrize("kind", KINDS)


def visible(kind, directions):
    """Return whether each surface (192, n) sees each of the directions, from the occluder's words.

    Written anew from what an occluder is, not from the openings it leaves.
    """
    receivers = KINDS[kind]
    if kind == "open":
        return np.ones((192, len(directions)), bool)
    if kind == "wall":
        return receivers.openings[:, 0, 0] @ directions.T > 0
    if kind == "sphere":
        away = receivers.openings[:, 0, 0]
        return -away @ directions.T < np.cos(np.radians(40))
    # Comb: gaps of 22.5° about the axis that the edges of all gaps have in common.
    axes = np.cross(receivers.openings[:, 0, 0], receivers.openings[:, 1, 0])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    edge = np.cross(receivers.openings[:, 0, 0], axes)  # toward where the first gap begins
    across = np.cross(axes, edge)
    azimuth = np.arctan2(across @ directions.T, edge @ directions.T)
    return azimuth % (np.pi / 4) < np.pi / 8


@each_kind
def test_lights_as_points_are_seen_wholly_or_not_at_all(kind):
    directions = spread_directions(300)
    light = np.random.default_rng(0).random((300, 3))
    lights = LightSet(directions, light, np.full(300, 0.2))
    normals = KINDS[kind].normals
    cosine = np.clip(normals @ directions.T, 0, None)
    expected = (cosine * visible(kind, directions)) @ light
    measured = received(KINDS[kind], lights, as_points=True)
    np.testing.assert_allclose(measured, expected, rtol=1e-9, atol=1e-12)


@each_kind
def test_the_map_is_the_sum_over_its_cells(kind):
    # A cell that an edge cuts counts by its share here, wholly or not at all in the plain sum.
    smooth = np.exp(cell_directions(64) @ (0.6, 0.5, 0.62))
    directions = cell_directions(64).reshape(-1, 3)
    light = smooth.reshape(-1, 1) * np.repeat(solid_angles(64), 128)[:, None]
    cosine = np.clip(KINDS[kind].normals @ directions.T, 0, None)
    expected = (cosine * visible(kind, directions)) @ light
    measured = received_from_map(KINDS[kind], environment(smooth))[:, :1]
    assert relative_rms(measured, expected) < {"open": 2e-4, "comb": 1e-2}.get(kind, 3e-3)


def test_an_even_sky_lights_every_open_surface_with_pi():
    # Within what cells as discs leave uncovered at the horizon.
    np.testing.assert_allclose(received_from_map(KINDS["open"], constant(64)), np.pi, rtol=3e-4)


def test_a_wall_across_an_even_sky_leaves_a_view_factor():
    # Half a sky whose edge is tilted by β from the surface's normal: π (1 + cos β)/2 with β the
    # angle between the normal and the direction that the free side faces.
    receivers = KINDS["wall"]
    cosine = (receivers.normals * receivers.openings[:, 0, 0]).sum(axis=1)
    expected = np.pi * (1 + cosine) / 2
    measured = received_from_map(receivers, constant(64))[:, 0]
    np.testing.assert_allclose(measured, expected, atol=3e-3)


def test_a_sphere_overhead_hides_the_square_of_its_sine():
    # π sin²r of π; nearer the horizon π sin²r cos θ as long as the sphere is wholly above it.
    normals = np.array([[0.6, 0.8, 0.0]] * 2)
    towards = np.array([[0.6, 0.8, 0.0], [1.0, 0.0, 0.0]])
    measured = received_from_map(behind_spheres(normals, towards, 0.5), constant(64))[:, 0]
    expected = np.pi * (1 - np.sin(0.5) ** 2 * np.array([1.0, 0.6]))
    np.testing.assert_allclose(measured, expected, rtol=1e-3)


@pytest.mark.parametrize("slats", [3, 8])
def test_a_comb_and_the_comb_in_its_gaps_hide_all(slats):
    normals = spread_directions(20)
    axes = spread_directions(40)[::2]
    begin = np.linspace(0, 1, 20)
    lights = reduce_to_lights(outdoors(16), 30, "cells")
    one = received(behind_combs(normals, axes, begin, slats), lights)
    other = received(behind_combs(normals, axes, begin + np.pi / slats, slats), lights)
    openings = np.empty((20, 1, 0, 3))
    free = received(type(KINDS["open"])(normals, openings), lights)
    np.testing.assert_allclose(one + other, free, rtol=1e-9)


@pytest.mark.parametrize(("kind", "bound"), [("open", 1e-4), ("wall", 1e-3), ("comb", 2e-3)])
def test_a_fill_is_seen_as_the_map_it_stands_for(kind, bound):
    fill = np.zeros((9, 3))
    fill[0], fill[1], fill[6] = 1.0, (0.3, 0.2, 0.1), -0.1
    picture = environment(harmonics.evaluate(fill, cell_directions(128)))
    no_lights = LightSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), fill=fill)
    measured = received(KINDS[kind], no_lights)
    assert relative_rms(measured, received_from_map(KINDS[kind], picture)) < bound
    if kind == "open":
        exact = harmonics.irradiance(fill, KINDS["open"].normals)
        np.testing.assert_allclose(measured, exact, rtol=1e-3)


def test_the_cells_of_a_map_as_lights_make_no_error():
    environment_map = outdoors(16)
    weight = np.repeat(solid_angles(16), 32)
    lights = LightSet(
        cell_directions(16).reshape(-1, 3),
        environment_map.radiance.reshape(-1, 3) * weight[:, None],
        2 * np.arcsin(np.sqrt(weight / (4 * np.pi))),
    )
    true = truth(environment_map)
    assert max(errors(lights, true).values()) < 1e-12
    assert min(errors(lights, true, as_points=True).values()) > 1e-3


def test_light_that_is_too_bright_by_a_tenth_is_an_error_of_a_tenth():
    environment_map = outdoors(16)
    lights = reduce_to_lights(environment_map, 16, "cells")
    true = {kind: received(KINDS[kind], lights) / 1.1 for kind in KINDS}
    assert errors(lights, true) == pytest.approx(dict.fromkeys(KINDS, 0.1), rel=1e-9)


def test_behind_occluders_leaves_out_what_is_open():
    assert behind_occluders({"open": 9.0, "wall": 3.0, "comb": 4.0}) == pytest.approx(
        np.sqrt(12.5), rel=1e-12
    )


def test_the_error_of_light_from_nowhere_is_infinite():
    dark = np.zeros((4, 3))
    assert relative_rms(dark, dark) == 0
    assert relative_rms(dark + 1, dark) == np.inf


def test_points_in_the_open_are_the_plain_sum():
    lights = reduce_to_lights(outdoors(32), 64, "inverse-cdf")
    measured = received(KINDS["open"], lights, as_points=True)
    expected = irradiance(KINDS["open"].normals, lights.directions, lights.irradiance)
    np.testing.assert_allclose(measured, expected, rtol=1e-9)


def test_surfaces_face_everywhere_alike():
    normals = spread_directions(192)
    np.testing.assert_allclose(normals.T @ normals / 192, np.eye(3) / 3, atol=2e-3)
    distance = np.linalg.norm(normals[:, None] - normals, axis=-1) + 9 * np.eye(192)
    # Of a hexagonal lattice 1.07; of random points 0.02 or so.
    assert distance.min() > 0.7 * np.sqrt(4 * np.pi / 192)
