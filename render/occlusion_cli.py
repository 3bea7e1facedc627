"""What `render --ao` does: ambient occlusion alone, as a layer to multiply others with.

It is drawn as a picture, or baked into the vertices of the meshes.
"""

import math
from pathlib import Path

import numpy as np

from capture.errors import InputError
from capture.exr import write_exr
from capture.pictures import write_png
from capture.sensor import srgb_encode
from render.output.pictures import PICTURE_SUFFIXES
from render.reference.ambient_occlusion import ambient_occlusion, vertex_occlusion
from render.scenes.mesh_writer import write_ply
from render.scenes.scene import Camera, Scene

WHOLE_CONE_DEG = 180.0
OCCLUSION_SUFFIXES = (*PICTURE_SUFFIXES, ".ply")


def write_occlusion(
    path: Path,
    scene: Scene,
    camera: Camera,
    cone_deg: float | None,
    max_distance_m: float | None,
    *,
    force: bool,
) -> str:
    """Write ambient occlusion, and return what it is.

    A picture is grey, with the coverage as alpha: an .exr holds it as it is, a .png sRGB-coded.
    A .ply holds the scene's meshes, and it as their vertices' colours.
    """
    cone_deg = WHOLE_CONE_DEG if cone_deg is None else cone_deg
    distance_m = math.inf if max_distance_m is None else max_distance_m
    cone_rad = math.radians(cone_deg)
    if path.suffix.lower() == ".ply":
        mean, of_what = _bake(path, scene, cone_rad, distance_m, force=force)
    else:
        mean, of_what = _draw(path, scene, camera, cone_rad, distance_m, force=force)
    limit = "" if max_distance_m is None else f", up to {max_distance_m:g} m"
    return f"ambient occlusion{of_what}, cone {cone_deg:g}°{limit}, mean {mean:.3f}"


def check_occlusion_suffix(path: Path) -> None:
    """Raise InputError unless `path` ends in a suffix that `write_occlusion` knows."""
    if path.suffix.lower() not in OCCLUSION_SUFFIXES:
        raise InputError(
            f"{path}: ambient occlusion is written as {', '.join(PICTURE_SUFFIXES)}, or as .ply "
            "of each vertex"
        )


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


def _draw(
    path: Path, scene: Scene, camera: Camera, cone_rad: float, distance_m: float, *, force: bool
) -> tuple[float, str]:
    """Write a picture; return the mean over what it shows, and no more to say."""
    seen = ambient_occlusion(scene, camera, cone_rad, distance_m)
    openness, coverage = seen[..., 0], seen[..., 1]
    if path.suffix.lower() == ".exr":
        write_exr(path, {**dict.fromkeys("RGB", openness), "A": coverage}, {}, force=force)
    else:
        channels = [*3 * [srgb_encode(openness)], coverage]
        picture = np.rint(255 * np.stack(channels, axis=-1)).astype(np.uint8)
        write_png(path, picture, force=force)
    covered = coverage > 0
    return float(openness[covered].mean()) if covered.any() else 0.0, ""


def _bake(
    path: Path, scene: Scene, cone_rad: float, distance_m: float, *, force: bool
) -> tuple[float, str]:
    """Write the meshes; return the mean over their vertices, and of how many."""
    openness = np.concatenate(vertex_occlusion(scene, cone_rad, distance_m))
    write_ply(path, scene.meshes, np.repeat(openness[:, None], 3, axis=1), force=force)
    return float(openness.mean()), f" of {len(openness)} vertices"
