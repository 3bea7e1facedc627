"""Shadow rays a second: as estimators send them to Embree, and embreex's own loop as the peer.

The chart's three scenes and the objects on a ground, each under a low sun and an overcast sky.
Surfaces of a picture get sixteen directions each, that are drawn beforehand: one for all sixteen
surfaces of a packet, or for each its own, by the map or by the cosine. What is timed is what
`render/estimators/shading.py` does with them. Figures are of one core, in CPU time; two cores trace
twice as many. Rays "asked" are those that carry light; those that miss the meshes' sphere are
answered without Embree.

Among floating objects nearly all rays begin on a finely cut surface, and are traced along it. Tried
there, in rays a second over those of today's settings: Embree's build of high quality 0.99 to 1.03,
compact scenes 0.76 to 0.90, trees four wide 0.87 to 0.94, AVX2 instead of AVX-512 0.62 to 0.84;
denormals flushed 1.01 to 1.03; rays of one direction packed with those of the next 0.87 to 0.99;
packets of rays of one octant 0.77 to 0.81. To know of each triangle into which of 256 parts of the
sphere its rays go free would answer 36 % of them (among slats 12 %, in a heap 15 %), and takes 0.1
to 0.5 ms a triangle, more than a picture spares.
"""

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numba import njit
from numpy.typing import NDArray

from render.comparison.scenes import comparison_scenes
from render.estimators.contract import Shadows
from render.estimators.lobes import draw_reflected
from render.estimators.map_tables import MapTables, draw_from_map, map_tables
from render.estimators.passes import _see, _upper_half
from render.estimators.points import net, shift_of, shifted
from render.estimators.shading import (
    CARRIED,
    FIELDS,
    TOWARD,
    add_visible,
    add_visible_alike,
    add_waiting,
    start_at,
    waiting,
)
from render.measures.chart_scenes import chart_maps, chart_scenes
from render.rays.embree import (
    PACKET,
    Occluders,
    intersect16_address,
    occluded16_address,
    packet,
)
from render.reference import surfaces as found
from render.reference.pixel_rays import SIDE, view_of
from render.reference.surfaces import Tables, scene_tables
from render.scenes.scene import Camera

SIZE_PX = (192, 144)
SAMPLES = 16
MAPS = ("low sun", "overcast")
ALIKE, BY_LIGHT, BY_COSINE = 0, 1, 2
WAYS = {"one direction for sixteen": ALIKE, "by the map": BY_LIGHT, "by the cosine": BY_COSINE}

Floats = NDArray[np.float32]


def run(repeats: int) -> list[dict[str, Any]]:
    """Return the rows of the stage, for `tests.benchmarks.bench`."""
    maps = chart_maps([])
    scenes = {**chart_scenes([], SIZE_PX), "on a ground": comparison_scenes(SIZE_PX)["diffuse"]}
    rows: list[dict[str, Any]] = []
    for scene_name, (scene, camera) in scenes.items():
        tables = scene_tables(scene)
        surfaces = _seen(tables, camera)
        lowest = -2.0 if scene.ground is None else 0.0
        with Occluders(tables.positions, tables.faces, is_watertight=False) as occluders:
            shadows = Shadows(occluded16_address(), occluders.address, tables.sphere, lowest)
            for map_name in MAPS:
                light = maps[map_name] if scene.ground is None else _upper_half(maps[map_name])
                drawn = map_tables(light)
                for way, kind in WAYS.items():
                    case = f"{scene_name}, {map_name}, {way}"
                    rows += _rates(case, tables, shadows, drawn, surfaces, kind, repeats)
    return rows


def _seen(tables: Tables, camera: Camera) -> Floats:
    """Return the packets of surfaces that a picture shows, one point of each pixel."""
    width, height = camera.size_px
    surfaces = np.empty((width // SIDE * height // SIDE, found.FIELDS, PACKET), np.float32)
    with Occluders(tables.positions, tables.faces) as occluders:
        _see(
            intersect16_address(), occluders.address, view_of(camera), tables, camera.size_px, 0, 0,
            1, surfaces, np.zeros((len(surfaces), PACKET), np.float32),
        )  # fmt: skip
    return surfaces[surfaces[:, found.HIT].any(axis=1)]


def _rates(
    case: str,
    tables: Tables,
    shadows: Shadows,
    drawn: MapTables,
    surfaces: Floats,
    kind: int,
    repeats: int,
) -> Iterator[dict[str, Any]]:
    light = np.zeros((len(surfaces), SAMPLES, FIELDS, PACKET), np.float32)
    _draw(drawn, surfaces, kind, net(SAMPLES), light)
    is_lit = _is_lit(surfaces, light, shadows.lowest)
    light[:, :, CARRIED:] = is_lit[:, :, None]
    trace = _trace_alike if kind == ALIKE else _trace
    radiance = np.zeros((len(surfaces), 3, PACKET), np.float32)
    traced = trace(shadows, surfaces[:2], light[:2], radiance[:2])
    best_s = np.inf
    for _ in range(repeats):
        start = time.thread_time()
        traced = trace(shadows, surfaces, light, radiance)
        best_s = min(best_s, time.thread_time() - start)
    peer_rate = _peer_rate(tables, surfaces, light, is_lit, repeats)
    rate = traced / best_s
    yield _row(
        case, "fishlight", best_s, rate / peer_rate,
        {"M rays/s and core": rate / 1e6, "asked": is_lit.sum() / best_s / 1e6, "rays": traced},
    )  # fmt: skip
    yield _row(case, "embreex", None, None, {"M rays/s and core": peer_rate / 1e6})


def _peer_rate(
    tables: Tables, surfaces: Floats, light: Floats, is_lit: NDArray[np.bool_], repeats: int
) -> float:
    """Return the rays per second of embreex's loop, which is given those that are traced."""
    scene = EmbreeScene()
    TriangleMesh(scene, tables.positions[tables.faces])
    at = np.broadcast_to(surfaces[:, None, :3], light[:, :, :3].shape).transpose(0, 1, 3, 2)
    toward = light[:, :, TOWARD : TOWARD + 3].transpose(0, 1, 3, 2)
    off = tables.sphere[:3] - at[is_lit]
    along = (off * toward[is_lit]).sum(axis=1)
    radius_m = tables.sphere[3]
    meets = ((off**2).sum(axis=1) - along**2 < radius_m**2) & (along > -radius_m)
    origins, directions = (np.ascontiguousarray(a[is_lit][meets]) for a in (at, toward))
    best_s = np.inf
    for _ in range(max(repeats // 2, 1)):
        start = time.thread_time()
        scene.run(origins, directions, query="OCCLUDED")
        best_s = min(best_s, time.thread_time() - start)
    return len(origins) / best_s


def _is_lit(surfaces: Floats, light: Floats, lowest: float) -> NDArray[np.bool_]:
    """Return which directions (P, S, 16) light can come from."""
    toward = light[:, :, TOWARD : TOWARD + 3]
    is_hit = surfaces[:, None, found.HIT] > 0
    normal, face = (
        np.where(is_hit[:, :, None], surfaces[:, None, row : row + 3], 0)
        for row in (found.NORMAL, found.FACE_NORMAL)
    )
    above = ((normal * toward).sum(axis=2) > 0) & ((face * toward).sum(axis=2) > 0)
    return is_hit & above & (toward[:, :, 1] > lowest)


@njit(nogil=True)
def _draw(
    tables: MapTables, surfaces: Floats, kind: int, points: NDArray[np.uint32], light: Floats
) -> None:  # pragma: no cover - compiled
    for k in range(len(surfaces)):
        for s in range(len(points)):
            for i in range(PACKET):
                u, v = shifted(points, s, shift_of(1, k, 0 if kind == ALIKE else i))
                if kind != BY_COSINE:
                    _, _, x, y, z = draw_from_map(tables, u, v)
                elif surfaces[k, found.HIT, i] > 0:
                    x, y, z = draw_reflected(surfaces[k], i, 0.0, u, v)
                else:
                    x, y, z = 0.0, 1.0, 0.0
                light[k, s, TOWARD, i] = x
                light[k, s, TOWARD + 1, i] = y
                light[k, s, TOWARD + 2, i] = z


@njit(nogil=True)
def _trace(
    shadows: Shadows, surfaces: Floats, light: Floats, radiance: Floats
) -> int:  # pragma: no cover - compiled
    traced = 0
    for k in range(len(surfaces)):
        held = waiting()
        for s in range(light.shape[1]):
            traced += add_visible(shadows, surfaces[k], light[k, s], held, radiance[k])
        traced += add_waiting(shadows, held, radiance[k])
    return traced


@njit(nogil=True)
def _trace_alike(
    shadows: Shadows, surfaces: Floats, light: Floats, radiance: Floats
) -> int:  # pragma: no cover - compiled
    traced = 0
    for k in range(len(surfaces)):
        shadow = packet()
        start_at(surfaces[k], shadow)
        for s in range(light.shape[1]):
            traced += add_visible_alike(shadows, surfaces[k], light[k, s], shadow, radiance[k])
    return traced


def _row(
    case: str, system: str, seconds: float | None, ratio: float | None, accuracy: dict[str, float]
) -> dict[str, Any]:
    return {
        "stage": "rays",
        "case": case,
        "system": system,
        "ms": None if seconds is None else 1e3 * seconds,
        "ratio": ratio,
        "accuracy": accuracy,
    }
