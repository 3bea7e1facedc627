"""What `render --ao` does: draws ambient occlusion alone, as a layer to multiply others with."""

import math
from pathlib import Path

import numpy as np

from capture.errors import InputError
from capture.exr import write_exr
from capture.pictures import write_png
from capture.sensor import srgb_encode
from render.reference.ambient_occlusion import ambient_occlusion
from render.scenes.scene import Camera, Scene

WHOLE_CONE_DEG = 180.0


def draw_occlusion(
    path: Path,
    scene: Scene,
    camera: Camera,
    cone_deg: float | None,
    max_distance_m: float | None,
    *,
    force: bool,
) -> str:
    """Write ambient occlusion, grey and with the coverage as alpha, and return what it is.

    An .exr holds it as it is, a .png sRGB-coded.
    """
    cone_deg = WHOLE_CONE_DEG if cone_deg is None else cone_deg
    distance_m = math.inf if max_distance_m is None else max_distance_m
    seen = ambient_occlusion(scene, camera, math.radians(cone_deg), distance_m)
    openness, coverage = seen[..., 0], seen[..., 1]
    if path.suffix.lower() == ".exr":
        write_exr(path, {**dict.fromkeys("RGB", openness), "A": coverage}, {}, force=force)
    else:
        channels = [*3 * [srgb_encode(openness)], coverage]
        picture = np.rint(255 * np.stack(channels, axis=-1)).astype(np.uint8)
        write_png(path, picture, force=force)
    covered = coverage > 0
    mean = float(openness[covered].mean()) if covered.any() else 0.0
    limit = "" if max_distance_m is None else f", up to {max_distance_m:g} m"
    return f"ambient occlusion, cone {cone_deg:g}°{limit}, mean {mean:.3f}"


def check_occlusion_flags(
    ao: bool, cone_deg: float | None, max_distance_m: float | None, *, has_others: bool
) -> None:
    """Raise InputError for what only `--ao` takes, without it, and for flags of light with it."""
    if not ao and (cone_deg is not None or max_distance_m is not None):
        raise InputError("--cone-deg and --max-distance-m are for --ao")
    if ao and has_others:
        raise InputError(
            "--ao is drawn without light: leave out --lights, --map, --background, --exposure-ev, "
            "--reference, and what goes with that"
        )
