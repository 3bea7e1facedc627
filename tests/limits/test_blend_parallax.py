"""Blended lights are distant: a lamp among the cameras is too dim between them, and may be two.

Claim    : between two cameras the blend is the light that is there.
Setup    : a small lamp 2 m above the middle between two cameras, which are 0.3 m apart, or 2 m;
           each sees it as it would, by inverse squares. The scene stands in the middle.
Expected : the light on a level surface is (h² / (h² + b²))^1.5 of the true one, b being half the
           distance: h² / (h² + b²) for the lamp's distance, its root for the angle. One light
           from above where the directions differ by less than 10°, else two, with two shadows.
Measured : as expected: 99.2 % and one light, 71.6 % and two.
"""

import numpy as np
import pytest

from lighting.light_set import LightSet
from lighting.stream.blending import blend_lights, place_weights

HEIGHT_M = 2.0


def seen_from(place):
    """Return a lamp that gives 1 on a level surface in the middle, as seen from `place`."""
    to_lamp = np.array([0.0, HEIGHT_M, 0.0]) - place
    apart_m = np.linalg.norm(to_lamp)
    irradiance = np.full((1, 3), (HEIGHT_M / apart_m) ** 2)
    return LightSet(to_lamp[None] / apart_m, irradiance, np.full(1, 0.02))


@pytest.mark.parametrize(("half_m", "count", "share"), [(0.15, 1, 0.992), (1.0, 2, 0.716)])
def test_a_near_lamp_is_too_dim_between_two_cameras(half_m, count, share):
    places = np.array([[-half_m, 0.0, 0.0], [half_m, 0.0, 0.0]])
    weights = place_weights(places, (0.0, 0.0, 0.0))
    lights = blend_lights([seen_from(each) for each in places], weights, timestamp_s=0, source="")
    on_level = (lights.irradiance[:, 0] * lights.directions[:, 1]).sum()
    assert len(lights) == count
    expected = (HEIGHT_M**2 / (HEIGHT_M**2 + half_m**2)) ** 1.5
    assert expected == pytest.approx(share, abs=5e-4)
    # One light in the middle faces the surface better than the two did.
    assert expected <= on_level * (1 + 1e-9) <= expected / np.cos(np.radians(5))
