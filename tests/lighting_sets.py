"""Sets of lights for tests, and a comparison that does not know their order."""

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


def as_set(directions, irradiance):
    """Return what two sets of lights share if they differ in order and rounding only."""
    rows = np.concatenate([directions, irradiance], axis=1)
    return {tuple(row) for row in np.round(rows, 9) + 0.0}
