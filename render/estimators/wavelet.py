"""Directions drawn from the product of map and BRDF in Haar's basis, by warping a point set.

For each surface the Haar series of f n·l, cut off at blocks of 11°, is multiplied by the map's;
points then go down the product's hierarchy, and on down the map's [1]_. Clarberg et al. look the
series of f up in tables for a few materials; here it is computed for each surface, as was done
later [2]_. The same warp of the map alone is the hierarchical sampling of before.

Fails  : a mirror whose lobe is much narrower than a block is met too rarely.

References
----------
.. [1] P. Clarberg, W. Jarosz, T. Akenine-Möller, H. W. Jensen, "Wavelet Importance Sampling:
       Efficiently Evaluating Products of Complex Functions", SIGGRAPH, 2005.
.. [2] P. Clarberg, T. Akenine-Möller, "Practical Product Importance Sampling for Direct
       Illumination", Eurographics, 2008.
"""

import numpy as np
from numba import njit, prange

from render.estimators.block_response import respond
from render.estimators.contract import Estimate, Floats, Setting, Shadows
from render.estimators.map_blocks import MapBlocks, add_up_levels, map_blocks, start, warp
from render.estimators.points import Points, PointSet, independent, shift_of, shifted
from render.estimators.shading import (
    CARRIED,
    FIELDS,
    TOWARD,
    add_visible,
    add_waiting,
    cell_luminance,
    reflect,
    waiting,
)
from render.rays.embree import PACKET
from render.reference.surfaces import HIT


def wavelet(setting: Setting, *, point_set: PointSet, is_product: bool = True) -> Estimate:
    """Prepare to warp a point set by the product, or else by the map alone."""
    blocks = map_blocks(setting.environment)
    # Independent points get a random shift each, others one for all.
    is_independent = point_set is independent

    def estimate(surfaces: Floats, samples: int, seed: int, radiance: Floats) -> int:
        return int(
            _add(
                setting.shadows, blocks, is_product, is_independent, surfaces,
                point_set(samples), seed, radiance,
            )
        )  # fmt: skip

    return estimate


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _add(
    shadows: Shadows,
    blocks: MapBlocks,
    is_product: bool,
    is_independent: bool,
    surfaces: Floats,
    points: Points,
    seed: int,
    radiance: Floats,
) -> int:  # pragma: no cover - compiled
    traced = 0
    for k in prange(len(surfaces)):
        surface = surfaces[k]
        if surface[HIT].max() == 0:
            continue
        held = waiting()
        light = np.zeros((FIELDS, PACKET), np.float32)
        first = start(blocks.level)
        response = np.ones((len(blocks.directions), PACKET), np.float32)
        product = np.empty((start(blocks.level + 1), PACKET))
        for b in range(len(blocks.directions)):
            if is_product:
                x, y, z = blocks.directions[b]
                respond(surface, x, y, z, np.float32(blocks.radius_rad), response[b])
            product[first + b] = response[b] * blocks.light[first + b]
        add_up_levels(product, blocks.level)
        whole = product[0] + product[1]
        for s in range(len(points)):
            for i in range(PACKET):
                light[CARRIED:FIELDS, i] = 0
                if whole[i] <= 0:
                    continue
                shift = shift_of(seed, k, i + PACKET * s * is_independent)
                u, v = shifted(points, s, shift)
                block, row, column, x, y, z = warp(blocks, product[:, i], u, v)
                light[TOWARD, i], light[TOWARD + 1, i], light[TOWARD + 2, i] = x, y, z
                # Density: response × luminance / whole.
                drawn = response[block, i] * cell_luminance(blocks.radiance, row, column)
                scale = whole[i] / (drawn * len(points))
                for c in range(3):
                    light[CARRIED + c, i] = scale * blocks.radiance[row, column, c]
            reflect(shadows, surface, light)
            traced += add_visible(shadows, surface, light, held, radiance[k])
        traced += add_waiting(shadows, held, radiance[k])
    return traced
