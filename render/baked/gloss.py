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
.. [2] E. Heitz, "Sampling the GGX Distribution of Visible Normals", JCGT 7(4), 2018.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.lights.map_pyramid import MapPyramid, mean_around
from render.rays.embree import PACKET, occluded16, packet
from render.rays.tangent_frame import tangent_frame

_FLOATS = NDArray[np.float32]

ROUGH_ALPHA = 0.1
"""GGX width of a lobe that is as wide as the cells of baked transport."""

RAYS = 24
"""Rays of a lobe."""

_OVERLAP = 0.7
"""What a ray looks up, over the share that it stands for, by solid angle: the pyramid's cells, and
that they are weighed between, widen it."""
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
    step = np.arange(RAYS) + 0.5
    points = np.stack([step / RAYS, step * (3 - math.sqrt(5)) / 2 % 1], axis=-1)  # a golden spiral
    _trace(function, scene, sphere, surface, points, has_ground, rays, met)
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
                    x, y, z, weight, c5, share = _reflected(part, i, points[r, 0], points[r, 1])
                    rays[4, i], rays[5, i], rays[6, i], rays[8, i] = x, y, z, _FAR_M
                    valid[i] = -np.int32(weight > 0 and _meets(part, i, x, y, z, sphere))
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


@njit(nogil=True)
def _meets(
    part: _FLOATS, i: int, x: float, y: float, z: float, sphere: _FLOATS
) -> bool:  # pragma: no cover - compiled
    dx, dy, dz = sphere[0] - part[0, i], sphere[1] - part[1, i], sphere[2] - part[2, i]
    along = dx * x + dy * y + dz * z
    off2 = dx * dx + dy * dy + dz * dz - along * along
    return bool(off2 < sphere[3] ** 2 and along > -sphere[3])


@njit(nogil=True)
def _reflected(
    part: _FLOATS, i: int, a: float, b: float
) -> tuple[float, float, float, float, float, float]:  # pragma: no cover - compiled
    """Return ray (a, b) of sample i's lobe: its direction (x, y, z), G₂/G₁, (1 − v·h)⁵, and sr.

    It is the mirror image of the view in a visible normal, drawn as in [2]_.
    """
    nx, ny, nz = part[3, i], part[4, i], part[5, i]
    tx, ty, tz, bx, by, bz = tangent_frame(nx, ny, nz)
    ex, ey, ez = part[9, i], part[10, i], part[11, i]
    vx, vy = ex * tx + ey * ty + ez * tz, ex * bx + ey * by + ez * bz
    vz = max(ex * nx + ey * ny + ez * nz, 1e-4)
    alpha2 = max(part[12, i], 1e-12)
    alpha = math.sqrt(alpha2)

    sx, sy, sz = alpha * vx, alpha * vy, vz
    length = math.sqrt(sx * sx + sy * sy + sz * sz)
    sx, sy, sz = sx / length, sy / length, sz / length
    across = math.sqrt(sx * sx + sy * sy)
    ux, uy = (-sy / across, sx / across) if across > 1e-7 else (1.0, 0.0)
    wx, wy, wz = -sz * uy, sz * ux, sx * uy - sy * ux
    radius, turn = math.sqrt(a), 2 * math.pi * b
    t1 = radius * math.cos(turn)
    s = 0.5 * (1 + sz)
    t2 = (1 - s) * math.sqrt(max(1 - t1 * t1, 0.0)) + s * radius * math.sin(turn)
    t3 = math.sqrt(max(1 - t1 * t1 - t2 * t2, 0.0))
    hx = alpha * (t1 * ux + t2 * wx + t3 * sx)
    hy = alpha * (t1 * uy + t2 * wy + t3 * sy)
    hz = max(t2 * wz + t3 * sz, 1e-9)
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = hx / length, hy / length, hz / length

    v_h = vx * hx + vy * hy + vz * hz
    lx, ly, lz = 2 * v_h * hx - vx, 2 * v_h * hy - vy, 2 * v_h * hz - vz
    x = lx * tx + ly * bx + lz * nx
    y = lx * ty + ly * by + lz * ny
    z = lx * tz + ly * bz + lz * nz
    facing = x * part[6, i] + y * part[7, i] + z * part[8, i]
    g_v = math.sqrt(alpha2 + (1 - alpha2) * vz * vz)
    spread = (hx * hx + hy * hy) + alpha2 * hz * hz
    density = alpha2 / (math.pi * spread * spread) / (2 * (vz + g_v))  # D G₁ / (4 n·v)
    share = _OVERLAP / (RAYS * density)
    if part[12, i] <= 0 or lz <= 0 or facing <= 0:
        return x, y, z, 0.0, 0.0, share
    g_l = math.sqrt(alpha2 + (1 - alpha2) * lz * lz)
    return x, y, z, lz * (vz + g_v) / (vz * g_l + lz * g_v), (1 - v_h) ** 5, share


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
