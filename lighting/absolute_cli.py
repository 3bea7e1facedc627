"""`fishlight illuminance`, `scale` and `recover`: maps in cd/m², and the lux that they imply."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from calibration.files import read_calibration
from capture.arguments import Output
from capture.errors import InputError
from capture.output import check_place
from capture.radiance import CD_M2
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import read_environment, write_environment
from lighting.photometry.absolute_scale import (
    grey_card_luminance,
    in_cd_m2,
    scale_from_illuminance,
    scale_from_luminance,
)
from lighting.photometry.clipped_source import recover_clipped
from lighting.photometry.illuminance import (
    FACINGS,
    Illuminance,
    sphere_illuminance,
    surface_illuminance,
)

Switch = Annotated[bool, Parameter(negative=())]
Triple = Annotated[str, Parameter(allow_leading_hyphen=True)]


def illuminance(environment: Path) -> None:
    """Print the illuminance that a map implies: horizontal, vertical to four sides, on a sphere.

    Parameters
    ----------
    environment
        A lat-long map, EXR or Radiance .hdr; in cd/m², or all is in its own relative unit.
    """
    for line in illuminance_lines(_read(environment)):
        print(line)


def scale(
    environment: Path,
    *,
    output: Output,
    luminance_cd_m2: float | None = None,
    grey_card: float | None = None,
    illuminance_lx: float | None = None,
    cd_m2_per_unit: float | None = None,
    direction: Triple | None = None,
    pixel: str | None = None,
    calibration: Path | None = None,
    radius_deg: float = 0.5,
    facing: Triple = "up",
    clipped_were_shaded: Switch = False,
    force: Switch = False,
) -> None:
    """Make a relative map absolute, in cd/m², by one measurement in the scene.

    Give one of: a spot's luminance (--luminance-cd-m2); a grey card (--grey-card 0.18) and the
    illuminance on it (--illuminance-lx); or an illuminance meter's reading (--illuminance-lx) and
    which way it faced. Spot and card lie at --direction, or at --pixel of the camera's picture.
    What is found holds for other maps of the same camera, lens and response (--cd-m2-per-unit).

    Parameters
    ----------
    environment
        The map, as `remap` makes it.
    output
        The map in cd/m², EXR.
    luminance_cd_m2
        What a luminance meter showed of a spot.
    grey_card
        The card's reflectance, from 0 to 1.
    illuminance_lx
        What an illuminance meter showed.
    cd_m2_per_unit
        What another map of this camera was found to have.
    direction
        X,Y,Z in the world.
    pixel
        X,Y in the camera's picture; needs --calibration.
    calibration
        The camera's calibration, JSON.
    radius_deg
        Half the angle of the meter's spot, or less than the card's.
    facing
        Of the illuminance meter: up, down, +X, -X, +Z, -Z, or X,Y,Z in the world.
    clipped_were_shaded
        The illuminance meter stood in the shade of what is clipped in the map.
    force
        Replace the output if it exists.
    """
    check_place(output, force=force)
    _refuse_without_unit(output)
    world = _read(environment)
    if grey_card is not None:
        if illuminance_lx is None or luminance_cd_m2 is not None:
            raise InputError("--grey-card needs --illuminance-lx, of the light on it, alone")
        luminance_cd_m2 = grey_card_luminance(grey_card, illuminance_lx)
        illuminance_lx = None
    given = [luminance_cd_m2, illuminance_lx, cd_m2_per_unit]
    if sum(each is not None for each in given) != 1:
        raise InputError(
            "give one of --luminance-cd-m2, --illuminance-lx (with --grey-card or without), and "
            "--cd-m2-per-unit"
        )
    note = ""
    if luminance_cd_m2 is not None:
        towards = _direction_of_spot(direction, pixel, calibration)
        with _about(environment):
            factor, unevenness = scale_from_luminance(
                world, towards, np.radians(radius_deg), luminance_cd_m2
            )
        note = f"; the spot and what is just beside it vary by {unevenness:.1%}"
    elif illuminance_lx is not None:
        if direction is not None or pixel is not None:
            raise InputError(
                "--direction and --pixel say where a spot or a card lies: give --luminance-cd-m2 "
                "or --grey-card; which way an illuminance meter faced is --facing"
            )
        normal = _parse_facing(facing)
        with _about(environment):
            factor = scale_from_illuminance(
                world, normal, illuminance_lx, clipped_were_shaded=clipped_were_shaded
            )
    elif cd_m2_per_unit is not None:
        factor = cd_m2_per_unit
    with _about(environment):
        absolute = in_cd_m2(world, factor)
    write_environment(output, absolute, force=force)
    print(f"{output}: {factor:.6g} cd/m² per unit{note}")
    for line in illuminance_lines(absolute):
        print(line)


def recover(
    environment: Path,
    *,
    output: Output,
    illuminance_lx: float,
    facing: Triple = "up",
    disc_deg: float = 0.533,
    spread: Switch = False,
    direction: Triple | None = None,
    force: Switch = False,
) -> None:
    """Give a map's clipped sun the light that a measured illuminance says it has.

    Parameters
    ----------
    environment
        The map, in cd/m².
    output
        The map with all its light, EXR.
    illuminance_lx
        What an illuminance meter showed, the sun shining on it.
    facing
        Which way it faced: up, down, +X, -X, +Z, -Z, or X,Y,Z in the world.
    disc_deg
        Diameter of the disc that the missing light is given to; the sun's if not given.
    spread
        Spread the light over all that is clipped instead, as for a lamp.
    direction
        X,Y,Z of the sun in the world, to 5°, where other things are clipped too. They stay so.
    force
        Replace the output if it exists.
    """
    check_place(output, force=force)
    _refuse_without_unit(output)
    world = _read(environment)
    normal = _parse_facing(facing)
    radius_rad = None if spread else np.radians(disc_deg / 2)
    towards = None if direction is None else _numbers(direction, 3, "--direction")
    with _about(environment):
        whole = recover_clipped(world, normal, illuminance_lx, radius_rad, towards)
    write_environment(output, whole, force=force)
    before = surface_illuminance(world, normal).total
    print(f"{output}: {illuminance_lx - before:.4g} of {illuminance_lx:.4g} lx were missing")
    for line in illuminance_lines(whole):
        print(line)


def illuminance_lines(environment: EnvironmentMap) -> list[str]:
    """Return what surfaces and a sphere receive, a line each, with what limits the numbers."""
    is_absolute = environment.scale == CD_M2
    unit = "lx" if is_absolute else f"({environment.scale})"
    lines = [
        _line(_name(facing), surface_illuminance(environment, normal), unit)
        for facing, normal in FACINGS.items()
    ]
    return [*lines, _line("on a sphere", sphere_illuminance(environment), unit)]


def _name(facing: str) -> str:
    return f"horizontal, {facing}" if facing in ("up", "down") else f"vertical, to {facing}"


def _line(name: str, received: Illuminance, unit: str) -> str:
    parts = [f"{name}: {received.total:.4g} {unit}"]
    if received.clipped_share > 0:
        parts.append(f"a lower bound, {received.clipped_share:.1%} of it from clipped cells")
    if received.unseen_share > 5e-4:
        parts.append(f"{received.unseen_share:.1%} of what it faces was not seen")
    return "; ".join(parts)


@contextmanager
def _about(path: Path) -> Iterator[None]:
    """Name the file in what is refused about its map."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _read(path: Path) -> EnvironmentMap:
    """Return the map of a file, and say what was amiss in it."""
    environment, cleaned = read_environment(path)
    for remark in cleaned.remarks:
        print(f"{path}: {remark}")
    return environment


def _refuse_without_unit(output: Path) -> None:
    if output.suffix.lower() != ".exr":
        raise InputError(f"{output}: wanted a file named .exr, which alone keeps the unit")


def _parse_facing(text: str) -> tuple[float, ...]:
    if text in FACINGS:
        return FACINGS[text]
    if "," not in text:
        raise InputError(f"--facing: wanted {', '.join(FACINGS)} or X,Y,Z, got {text!r}")
    return _numbers(text, 3, "--facing")


def _direction_of_spot(
    direction: str | None, pixel: str | None, calibration: Path | None
) -> tuple[float, ...]:
    if (direction is None) == (pixel is None):
        raise InputError("where the spot lies: give either --direction X,Y,Z or --pixel X,Y")
    if direction is not None:
        return _numbers(direction, 3, "--direction")
    if pixel is None or calibration is None:
        raise InputError("--pixel needs the --calibration that the map was made with")
    towards, seen = read_calibration(calibration).unproject(_numbers(pixel, 2, "--pixel"))
    if not seen:
        raise InputError(f"--pixel {pixel}: {calibration} says that the camera sees nothing there")
    return tuple(towards.tolist())


def _numbers(text: str, count: int, flag: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count:
        raise InputError(f"{flag}: wanted {count} numbers with commas between, got {text!r}")
    return numbers
