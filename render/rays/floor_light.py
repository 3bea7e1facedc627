"""Light that a matt floor sends up to what stands on it, with the shadows that lie on the floor.

What reaches the floor is known on a grid around the objects; rays from these look it up. Underneath
an object the floor lies in its shadow, and so it stays dark where they touch.

Input  : surfaces, as `first_hits` finds them; discs of light.    Output : radiance.
Cost   : about 0.1 µs a ray, 64 for each sample of an object that sees some floor.
Fails  : light that objects send to the floor, and from there or straight to each other, is left
         out. Mirrors see the floor elsewhere (reflected_map.py). Beyond the grid no shadow falls.
"""

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from lighting.sphere import harmonics
from render.lights.dome import dome_lights
from render.rays.disc_net import disc_net
from render.rays.embree import PACKET, occluded16, occluded16_address, packet
from render.rays.row_order import row_order
from render.rays.surface_rows import DULL, FACE_NORMAL, KIND, LANES, MATT, NORMAL, SIDE
from render.rays.tangent_frame import tangent_frame
from render.rays.traced_scene import TracedScene

_FLOATS = NDArray[np.float32]
Array = NDArray[np.float64]

RAYS = 64
CELLS, FEW_CELLS = 128, 48
"""Rows of the grid, a multiple of 16: for what stays, and for what the next picture replaces."""
_POINTS = 16  # of a disc of light, of which each place of the grid looks at one
_EXTENT = 3.0  # of the objects' radius, to either side
_GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
_FAR_M = np.float32(1e30)


def floor_shade(
    traced: TracedScene,
    directions: Array,
    irradiance: Array,
    radius_rad: Array,
    cells: int = CELLS,
) -> tuple[_FLOATS, _FLOATS]:
    """Return what share of the light reaches a floor around the objects, (n, n, 3), and where.

    Rows follow z, columns x; the second, (3,), is x and z of the first cell's centre and the width
    of a cell. `directions`, `irradiance` and `radius_rad` are as `all_lights` returns them.
    """
    assert traced.scene.ground is not None
    x, _, z, radius_m = (float(each) for each in traced.sphere)
    width_m = 2 * _EXTENT * radius_m / cells
    first = 0.5 * width_m - _EXTENT * radius_m
    place = np.array([x + first, z + first, width_m], np.float32)
    points = disc_net(directions, radius_rad, _POINTS).astype(np.float32)
    received = (irradiance * np.maximum(directions[:, 1:2], 0)).astype(np.float32)
    total = received.sum(axis=0)
    weights = np.divide(received, total, out=np.zeros_like(received), where=total > 0)
    share = np.zeros((cells, cells, 3), np.float32)
    _look_up_from_floor(
        occluded16_address(), traced.address,
        np.float32(traced.scene.ground.y_m + traced.offset_m), place, points, weights, share,
    )  # fmt: skip
    share[..., total <= 0] = 1
    return share, place


def open_floor(traced: TracedScene, cells: int = CELLS) -> tuple[_FLOATS, _FLOATS]:
    """Return what share of a uniform sky reaches the ground of a scene, as `floor_shade` does."""
    uniform = np.zeros((harmonics.COUNT, 3))
    uniform[0] = 1.0
    return floor_shade(traced, *dome_lights(uniform, upper_only=True), cells)


def add_floor_light(
    traced: TracedScene,
    surfaces: _FLOATS,
    radiance: _FLOATS,
    shade: tuple[_FLOATS, _FLOATS],
    picture: _FLOATS,
    rays: int = RAYS,
) -> None:
    """Add what matt surfaces reflect of a floor to `picture` (H, W, 4).

    Parameters
    ----------
    traced : TracedScene
        With a ground.
    surfaces : (rows, LANES, FIELDS, columns) float32
        What its picture shows.
    radiance : (3,) float32
        Of the ground where nothing shades it.
    shade
        As `floor_shade` returns it.
    rays : int
        Of each surface.
    """
    assert traced.scene.ground is not None
    _look_down(
        occluded16_address(), traced.address, np.float32(traced.offset_m), surfaces,
        np.float32(traced.scene.ground.y_m), np.asarray(radiance, np.float32), *shade, rays,
        picture,
    )  # fmt: skip


@njit(cache=True, nogil=True, parallel=True)
def add_lit(
    samples: NDArray[np.int64], share: _FLOATS, radiance: _FLOATS, picture: _FLOATS
) -> None:  # pragma: no cover - compiled
    """Add a floor's radiance (3,) to `samples` (M,) of a picture (S, 4) that have shares (M, 3)."""
    for i in prange(len(samples)):
        for c in range(3):
            picture[samples[i], c] += share[i, c] * radiance[c]


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _look_up_from_floor(
    function: int,
    scene: int,
    y_m: np.float32,
    place: _FLOATS,
    points: _FLOATS,
    weights: _FLOATS,
    share: _FLOATS,
) -> None:  # pragma: no cover - compiled
    for row in prange(len(share)):
        rays, valid = packet()
        valid[:] = -1
        for first in range(0, share.shape[1], PACKET):
            for light in range(len(points)):
                for i in range(PACKET):
                    column = first + i
                    right, back = _lattice(row + 31 * light, column)
                    point = int(points.shape[1] * _lattice(column, row + 17 * light)[0])
                    rays[0, i] = place[0] + (column + right - 0.5) * place[2]
                    rays[1, i] = y_m
                    rays[2, i] = place[1] + (row + back - 0.5) * place[2]
                    for axis in range(3):
                        rays[4 + axis, i] = points[light, point, axis]
                    rays[8, i] = _FAR_M
                occluded16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
                for i in range(PACKET):
                    if rays[8, i] > 0:
                        for c in range(3):
                            share[row, first + i, c] += weights[light, c]


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _look_down(
    function: int,
    scene: int,
    offset_m: np.float32,
    surfaces: _FLOATS,
    y_m: np.float32,
    radiance: _FLOATS,
    share: _FLOATS,
    place: _FLOATS,
    count: int,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    height, width = picture.shape[:2]
    order = row_order(1, surfaces.shape[0] - 1)
    for k in prange(len(order)):
        row = order[k]
        rays, valid = packet()
        received = np.empty((3, PACKET), np.float32)
        for tile in range(1, surfaces.shape[3] - 1):
            if surfaces[row, :, KIND, tile].max() < DULL:
                continue
            received[:] = 0
            for r in range(count):
                for i in range(LANES):
                    valid[i] = -np.int32(
                        _aim_down(surfaces, row, i, tile, (r + 0.5) / count, r, offset_m, rays)
                    )
                occluded16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
                for i in range(LANES):
                    if valid[i] != 0 and rays[8, i] > 0:
                        reach = (y_m - rays[1, i]) / rays[5, i]
                        x, z = rays[0, i] + reach * rays[4, i], rays[2, i] + reach * rays[6, i]
                        _add_share(share, place, x, z, i, received)
            for i in range(LANES):
                y, x = SIDE * (row - 1) + i // SIDE, SIDE * (tile - 1) + i % SIDE
                if surfaces[row, i, KIND, tile] >= DULL and y < height and x < width:
                    for c in range(3):
                        # MATT is ρ/π, and rays spread by the cosine stand for π/count each.
                        of_floor = np.float32(math.pi / count) * radiance[c] * received[c, i]
                        picture[y, x, c] += surfaces[row, i, MATT + c, tile] * of_floor


@njit(nogil=True, error_model="numpy")
def _aim_down(
    surfaces: _FLOATS,
    row: int,
    i: int,
    tile: int,
    sine2: float,
    r: int,
    offset_m: np.float32,
    rays: _FLOATS,
) -> bool:  # pragma: no cover - compiled
    """Set ray `i` of a pixel, and return whether it runs down from an object's surface."""
    if surfaces[row, i, KIND, tile] < DULL:
        return False
    nx, ny, nz = (
        surfaces[row, i, NORMAL, tile],
        surfaces[row, i, NORMAL + 1, tile],
        surfaces[row, i, NORMAL + 2, tile],
    )
    turn = 2 * math.pi * _lattice(4 * row + i // 4, 4 * tile + i % 4)[0]
    angle = r * _GOLDEN_ANGLE + turn
    a, b, c = (
        math.sqrt(sine2) * math.cos(angle),
        math.sqrt(sine2) * math.sin(angle),
        math.sqrt(1 - sine2),
    )
    tx, ty, tz, bx, by, bz = tangent_frame(nx, ny, nz)
    x, y, z = a * tx + b * bx + c * nx, a * ty + b * by + c * ny, a * tz + b * bz + c * nz
    above = 0.0
    for axis, d in enumerate((x, y, z)):
        normal = surfaces[row, i, FACE_NORMAL + axis, tile]
        above += normal * d
        rays[axis, i] = surfaces[row, i, axis, tile] + offset_m * normal
        rays[4 + axis, i] = d
    rays[8, i] = _FAR_M
    return y < -1e-6 and above > 0


@njit(nogil=True)
def _lattice(row: int, column: int) -> tuple[float, float]:  # pragma: no cover - compiled
    """Return two numbers in [0, 1), each far from its neighbours': Roberts' R2 lattice."""
    x = 0.7548776662466927 * column + 0.5698402909980532 * row
    y = 0.5698402909980532 * column + 0.7548776662466927 * row
    return x % 1.0, y % 1.0


@njit(nogil=True, error_model="numpy")
def _add_share(
    share: _FLOATS, place: _FLOATS, x: np.float32, z: np.float32, i: int, received: _FLOATS
) -> None:  # pragma: no cover - compiled
    """Add what reaches the floor at (x, z) to column `i`; all, off the grid."""
    last = share.shape[0] - 1
    column, row = (x - place[0]) / place[2], (z - place[1]) / place[2]
    if not (0 <= column < last and 0 <= row < last):
        for c in range(3):
            received[c, i] += 1
        return
    c0, r0 = int(column), int(row)
    right, below = column - c0, row - r0
    for c in range(3):
        upper = (1 - right) * share[r0, c0, c] + right * share[r0, c0 + 1, c]
        lower = (1 - right) * share[r0 + 1, c0, c] + right * share[r0 + 1, c0 + 1, c]
        received[c, i] += (1 - below) * upper + below * lower
