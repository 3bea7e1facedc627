"""Structured importance sampling: strata of equal width inside regions of like brightness.

The map is thresholded at multiples of the standard deviation of its luminance; what lies between
two thresholds and hangs together is a region (nested_regions.py). Lights are shared out by the
metric of the paper [1]_ (apportionment.py), each region is parted into strata of about equal width
(farthest_points.py), and each stratum is pre-integrated to one light at its centroid.

Domain : world frame, lat-long grid (CONVENTIONS.md). Unseen cells count as what they hold.
Input  : EnvironmentMap.    Output : directions, irradiance and angular radius of each light.
Cost   : one pass over the map; then, over blocks of its cells, one for each threshold and about one
         for each doubling of the number of lights.
Fails  : noise moves blocks across thresholds, and regions join, part and trade lights
         (tests/limits/test_structured_noise.py); within a region strata are blind to brightness.
         While no block does, the strata stand still, whatever the light in them.

References
----------
.. [1] S. Agarwal, R. Ramamoorthi, S. Belongie, H. W. Jensen, "Structured Importance Sampling of
       Environment Maps", ACM Transactions on Graphics 22(3) (SIGGRAPH), 2003.
"""

import numpy as np

from lighting.blocks.block_grid import block_grid
from lighting.blocks.summed_area import block_sums, label_sums
from lighting.cells.apportionment import apportion
from lighting.cells.cell_splitting import Array, lights_of_sums
from lighting.cells.farthest_points import farthest_point_strata
from lighting.cells.nested_regions import nested_regions
from lighting.maps.environment import EnvironmentMap

_THRESHOLDS = np.arange(1, 6)
"""In standard deviations above 0."""
_LARGE_SR = 0.01
"""Solid angle above which a region's size no longer matters."""
_BLOCKS_PER_BUCKET = 16
"""Along a side. 3000 lights take a third longer with 8, and no less with 12."""


def structured(environment: EnvironmentMap, count: int) -> tuple[Array, Array, Array]:
    """Return `count` lights for strata of the map's regions.

    Parameters
    ----------
    environment : EnvironmentMap
    count : int
        Number of lights, at least 1. Fewer are returned if they hold all the light: one for each
        block of the map (summed_area.py) that has any.

    Returns
    -------
    directions : (n, 3) float64
        Unit vectors in the world frame, toward the light.
    irradiance : (n, 3) float64
        Radiance × sr. They sum to the map's integral.
    angular_radius_rad : (n,) float64
        Radius of the disc that is spread as the light is.

    Notes
    -----
    A region's lights are as Γ = L min(Δω, Δω₀)^¼, L its light and Δω its solid angle: between
    importance sampling, ∝ L, and what the variance of visibility asks for. The paper [1]_ has six
    thresholds i σ from i = 0 and Δω₀ = 0.01 sr. It leaves open what is read here thus: a component
    is what remains of it outside brighter ones; one too faint for a light is part of the one
    around it.
    """
    blocks = block_sums(environment.radiance)
    power = blocks[..., 0]
    if not power.any():
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
    grid = block_grid(environment.height)
    solid_angle = grid.area[..., 0]
    brightness = power / solid_angle
    mean = float(power.sum()) / (4 * np.pi)
    deviation = np.sqrt(float((solid_angle * (brightness - mean) ** 2).sum()) / (4 * np.pi))
    regions, parents = nested_regions(brightness, deviation * _THRESHOLDS)

    def total(values: Array) -> Array:
        return np.bincount(regions.ravel(), values.ravel(), len(parents)).astype(np.float64)

    importance = total(power) * np.minimum(total(solid_angle), _LARGE_SR) ** 0.25
    lit_blocks = np.bincount(regions[power > 0], minlength=len(parents))
    owners, seats = apportion(importance, lit_blocks, parents, count)

    # Directions of blocks, not centroids of their light: where two points are as far, rounding must
    # not choose anew in each frame.
    lit = np.flatnonzero(power)
    row, column = np.divmod(lit, power.shape[1])
    strata = farthest_point_strata(
        grid.directions.reshape(-1, 3)[lit],
        owners[regions.ravel()[lit]],
        row // _BLOCKS_PER_BUCKET * power.shape[1] + column // _BLOCKS_PER_BUCKET,
        seats,
    )
    return lights_of_sums(label_sums(blocks.reshape(-1, 7)[lit], strata, seats.sum()))
