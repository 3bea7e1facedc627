"""Light by way of other surfaces: paths that go on as surfaces reflect.

At each place of a path two directions are drawn, one by the map's light, one by what the surface
reflects there; both look for the map, weighed by the balance heuristic [1]_, and the second goes on
from what it hits. With one bounce that is multiple_importance.py with a direction of each kind.

Cost   : two rays for each sample and bounce; rays after the first bounce run apart, and take Embree
         longer.
Fails  : light that first meets a near mirror and then a matt surface, a caustic, is found by the
         few paths that are mirrored to where it comes from. No path ends by chance: what more
         bounces would bring is left out.

References
----------
.. [1] E. Veach, L. Guibas, "Optimally Combining Sampling Techniques for Monte Carlo Rendering",
       SIGGRAPH, 1995.
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from render.estimators.contract import Estimate, Floats, Setting, Shadows
from render.estimators.lobes import mirror_shares, reflected_density
from render.estimators.map_tables import MapTables, cell_of, map_tables
from render.estimators.points import Points, net, random, shift_of, shifted
from render.estimators.proposals import draw, set_carried
from render.estimators.shading import (
    CARRIED,
    FIELDS,
    TOWARD,
    Waiting,
    add_visible,
    add_waiting,
    reflect,
    waiting,
)
from render.rays.embree import PACKET, hit_packet, intersect16_address
from render.reference.surfaces import HIT, ORIGIN, Tables, find_surfaces_apart

_BY_LIGHT, _BY_BRDF = 0, 1
_EVERYWHERE = -2.0  # as `Shadows.lowest`: surfaces reflect what comes from below the horizon too


def paths(setting: Setting) -> Estimate:
    """Prepare to follow paths to as many surfaces as the setting says."""
    light = map_tables(setting.environment)

    def estimate(surfaces: Floats, samples: int, seed: int, radiance: Floats) -> int:
        if not light.density.any():
            return 0
        traced = _add(
            intersect16_address(), setting.shadows, light, setting.scene, setting.bounces, surfaces,
            net(samples), seed, radiance,
        )  # fmt: skip
        return int(traced)

    return estimate


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _add(
    function: int,
    shadows: Shadows,
    tables: MapTables,
    scene: Tables,
    bounces: int,
    surfaces: Floats,
    points: Points,
    seed: int,
    radiance: Floats,
) -> int:  # pragma: no cover - compiled
    traced = 0
    for k in prange(len(surfaces)):
        if surfaces[k, HIT].max() > 0:
            traced += _follow(
                function, shadows, tables, scene, bounces, surfaces[k], points, seed, k, radiance[k]
            )
    return traced


@njit(nogil=True, error_model="numpy")
def _follow(
    function: int,
    shadows: Shadows,
    tables: MapTables,
    scene: Tables,
    bounces: int,
    first: Floats,
    points: Points,
    seed: int,
    k: int,
    total: Floats,
) -> int:  # pragma: no cover - compiled
    """Add what paths from the surfaces of a packet bring; return the rays traced."""
    traced = 0
    held, path = waiting(), hit_packet()
    light = np.zeros((FIELDS, PACKET), np.float32)
    passed = np.empty((3, PACKET), np.float32)
    surface = np.empty_like(first)
    uv = np.empty((2, PACKET))
    for s in range(len(points)):
        surface[:] = first
        passed[:] = np.float32(1 / len(points))
        for bounce in range(bounces):
            if surface[HIT].max() == 0:
                break
            _set_points(points, s, bounce, _BY_LIGHT, seed, k, uv)
            traced += _look_at_light(shadows, tables, surface, passed, uv, light, held, total)
            _set_points(points, s, bounce, _BY_BRDF, seed, k, uv)
            traced += _go_on(
                function, shadows, tables, scene, surface, passed, uv, light, path, total
            )
    return traced + add_waiting(shadows, held, total)


@njit(nogil=True)
def _set_points(
    points: Points, s: int, bounce: int, way: int, seed: int, k: int, uv: NDArray[np.float64]
) -> None:  # pragma: no cover - compiled
    """Set where in the unit square sample `s` is drawn: evenly spread first, then at random."""
    for i in range(PACKET):
        of = i + PACKET * way
        if bounce == 0:
            uv[0, i], uv[1, i] = shifted(points, s, shift_of(seed, k, of))
        else:
            of += 2 * PACKET * min(bounce, 7)
            uv[0, i] = random(seed, k, of, 2 * (bounce * len(points) + s))
            uv[1, i] = random(seed, k, of, 2 * (bounce * len(points) + s) + 1)


@njit(nogil=True, error_model="numpy")
def _look_at_light(
    shadows: Shadows,
    tables: MapTables,
    surface: Floats,
    passed: Floats,
    uv: NDArray[np.float64],
    light: Floats,
    held: Waiting,
    total: Floats,
) -> int:  # pragma: no cover - compiled
    """Add what comes from directions drawn by the light; return the rays traced."""
    shares = mirror_shares(surface)
    for i in range(PACKET):
        if surface[HIT, i] == 0:
            continue
        row, column, density = draw(tables, True, shares[i], surface, uv[0, i], uv[1, i], light, i)
        x, y, z = light[TOWARD, i], light[TOWARD + 1, i], light[TOWARD + 2, i]
        other = reflected_density(surface, i, shares[i], x, y, z)
        set_carried(tables, row, column, 1 / (density + other), light, i)
        for c in range(3):
            light[CARRIED + c, i] *= passed[c, i]
    reflect(shadows, surface, light)
    return add_visible(shadows, surface, light, held, total)


@njit(nogil=True, error_model="numpy")
def _go_on(
    function: int,
    shadows: Shadows,
    tables: MapTables,
    scene: Tables,
    surface: Floats,
    passed: Floats,
    uv: NDArray[np.float64],
    light: Floats,
    path: tuple[Floats, NDArray[np.int32]],
    total: Floats,
) -> int:  # pragma: no cover - compiled
    """Follow directions drawn by what surfaces reflect: to the map, or on to the next surface.

    `surface` becomes what they hit, and `passed` how much of its light comes back along the path.
    """
    rays, valid = path
    density = np.zeros(PACKET)
    shares = mirror_shares(surface)
    for i in range(PACKET):
        if surface[HIT, i] == 0:
            continue
        _, _, density[i] = draw(tables, False, shares[i], surface, uv[0, i], uv[1, i], light, i)
        for c in range(3):
            light[CARRIED + c, i] = passed[c, i] / density[i] if density[i] > 0 else 0.0
    reflect(Shadows(shadows.function, shadows.scene, shadows.sphere, _EVERYWHERE), surface, light)
    traced = 0
    for i in range(PACKET):
        carries = light[CARRIED, i] + light[CARRIED + 1, i] + light[CARRIED + 2, i] > 0
        valid[i] = -np.int32(carries)
        traced += carries
        for axis in range(3):
            rays[axis, i] = surface[ORIGIN + axis, i]
            rays[4 + axis, i] = light[TOWARD + axis, i]
            passed[axis, i] = light[CARRIED + axis, i]
    find_surfaces_apart(function, shadows.scene, scene, rays, valid, surface)
    for i in range(PACKET):
        x, y, z = light[TOWARD, i], light[TOWARD + 1, i], light[TOWARD + 2, i]
        if valid[i] == 0 or surface[HIT, i] > 0 or y <= shadows.lowest:
            continue
        row, column = cell_of(tables, x, y, z)
        share = density[i] / (density[i] + tables.density[row, column])
        for c in range(3):
            total[c, i] += share * passed[c, i] * tables.radiance[row, column, c]
    return traced
