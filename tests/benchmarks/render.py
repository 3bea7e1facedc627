"""The renderers: the parts of a frame, whole frames, and a ray caster in numpy as the peer.

640×480, one sample per pixel, 64 lights, the default scene (24,576 triangles). The peer sees a
sphere on a plane, which is all it can; accuracy is the relative RMSE between the two. Shadows of
lights with an extent, and of a fill, are compared in a smaller picture, 160×120.
"""

import itertools
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import moderngl
import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from render.baked.renderer import BakedRenderer
from render.baked.roaming import RoamingRenderer
from render.moving import reflected_map
from render.moving.lobe_sharing import FACING, GRAZING
from render.moving.renderer import MovingRenderer
from render.moving.shared_rays import Effort
from render.opengl.context import create_context, describe
from render.opengl.gbuffer import GBuffer
from render.opengl.renderer import Renderer
from render.opengl.shadows import ShadowAtlas
from render.rays.surface_rows import ALPHA2, F0, F90, GLOSSY, KIND, in_picture
from render.scenes.casters import gather_casters
from render.scenes.default_scene import default_scene, sphere
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.render.brute_force import SphereScene, as_points, away_from_outlines, trace
from tests.render.light_sets import random_lights, uniform_fill

LIGHT_COUNT = 64


def run(repeats: int) -> list[dict[str, Any]]:
    """Return the rows of the stage, for `tests.benchmarks.bench`."""
    with create_context() as context:
        few = max(repeats // 5, 1)
        return [
            *_parts(context, repeats),
            *_baked(repeats),
            *_moving(few),
            *_roaming(few),
            *_peer(context, few),
            *_soft(context, few),
        ]


def _parts(context: moderngl.Context, repeats: int) -> list[dict[str, Any]]:
    scene, camera = default_scene()
    size_px = camera.size_px
    lights, others = random_lights(LIGHT_COUNT, seed=0), random_lights(LIGHT_COUNT, seed=1)
    atlas = ShadowAtlas(context, gather_casters(scene.meshes), 4096, 512)
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


def _baked(repeats: int) -> list[dict[str, Any]]:
    scene, camera = default_scene()
    lights = _discs(LIGHT_COUNT, seed=0)
    start = time.perf_counter()
    with BakedRenderer(scene, camera) as renderer:
        traced_ms = 1e3 * (time.perf_counter() - start)
        frame_ms = _median_ms(lambda: renderer.render(lights), repeats)
    with BakedRenderer(scene, camera) as renderer:
        # Narrow enough to be traced alone: two in turn, so that it has moved.
        narrow = random_lights(1, seed=2), random_lights(1, seed=3)
        moved_ms = 0.5 * _median_ms(lambda: [renderer.render(each) for each in narrow], repeats)
    return [
        _row("transport, once per scene and camera", "baked", traced_ms),
        _row("frame, 64 lights, baked", "baked", frame_ms),
        _row("frame, one narrow light moved, baked", "baked", moved_ms),
    ]


EFFORTS = {
    "n = 4": Effort(),
    "n = 4, not averaged": Effort(is_softened=False),
    "n = 4, no key lights": Effort(key_lights=0),
    "n = 4, 16 key lights": Effort(key_lights=16, key_share=0.0),
    "n = 2": Effort(interleaving=2),
    "n = 1": Effort(interleaving=1),
}


def _moving(repeats: int) -> list[dict[str, Any]]:
    """Error against 16 of 256 points of every light from every pixel; CPU time of both cores."""
    scene, camera = default_scene()
    around = [replace(camera, eye=camera.eye + 0.02 * step) for step in range(repeats)]
    rows = []
    for name, lights in light_cases().items():
        every = Effort(
            key_lights=LIGHT_COUNT, key_share=0.0, key_rays=16, is_sparing=False, soft_rad=math.inf
        )
        with MovingRenderer(scene, camera, effort=every) as renderer:
            truth = renderer.render(lights)
        hit = truth[..., 3] > 0
        for case, effort in EFFORTS.items():
            with MovingRenderer(scene, camera, effort=effort) as renderer:
                off = (renderer.render(lights) - truth)[hit, :3]
                start = time.process_time()
                for view in around:
                    # Other objects of the same shape: all triangles count as moved.
                    renderer.move(replace(scene), view)
                    renderer.render(lights)
                ms = 1e3 * (time.process_time() - start) / repeats
            error = math.sqrt(np.mean(off**2) / np.mean(truth[hit, :3] ** 2))
            row = _row(f"everything moves, {name}, CPU time", f"rays, {case}", ms)
            rows.append({**row, "accuracy": {"rel. RMSE": error}})
    return rows


def _roaming(repeats: int) -> list[dict[str, Any]]:
    """Error and CPU time as in `_moving`, of what stands; the light changes in every picture.

    With mirrors, which show other things here than there, it is the error beside lobes of 256 rays
    that no other pixel shares.
    """
    scene, camera = default_scene()
    around = [replace(camera, eye=camera.eye + 0.02 * step) for step in range(repeats)]
    rows = []
    every = Effort(
        key_lights=LIGHT_COUNT, key_share=0.0, key_rays=16, is_sparing=False, soft_rad=math.inf
    )
    matt = Material((0.6, 0.5, 0.4), specular=0.0)
    dull = replace(scene, meshes=tuple(replace(mesh, material=matt) for mesh in scene.meshes))
    with (
        RoamingRenderer(dull) as renderer,
        RoamingRenderer(scene) as with_mirrors,
        MovingRenderer(dull, camera, effort=every) as exact,
    ):

        def many_rays(lights: LightSet) -> NDArray[np.float32]:
            own, _ = reflected_map._points(256)
            with (
                patch.object(reflected_map, "_points", lambda _: (own, own)),
                patch.object(reflected_map, "add_shared_lobes", _add_own_lobes),
            ):
                return with_mirrors.render(camera, lights)

        for (name, lights), (kind, drawn, true) in itertools.product(
            light_cases().items(),
            (("matt", renderer, exact.render), ("mirrors", with_mirrors, many_rays)),
        ):
            truth = true(lights)
            hit = truth[..., 3] > 0
            off = (drawn.render(camera, lights) - truth)[hit, :3]
            start = time.process_time()
            for step, view in enumerate(around):
                drawn.render(view, replace(lights, irradiance=(1 + step) * lights.irradiance))
            ms = 1e3 * (time.process_time() - start) / repeats
            error = math.sqrt(np.mean(off**2) / np.mean(truth[hit, :3] ** 2))
            row = _row(f"camera moves, {name}, {kind}, CPU time", "points and rays", ms)
            rows.append({**row, "accuracy": {"rel. RMSE": error}})
    return rows


def _add_own_lobes(
    surfaces: NDArray[np.float32],
    lobes: NDArray[np.float32],
    rough_alpha2: float,
    picture: NDArray[np.float32],
) -> None:
    """As `add_shared_lobes`, of what each pixel saw by itself."""
    size_px = picture.shape[1], picture.shape[0]
    seen, saw = in_picture(surfaces, size_px), in_picture(lobes, size_px)
    mirrors = (seen[..., KIND] == GLOSSY) & (seen[..., ALPHA2] < rough_alpha2)
    for c in range(3):
        facing, grazing = saw[..., FACING + c], saw[..., GRAZING + c]
        reflected = seen[..., F0 + c] * facing + seen[..., F90] * grazing
        picture[mirrors, c] += reflected[mirrors]


def light_cases() -> dict[str, LightSet]:
    wide = _discs(LIGHT_COUNT, seed=0)
    irradiance, radius_rad = 0.3 * wide.irradiance, wide.angular_radius_rad.copy()
    irradiance[5], radius_rad[5] = (60.0, 55.0, 50.0), 0.005
    return {
        "64 points": random_lights(LIGHT_COUNT, seed=0),
        "64 discs of 10°": wide,
        "a sun and 63 discs": LightSet(wide.directions, irradiance, radius_rad),
    }


def _soft(context: moderngl.Context, repeats: int) -> list[dict[str, Any]]:
    ball = SphereScene(
        (0.0, 0.5, 0.0),
        0.5,
        Material((0.7, 0.5, 0.3), specular=0.0),
        Ground(0.0, (0.5, 0.4, 0.3), 20.0),
    )
    camera = Camera(np.array([1.0, 1.2, 2.5]), np.array([0.0, 0.4, 0.0]), 0.7, (160, 120))
    lights = replace(_discs(8, seed=2), fill=uniform_fill(0.3))
    truth = trace(ball, camera, as_points(lights, per_light=64, per_fill=512))
    inside = away_from_outlines(ball, camera)
    scene = Scene((sphere(ball.centre, ball.radius_m, ball.material, 64),), ball.ground)
    rows = []
    baked, drawn = BakedRenderer(scene, camera), Renderer(context, scene, camera)
    for system, made in (("baked", baked), ("shadow maps", drawn)):
        with made as renderer:
            ms = _median_ms(lambda: renderer.render(lights), repeats)
            off = (renderer.render(lights) - truth)[inside, :3]
        error = math.sqrt(np.mean(off**2) / np.mean(truth[inside, :3] ** 2))
        row = _row("sphere on a plane, 8 discs of 10° and a fill", system, ms)
        rows.append({**row, "accuracy": {"rel. RMSE": error}})
    return rows


def _discs(count: int, seed: int) -> LightSet:
    points = random_lights(count, seed, lowest=0.3)
    return LightSet(points.directions, points.irradiance, np.full(count, math.radians(10)))


def _peer(context: moderngl.Context, repeats: int) -> list[dict[str, Any]]:
    ball = SphereScene(
        (0.0, 0.5, 0.0),
        0.5,
        Material((0.7, 0.5, 0.3), specular=0.0),
        Ground(0.0, (0.5, 0.4, 0.3), 20.0),
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
