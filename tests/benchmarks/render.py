"""The renderer: the parts of a frame, whole frames, and a ray caster in numpy as the peer.

640×480, one sample per pixel, 64 lights, the default scene (24,576 triangles). The peer sees a
sphere on a plane, which is all it can; accuracy is the relative RMSE between the two.
"""

import math
import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import moderngl
import numpy as np

from render.casters import gather_casters
from render.default_scene import default_scene, sphere
from render.gbuffer import GBuffer
from render.gl import create_context, describe
from render.renderer import Renderer
from render.scene import Camera, Ground, Material, Scene
from render.shadows import ShadowAtlas
from tests.render.brute_force import SphereScene, trace
from tests.render.light_sets import random_lights

LIGHT_COUNT = 64


def run(repeats: int) -> list[dict[str, Any]]:
    """Return the rows of the stage, for `tests.benchmarks.bench`."""
    with create_context() as context:
        return [*_parts(context, repeats), *_peer(context, max(repeats // 5, 1))]


def _parts(context: moderngl.Context, repeats: int) -> list[dict[str, Any]]:
    scene, camera = default_scene()
    size_px = camera.size_px
    lights, others = random_lights(LIGHT_COUNT, seed=0), random_lights(LIGHT_COUNT, seed=1)
    atlas = ShadowAtlas(context, gather_casters(scene.meshes))
    with Renderer(context, scene, camera) as renderer:

        def gbuffer() -> None:
            GBuffer(context, scene, camera, size_px).release()
            context.finish()

        def maps() -> None:
            # Two sets in turn, so that every light has moved.
            for part in (lights, others):
                assert atlas.draw(part.directions) == LIGHT_COUNT
            context.finish()

        def moving() -> None:
            renderer.render(lights)
            renderer.render(others)

        cases: list[tuple[str, Callable[[], object], int]] = [
            ("G-buffer, once per scene", gbuffer, 1),
            ("64 shadow maps of 512²", maps, 2),
            ("frame, 64 lights, all moved", moving, 2),
            ("frame, 64 lights, none moved", lambda: renderer.render(lights), 1),
        ]
        rows = [
            _row(case, describe(context), _median_ms(action, repeats) / count)
            for case, action, count in cases
        ]
    atlas.release()
    return rows


def _peer(context: moderngl.Context, repeats: int) -> list[dict[str, Any]]:
    ball = SphereScene(
        (0.0, 0.5, 0.0), 0.5, Material((0.7, 0.5, 0.3), 0.4), Ground(0.0, (0.5, 0.4, 0.3), 20.0)
    )
    camera = Camera(np.array([1.0, 1.2, 2.5]), np.array([0.0, 0.4, 0.0]), 0.7, (640, 480))
    lights = random_lights(8, seed=2)
    scene = Scene((sphere(ball.centre, ball.radius_m, ball.material, 64),), ball.ground)
    moved = replace(lights, directions=lights.directions[::-1])
    with Renderer(context, scene, camera) as renderer:
        ours_ms = 0.5 * _median_ms(
            lambda: (renderer.render(moved), renderer.render(lights)), repeats
        )
        picture = renderer.render(lights)
    truth_ms = _median_ms(lambda: trace(ball, camera, lights), repeats)
    truth = trace(ball, camera, lights)
    error = math.sqrt(np.mean((picture - truth) ** 2) / np.mean(truth**2))
    case = "sphere on a plane, 8 lights"
    return [
        {**_row(case, "fishlight", ours_ms, truth_ms / ours_ms), "accuracy": {"rel. RMSE": error}},
        {**_row(case, "ray cast in numpy", truth_ms), "accuracy": {"rel. RMSE": 0.0}},
    ]


def _row(case: str, system: str, ms: float, ratio: float | None = None) -> dict[str, Any]:
    return {
        "stage": "render",
        "case": case,
        "system": system,
        "ms": ms,
        "ratio": ratio,
        "accuracy": {},
    }


def _median_ms(action: Callable[[], object], repeats: int) -> float:
    action()  # compiles the shaders
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return 1e3 * statistics.median(times)
