"""Lights as a map, for what mirrors them where no map is given."""

import numpy as np

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere import harmonics
from lighting.sphere.latlong import grid_to_direction, solid_angles


def map_of_lights(lights: LightSet, rows: int) -> EnvironmentMap:
    """Return the map (rows, 2 rows) of each light's disc, at least a cell, and of the fill.

    Its integral is the lights' irradiance and that of the fill, where that is nowhere negative.
    """
    column, row = np.meshgrid(np.arange(2 * rows), np.arange(rows))
    directions = grid_to_direction(np.stack([column, row], axis=-1), rows)
    weights = np.broadcast_to(solid_angles(rows)[:, None], row.shape)
    radiance = np.maximum(harmonics.basis(directions) @ lights.fill, 0.0)
    for direction, irradiance, radius_rad in zip(
        lights.directions, lights.irradiance, lights.angular_radius_rad, strict=True
    ):
        cosine = directions @ direction
        disc = cosine >= min(np.cos(radius_rad), cosine.max())
        radiance[disc] += irradiance / weights[disc].sum()
    marks = np.ones(row.shape, np.bool_)
    return EnvironmentMap(radiance.astype(np.float32), marks, ~marks)
