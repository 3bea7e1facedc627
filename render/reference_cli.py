"""What `render --reference` does: traces the picture and writes it with its error."""

import math
import time
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import Progress as ProgressBar

from capture.errors import InputError
from capture.exr import write_exr
from lighting.light_files import read_lights
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import read_environment
from render.estimators.passes import estimate_picture
from render.estimators.registry import PATHS, UNBIASED
from render.output.pictures import write_picture
from render.rays.background import look_up, map_coordinates, picture_rays
from render.reference.accumulation import Progress, nothing_yet
from render.reference.checkpoint import checkpoint_of, read_checkpoint, write_checkpoint
from render.reference.digest import digest_of
from render.reference.tracing import ReferencePicture, render_reference
from render.scenes.scene import Camera, Scene

DEFAULT_ERROR = 0.01
KEPT_EVERY_S = 5.0
"""How often what is traced so far is written, and so the most that an interruption loses."""

_BACKGROUND_SAMPLES = 2  # per axis of a pixel


def read_light(
    lights: Path | None, environment: Path | None
) -> tuple[LightSet | EnvironmentMap, str]:
    """Return the light of the one file that is given, and what it is; say what was amiss in it."""
    if (lights is None) == (environment is None):
        raise InputError("--reference needs the light: give either --lights or --map")
    if lights is not None:
        light_set = read_lights(lights)
        return light_set, f"lights {len(light_set)}"
    assert environment is not None
    read, cleaned = read_environment(environment)
    for remark in cleaned.remarks:
        print(f"  {environment}: {remark}")
    return read, f"map {2 * read.height}×{read.height}"


def trace_picture(
    output: Path,
    scene: Scene,
    camera: Camera,
    light: LightSet | EnvironmentMap,
    estimator: str | None,
    error: float | None,
    seconds: float | None,
    bounces: int | None,
) -> ReferencePicture:
    """Return the reference picture, or that of an estimator, and show how far it is.

    What it has so far is kept beside the output: a picture that was interrupted goes on. Call
    `drop_checkpoint` once the output is written.

    Raises
    ------
    InputError
        If the error or the time is not positive, there is no such estimator or it does not follow
        light so far, or nothing can be written beside the output.
    """
    for flag, limit in (("--error", error), ("--seconds", seconds)):
        if limit is not None and not 0 < limit < math.inf:
            raise InputError(f"{flag} must be above 0, got {limit}")
    if error is None:
        error = DEFAULT_ERROR if seconds is None else 0.0
    if bounces is not None and estimator is None:
        estimator = PATHS
    light_meets = 1 if bounces is None else bounces
    limit_s = math.inf if seconds is None else seconds
    place = checkpoint_of(output)
    digest = digest_of(version("fishlight"), scene, camera, light, estimator, light_meets)
    known = read_checkpoint(place, digest)
    if known is None:
        known = nothing_yet(camera.size_px)
    else:
        print(f"{place}: goes on from {_how_far(known)}")
    with _bar() as bar:
        shown = bar.add_task("tracing", total=1.0)
        kept_s = time.monotonic()

        def keep_and_show(now: Progress) -> None:
            nonlocal kept_s
            if time.monotonic() > kept_s + KEPT_EVERY_S:
                write_checkpoint(place, now, digest)
                kept_s = time.monotonic()
            if now.relative_error > error:
                done = max((error / now.relative_error) ** 2, now.elapsed_s / limit_s)
            else:
                done = 1.0
            bar.update(shown, completed=done, description=_how_far(now))

        render = (
            render_reference
            if estimator is None
            else partial(estimate_picture, estimator, bounces=light_meets)
        )
        return render(
            scene, camera, light, error=error, seconds=limit_s, progress=known,
            on_pass=keep_and_show,
        )  # fmt: skip


def remark_on(estimator: str | None) -> str:
    """Return what to say of an estimator whose passes all err alike, "" of any other."""
    if estimator is None or estimator in UNBIASED:
        return ""
    return " of its noise (what its lights leave out is not told)"


def drop_checkpoint(output: Path) -> None:
    """Remove what was kept of a picture: it is written, or not wanted."""
    checkpoint_of(output).unlink(missing_ok=True)


def put_in_front(picture: ReferencePicture, background: EnvironmentMap, camera: Camera) -> None:
    """Add the map to the picture where the scene does not cover it."""
    clear = 1 - picture.radiance[..., 3:]
    picture.radiance[..., :3] += clear * _seen_behind(background, camera)


def write_reference(
    path: Path, picture: ReferencePicture, exposure_ev: float, *, force: bool
) -> None:
    """Write the picture; an EXR has its standard error as a layer, `standard_error.R`, G and B."""
    if path.suffix.lower() == ".exr":
        layers = {name: picture.radiance[..., c] for c, name in enumerate("RGBA")}
        for c, name in enumerate("RGB"):
            layers[f"standard_error.{name}"] = picture.standard_error[..., c]
        write_exr(path, layers, {"relative_error": picture.relative_error}, force=force)
    else:
        write_picture(path, picture.radiance, exposure_ev, force=force)


def _seen_behind(background: EnvironmentMap, camera: Camera) -> NDArray[np.float32]:
    """Return the map as the camera sees it, (H, W, 3)."""
    n = _BACKGROUND_SAMPLES
    width, height = camera.size_px
    rays = picture_rays(camera, (n * width, n * height)).reshape(-1, 3)
    seen = np.zeros((len(rays), 3), np.float32)
    at = map_coordinates(rays)
    look_up(np.ascontiguousarray(background.radiance), at, np.arange(len(rays)), seen)
    return seen.reshape(height, n, width, n, 3).mean(axis=(1, 3), dtype=np.float32)


def _how_far(progress: Progress) -> str:
    known = math.isfinite(progress.relative_error)
    error = f", error {progress.relative_error:.2%}" if known else ""
    return f"pass {progress.passes}{error}"


def _bar() -> ProgressBar:
    """Return a bar on a terminal, and nothing anywhere else."""
    console = Console(stderr=True)
    return ProgressBar(console=console, transient=True, disable=not console.is_terminal)
