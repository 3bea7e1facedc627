"""The reference renderer: time to a relative error of 1 %, and Mitsuba 3 as the peer.

512 × 512, the diffuse, glossy and mixed scene of `fishlight chart estimators` under its three maps,
and under captured ones where they are at hand. All give direct light only: ours `--reference` and
`--estimator` of the name told, Mitsuba's `direct` and `path` of depth 2. Times are CPU time of all
threads over the number of cores, so that a busy machine changes them little. `--reference` draws
until it says 1 %. Others' passes and samples are independent, so their time to 1 % follows from a
larger error: their time × (error / 1 %)²; that of estimators is what they say, of Mitsuba the
spread of a few renders. What is prepared before the first pass counts for ours, not for Mitsuba.
`times what it says` is what our two pictures differ by, over what they say that they err by
together; `off Mitsuba` is what blocks of 16 × 16 pixels differ by from the mean of its renders,
freed of what both spread by as if pixels erred independently, which ours do not quite.

Mitsuba's fastest variant that runs is taken: `llvm_ad_rgb` is five times as fast as `scalar_rgb`.
Where only the latter runs, Mitsuba is left out: the BRDF that is written for it takes minutes.
"""

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import read_environment
from render.comparison.scenes import comparison_scenes
from render.estimators.passes import estimate_picture
from render.estimators_chart_cli import DEFAULT_MAPS
from render.measures.chart_scenes import View, chart_maps
from render.reference.tracing import ReferencePicture, render_reference

CAPTURED = Path(__file__).resolve().parents[2].parent / "shared/data/env-pmndrs"
CAPTURED_MAPS = ("esplanade", "hall")
ERROR = 0.01
SIZE_PX = (512, 512)
OURS: dict[str, tuple[Callable[..., ReferencePicture], float]] = {
    "reference": (render_reference, ERROR),
    "shared-product": (partial(estimate_picture, "shared-product"), 2 * ERROR),
}
"""What draws, and to which error."""
PEER_RENDERS, PEER_SAMPLES = 4, 16
BLOCK_PX = 16

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Peer:
    """Renders of Mitsuba's (n, H, W, 3), and the least CPU time of one."""

    pictures: Floats
    ms: float

    @property
    def error(self) -> float:
        """Relative error of one render."""
        return _relative_spread(self.pictures)


def run(_repeats: int) -> list[dict[str, Any]]:
    """Return the rows of the stage, for `tests.benchmarks.bench`."""
    llvm = _mitsuba_by_llvm()
    rows = []
    for map_name, environment in _maps().items():
        for scene_name, view in comparison_scenes(SIZE_PX).items():
            rows += _to_one_percent(f"{scene_name}, {map_name}", view, environment, llvm)
    return rows


def _maps() -> dict[str, EnvironmentMap]:
    made = chart_maps(())
    files = {name: CAPTURED / f"{name}.exr" for name in CAPTURED_MAPS}
    captured = {name: read_environment(path)[0] for name, path in files.items() if path.is_file()}
    return {name: made[name] for name in DEFAULT_MAPS} | captured


def _to_one_percent(
    case: str, view: View, environment: EnvironmentMap, mitsuba: Any
) -> list[dict[str, Any]]:
    drawn = {name: _timed(*ours, view, environment) for name, ours in OURS.items()}
    first, second = (picture for picture, *_ in drawn.values())
    power = np.mean(first.radiance[..., :3].astype(np.float64) ** 2)
    told = math.hypot(first.relative_error, second.relative_error)
    apart = np.mean((first.radiance - second.radiance)[..., :3].astype(np.float64) ** 2)
    peers = {} if mitsuba is None else _peers(mitsuba, view, environment)
    to_error = {name: _ms_to_error(peer.ms, peer.error) for name, peer in peers.items()}
    rows = []
    for name, (picture, drawn_ms, clock_s) in drawn.items():
        ms = _ms_to_error(drawn_ms, max(picture.relative_error, ERROR))
        accuracy = {
            "rel. error": picture.relative_error,
            "times what it says": math.sqrt(apart / power) / told,
            "s on the clock": clock_s,
            "M shadow rays": picture.shadow_rays / 1e6,
        }
        if peers:
            accuracy["off Mitsuba"] = _off(picture, list(peers.values()))
        ratio = min(to_error.values()) / ms if peers else None
        rows.append(_row(case, f"fishlight, {name}", ms, ratio, accuracy))
    for name, ms in to_error.items():
        rows.append(_row(case, f"Mitsuba 3 llvm_ad_rgb, {name}", ms, None, {"rel. error": ERROR}))
    return rows


def _timed(
    draw: Callable[..., ReferencePicture], error: float, view: View, environment: EnvironmentMap
) -> tuple[ReferencePicture, float, float]:
    """Return the picture, its time in ms and its seconds on the clock."""
    draw(view[0], comparison_scenes((32, 32))["mixed"][1], environment, error=1.0)  # compiles
    clock_s = time.perf_counter()
    cpu_ms = _cpu_ms()
    picture = draw(*view, environment, error=error)
    return picture, _cpu_ms() - cpu_ms, time.perf_counter() - clock_s


def _peers(mitsuba: Any, view: View, environment: EnvironmentMap) -> dict[str, Peer]:
    loaded = mitsuba.load(*view, environment)
    peers = {}
    for name in mitsuba.INTEGRATORS:
        mitsuba.render(loaded, PEER_SAMPLES, 0, name)  # compiles
        pictures, times = [], []
        for seed in range(PEER_RENDERS):
            start = _cpu_ms()
            pictures.append(mitsuba.render(loaded, PEER_SAMPLES, seed + 1, name))
            times.append(_cpu_ms() - start)
        peers[name] = Peer(np.stack(pictures), min(times))
    return peers


def _mitsuba_by_llvm() -> Any:
    """Return the module that draws with Mitsuba, None where its LLVM variant does not run."""
    try:
        from tests.render import mitsuba_scene
    except ImportError:
        return None
    return mitsuba_scene if mitsuba_scene.use_variant().startswith("llvm") else None


def _off(ours: ReferencePicture, peers: list[Peer]) -> float:
    """Return by how much blocks of pixels differ, over the picture; what is noise is taken off."""
    theirs = np.stack([_blocks(each) for peer in peers for each in peer.pictures])
    mean, noise = theirs.mean(axis=0), np.var(theirs, axis=0, ddof=1).mean() / len(theirs)
    own = _blocks(ours.standard_error.astype(np.float64) ** 2).mean() / BLOCK_PX**2
    square = np.mean((_blocks(ours.radiance[..., :3]) - mean) ** 2) - noise - own
    return math.sqrt(max(square, 0.0) / np.mean(mean**2))


def _blocks(picture: NDArray[Any]) -> NDArray[np.float64]:
    height, width = (length // BLOCK_PX for length in picture.shape[:2])
    parts = picture.reshape(height, BLOCK_PX, width, BLOCK_PX, 3)
    return parts.mean(axis=(1, 3), dtype=np.float64)


def _relative_spread(pictures: Floats) -> float:
    variance = np.var(pictures, axis=0, ddof=1, dtype=np.float64).mean()
    power = np.mean(np.mean(pictures, axis=0, dtype=np.float64) ** 2) - variance / len(pictures)
    return float(np.sqrt(variance / power))


def _ms_to_error(ms: float, error: float) -> float:
    """Return the time to `ERROR` of what errs by `error` after a time."""
    return ms * (error / ERROR) ** 2


def _cpu_ms() -> float:
    return 1e3 * time.process_time() / len(os.sched_getaffinity(0))


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
