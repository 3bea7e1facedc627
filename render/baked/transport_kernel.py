"""Loops of the baked transport: tracing it, and multiplying it with the light of a frame.

Samples come in tiles of TILE, a tile's transport as (D, TILE), so that one loop runs over samples.
"""

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.rays.embree import PACKET, coherent16, packet

TILE = 128
"""Samples of a tile: their sums fit into the first-level cache."""

_FLOATS = NDArray[np.float32]
_FAR_M = 1e30


@njit(cache=True, nogil=True, parallel=True)
def trace_transport(
    function: int,
    scene: int,
    sphere: _FLOATS,
    surface: _FLOATS,
    points: _FLOATS,
    from_alpha2: float,
    least_alpha2: float,
    mirror_row: NDArray[np.int64],
    matt: NDArray[np.uint8],
    matt_step: _FLOATS,
    mirror: NDArray[np.uint8],
    mirror_step: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Fill the last four: transport from each cell, the mean over its points, in 8-bit steps.

    Parameters
    ----------
    function, scene : int
        Addresses of Embree's function and scene.
    sphere : (4,) float32
        Centre and radius of the occluders' bounding sphere.
    surface : (tiles, 14, TILE) float32
        Origin (3), shading normal (3), face normal (3), direction to the eye (3), α², f0; α² below
        zero marks a sample that mirrors nothing.
    points : (D, S, 3) float32
    from_alpha2 : float
        α² from which on samples mirror; others are left out.
    least_alpha2 : float
        Lobes are no narrower, so that the points do not show one by one.
    mirror_row : (tiles,) int64
        Row of `mirror` that is the tile's, −1 where its reflections are not wanted.
    matt, mirror : (tiles, D, TILE), (mirroring tiles, D, TILE) uint8
        Visible n·l (1 − F) and visible n·l D G F / (4 n·l n·v), in steps.
    matt_step, mirror_step : (tiles, TILE), (mirroring tiles, TILE) float32
        What a step is worth.
    """
    for tile in prange(surface.shape[0]):
        received, mirrored = _traced(
            function, scene, sphere, surface[tile], points, from_alpha2, least_alpha2
        )
        _quantise(received, matt[tile], matt_step[tile])
        if mirror_row[tile] >= 0:
            _quantise(mirrored, mirror[mirror_row[tile]], mirror_step[mirror_row[tile]])


@njit(nogil=True)
def _traced(
    function: int,
    scene: int,
    sphere: _FLOATS,
    surface: _FLOATS,
    points: _FLOATS,
    from_alpha2: float,
    least_alpha2: float,
) -> tuple[_FLOATS, _FLOATS]:  # pragma: no cover - compiled
    matt = np.zeros((points.shape[0], TILE), np.float32)
    mirror = np.zeros((points.shape[0], TILE), np.float32)
    rays, valid = packet()
    received = np.empty(PACKET, np.float32)
    share = np.float32(1.0 / points.shape[1])
    for first in range(0, TILE, PACKET):
        part = surface[:, first : first + PACKET].copy()
        rays[:3] = part[:3]
        mirrors = part[12].max() > 0
        for cell in range(points.shape[0]):
            for s in range(points.shape[1]):
                light = points[cell, s]
                _receive(part, light, received)
                if _select(part, light, sphere, received, valid):
                    rays[4], rays[5], rays[6], rays[8] = light[0], light[1], light[2], _FAR_M
                    coherent16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
                    for i in range(PACKET):
                        received[i] *= np.float32(rays[8, i] > 0)
                for i in range(PACKET):
                    matt[cell, first + i] += share * received[i]
                if mirrors:
                    for i in range(PACKET):
                        if part[12, i] > 0 and received[i] > 0:
                            fresnel, reflected = _mirrored(
                                part, i, light, received[i], least_alpha2
                            )
                            matt[cell, first + i] -= share * received[i] * fresnel
                            if part[12, i] >= from_alpha2:
                                mirror[cell, first + i] += share * reflected
    return matt, mirror


@njit(nogil=True)
def _quantise(
    values: _FLOATS, steps: NDArray[np.uint8], step: _FLOATS
) -> None:  # pragma: no cover - compiled
    for i in range(TILE):
        most = np.float32(0)
        for cell in range(values.shape[0]):
            most = max(most, values[cell, i])
        step[i] = most / np.float32(255)
    for cell in range(values.shape[0]):
        for i in range(TILE):
            if step[i] > 0:
                steps[cell, i] = np.uint8(values[cell, i] / step[i] + np.float32(0.5))


@njit(nogil=True)
def _receive(part: _FLOATS, light: _FLOATS, received: _FLOATS) -> None:  # pragma: no cover
    """Set `received` to n·l, or 0 where the surface or its facet looks away."""
    lx, ly, lz = light[0], light[1], light[2]
    for i in range(PACKET):
        cosine = part[3, i] * lx + part[4, i] * ly + part[5, i] * lz
        facing = part[6, i] * lx + part[7, i] * ly + part[8, i] * lz
        received[i] = max(cosine, np.float32(0)) * np.float32(facing > 0)


@njit(nogil=True)
def _select(
    part: _FLOATS,
    light: _FLOATS,
    sphere: _FLOATS,
    received: _FLOATS,
    valid: NDArray[np.int32],
) -> bool:  # pragma: no cover - compiled
    """Mark the samples that receive light and whose way to it meets the bounding sphere."""
    lx, ly, lz = light[0], light[1], light[2]
    cx, cy, cz, radius = sphere[0], sphere[1], sphere[2], sphere[3]
    needed = np.int32(0)
    for i in range(PACKET):
        dx, dy, dz = cx - part[0, i], cy - part[1, i], cz - part[2, i]
        along = dx * lx + dy * ly + dz * lz
        off2 = dx * dx + dy * dy + dz * dz - along * along
        meets = (off2 < radius * radius) & (along > -radius) & (received[i] > 0)
        valid[i] = -np.int32(meets)
        needed |= valid[i]
    return needed != 0


@njit(nogil=True)
def _mirrored(
    part: _FLOATS, i: int, light: _FLOATS, n_l: float, least_alpha2: float
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Return F and n·l D G F / (4 n·l n·v) of sample `i`, as shade.frag has them."""
    vx, vy, vz = part[9, i], part[10, i], part[11, i]
    lx, ly, lz = light[0], light[1], light[2]
    alpha2, f0 = max(part[12, i], least_alpha2), part[13, i]
    n_v = max(part[3, i] * vx + part[4, i] * vy + part[5, i] * vz, 1e-4)
    length = math.sqrt(max(2 + 2 * (vx * lx + vy * ly + vz * lz), 1e-12))
    v_h = min(0.5 * length, 1.0)
    n_h = (n_l + n_v) / length
    fresnel = f0 + (1 - f0) * (1 - v_h) ** 5
    spread = max(1 - n_h * n_h, 0.0) + alpha2 * n_h * n_h
    distribution = alpha2 / (math.pi * spread * spread)
    masking = 0.5 / (
        n_l * math.sqrt(n_v * n_v * (1 - alpha2) + alpha2)
        + n_v * math.sqrt(n_l * n_l * (1 - alpha2) + alpha2)
    )
    return fresnel, fresnel * distribution * masking * n_l


@njit(cache=True, nogil=True, parallel=True, fastmath={"contract"})
def add_transported(
    transport: NDArray[np.uint8],
    scale: _FLOATS,
    cells: NDArray[np.int64],
    light: _FLOATS,
    rows: NDArray[np.int64],
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Add Σ transport · light to rows of `picture` (…, 3, TILE), times what a step is worth.

    Parameters
    ----------
    transport : (tiles, D, TILE) uint8
    scale : (tiles, 3, TILE) float32
        Radiance that one step of a sample's transport gives under a unit of light, per channel.
    cells : (n,) int64
        Which of the D cells shine: n is a multiple of 4.
    light : (n, 3) float32
        Of each of those.
    rows : (tiles,) int64
        Where in the picture each tile is.
    """
    for tile in prange(transport.shape[0]):
        _add_tile(transport[tile], scale[tile], cells, light, picture[rows[tile]])


@njit(nogil=True, fastmath={"contract"})
def _add_tile(
    transport: NDArray[np.uint8],
    scale: _FLOATS,
    cells: NDArray[np.int64],
    light: _FLOATS,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    total = np.zeros((3, TILE), np.float32)
    for k in range(0, len(cells), 4):  # one load and store of the sums for four cells
        of, a, b = light[k : k + 4], transport[cells[k]], transport[cells[k + 1]]
        c, d = transport[cells[k + 2]], transport[cells[k + 3]]
        for i in range(TILE):
            ta, tb, tc, td = np.float32(a[i]), np.float32(b[i]), np.float32(c[i]), np.float32(d[i])
            for h in range(3):
                total[h, i] += of[0, h] * ta + of[1, h] * tb + of[2, h] * tc + of[3, h] * td
    for h in range(3):
        for i in range(TILE):
            picture[h, i] += scale[h, i] * total[h, i]


@njit(cache=True, nogil=True, parallel=True, fastmath={"contract"})
def add_narrow(
    received: tuple[_FLOATS, ...],
    light: _FLOATS,
    colour: _FLOATS,
    rows: NDArray[np.int64],
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Add Σ received · light to rows of `picture` (…, 3, TILE), times the samples' colours.

    Parameters
    ----------
    received : tuple of (tiles, TILE) float32
        What samples pass on of each light.
    light : (K, 3) float32
        Of the first K of those.
    colour : (tiles, 3, TILE) float32
    rows : (tiles,) int64
        Where in the picture each tile is.
    """
    for tile in prange(len(rows)):
        total = np.zeros((3, TILE), np.float32)
        for k in range(len(light)):
            of, passed = light[k], received[k][tile]
            for i in range(TILE):
                for h in range(3):
                    total[h, i] += of[h] * passed[i]
        shown = picture[rows[tile]]
        for h in range(3):
            for i in range(TILE):
                shown[h, i] += colour[tile, h, i] * total[h, i]


@njit(cache=True, nogil=True, parallel=True)
def place(
    picture: _FLOATS, samples: NDArray[np.int64], out: _FLOATS
) -> None:  # pragma: no cover - compiled
    """Write `picture` (tiles, 3, TILE), alpha 1, to rows `samples` (tiles, TILE) of `out`."""
    for tile in prange(len(samples)):
        for i in range(TILE):
            sample = samples[tile, i]
            for c in range(3):
                out[sample, c] = picture[tile, c, i]
            out[sample, 3] = 1.0
