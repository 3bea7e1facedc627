"""Export on disk: a scene in the format its suffix names, its dome's map beside it; maps alone.

Maps are written without the marks (valid, clipped), as colours only: Mitsuba 3 refuses an
environment map that has other channels.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from capture.errors import InputError
from capture.output import replacing
from capture.radiance_files import write_hdr
from lighting.export.blender import to_blender
from lighting.export.gltf import to_glb, to_gltf
from lighting.export.orientation import Convention, in_convention
from lighting.export.radiance import to_radiance
from lighting.export.rig import DomeFile, LightRig
from lighting.export.usd import to_usda
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap


@dataclass(frozen=True)
class _Format:
    """How a scene is written, and in what convention and kind of file its dome."""

    encode: Callable[[LightSet, DomeFile | None], bytes]
    convention: Convention
    dome_suffix: str = ".exr"


_FORMATS = {
    ".usda": _Format(to_usda, "usd"),
    ".gltf": _Format(to_gltf, "three"),
    ".glb": _Format(to_glb, "three"),
    ".py": _Format(to_blender, "blender"),
    ".rad": _Format(to_radiance, "exr", ".hdr"),  # Radiance reads no OpenEXR
}

SCENE_SUFFIXES = tuple(_FORMATS)


def write_scene(path: Path, rig: LightRig, *, force: bool = False) -> Path | None:
    """Write the lights to `path`, and their dome beside it; return the dome's path, or None.

    The dome's file has the scene's whole name before its own suffix (`scene.usda.dome.exr`), for
    domes of other formats have other conventions. The scene appears after its dome, or not at all.

    Raises
    ------
    InputError
        If the suffix is none of SCENE_SUFFIXES, a file exists and `force` is not set, the folder
        does not exist, a dome's name would break the scene's text, or it cannot be turned.
    """
    try:
        scene_format = _FORMATS[path.suffix.lower()]
    except KeyError:
        wanted = ", ".join(SCENE_SUFFIXES)
        raise InputError(f"{path}: wanted a scene named {wanted}") from None
    dome_path = path.with_name(f"{path.name}.dome{scene_format.dome_suffix}")
    if rig.dome is None:
        with replacing(path, force=force) as partial:
            partial.write_bytes(scene_format.encode(rig.lights, None))
        return None
    if set(dome_path.name) & set('"@') or not dome_path.name.isprintable():
        raise InputError(
            f"{str(path)!a}: a scene with a dome needs a name that it can be found by: "
            "without quotes, @ and what cannot be printed"
        )
    with replacing(path, force=force) as partial:
        dome_file = DomeFile(dome_path.name, rig.dome.height)
        partial.write_bytes(scene_format.encode(rig.lights, dome_file))
        write_map(dome_path, rig.dome, scene_format.convention, force=force)
    return dome_path


def write_map(
    path: Path, environment: EnvironmentMap, convention: Convention, *, force: bool = False
) -> None:
    """Write a map's colours to an .exr or .hdr file, in another program's convention.

    Raises
    ------
    InputError
        If the suffix is neither, the file exists and `force` is False, or the map has an odd number
        of rows and would have to be turned by a quarter.
    """
    converted = in_convention(environment, convention)
    write_hdr(path, converted.radiance, scale=converted.scale, force=force)
