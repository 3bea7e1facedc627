"""What `render --reference` does: traces the picture and writes it with its error."""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from capture.errors import InputError
from capture.exr import write_exr
from lighting.light_files import read_lights
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import read_environment
from render.output.pictures import write_picture
from render.rays.background import look_up, map_coordinates, picture_rays
from render.reference.tracing import ReferencePicture, render_reference
from render.scenes.scene import Camera, Scene

DEFAULT_ERROR = 0.01

_BACKGROUND_SAMPLES = 2  # per axis of a pixel


def read_light(
    lights: Path | None, environment: Path | None
) -> tuple[LightSet | EnvironmentMap, str]:
    """Return the light of the one file that is given, and what it is."""
    if (lights is None) == (environment is None):
        raise InputError("--reference needs the light: give either --lights or --map")
    if lights is not None:
        light_set = read_lights(lights)
        return light_set, f"lights {len(light_set)}"
    assert environment is not None
    read, _ = read_environment(environment)
    return read, f"map {2 * read.height}×{read.height}"


def trace_picture(
    scene: Scene,
    camera: Camera,
    light: LightSet | EnvironmentMap,
    background: EnvironmentMap | None,
    error: float | None,
    seconds: float | None,
) -> ReferencePicture:
    """Return the reference picture, in front of a map if there is one, and show how far it is.

    Raises
    ------
    InputError
        If the error or the time is not positive.
    """
    for flag, limit in (("--error", error), ("--seconds", seconds)):
        if limit is not None and not 0 < limit < math.inf:
            raise InputError(f"{flag} must be above 0, got {limit}")
    if error is None:
        error = DEFAULT_ERROR if seconds is None else 0.0
    with Console(stderr=True).status("tracing") as status:
        picture = render_reference(
            scene,
            camera,
            light,
            error=error,
            seconds=math.inf if seconds is None else seconds,
            on_pass=lambda passes, now: status.update(f"pass {passes}, error {now:.2%}"),
        )
    if background is not None:
        clear = 1 - picture.radiance[..., 3:]
        picture.radiance[..., :3] += clear * _seen_behind(background, camera)
    return picture


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
