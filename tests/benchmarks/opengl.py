"""The OpenGL renderer where everything moves: for GPUs, and as it is on llvmpipe.

From picture to picture the camera goes round and every light turns by a degree, so that all shadow
maps, the G-buffer and the picture are drawn anew, streamed as a session would. ms is what a picture
takes from one to the next; where the processor draws, its CPU time. Parts are by the device's clock
and, issued, by the thread's. Accuracy is the relative RMSE against the traced reference under the
same lights. The system names the device.

Maps of large casters are drawn from proxies: what they save and what it takes to make them.

Mirrors: balls and a ring of metal around nothing but a map and its 64 lights, against the traced
reference under the map; what is brighter than all but 2 % of the truth is cut off there, or the
highlight of the sun would be all that counts.
"""

import math
import time
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from statistics import median
from typing import Any
from unittest.mock import patch

import moderngl
import numpy as np

from lighting.light_set import LightSet
from lighting.reduce import reduce_to_lights
from render.measures.chart_scenes import chart_maps
from render.measures.picture_errors import away_from_outlines
from render.moving.renderer import MovingRenderer
from render.opengl import hidden_sky
from render.opengl.context import create_context, describe, is_software
from render.opengl.picture_stream import PictureStream, StreamedPicture
from render.opengl.renderer import LARGEST_MAP_PX, Renderer, as_maps_see
from render.opengl.shadows import ATLAS_SIDE_PX, ShadowAtlas
from render.reference.tracing import render_reference
from render.scenes.casters import gather_casters
from render.scenes.default_scene import default_scene, sphere
from render.scenes.scene import Material
from render.scenes.shadow_proxies import shadow_proxy
from tests.render.light_sets import random_lights

_RADIUS_RAD = math.radians(10)
_STEP_RAD = math.radians(1)
_ERROR = 0.005  # of the reference


def run(repeats: int) -> list[dict[str, Any]]:
    """Return the rows of the stage, for `tests.benchmarks.bench`."""
    with create_context() as context:
        return [
            *_everything_moves(context, (640, 480), 64, 24, repeats),
            *_everything_moves(context, (640, 480), 64, 24, repeats, frame_rate_hz=10.0),
            *_everything_moves(context, (1920, 1080), 128, 48, max(repeats // 5, 3)),
            *_soft(context),
            *_proxies(context, repeats),
            *_mirrors(context),
        ]


def _everything_moves(
    context: moderngl.Context,
    size_px: tuple[int, int],
    light_count: int,
    warm_up: int,
    repeats: int,
    frame_rate_hz: float | None = None,
) -> Iterator[dict[str, Any]]:
    scene, camera = default_scene(size_px)
    discs = _discs(light_count, seed=0)
    clock = time.process_time if is_software(context) else time.perf_counter
    streamed: list[StreamedPicture] = []
    begun: list[float] = []
    with (
        Renderer(context, scene, camera) as renderer,
        PictureStream(context, renderer, frame_rate_hz) as stream,
    ):
        for k in range(repeats + warm_up):
            begun.append(clock())
            eye = camera.target + _turned(camera.eye - camera.target, k * _STEP_RAD)
            renderer.look_from(replace(camera, eye=eye))
            lights = replace(discs, directions=_turned(discs.directions, k * _STEP_RAD))
            picture = stream.draw(lights)
            if picture is not None:
                streamed.append(picture)
        streamed.extend(stream.rest())
    kept = streamed[warm_up:]  # the shaders are compiled, a controller has settled
    parts = {
        f"{part}, ms": median(each.device_ms[part] for each in kept) for part in kept[0].device_ms
    }
    issued_ms = median(sum(each.issue_ms.values()) for each in kept)
    case = f"everything moves, {size_px[0]}×{size_px[1]}, {light_count} discs of 10°"
    accuracy = {**parts, "issued, ms": issued_ms}
    if frame_rate_hz is not None:
        case += f", {frame_rate_hz:g} a second asked for"
        accuracy["maps a picture"] = kept[-1].most_maps
    yield {
        "stage": "opengl",
        "case": case,
        "system": describe(context),
        "ms": 1e3 * median(np.diff(begun[warm_up:])),
        "ratio": None,
        "accuracy": accuracy,
    }


def _soft(context: moderngl.Context) -> Iterator[dict[str, Any]]:
    scene, camera = default_scene((96, 72))
    wide = _discs(64, seed=0)
    irradiance, radius_rad = 0.3 * wide.irradiance, wide.angular_radius_rad.copy()
    irradiance[5], radius_rad[5] = (60.0, 55.0, 50.0), 0.005
    cases = {
        "64 discs of 10°": wide,
        "a sun and 63 discs": LightSet(wide.directions, irradiance, radius_rad),
        "one disc of 10°": LightSet(
            wide.directions[3:4], wide.irradiance[3:4], wide.angular_radius_rad[3:4]
        ),
    }
    matt = tuple(
        replace(mesh, material=replace(mesh.material, metalness=0.0, specular=0.0))
        for mesh in scene.meshes
    )
    scene = replace(scene, meshes=matt)
    for name, lights in cases.items():
        truth = render_reference(scene, camera, lights, error=_ERROR).radiance
        inside = truth[..., 3] == 1
        for interleaving in (1, 4):
            with Renderer(context, scene, camera, 2, interleaving) as renderer:
                renderer.render(lights)
                start = time.process_time()
                off = (renderer.render(lights) - truth)[inside, :3]
                ms = 1e3 * (time.process_time() - start)
            error = math.sqrt(np.mean(off**2) / np.mean(truth[inside, :3] ** 2))
            yield {
                "stage": "opengl",
                "case": f"soft shadows, {name}, 96×72 of 2×2, CPU time",
                "system": f"turns of {interleaving} × {interleaving}",
                "ms": ms,
                "ratio": None,
                "accuracy": {"rel. RMSE": error},
            }


def _proxies(context: moderngl.Context, repeats: int) -> Iterator[dict[str, Any]]:
    directions = _discs(64, seed=0).directions
    clock = time.process_time if is_software(context) else time.perf_counter
    shadow_proxy(gather_casters([sphere((0.0, 0.5, 0.0), 0.5, Material(), 8)]), 0.1)  # compiles
    for rings in (140, 500):
        full = gather_casters([sphere((0.0, 0.5, 0.0), 0.5, Material(), rings)])
        start = time.process_time()
        proxy = as_maps_see(full, LARGEST_MAP_PX)
        made_s = time.process_time() - start
        for name, casters, extra in (
            ("all triangles", full, {}),
            ("proxies", proxy, {"made in, s": made_s}),
        ):
            atlas = ShadowAtlas(context, casters, ATLAS_SIDE_PX, LARGEST_MAP_PX)
            times_s = []
            for k in range(1 + max(repeats // 10, 2)):
                start = clock()
                atlas.draw(_turned(directions, k * _STEP_RAD))
                context.finish()
                times_s.append(clock() - start)
            atlas.release()
            yield {
                "stage": "opengl",
                "case": f"64 shadow maps of a ball of {len(full.closed_faces):,} triangles",
                "system": name,
                "ms": 1e3 * min(times_s[1:]),
                "ratio": None,
                "accuracy": {"triangles": len(casters.closed_faces), **extra},
            }


def _mirrors(context: moderngl.Context) -> Iterator[dict[str, Any]]:
    maps = chart_maps(())
    bare, camera = default_scene((120, 90))
    inside = away_from_outlines(replace(bare, ground=None), camera)
    for name in ("indoor", "low sun"):
        lights = reduce_to_lights(maps[name], 64)
        for roughness in (0.1, 0.3, 0.6):
            metal = Material((0.95, 0.93, 0.88), roughness, metalness=1.0)
            meshes = tuple(replace(mesh, material=metal) for mesh in bare.meshes)
            scene = replace(bare, meshes=meshes, ground=None)
            truth = render_reference(scene, camera, maps[name], error=0.01, seconds=10.0).radiance
            true = truth[inside, :3]
            most = np.quantile(true, 0.98)
            true = np.minimum(true, most)
            nothing = patch.object(
                hidden_sky, "hidden_sky", lambda _, points, *__: np.zeros((len(points), 16), "f4")
            )
            for system, make, hides in (
                ("rays", lambda scene=scene: MovingRenderer(scene, camera), nullcontext()),
                ("OpenGL", lambda scene=scene: Renderer(context, scene, camera), nullcontext()),
                (
                    "OpenGL, hiding none",
                    lambda scene=scene: Renderer(context, scene, camera),
                    nothing,
                ),
            ):
                with hides, make() as renderer:
                    renderer.render(lights, maps[name])
                    start = time.process_time()
                    drawn = renderer.render(lights, maps[name])[inside, :3]
                    ms = 1e3 * (time.process_time() - start)
                off = np.minimum(drawn, most) - true
                yield {
                    "stage": "opengl",
                    "case": f"metals of roughness {roughness:g}, {name}, 120×90, CPU time",
                    "system": system,
                    "ms": ms,
                    "ratio": None,
                    "accuracy": {"rel. RMSE": math.sqrt(np.mean(off**2) / np.mean(true**2))},
                }


def _discs(count: int, seed: int) -> LightSet:
    points = random_lights(count, seed, lowest=0.3)
    return replace(points, angular_radius_rad=np.full(count, _RADIUS_RAD))


def _turned(vectors: np.ndarray, angle_rad: float) -> np.ndarray:
    """Return vectors (..., 3) turned about the vertical."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return vectors @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
