"""What smooth surfaces mirror of a map, when everything may move: rays of every pixel's lobe.

As in render/baked/gloss.py, with fewer rays, all of them new in every picture.

Input  : surfaces, as `first_hits` finds them; a map's pyramid.    Output : radiance.
Cost   : about 0.1 µs a ray, tracing and looking up.
Fails  : no object is seen in another; below the horizon a ground is seen as if nothing stood on it.
"""

import math
from dataclasses import replace

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from lighting.export.residual import remove_lights
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.lights.map_pyramid import MapPyramid, mean_around
from render.lights.narrow_lights import PEAK_RAD, narrow_lights
from render.moving.shared_rays import Discs
from render.rays.embree import PACKET, occluded16, occluded16_address, packet
from render.rays.first_hits import ALPHA2, F0, F90, FACE_NORMAL, GLOSSY, KIND, LANES, NORMAL, SIDE
from render.rays.lobe import lobe_points, lobe_ray, meets
from render.rays.traced_scene import TracedScene

_FLOATS = NDArray[np.float32]

ROUGH_ALPHA = 0.2
"""GGX width of a lobe from which on a few dozen lights stand for the map as well as rays do."""

_RAYS = 8
_PLACE = 3 * 4 + 1  # rows of a surface as lobe_ray takes it
_FAR_M = 1e30


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
        eye.astype(np.float32), lobe_points(_RAYS), pyramid.cells, pyramid.starts, radiance,
        rough_alpha**2, picture,
    )  # fmt: skip


def without_peaks(environment: EnvironmentMap, lights: Discs) -> tuple[EnvironmentMap, Discs]:
    """Return a map without the narrow lights among some, and these with what they had in it.

    Those are mirrored by themselves, all others by the map.
    """
    peaks = narrow_lights(lights.irradiance, lights.radius_rad, PEAK_RAD)
    of = lights.taken(peaks)
    rest, removed = remove_lights(
        environment, LightSet(of.directions, of.irradiance, of.radius_rad)
    )
    mirrored = np.zeros_like(lights.irradiance)
    mirrored[peaks] = removed
    return rest, replace(lights, mirrored=mirrored)


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _add_reflected_map(
    function: int,
    scene: int,
    sphere: _FLOATS,
    offset_m: float,
    surfaces: _FLOATS,
    eye: _FLOATS,
    points: NDArray[np.float64],
    levels: _FLOATS,
    starts: NDArray[np.int64],
    ground: _FLOATS,
    rough_alpha2: float,
    picture: _FLOATS,
) -> None:  # pragma: no cover - compiled
    height, width = picture.shape[:2]
    for row in prange(1, surfaces.shape[0] - 1):
        part = np.empty((_PLACE, PACKET), np.float32)
        mirrored = np.empty((3, PACKET), np.float32)
        rays, valid = packet()
        for lane in range(LANES):
            line = SIDE * (row - 1) + lane // SIDE
            if line >= height:
                continue
            for first in range(1, surfaces.shape[3] - 1, PACKET):
                seen = surfaces[row, lane, :, first : first + PACKET]
                if not _load(seen, eye, np.float32(offset_m), np.float32(rough_alpha2), part):
                    continue
                _mirror(
                    function, scene, sphere, part, seen, points, levels, starts, ground, rays,
                    valid, mirrored,
                )  # fmt: skip
                for i in range(PACKET):
                    column = SIDE * (first - 1 + i) + lane % SIDE
                    if part[12, i] > 0 and column < width:
                        for c in range(3):
                            picture[line, column, c] += mirrored[c, i]


@njit(nogil=True, error_model="numpy")
def _load(
    seen: _FLOATS, eye: _FLOATS, offset_m: np.float32, rough_alpha2: np.float32, part: _FLOATS
) -> bool:  # pragma: no cover - compiled
    """Set `part` as `lobe_ray` takes it; return whether any surface mirrors."""
    some = False
    for i in range(PACKET):
        mirrors = seen[KIND, i] == GLOSSY and seen[ALPHA2, i] < rough_alpha2
        part[12, i] = max(seen[ALPHA2, i], np.float32(1e-10)) if mirrors else np.float32(-1)
        some |= mirrors
    if not some:
        return False
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
    return True


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
    passed = np.empty((3, PACKET))  # weight, what of it is of f90, width of the look-up
    mirrored[:] = 0
    rays[:3] = part[:3]
    for r in range(count):
        for i in range(PACKET):
            valid[i] = 0
            passed[0, i] = 0
            rays[8, i] = _FAR_M
            if part[12, i] > 0:
                x, y, z, weight, c5, share = lobe_ray(part, i, points[r, 0], points[r, 1], count)
                rays[4, i], rays[5, i], rays[6, i] = x, y, z
                valid[i] = -np.int32(weight > 0 and meets(part, i, x, y, z, sphere))
                passed[0, i], passed[1, i], passed[2, i] = weight / count, c5, math.sqrt(share)
        occluded16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
        for i in range(PACKET):
            if passed[0, i] <= 0 or rays[8, i] < 0:
                continue
            x, y, z = rays[4, i], rays[5, i], rays[6, i]
            red, green, blue = ground[0], ground[1], ground[2]
            if y >= 0 or math.isnan(red):
                u = 0.5 - math.atan2(x, z) / (2 * math.pi)
                v = math.atan2(math.hypot(x, z), y) / math.pi
                red, green, blue = mean_around(levels, starts, u, v, passed[2, i])
            facing, grazing = passed[0, i] * (1 - passed[1, i]), passed[0, i] * passed[1, i]
            grazing *= seen[F90, i]
            mirrored[0, i] += (facing * seen[F0, i] + grazing) * red
            mirrored[1, i] += (facing * seen[F0 + 1, i] + grazing) * green
            mirrored[2, i] += (facing * seen[F0 + 2, i] + grazing) * blue
