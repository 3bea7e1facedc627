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

from render.lights.map_pyramid import MapPyramid, around, mean_over
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
class MapRays:
    """Rays that meet the map, those of a tile in a row.

    Attributes
    ----------
    starts : (tiles + 1,) int64
        Where each tile's begin.
    samples : (n,) uint8
        Which of the tile's samples each is of.
    rays : (n, 7) float32
        Where they meet the map (u, v, as `background.map_coordinates`), what they look up of it
        (two, of `map_pyramid.around`), and what they pass on of R, G and B.
    """

    starts: NDArray[np.int64]
    samples: NDArray[np.uint8]
    rays: _FLOATS

    def add(self, pyramid: MapPyramid, tiles: NDArray[np.intp], picture: _FLOATS) -> None:
        """Add what they see of a map to those tiles of `picture` (…, 3, TILE)."""
        _look_up(
            self.starts, self.samples, self.rays, pyramid.cells, pyramid.starts, tiles, picture
        )


@dataclass(frozen=True, eq=False)
class GlossRays:
    """The rays of tiles of samples that nothing stops.

    Attributes
    ----------
    to_sky, to_ground : MapRays
        The latter show the ground, or what the map has there.
    of_ground : (tiles, 3, TILE) float32
        What those together pass on of one radiance.
    """

    to_sky: MapRays
    to_ground: MapRays
    of_ground: _FLOATS


def trace_gloss(
    function: int,
    scene: int,
    sphere: _FLOATS,
    surface: _FLOATS,
    f0: _FLOATS,
    f90: _FLOATS,
    has_ground: bool,
) -> GlossRays:
    """Return the rays of samples `surface` (tiles, 14, TILE), as `trace_transport` takes them.

    Parameters
    ----------
    function, scene : int
        Addresses of Embree's function and scene.
    sphere : (4,) float32
        Centre and radius of the occluders' bounding sphere.
    f0, f90 : (tiles, 3, TILE), (tiles, TILE) float32
        Share of light reflected at normal and at grazing incidence.
    has_ground : bool
        Whether what goes below the horizon meets a ground.
    """
    tiles, _, samples = surface.shape
    rays = np.zeros((tiles, RAYS, samples, 7), np.float32)
    met = np.zeros((tiles, RAYS, samples), np.uint8)
    points = lobe_points(RAYS)
    _trace(function, scene, sphere, surface, f0, f90, points, has_ground, rays, met)
    shares = np.where(met[..., None] == _TO_GROUND, rays[..., 4:], np.float32(0))
    of_ground = np.ascontiguousarray(shares.sum(axis=1).swapaxes(1, 2))
    return GlossRays(_met(rays, met == _TO_SKY), _met(rays, met == _TO_GROUND), of_ground)


def _met(rays: _FLOATS, which: NDArray[np.bool_]) -> MapRays:
    starts = np.concatenate([[0], np.cumsum(which.sum(axis=(1, 2)))])
    return MapRays(starts, np.nonzero(which)[2].astype(np.uint8), rays[which])


def add_reflections(
    gloss: GlossRays,
    pyramid: MapPyramid,
    ground: _FLOATS | None,
    tiles: NDArray[np.intp],
    picture: _FLOATS,
) -> None:
    """Add what samples mirror to those tiles of `picture` (…, 3, TILE).

    `ground`, (3,), is its radiance; what the map shows there if None.
    """
    gloss.to_sky.add(pyramid, tiles, picture)
    if ground is None:
        gloss.to_ground.add(pyramid, tiles, picture)
    else:
        picture[tiles] += gloss.of_ground * ground[:, None]


@njit(cache=True, nogil=True, parallel=True)
def _trace(
    function: int,
    scene: int,
    sphere: _FLOATS,
    surface: _FLOATS,
    f0: _FLOATS,
    f90: _FLOATS,
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
                    ray = out[tile, r, at]
                    ray[0] = 0.5 - math.atan2(x, z) / (2 * math.pi)
                    ray[1] = math.atan2(math.hypot(x, z), y) / math.pi
                    ray[2], ray[3] = around(ray[1], math.sqrt(share))
                    facing, grazing = weight * (1 - c5), weight * c5 * f90[tile, at]
                    for c in range(3):
                        ray[4 + c] = (facing * f0[tile, c, at] + grazing) / points.shape[0]
                occluded16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
                for i in range(PACKET):
                    if rays[8, i] < 0:
                        met[tile, r, first + i] = _STOPPED


@njit(cache=True, nogil=True, parallel=True)
def _look_up(
    starts: NDArray[np.int64],
    samples: NDArray[np.uint8],
    rays: _FLOATS,
    levels: _FLOATS,
    level_starts: NDArray[np.int64],
    tiles: NDArray[np.intp],
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    for t in prange(len(tiles)):
        shown = picture[tiles[t]]
        for k in range(starts[t], starts[t + 1]):
            ray, i = rays[k], samples[k]
            red, green, blue = mean_over(levels, level_starts, ray[0], ray[1], ray[2], ray[3])
            shown[0, i] += ray[4] * red
            shown[1, i] += ray[5] * green
            shown[2, i] += ray[6] * blue
