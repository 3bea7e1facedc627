"""Sets of lights for tests, and a comparison that does not mind their order."""

import numpy as np

from lighting.light_set import LightSet


def towards(angles_deg):
    """Return directions (n, 3) on the circle from +Y, at 0, through +X."""
    angle = np.radians(np.asarray(angles_deg, float))
    return np.stack([np.sin(angle), np.cos(angle), np.zeros_like(angle)], axis=-1)


def random_set(random, count, timestamp_s=0.0):
    """Return lights crowded enough that some match and some do not."""
    directions = np.array([0.0, 1.0, 0.0]) + 0.3 * random.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return LightSet(
        directions,
        np.exp(random.standard_normal((count, 3))),
        random.uniform(0, 0.5, count),
        timestamp_s=timestamp_s,
        is_key=random.random(count) < 0.2,
    )


def assert_same_lights(one, other):
    """Assert that (directions, irradiance, …) have the same lights, but for order and rounding.

    Lights without irradiance do not count.
    """
    ordered = []
    for directions, irradiance, *_ in (one, other):
        rows = np.concatenate([directions, irradiance], axis=1)[irradiance.any(axis=1)]
        ordered.append(rows[np.argsort(rows[:, 0])])
    np.testing.assert_allclose(ordered[0], ordered[1], rtol=1e-9, atol=1e-9)
