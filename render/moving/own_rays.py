"""Shadow rays of a single pixel: to lights of which no neighbour on its surface knows."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from render.moving.shadow_rays import ALL_PASSES, POINTS
from render.rays.embree import PACKET, occluded16
from render.rays.surface_rows import FACE_NORMAL, POSITION

_FLOATS = NDArray[np.float32]
_BYTES = NDArray[np.uint8]
_FAR_M = np.float32(1e30)


@njit(nogil=True, error_model="numpy")
def ask_for_unknown(
    function: int,
    scene: int,
    offset_m: np.float32,
    part: _FLOATS,
    i: int,
    points: _FLOATS,
    weights: _FLOATS,
    start: int,
    turns: int,
    lacking: np.float32,
    turn: int,
    known: _BYTES,
    seen: _BYTES,
    rays: _FLOATS,
    valid: NDArray[np.int32],
) -> None:  # pragma: no cover - compiled
    """Trace a ray of pixel `i` to lights not `known`, strongest first, until enough are.

    Lights are those from `start` on, in `turns`; `weights` are as in `light_weights`. Enough is
    when all those traced have weighed as much as is `lacking`, or all are known that shine on it.

    Which of a light's points is asked follows from `turn` of the pixel. What is `seen` of a light
    is set to 0 or ALL_PASSES.
    """
    for axis in range(3):
        rays[axis, :] = part[POSITION + axis, i] + offset_m * part[FACE_NORMAL + axis, i]
    fx, fy, fz = part[FACE_NORMAL, i], part[FACE_NORMAL + 1, i], part[FACE_NORMAL + 2, i]
    asked = np.empty(PACKET, np.int64)
    step, count = 0, len(known)
    while step < count and lacking > 0:
        valid[:] = 0
        ray = 0
        while step < count and ray < PACKET and lacking > 0:
            light = step % turns * (count // turns) + step // turns
            at = start + light
            weight = weights[0, at] + weights[1, at] + weights[2, at]
            if not known[light] and weight > 0:
                which = (turn + at) % POINTS
                dx, dy, dz = points[at, which, 0], points[at, which, 1], points[at, which, 2]
                below = np.float32(2) * min(dx * fx + dy * fy + dz * fz, np.float32(0))
                rays[4, ray] = dx - below * fx
                rays[5, ray] = dy - below * fy
                rays[6, ray] = dz - below * fz
                rays[8, ray] = _FAR_M
                valid[ray], asked[ray] = -1, light
                lacking -= weight
                ray += 1
            step += 1
        occluded16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
        for k in range(ray):
            known[asked[k]] = 1
            seen[asked[k]] = np.uint8(ALL_PASSES * (rays[8, k] > 0))
