"""What smooth surfaces mirror of a map, when everything may move: rays of every pixel's lobe.

As in render/baked/gloss.py, with fewer rays, all of them new in every picture. Those of a tile are
traced and looked up sixteen at a time.

Input  : surfaces, as `first_hits` finds them; a map's pyramid.    Output : radiance.
Cost   : about 0.1 µs a ray, tracing and looking up; a metal has 12, a dielectric 4.
Fails  : no object is seen in another; below the horizon a ground is seen as if nothing stood on it.
"""

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.lights.map_places import place_on_map
from render.lights.map_pyramid import MapPyramid, mean_over
from render.lights.peaks import ROUGH_ALPHA
from render.rays.embree import PACKET, coherent16, occluded16_address, packet
from render.rays.lobe import lobe_points, lobe_rays
from render.rays.row_order import row_order
from render.rays.surface_rows import (
    ALPHA2,
    F0,
    F90,
    FACE_NORMAL,
    FIELDS,
    GLOSSY,
    KIND,
    LANES,
    NORMAL,
    SIDE,
)
from render.rays.traced_scene import TracedScene

_FLOATS = NDArray[np.float32]

_RAYS = 12
_FEW_RAYS = 4
_WEAK_F0 = 0.1  # of dielectrics: what they mirror is little beside what they scatter

_PLACE = 3 * 4 + 1  # rows of a surface as lobe_rays takes it
_FAR_M = np.float32(1e30)


def add_reflected_map(
    traced: TracedScene,
    surfaces: _FLOATS,
    eye: NDArray[np.float64],
    pyramid: MapPyramid,
    ground: _FLOATS | None,
    picture: _FLOATS,
    rough_alpha: float = ROUGH_ALPHA,
) -> None:
    """Add what surfaces smoother than `rough_alpha` mirror of a map to `picture` (H, W, 4).

    Parameters
    ----------
    traced : TracedScene
    surfaces : (rows, LANES, FIELDS, columns) float32
        What its picture shows, seen from `eye`.
    pyramid : MapPyramid
    ground : (3,) float32 or None
        Radiance of the ground; what the map shows there if None, or if the scene has none.
    """
    shows_map = ground is None or traced.scene.ground is None
    radiance = np.full(3, np.nan, np.float32) if shows_map else np.asarray(ground, np.float32)
    _add_reflected_map(
        occluded16_address(), traced.address, traced.sphere, traced.offset_m, surfaces,
        eye.astype(np.float32), lobe_points(_RAYS), lobe_points(_FEW_RAYS), pyramid.cells,
        pyramid.starts, radiance, rough_alpha**2, picture,
    )  # fmt: skip


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _add_reflected_map(
    function: int,
    scene: int,
    sphere: _FLOATS,
    offset_m: float,
    surfaces: _FLOATS,
    eye: _FLOATS,
    points: NDArray[np.float64],
    few_points: NDArray[np.float64],
    levels: _FLOATS,
    starts: NDArray[np.int64],
    ground: _FLOATS,
    rough_alpha2: float,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    height, width = picture.shape[:2]
    order = row_order(1, surfaces.shape[0] - 1)
    for k in prange(len(order)):
        row = order[k]
        seen = np.empty((FIELDS, PACKET), np.float32)
        part = np.empty((_PLACE, PACKET), np.float32)
        mirrored = np.empty((3, PACKET), np.float32)
        rays, valid = packet()
        for column in range(1, surfaces.shape[3] - 1):
            if not _load_mirrors(surfaces, row, column, np.float32(rough_alpha2), seen):
                continue
            _place(seen, eye, np.float32(offset_m), part)
            is_weak = seen[F0 : F0 + 3].max() < _WEAK_F0
            _mirror(
                function, scene, sphere, part, seen, few_points if is_weak else points, levels,
                starts, ground, rays, valid, mirrored,
            )  # fmt: skip
            for lane in range(LANES):
                y, x = SIDE * (row - 1) + lane // SIDE, SIDE * (column - 1) + lane % SIDE
                if part[12, lane] > 0 and y < height and x < width:
                    for c in range(3):
                        picture[y, x, c] += mirrored[c, lane]


@njit(nogil=True, error_model="numpy")
def _load_mirrors(
    surfaces: _FLOATS, row: int, column: int, rough_alpha2: np.float32, seen: _FLOATS
) -> bool:  # pragma: no cover - compiled
    """Copy a tile's surfaces, α² −1 where nothing is mirrored; return whether anything is."""
    some = False
    for lane in range(LANES):
        some |= surfaces[row, lane, KIND, column] == GLOSSY
    if not some:
        return False
    some = False
    for lane in range(LANES):
        for field in range(FIELDS):
            seen[field, lane] = surfaces[row, lane, field, column]
        alpha2 = seen[ALPHA2, lane]
        mirrors = seen[KIND, lane] == GLOSSY and alpha2 < rough_alpha2
        seen[ALPHA2, lane] = max(alpha2, np.float32(1e-10)) if mirrors else np.float32(-1)
        some |= mirrors
    return some


@njit(nogil=True, error_model="numpy")
def _place(
    seen: _FLOATS, eye: _FLOATS, offset_m: np.float32, part: _FLOATS
) -> None:  # pragma: no cover - compiled
    """Set `part` as `lobe_rays` takes it."""
    part[12] = seen[ALPHA2]
    for i in range(PACKET):
        squared = np.float32(1e-30)
        for axis in range(3):
            part[axis, i] = seen[axis, i] + offset_m * seen[FACE_NORMAL + axis, i]
            part[3 + axis, i] = seen[NORMAL + axis, i]
            part[6 + axis, i] = seen[FACE_NORMAL + axis, i]
            part[9 + axis, i] = eye[axis] - seen[axis, i]
            squared += part[9 + axis, i] ** 2
        for axis in range(3):
            part[9 + axis, i] /= math.sqrt(squared)


@njit(nogil=True, error_model="numpy")
def _mirror(
    function: int,
    scene: int,
    sphere: _FLOATS,
    part: _FLOATS,
    seen: _FLOATS,
    points: NDArray[np.float64],
    levels: _FLOATS,
    starts: NDArray[np.int64],
    ground: _FLOATS,
    rays: _FLOATS,
    valid: NDArray[np.int32],
    mirrored: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set `mirrored` (3, 16) to the radiance that surfaces with α² > 0 mirror."""
    count = points.shape[0]
    passed, places = np.empty((3, PACKET), np.float32), np.empty((4, PACKET), np.float32)
    each, one = np.float32(1 / count), np.float32(1)
    mirrored[:] = 0
    rays[:3] = part[:3]
    for r in range(count):
        rays[8] = _FAR_M
        lobe_rays(part, points[r, 0], points[r, 1], count, sphere, rays, valid, passed)
        coherent16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
        place_on_map(rays[4:7], passed[2], places)
        for i in range(PACKET):
            if passed[0, i] <= 0 or rays[8, i] < 0:
                continue
            red, green, blue = ground[0], ground[1], ground[2]
            if rays[5, i] >= 0 or math.isnan(red):
                red, green, blue = mean_over(
                    levels, starts, places[0, i], places[1, i], places[2, i], places[3, i]
                )
            weight, grazing = each * passed[0, i], passed[1, i]
            facing, grazing = weight * (one - grazing), weight * grazing * seen[F90, i]
            mirrored[0, i] += (facing * seen[F0, i] + grazing) * red
            mirrored[1, i] += (facing * seen[F0 + 1, i] + grazing) * green
            mirrored[2, i] += (facing * seen[F0 + 2, i] + grazing) * blue
