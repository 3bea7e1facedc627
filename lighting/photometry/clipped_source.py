"""The light of a clipped lamp or sun, from what an illuminance meter showed.

Input  : an EnvironmentMap in cd/m², one clipped region of it, and a measured illuminance.
Output : the map with the missing light in it, (E_measured − E_map)/cos θ as a flux per facing area.
P. Debevec, P. Graham, J. Busch, M. Bolas, "A Single-Shot Light Probe", SIGGRAPH 2012 Talks, solves
for the light of clipped directions from what they do to a diffuse surface; a meter is one.
Fails  : all that the map and the meter disagree about is taken for the sun's, so an error of 2 % of
the illuminance in the scale is one of 2 % divided by the sun's share of it in the sun. Its colour
is that of the clipped cells, which is nearly white.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from capture.errors import InputError
from capture.radiance import CD_M2
from lighting.maps.environment import EnvironmentMap, luminance
from lighting.photometry.disc import disc_shares
from lighting.photometry.illuminance import cosine_weights, surface_illuminance, unit
from lighting.sphere.caps import SUN_RADIUS_RAD
from lighting.sphere.latlong import cell_directions, solid_angles

_LEAST_COSINE = 0.05
_NEAR_RAD = np.radians(5.0)


def recover_clipped(
    environment: EnvironmentMap,
    normal: ArrayLike,
    illuminance_lx: float,
    radius_rad: float | None = SUN_RADIUS_RAD,
    towards: ArrayLike | None = None,
) -> EnvironmentMap:
    """Return the map that gives the measured illuminance, its clipped region no longer clipped.

    Parameters
    ----------
    environment : EnvironmentMap
        In cd/m².
    normal : (3,) array_like
        Which way the meter faced, in the world frame.
    illuminance_lx : float
        What it showed, the clipped source shining on it.
    radius_rad : float or None
        Of the disc that the missing light comes from, around the middle of the clipped region; a
        sun's by default. None spreads it over the region, as for a lamp of unknown size.
    towards : (3,) array_like or None
        Where the region is, in the world frame, to 5°: where glints, say, are clipped too. They
        stay so, and what they lack is given to the region.

    Raises
    ------
    InputError
        If the map is relative, nothing is clipped (there), or more than one region and none is
        named; the region does not shine on the meter; the map gives as much light as was
        measured without any added; or float32 cannot hold what is added.
    """
    if environment.scale != CD_M2:
        raise InputError(
            f"the map is {environment.scale}, and must be in {CD_M2} for a measured illuminance to "
            "say what is missing; `fishlight scale` takes it there"
        )
    if not (np.isfinite(illuminance_lx) and illuminance_lx > 0):
        raise InputError(f"an illuminance must be positive and finite, got {illuminance_lx:g} lx")
    if radius_rad is not None and not 0 < radius_rad < np.pi / 2:
        raise InputError(
            f"a disc's radius is between 0° and 90°, got {np.degrees(radius_rad):.4g}°"
        )
    region = _clipped_region(environment, towards)
    centre, colour = _middle(environment, region)
    cosine = float(unit(normal) @ centre)
    if cosine < _LEAST_COSINE:
        raise InputError(
            f"the clipped region stands {np.degrees(np.arccos(cosine)):.1f}° from where the meter "
            "faced, so that its reading says too little of it; face the meter towards the region"
        )
    received = surface_illuminance(environment, normal)
    missing_lx = illuminance_lx - received.total
    if missing_lx <= 0:
        raise InputError(
            f"the map gives {received.total:.4g} lx already, with what is clipped as a lower "
            f"bound, and {illuminance_lx:g} lx were measured: check the scale, and which way the "
            "meter faced"
        )
    height = environment.height
    shape = region.astype(np.float64)
    if radius_rad is not None:
        shape = disc_shares(height, centre, radius_rad) / solid_angles(height)[:, None]
    # By the cells' own cosines, so that the map gives what was measured exactly.
    added = shape * (missing_lx / float((shape * cosine_weights(height, normal)).sum()))
    with np.errstate(over="ignore"):
        radiance = (environment.radiance + added[..., None] * (colour / luminance(colour))).astype(
            np.float32
        )
    if not np.isfinite(radiance).all():
        raise InputError(f"{illuminance_lx:g} lx are beyond what the map's radiance can hold")
    return replace(environment, radiance=radiance, clipped=environment.clipped & ~region)


def _clipped_region(environment: EnvironmentMap, towards: ArrayLike | None) -> NDArray[np.bool_]:
    """Return the clipped region, (N, 2N): the only one, or the one that is named."""
    clipped = environment.clipped
    count, number = _regions(clipped)
    if count == 0:
        raise InputError("nothing in the map is clipped: no light is missing")
    if towards is None:
        if count > 1:
            raise InputError(
                f"{count} separate regions are clipped, and one measured illuminance cannot say "
                "how much light each of them lacks; expose so that only one is, or say where the "
                "one is that lacks most"
            )
        return clipped
    cosines = cell_directions(environment.height)[clipped] @ unit(towards)
    nearest = int(np.argmax(cosines))
    if cosines[nearest] < np.cos(_NEAR_RAD):
        off_deg = np.degrees(np.arccos(np.clip(cosines[nearest], -1, 1)))
        raise InputError(f"nothing is clipped there; the nearest that is lies {off_deg:.1f}° off")
    region = np.zeros_like(clipped)
    region[clipped] = number == number[nearest]
    return region


def _middle(
    environment: EnvironmentMap, region: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return direction and mean colour of a region."""
    weights = np.repeat(solid_angles(environment.height)[:, None], region.shape[1], 1)[region]
    centre = unit(weights @ cell_directions(environment.height)[region])
    colour = weights @ environment.radiance[region].astype(np.float64)
    return centre, colour if luminance(colour) > 0 else np.ones(3)


def _regions(marked: NDArray[np.bool_]) -> tuple[int, NDArray[np.int32]]:
    """Return how many connected regions of the sphere are marked, and each marked cell's region.

    Cells touch by sides and corners, across the seam, and across a pole.
    """
    height = len(marked)
    number = np.full(marked.shape, -1)
    number[marked] = np.arange(marked.sum())
    pairs = []
    for row_step, column_step in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = number[: height - row_step]
        there = np.roll(number, -column_step, axis=1)[row_step:]
        pairs.append(np.stack([here.ravel(), there.ravel()]))
    for row in (number[0], number[-1]):
        around = row[row >= 0]
        pairs.append(np.stack([around[:-1], around[1:]]))
    edges = np.concatenate(pairs, axis=1)
    edges = edges[:, (edges >= 0).all(axis=0)]
    size = int(marked.sum())
    graph = coo_array((np.ones(edges.shape[1]), (edges[0], edges[1])), shape=(size, size))
    count, regions = connected_components(graph, directed=False)
    return int(count), regions
