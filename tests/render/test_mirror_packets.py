"""Rays of mirror lobes and their places on a map, sixteen at a time, against one at a time."""

import math

import numpy as np
import pytest

from render.lights.map_places import place_on_map
from render.lights.map_pyramid import around
from render.rays.background import map_coordinates
from render.rays.embree import PACKET, packet
from render.rays.lobe import lobe_points, lobe_ray, lobe_rays, meets, on_disc

pytestmark = pytest.mark.slow  # compiling takes seconds


def surfaces(rng, alpha):
    """Sixteen that look any way, seen from their own side; the last mirrors nothing."""
    part = np.empty((13, PACKET), np.float32)
    part[:3] = rng.normal(size=(3, PACKET))
    normal, eye = rng.normal(size=(2, 3, PACKET))
    normal /= np.linalg.norm(normal, axis=0)
    eye *= np.where((normal * eye).sum(axis=0) < 0, -1, 1)
    part[3:6] = part[6:9] = normal
    part[9:12] = eye / np.linalg.norm(eye, axis=0)
    part[12] = alpha**2
    part[12, -1] = -1
    return part


@pytest.mark.parametrize("alpha", [0.01, 0.12, 0.5])
def test_a_packet_of_a_lobe_is_what_its_rays_are(alpha):
    rng = np.random.default_rng(1)
    part, sphere = surfaces(rng, alpha), np.array([0.2, 0.1, 0.0, 0.7], np.float32)
    rays, valid = packet()
    passed = np.empty((3, PACKET), np.float32)
    some = 0
    for a, b in lobe_points(8):
        points = np.repeat(on_disc(np.array([a, b]))[:, None], PACKET, axis=1)
        lobe_rays(part, points, 8, sphere, rays, valid, passed)
        for i in range(PACKET):
            x, y, z, weight, c5, share = lobe_ray(part, i, a, b, 8)
            assert passed[0, i] == pytest.approx(weight, abs=1e-4)
            assert bool(valid[i]) == (weight > 0 and meets(part, i, x, y, z, sphere))
            some += valid[i] != 0
            if weight > 0:
                np.testing.assert_allclose(rays[4:7, i], (x, y, z), atol=2e-5)
                np.testing.assert_allclose(passed[1:, i], (c5, share), rtol=2e-3, atol=1e-6)
    assert 0 < some < 8 * PACKET


def test_places_are_those_of_the_plain_functions():
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(3, 64)).astype(np.float32)
    directions[:, :4] = np.array([[0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0.5, 0]]).T
    share = np.exp(rng.uniform(math.log(1e-10), math.log(4), 64)).astype(np.float32)
    places = np.empty((4, 64), np.float32)
    place_on_map(directions, share, places)
    u, v = map_coordinates(directions.T.astype(float)).T
    np.testing.assert_allclose(np.angle(np.exp(2j * np.pi * (places[0] - u))), 0, atol=1e-5)
    np.testing.assert_allclose(places[1], v, atol=2e-6)
    for i in range(64):
        turn, octave = around(float(v[i]), math.sqrt(share[i]))
        assert places[2, i] == pytest.approx(turn, rel=1e-3)
        assert places[3, i] == pytest.approx(octave, abs=2e-3)
