"""`fishlight export`: lights and maps for other programs."""

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from capture.arguments import Output
from capture.errors import InputError
from capture.output import check_place
from capture.radiance import Cleaned
from capture.radiance_files import HDR_SUFFIXES
from lighting.export.files import SCENE_SUFFIXES, write_map, write_scene
from lighting.export.orientation import Convention
from lighting.export.rig import light_rig
from lighting.light_files import read_lights
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import read_environment


def export(
    lights: Path | None = None,
    *,
    output: Output,
    map_path: Annotated[Path | None, Parameter(name="--map")] = None,
    convention: Convention | None = None,
    force: bool = False,
) -> None:
    """Write lights for another program, or a map in its convention.

    With the map that the lights were found in, the key lights are written, and the map without
    them as a dome. Without it, or without key lights, all lights are, and their fill as a dome.

    Parameters
    ----------
    lights
        The lights, lights.json. Left out if the output is a map.
    output
        A scene: .usda, .gltf, .glb, .py (a script for Blender) or .rad (Radiance).
        Or a map: .exr or .hdr.
    map_path
        The lat-long map that the lights come from, or the one to convert; EXR or Radiance .hdr.
    convention
        Of the map that is written, without its marks of unseen and clipped cells: exr, mitsuba,
        usd, blender or three. A scene's dome has the one of the scene's format.
    force
        Replace the output if it exists.
    """
    suffix = output.suffix.lower()
    if suffix not in (*SCENE_SUFFIXES, *HDR_SUFFIXES):
        raise InputError(
            f"{output}: wanted a scene named {', '.join(SCENE_SUFFIXES)}, "
            f"or a map named {', '.join(sorted(HDR_SUFFIXES))}"
        )
    check_place(output, force=force)
    if suffix in HDR_SUFFIXES:
        if lights is not None or map_path is None or convention is None:
            raise InputError(
                f"{output}: a map is made from --map and --convention, and takes no lights"
            )
        _export_map(map_path, output, convention, force=force)
        return
    if lights is None:
        raise InputError(f"{output}: wanted lights to write, such as `fishlight lights` makes")
    if convention is not None:
        raise InputError(
            f"{output}: --convention is for maps; the dome of a {suffix} scene has its own"
        )
    _export_scene(lights, map_path, output, force=force)


def _export_map(map_path: Path, output: Path, convention: Convention, *, force: bool) -> None:
    environment, cleaned = read_environment(map_path)
    write_map(output, environment, convention, force=force)
    print(f"{output}: {2 * environment.height}×{environment.height}, as {convention} takes it")
    _print_marks(environment, cleaned)


def _export_scene(lights: Path, map_path: Path | None, output: Path, *, force: bool) -> None:
    light_set = read_lights(lights)
    environment, cleaned = (None, None) if map_path is None else read_environment(map_path)
    rig = light_rig(light_set, environment)
    dome_path = write_scene(output, rig, force=force)

    dome = "no dome" if dome_path is None else f"the dome {dome_path.name}"
    print(f"{output}: lights: {len(rig.lights)}, and {dome}")
    print(f"  ∫ L dω in red, green, blue ({light_set.scale} × sr):")
    in_dome = np.zeros(3) if rig.dome is None else rig.dome.integral()
    in_lights = rig.lights.integral()
    energies = {"lights": in_lights, "dome": in_dome, "sum": in_lights + in_dome}
    if environment is not None:
        energies["map"] = environment.integral()
    for name, rgb in energies.items():
        print(f"    {name:<6} " + " ".join(f"{value:10.4g}" for value in rgb))
    if np.any(rig.missing > 1e-3 * in_lights):
        share = rig.missing.sum() / in_lights.sum()
        print(f"  {share:.1%} of the lights was not in the map where they stand: is it theirs?")
    if light_set.clipped_fraction > 0:
        print(
            f"  {light_set.clipped_fraction:.1%} of the light comes from clipped cells: "
            "the lights are a lower bound"
        )
    if environment is None or cleaned is None:
        return
    if rig.lights.is_key.any():
        _print_marks(environment, cleaned)
    else:
        print("  no key lights: the lights stand for all of the map, which is not written")


def _print_marks(environment: EnvironmentMap, cleaned: Cleaned) -> None:
    """Print what the exported map does not tell: its file has no marks."""
    if environment.seen_share < 1 - 1e-9:
        print(
            f"  {1 - environment.seen_share:.1%} of all directions were not seen: "
            "there the map holds what `fishlight remap --fill` put"
        )
    if environment.clipped.any():
        print(f"  {environment.clipped.sum()} cells are clipped: their radiance is a lower bound")
    for remark in cleaned.remarks:
        print(f"  {remark}")
