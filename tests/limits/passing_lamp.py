"""A soft lamp that passes over a faint sky, for the tests of what its lights do."""

from functools import cache
from itertools import pairwise

import numpy as np

from lighting.reduce import reduce_to_lights
from lighting.sphere.latlong import cell_directions
from tests.environments import environment, irradiance, normals, true_irradiance

ELEVATION = 0.4


@cache
def passing_lamp(method, middle):
    """Return the light sets, and the mean change of the irradiance's error per frame.

    A lamp of 4°, 100 above a sky of 0.1, goes 0.5° per frame through 10° of azimuth around
    `middle`; 64 lights.
    """
    sets, errors = [], []
    for azimuth in middle + np.radians(np.arange(-5, 5.25, 0.5)):
        level, y = np.cos(ELEVATION), np.sin(ELEVATION)
        lamp = cell_directions(64) @ (level * np.sin(azimuth), y, level * np.cos(azimuth))
        frame = environment(0.1 + 100 * np.exp((lamp - 1) / 0.05**2))
        sets.append(reduce_to_lights(frame, 64, method))
        true = true_irradiance(normals(), frame)
        errors.append(irradiance(normals(), sets[-1].directions, sets[-1].irradiance) - true)
    change = np.diff(errors, axis=0)
    return sets, np.sqrt(np.mean(change**2) / np.mean(true**2))


def vanished(sets):
    """Return for each set but the last the share of its lights that the next has not in place."""
    cosines = (before.directions @ after.directions.T for before, after in pairwise(sets))
    return np.array([(cosine.max(axis=1) < 1 - 1e-9).mean() for cosine in cosines])
