"""The reference renderer: time to a relative error of 1 %, and Mitsuba 3 as the peer.

512 × 512, the default scene made matt, and as it is; lit by the maps of the bundled recordings, and
by `esplanade` where it is at hand. Both give one bounce of direct light. Ours stops by itself;
Mitsuba's error is the spread of a few renders, and its time to 1 % follows from it: for independent
samples the error falls with the root of the time.
"""

import statistics
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import read_environment
from render.reference.passes import Rays
from render.reference.tracing import render_reference
from render.scenes.default_scene import default_scene
from render.scenes.scene import Camera, Material, Scene

ROOT = Path(__file__).resolve().parents[2]
ERROR = 0.01
SIZE_PX = (512, 512)
PEER_RENDERS, PEER_SAMPLES = 4, 32


def run(repeats: int) -> list[dict[str, Any]]:
    """Return the rows of the stage, for `tests.benchmarks.bench`."""
    scene, camera = default_scene(SIZE_PX)
    rows = []
    for kind, shown in (("matt", _matt(scene)), ("default scene", scene)):
        for name, environment in _maps().items():
            rows += _to_one_percent(f"{kind}, {name}", shown, camera, environment, repeats)
    return rows


def _maps() -> dict[str, EnvironmentMap]:
    files = {path.parts[-3]: path for path in sorted(ROOT.glob("recordings/*/truth/*.exr"))}
    files["esplanade"] = ROOT.parent / "shared/data/env-pmndrs/esplanade.exr"
    return {name: read_environment(path)[0] for name, path in files.items() if path.is_file()}


def _matt(scene: Scene) -> Scene:
    meshes = (
        replace(mesh, material=Material(mesh.material.base_colour, specular=0.0))
        for mesh in scene.meshes
    )
    return replace(scene, meshes=tuple(meshes))


def _to_one_percent(
    case: str, scene: Scene, camera: Camera, environment: EnvironmentMap, repeats: int
) -> list[dict[str, Any]]:
    def ours(**limits: Any) -> tuple[float, Any]:
        start = time.perf_counter()
        picture = render_reference(scene, camera, environment, **limits)
        return 1e3 * (time.perf_counter() - start), picture

    ours(error=1.0)  # compiles
    times, errors, rays = [], [], []
    for _ in range(max(repeats // 5, 1)):
        ms, picture = ours(error=ERROR)
        times.append(ms)
        errors.append(picture.relative_error)
        ms, picture = ours(error=0.0, seconds=0.0, spent=Rays(2, 64, 16))
        rays.append(picture.shadow_rays / ms / 1e3)
    ms = statistics.median(times)
    accuracy = {"rel. error": statistics.median(errors), "M shadow rays/s": statistics.median(rays)}
    peer = _peer(scene, camera, environment)
    if peer is None:
        return [_row(case, "fishlight", ms, None, accuracy)]
    name, peer_ms, error = peer
    to_error = peer_ms * (error / ERROR) ** 2
    return [
        _row(case, "fishlight", ms, to_error / ms, accuracy),
        _row(case, name, to_error, None, {"rel. error": ERROR}),
    ]


def _peer(
    scene: Scene, camera: Camera, environment: EnvironmentMap
) -> tuple[str, float, float] | None:
    """Return Mitsuba's variant, the time of one render in ms, and its relative error."""
    try:
        from tests.render import mitsuba_scene
    except ImportError:
        return None
    name = f"Mitsuba 3, {mitsuba_scene.use_variant()}"
    loaded = mitsuba_scene.load(scene, camera, environment)
    mitsuba_scene.render(loaded, PEER_SAMPLES, 0)  # compiles
    pictures, times = [], []
    for seed in range(PEER_RENDERS):
        start = time.perf_counter()
        pictures.append(mitsuba_scene.render(loaded, PEER_SAMPLES, seed + 1))
        times.append(1e3 * (time.perf_counter() - start))
    variance = np.var(pictures, axis=0, ddof=1).mean(dtype=np.float64)
    power = np.mean(np.mean(pictures, axis=0, dtype=np.float64) ** 2) - variance / PEER_RENDERS
    return name, statistics.median(times), float(np.sqrt(variance / power))


def _row(
    case: str, system: str, ms: float, ratio: float | None, accuracy: dict[str, float]
) -> dict[str, Any]:
    return {
        "stage": "reference",
        "case": case,
        "system": system,
        "ms": ms,
        "ratio": ratio,
        "accuracy": accuracy,
    }
