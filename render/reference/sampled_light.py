"""What directions bring to the points of a tile that are seen: drawn by the light, and by the lobe.

The pool of directions is cut into strata, as many as a pixel has shadow rays. In a stratum the 16
pixels of a tile take directions at even steps from a random one on, so that neighbours err in
different ways, and rays of a packet run nearly alike.

What surfaces mirror is also estimated from directions drawn by their lobe, and the two are combined
by the balance heuristic [1]_.

Input  : surfaces, sixteen at a time; the pool, or the light.
Output : what comes from each direction beyond what is known without shadows.

References
----------
.. [1] E. Veach, L. Guibas, "Optimally Combining Sampling Techniques for Monte Carlo Rendering",
       SIGGRAPH, 1995.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from render.rays.embree import PACKET, coherent16
from render.reference.emitters import Emitters, arriving
from render.reference.irradiance import CORNERS
from render.reference.pixel_rays import mixed, pair
from render.reference.reflection import drawn, reflected
from render.reference.surfaces import F0, F90, FACE_NORMAL, FAR_M, HIT, MATT, NORMAL

Floats = NDArray[np.float32]

# A pixel's place in its tile → its step in a stratum: an ordered dither, far apart where near.
_STEP = np.array([0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5], np.int64)
_GOLDEN = 0.6180339887498949


class Rays(NamedTuple):
    """How many rays a pass spends.

    Attributes
    ----------
    side : int
        Points along the side of a pixel.
    light, lobe : int
        Directions of each point that are drawn from the pool, and from the lobe where the surface
        mirrors.
    """

    side: int
    light: int
    lobe: int


@njit(nogil=True, fastmath={"contract"})
def add_from_pool(
    function: int,
    scene: int,
    sphere: Floats,
    lowest: float,
    pool: Floats,
    spent: Rays,
    share: int,
    random: np.uint64,
    surface: Floats,
    corners: Floats,
    shadow: tuple[Floats, NDArray[np.int32]],
    light: Floats,
    total: Floats,
) -> int:  # pragma: no cover - compiled
    """Add what directions of the pool give, in strata `share`, `share` + n², … beyond `corners`.

    Returns how many rays were traced.
    """
    traced = 0
    points = spent.side * spent.side
    strata = spent.light * points
    members = pool.shape[0] // strata
    part = np.float32(1 / strata)
    preference = spent.lobe / spent.light
    mirrors = (surface[F90] * surface[HIT]).max() > 0
    shadow[0][0:3] = surface[0:3]
    for s in range(spent.light):
        random = mixed(random)
        first = (s * points + share) * members
        start = np.int64(random >> np.uint64(36))  # 28 bits, below the 4 of the step
        turned = np.int64(random & np.uint64(15))
        for i in range(PACKET):
            at = first + ((((_STEP[i] ^ turned) << 28) + start) * members >> 32)
            for field in range(7):
                light[field, i] = pool[at, field]
        traced += _look(function, scene, sphere, lowest, surface, shadow, light)
        for i in range(PACKET):
            expected = np.float32(0)
            for k in range(0, CORNERS, 3):
                cosine = (
                    corners[k, i] * light[0, i]
                    + corners[k + 1, i] * light[1, i]
                    + corners[k + 2, i] * light[2, i]
                )
                expected += max(cosine, np.float32(0))
            light[8, i] = part * (light[7, i] - expected)
        for c in range(3):
            for i in range(PACKET):
                total[c, i] += light[8, i] * light[3 + c, i] * surface[MATT + c, i]
        if not mirrors:
            continue
        for i in range(PACKET):
            if light[7, i] == 0 or surface[F90, i] == 0:
                continue
            mirror, grazing, density = reflected(surface, i, light[0, i], light[1, i], light[2, i])
            mirror *= light[6, i] / (light[6, i] + preference * density)
            for c in range(3):
                f0 = surface[F0 + c, i]
                fresnel = f0 + (surface[F90, i] - f0) * grazing
                passed = fresnel * (mirror - surface[MATT + c, i] * light[7, i])
                total[c, i] += part * light[3 + c, i] * passed
    return traced


@njit(nogil=True, fastmath={"contract"})
def add_from_lobes(
    function: int,
    scene: int,
    sphere: Floats,
    emitters: Emitters,
    spent: Rays,
    share: int,
    tile: np.uint64,
    surface: Floats,
    shadow: tuple[Floats, NDArray[np.int32]],
    light: Floats,
    total: Floats,
) -> int:  # pragma: no cover - compiled
    """Add what surfaces mirror from directions of their lobes; return how many rays were traced."""
    traced = 0
    strata = spent.lobe * spent.side * spent.side
    preference = spent.lobe / spent.light
    radiance = np.empty(3, np.float32)
    shadow[0][0:3] = surface[0:3]
    for s in range(spent.lobe):
        index = share * spent.lobe + s
        for i in range(PACKET):
            # A lattice, moved at random for each pixel.
            right, down = pair(mixed(tile ^ np.uint64((i + 1) << 40)))
            u, v = ((index + 0.5) / strata + right) % 1.0, (index * _GOLDEN + down) % 1.0
            if surface[HIT, i] > 0 and surface[F90, i] > 0:
                light[0, i], light[1, i], light[2, i] = drawn(surface, i, u, v)
            else:
                for axis in range(3):  # away from the surface: not selected
                    light[axis, i] = -surface[NORMAL + axis, i]
        traced += _look(function, scene, sphere, emitters.lowest, surface, shadow, light)
        for i in range(PACKET):
            if light[7, i] == 0:
                continue
            x, y, z = light[0, i], light[1, i], light[2, i]
            mirror, grazing, density = reflected(surface, i, x, y, z)
            arriving(emitters, x, y, z, preference * density, radiance)
            for c in range(3):
                f0 = surface[F0 + c, i]
                fresnel = f0 + (surface[F90, i] - f0) * grazing
                total[c, i] += radiance[c] * fresnel * mirror / (density * strata)
    return traced


@njit(nogil=True)
def _look(
    function: int,
    scene: int,
    sphere: Floats,
    lowest: float,
    surface: Floats,
    shadow: tuple[Floats, NDArray[np.int32]],
    light: Floats,
) -> int:  # pragma: no cover - compiled
    """Set row 7 of `light` to n·l, 0 where no light comes; return how many rays were traced."""
    rays, valid = shadow
    if not _select(sphere, lowest, surface, light, valid):
        return 0
    rays[4:7] = light[0:3]
    rays[8] = FAR_M
    coherent16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
    traced = 0
    for i in range(PACKET):
        light[7, i] *= np.float32(rays[8, i] > 0)
        traced -= valid[i]
    return traced


@njit(nogil=True, fastmath={"contract"})
def _select(
    sphere: Floats, lowest: float, surface: Floats, light: Floats, valid: NDArray[np.int32]
) -> bool:  # pragma: no cover - compiled
    """Set row 7 of `light` to n·l, 0 where no light may come; mark the rays to trace.

    Light comes from above the surface, its face and the ground, which is opaque. Rays are traced
    that meet the meshes' bounding sphere.
    """
    needed = np.int32(0)
    for i in range(PACKET):
        x, y, z = light[0, i], light[1, i], light[2, i]
        cosine = surface[NORMAL, i] * x + surface[NORMAL + 1, i] * y + surface[NORMAL + 2, i] * z
        facing = (
            surface[FACE_NORMAL, i] * x
            + surface[FACE_NORMAL + 1, i] * y
            + surface[FACE_NORMAL + 2, i] * z
        )
        is_lit = (surface[HIT, i] > 0) & (cosine > 0) & (facing > 0) & (y > lowest)
        dx, dy, dz = sphere[0] - surface[0, i], sphere[1] - surface[1, i], sphere[2] - surface[2, i]
        along = dx * x + dy * y + dz * z
        off2 = dx * dx + dy * dy + dz * dz - along * along
        meets = (off2 < sphere[3] * sphere[3]) & (along > -sphere[3])
        light[7, i] = cosine * np.float32(is_lit)
        valid[i] = -np.int32(is_lit & meets)
        needed |= valid[i]
    return needed != 0
