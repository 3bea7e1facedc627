"""What smooth surfaces mirror of a map, when everything may move: rays of every pixel's lobe.

As in render/baked/gloss.py, with fewer rays, all of them new in every picture. Those of a tile are
traced and looked up sixteen at a time. Where pixels side by side mirror about the same part of the
map, the sixteen share a lobe, each with a few rays of its own part. Of a lobe's rays those that
come first tell whether anything stops some; only then are the others traced.

Input  : surfaces, as `first_hits` finds them; a map's pyramid.    Output : radiance.
Cost   : about 0.15 µs a ray, tracing and looking up. A pixel of metal has 12, one of a dielectric
         4; where they share, a quarter of that.
Fails  : no object is seen in another; below the horizon a ground is seen as if nothing stood on it.
         What hides a part of the map that is narrower than the first rays are apart may be missed.
"""

import math
from functools import cache

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.lights.map_places import place_on_map
from render.lights.map_pyramid import MapPyramid, mean_over
from render.lights.peaks import ROUGH_ALPHA
from render.moving.lobe_sharing import (
    FACING,
    GRAZING,
    LOBE_FIELDS,
    TOWARD,
    add_shared_lobes,
)
from render.rays.embree import PACKET, coherent16, occluded16_address, packet
from render.rays.lobe import lobe_points, lobe_rays, on_disc
from render.rays.row_order import row_order
from render.rays.surface_rows import (
    ALPHA2,
    F0,
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
_SPARED = 4  # where pixels share a lobe, each sends one in so many rays
_QUARTERS = np.array([[0, 1, 2, 3], [2, 3, 0, 1], [1, 0, 3, 2], [3, 2, 1, 0]])
_PARTS = np.array([[0, 2, 3, 1], [2, 0, 1, 3], [1, 3, 2, 0], [3, 1, 0, 2]])
"""Which quarter of a lobe each pixel of a tile has, and which part of it: Graeco-Latin squares, so
that those of every row, column and square of 2 × 2 are spread around it."""
_GOLDEN = (math.sqrt(5) - 1) / 2
_WEAK_F0 = 0.1  # of dielectrics: what they mirror is little beside what they scatter

_MOST_TURN2, _MOST_TURN2_OF_WEAK = np.float32(0.1), np.float32(0.5)
"""Square of the angle between what neighbours mirror, over α², up to which they share rays."""

_FIRST_SHARE = 4  # of rays alone, one in so many are traced first

_PLACE = 3 * 4 + 1  # rows of a surface as lobe_rays takes it
_FAR_M = np.float32(1e30)


class ReflectedMap:
    """Adds what is mirrored of maps to pictures; keeps only memory from one to the next."""

    def __init__(self) -> None:
        self._lobes = np.zeros((0, 0, 0, 0), np.float32)

    def add(
        self,
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
        rows, _, _, columns = surfaces.shape
        if self._lobes.shape[::3] != (rows, columns):
            self._lobes = np.zeros((rows, LANES, LOBE_FIELDS, columns), np.float32)
        shows_map = ground is None or traced.scene.ground is None
        radiance = np.full(3, np.nan, np.float32) if shows_map else np.asarray(ground, np.float32)
        _trace_lobes(
            occluded16_address(), traced.address, traced.sphere, traced.offset_m, surfaces,
            eye.astype(np.float32), _points(_RAYS), _points(_FEW_RAYS), pyramid.cells,
            pyramid.starts, radiance, rough_alpha**2, self._lobes,
        )  # fmt: skip
        add_shared_lobes(surfaces, self._lobes, rough_alpha**2, picture)


@cache
def _points(count: int) -> tuple[_FLOATS, _FLOATS]:
    """Return the points of a lobe that a pixel has alone, and those that all of a tile share.

    In turn, of every pixel, (count, 3, LANES) and (count / _SPARED, 3, LANES). A pixel's own begin
    with the outermost; the first of those shared are all on the inmost ring, spread around it.
    """
    own = np.broadcast_to(on_disc(lobe_points(count))[::-1, :, None], (count, 3, LANES))
    turn = np.arange(count // _SPARED)[:, None]
    quarter, part = _QUARTERS.ravel(), _PARTS.ravel()
    area = (turn + (SIDE * part + quarter + 0.5) / LANES) / len(turn)
    around = ((SIDE * quarter + part + 0.5) / LANES + turn * _GOLDEN) % 1
    shared = on_disc(np.stack([area, around], axis=-1)).swapaxes(1, 2)
    return np.ascontiguousarray(own), np.ascontiguousarray(shared)


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _trace_lobes(
    function: int,
    scene: int,
    sphere: _FLOATS,
    offset_m: float,
    surfaces: _FLOATS,
    eye: _FLOATS,
    points: tuple[_FLOATS, _FLOATS],
    few_points: tuple[_FLOATS, _FLOATS],
    levels: _FLOATS,
    starts: NDArray[np.int64],
    ground: _FLOATS,
    rough_alpha2: float,
    lobes: _FLOATS,
) -> None:  # pragma: no cover - compiled
    order = row_order(1, surfaces.shape[0] - 1)
    for k in prange(len(order)):
        row = order[k]
        seen = np.empty((FIELDS, PACKET), np.float32)
        part = np.empty((_PLACE, PACKET), np.float32)
        mirrored = np.empty((LOBE_FIELDS, PACKET), np.float32)
        rays, valid = packet()
        for column in range(1, surfaces.shape[3] - 1):
            if not _load_mirrors(surfaces, row, column, np.float32(rough_alpha2), seen):
                continue
            _place(seen, eye, np.float32(offset_m), part, mirrored)
            is_weak = seen[F0 : F0 + 3].max() < _WEAK_F0
            own, shared = few_points if is_weak else points
            is_alone = _turn2(part, mirrored) > (_MOST_TURN2_OF_WEAK if is_weak else _MOST_TURN2)
            _mirror(
                function, scene, sphere, part, own if is_alone else shared, len(own),
                levels, starts, ground, rays, valid, mirrored,
            )  # fmt: skip
            for lane in range(LANES):
                if part[12, lane] > 0:
                    for field in range(LOBE_FIELDS):
                        lobes[row, lane, field, column] = mirrored[field, lane]


@njit(nogil=True, error_model="numpy")
def _turn2(part: _FLOATS, mirrored: _FLOATS) -> np.float32:  # pragma: no cover - compiled
    """Return the mean square of the angle between what neighbours mirror, over that of α²."""
    turn2, alpha2 = np.float32(0), np.float32(1e-30)
    for i in range(PACKET):
        for other, exists in ((i + 1, i % SIDE < SIDE - 1), (i + SIDE, i < LANES - SIDE)):
            if exists and part[12, i] > 0 and part[12, other] > 0:
                for axis in range(3):
                    between = mirrored[TOWARD + axis, other] - mirrored[TOWARD + axis, i]
                    turn2 += between**2
                alpha2 += part[12, i]
    return np.float32(turn2 / alpha2)


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
    seen: _FLOATS, eye: _FLOATS, offset_m: np.float32, part: _FLOATS, mirrored: _FLOATS
) -> None:  # pragma: no cover - compiled
    """Set `part` as `lobe_rays` takes it, and the rows TOWARD of `mirrored`."""
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
        facing = np.float32(0)
        for axis in range(3):
            facing += part[3 + axis, i] * part[9 + axis, i]
        for axis in range(3):
            along = np.float32(2) * facing * part[3 + axis, i]
            mirrored[TOWARD + axis, i] = along - part[9 + axis, i]


@njit(nogil=True, error_model="numpy")
def _mirror(
    function: int,
    scene: int,
    sphere: _FLOATS,
    part: _FLOATS,
    points: _FLOATS,
    count: int,
    levels: _FLOATS,
    starts: NDArray[np.int64],
    ground: _FLOATS,
    rays: _FLOATS,
    valid: NDArray[np.int32],
    mirrored: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set rows FACING and GRAZING of `mirrored` to what surfaces with α² > 0 see.

    Their `points` are some of a lobe's `count`.
    """
    passed, places = np.empty((3, PACKET), np.float32), np.empty((4, PACKET), np.float32)
    each, one = np.float32(1 / len(points)), np.float32(1)
    first, some_stopped = -(-len(points) // _FIRST_SHARE), False
    mirrored[FACING:] = 0
    rays[:3] = part[:3]
    for r in range(len(points)):
        rays[8] = _FAR_M
        lobe_rays(part, points[r], count, sphere, rays, valid, passed)
        if r < first or some_stopped:
            coherent16(  # type: ignore[call-arg]
                function, valid.ctypes.data, scene, rays.ctypes.data
            )
            some_stopped |= rays[8].min() < 0
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
            facing, grazing = weight * (one - grazing), weight * grazing
            mirrored[FACING, i] += facing * red
            mirrored[FACING + 1, i] += facing * green
            mirrored[FACING + 2, i] += facing * blue
            mirrored[GRAZING, i] += grazing * red
            mirrored[GRAZING + 1, i] += grazing * green
            mirrored[GRAZING + 2, i] += grazing * blue
