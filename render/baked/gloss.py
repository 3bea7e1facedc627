"""Mirror reflections of a map: rays of each sample's lobe, traced once and looked up each frame.

A rough surface reflects a lobe of directions. A few rays stand for it, drawn by what the surface
passes on, each for a share of the lobe as wide as the rays are apart. Per frame each looks up the
mean of the map over its share, in a pyramid of halved maps [1]_.

Input  : what samples show; an EnvironmentMap per frame.    Output : radiance toward the eye.
Lobes from ROUGH_ALPHA on reflect the sky by the cells of baked transport; here only the ground.
Cost   : tracing, a ray as in transport_kernel; a frame, a look-up for each ray that nothing stops.
Fails  : a ray that meets an object returns nothing: no object is seen in another. One that goes
         below the horizon sees the ground as if nothing stood on it. Light that facets pass on to
         each other is lost.

References
----------
.. [1] J. Křivánek, M. Colbert, "Real-time Shading with Filtered Importance Sampling", EGSR 2008.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.lights.map_pyramid import MapPyramid, mean_around
from render.rays.embree import PACKET, occluded16, packet
from render.rays.lobe import lobe_points, lobe_ray, meets

_FLOATS = NDArray[np.float32]

ROUGH_ALPHA = 0.1
"""GGX width of a lobe that is as wide as the cells of baked transport."""

RAYS = 24
"""Rays of a lobe."""

_FAR_M = 1e30
_STOPPED, _TO_SKY, _TO_GROUND = 0, 1, 2


@dataclass(frozen=True, eq=False)
class GlossRays:
    """The rays of tiles of samples.

    Attributes
    ----------
    rays : (tiles, RAYS, 5, TILE) float32
        Where they meet the map (u, v, as `background.map_coordinates`); how wide a square of it
        they look up, in rad; what they pass on of f0 and of f90.
    met : (tiles, RAYS, TILE) uint8
        Nothing but the sky, the ground, or something that stops them.
    """

    rays: _FLOATS
    met: NDArray[np.uint8]


def trace_gloss(
    function: int, scene: int, sphere: _FLOATS, surface: _FLOATS, has_ground: bool
) -> GlossRays:
    """Return the rays of samples `surface` (tiles, 14, TILE), as `trace_transport` takes them.

    Parameters
    ----------
    function, scene : int
        Addresses of Embree's function and scene.
    sphere : (4,) float32
        Centre and radius of the occluders' bounding sphere.
    has_ground : bool
        Whether what goes below the horizon meets a ground.
    """
    tiles, _, samples = surface.shape
    rays = np.zeros((tiles, RAYS, 5, samples), np.float32)
    met = np.zeros((tiles, RAYS, samples), np.uint8)
    _trace(function, scene, sphere, surface, lobe_points(RAYS), has_ground, rays, met)
    return GlossRays(rays, met)


def add_reflections(
    gloss: GlossRays,
    f0: _FLOATS,
    f90: _FLOATS,
    pyramid: MapPyramid,
    ground: _FLOATS | None,
    picture: _FLOATS,
) -> None:
    """Add what samples mirror to `picture` (tiles, 3, TILE).

    Parameters
    ----------
    f0, f90 : (tiles, 3, TILE), (tiles, TILE) float32
        Share of light reflected at normal and at grazing incidence.
    pyramid : MapPyramid
    ground : (3,) float32 or None
        Radiance of the ground; what the map shows there if None.
    """
    radiance = np.full(3, np.nan, np.float32) if ground is None else ground
    _look_up(gloss.rays, gloss.met, f0, f90, pyramid.cells, pyramid.starts, radiance, picture)


@njit(cache=True, nogil=True, parallel=True)
def _trace(
    function: int,
    scene: int,
    sphere: _FLOATS,
    surface: _FLOATS,
    points: NDArray[np.float64],
    has_ground: bool,
    out: _FLOATS,
    met: NDArray[np.uint8],
) -> None:  # pragma: no cover - compiled
    for tile in prange(surface.shape[0]):
        rays, valid = packet()
        for first in range(0, surface.shape[2], PACKET):
            part = surface[tile, :, first : first + PACKET].copy()
            rays[:3] = part[:3]
            for r in range(points.shape[0]):
                for i in range(PACKET):
                    at = first + i
                    x, y, z, weight, c5, share = lobe_ray(
                        part, i, points[r, 0], points[r, 1], points.shape[0]
                    )
                    rays[4, i], rays[5, i], rays[6, i], rays[8, i] = x, y, z, _FAR_M
                    valid[i] = -np.int32(weight > 0 and meets(part, i, x, y, z, sphere))
                    kind = _TO_GROUND if has_ground and y < 0 else _TO_SKY
                    by_cells = kind == _TO_SKY and part[12, i] >= ROUGH_ALPHA**2
                    met[tile, r, at] = _STOPPED if weight <= 0 or by_cells else kind
                    level = math.hypot(x, z)
                    out[tile, r, 0, at] = 0.5 - math.atan2(x, z) / (2 * math.pi)
                    out[tile, r, 1, at] = math.atan2(level, y) / math.pi
                    out[tile, r, 2, at] = math.sqrt(share)
                    out[tile, r, 3, at] = weight * (1 - c5) / points.shape[0]
                    out[tile, r, 4, at] = weight * c5 / points.shape[0]
                occluded16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
                for i in range(PACKET):
                    if rays[8, i] < 0:
                        met[tile, r, first + i] = _STOPPED


@njit(cache=True, nogil=True, parallel=True)
def _look_up(
    rays: _FLOATS,
    met: NDArray[np.uint8],
    f0: _FLOATS,
    f90: _FLOATS,
    levels: _FLOATS,
    starts: NDArray[np.int64],
    ground: _FLOATS,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    for tile in prange(rays.shape[0]):
        for r in range(rays.shape[1]):
            for i in range(rays.shape[3]):
                kind = met[tile, r, i]
                if kind == _STOPPED:
                    continue
                facing, grazing = rays[tile, r, 3, i], rays[tile, r, 4, i] * f90[tile, i]
                red, green, blue = ground[0], ground[1], ground[2]
                if kind == _TO_SKY or math.isnan(red):
                    u, v, width = rays[tile, r, 0, i], rays[tile, r, 1, i], rays[tile, r, 2, i]
                    red, green, blue = mean_around(levels, starts, u, v, width)
                picture[tile, 0, i] += (facing * f0[tile, 0, i] + grazing) * red
                picture[tile, 1, i] += (facing * f0[tile, 1, i] + grazing) * green
                picture[tile, 2, i] += (facing * f0[tile, 2, i] + grazing) * blue
