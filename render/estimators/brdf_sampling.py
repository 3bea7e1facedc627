"""Directions drawn by how a surface reflects: its cosine, and its mirror's visible normals.

Fails  : a small and bright source is met too rarely: the sun by one direction in 100,000.

References
----------
.. [1] P. Debevec, "Image-Based Lighting", IEEE Computer Graphics and Applications 22(2), 2002.
"""

from functools import partial

from render.estimators.contract import Estimate, Floats, Setting, Shadows
from render.estimators.map_tables import MapTables, map_tables
from render.estimators.points import net
from render.estimators.proposals import add_proposed


def cosine(setting: Setting) -> Estimate:
    """Prepare to draw by the cosine alone, whatever the surface mirrors."""
    return partial(_estimate, setting.shadows, map_tables(setting.environment), False)


def brdf(setting: Setting) -> Estimate:
    """Prepare to draw by the cosine and the mirror."""
    return partial(_estimate, setting.shadows, map_tables(setting.environment), True)


def _estimate(
    shadows: Shadows,
    tables: MapTables,
    has_lobe: bool,
    surfaces: Floats,
    samples: int,
    seed: int,
    radiance: Floats,
) -> int:
    return int(
        add_proposed(shadows, tables, False, has_lobe, surfaces, net(samples), seed, radiance)
    )
