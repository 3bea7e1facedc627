"""How the cost of a picture grows with triangles and with pixels, the other one held.

Input  : ways, a map.    Output : measurements.
Cost   : about two minutes on two idle cores.
Fails  : as chart.py.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from functools import partial

import msgspec

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.measures.chart import Point
from lighting.measures.known import remembered
from lighting.reduce import reduce_to_lights
from render.measures.chart import measuring_digest, open_way, timed_frames
from render.measures.chart_scenes import map_digest
from render.measures.ways import Way
from render.scenes.default_scene import default_scene, frame_meshes, sphere
from render.scenes.scene import Camera, Material, Scene

LIGHTS = 64
TRIANGLES, PIXELS = "triangles", "pixels"

_SIZE_PX = (640, 480)
_SLOW_S = 5.0
"""A way that takes longer for a frame is not tried with more."""


class Growth(msgspec.Struct, frozen=True):
    """What a frame took: `count` triangles, or pixels, as `of` says."""

    of: str
    way: str
    count: int
    ms: float
    setup_ms: float


View = Callable[[int], tuple[Scene, Camera]]


def _of_triangles(count: int) -> tuple[Scene, Camera]:
    """Return a ball of about so many triangles."""
    rings = round((count / 4) ** 0.5)
    ball = sphere((0.0, 0.5, 0.0), 0.5, Material(specular=0.0), rings)
    return frame_meshes((ball,), _SIZE_PX)


def _of_pixels(count: int) -> tuple[Scene, Camera]:
    """Return the default scene in a picture of 4 : 3."""
    width = round((count * 4 / 3) ** 0.5)
    return default_scene((width, count // width))


VIEWS: Mapping[str, View] = {TRIANGLES: _of_triangles, PIXELS: _of_pixels}
COUNTS = {
    TRIANGLES: (1_024, 10_000, 102_400, 1_000_000),
    PIXELS: (160 * 120, 320 * 240, 640 * 480, 1280 * 960),
}


def measure(
    environment: EnvironmentMap, ways: Mapping[str, Way], known: dict[str, Growth]
) -> Iterator[Growth | None]:
    """Yield a measurement of each count and way; None where the way would be too slow.

    `known` are earlier results, which are not measured again; new ones are added to it.
    """
    lights = reduce_to_lights(environment, LIGHTS)
    for of, counts in COUNTS.items():
        measured = partial(_measured, of, environment, lights, ways)
        digest = f"{measuring_digest()} {map_digest(environment)} {of}"
        yield from remembered(measured, digest, ways, counts, known, _SLOW_S)


def points_of(rows: list[Growth]) -> list[Point]:
    """Return the points of the chart."""
    return [Point(row.way, row.count, row.ms, {row.of: row.ms}) for row in rows]


def _measured(
    of: str,
    environment: EnvironmentMap,
    lights: LightSet,
    ways: Mapping[str, Way],
    name: str,
    count: int,
) -> Growth:
    with ExitStack() as stack:
        draw, setup_ms = open_way(stack, ways[name], *VIEWS[of](count))
        _, ms = timed_frames(draw, lights, environment)
        return Growth(of, name, count, ms, setup_ms)
