"""`fishlight calibrate colour`: a camera's colours, from its picture of a ColorChecker."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from cyclopts import Parameter

from capture.arguments import Output, WholeNumber, parse_exposures, tell
from capture.bracket_sources import read_bracket
from capture.errors import InputError
from capture.manifest import SensorRecord, sensor_record
from capture.output import check_place, write_json
from capture.sensor_files import SCHEMA, read_sensor


class ColourRecord(msgspec.Struct, frozen=True):
    """A colour calibration, in the schema of `calibrate response`: merging needs its `sensor`."""

    schema: str
    source: str
    light: str
    form: str
    delta_e_before: float
    delta_e: float
    worst_delta_e: float
    tried: dict[str, float]
    patches: list[list[float]]
    sensor: SensorRecord


def calibrate_colour(
    *sources: Path,
    output: Output,
    corners: str | None = None,
    light: str = "D65",
    exposures: str | None = None,
    bracket: WholeNumber = 0,
    response: Path | None = None,
    force: Annotated[bool, Parameter(negative=())] = False,
) -> None:
    """Estimate the matrix from a camera's colours to Rec.709, from a picture of a ColorChecker.

    The chart has to be evenly lit, near the picture's middle, and in the light that --light names:
    of that light it is known what colours the patches have, so that other lights keep theirs.
    `merge --response` then uses the result, in Rec.709, Rec.2020 or ACEScg.

    Parameters
    ----------
    sources
        A recording; or photographs, or a folder of them; of a chart with 24 patches.
    output
        A JSON file for the sensor with its matrix.
    corners
        The centres of the corner patches in pixels, "x,y x,y x,y x,y": dark skin, bluish green,
        black, white. Without it the chart is searched for.
    light
        What lit the chart: D65, D50, A (a filament), FL2 (a fluorescent tube), LED-B3 or another
        name of colour-science's; or its CIE "x,y", which says less of what it does to colours.
    exposures
        Exposure times in seconds, as for `import`; not for a recording.
    bracket
        Which bracket, from 0.
    response
        The camera's response, as `calibrate response` writes it.
    force
        Replace the output if it exists.
    """
    # Here, so that no other command waits for OpenCV and colour-science.
    from calibration.colour_chart import NEUTRALS, find_corners, measure_patches, reference_colours
    from calibration.colour_matrix import fit_colours
    from capture.merge import merge_bracket

    check_place(output, force=force)
    white_xy, spectrum = _white(light)
    measured = None if response is None else read_sensor(response)
    times_s = None if exposures is None else parse_exposures(exposures)
    chosen, sensor, notes = read_bracket(sources, times_s, bracket, measured)
    tell(notes)
    image = merge_bracket(chosen, replace(sensor, colour_matrix=None, primaries="rec709"))
    corners_px = find_corners(image) if corners is None else _parse_corners(corners)
    patches = measure_patches(image, corners_px)
    old = np.eye(3) if sensor.colour_matrix is None else sensor.colour_matrix
    fit = fit_colours(patches, reference_colours(white_xy, spectrum), NEUTRALS, old)
    calibrated = replace(
        sensor,
        colour_matrix=fit.matrix,
        source=f"{sensor.source}, colours by a ColorChecker under {light}",
    )
    record = ColourRecord(
        schema=SCHEMA,
        source=", ".join(path.name for path in sources),
        light=light,
        form=fit.form,
        delta_e_before=fit.before,
        delta_e=fit.after,
        worst_delta_e=fit.worst,
        tried={each.form: each.held_out for each in fit.trials},
        patches=patches.tolist(),
        sensor=sensor_record(calibrated),
    )
    write_json(output, record, force=force)
    print(
        f"{output}: {fit.form}; ΔE00 of left-out patches {fit.after:.2f} in the mean, "
        f"{fit.worst:.2f} at worst; {fit.before:.2f} before"
    )


def _white(light: str) -> tuple[tuple[float, float], str]:
    """Return CIE xy of a light by its name, or of "x,y"; and its name if its spectrum is known."""
    from colour import CCS_ILLUMINANTS, SDS_ILLUMINANTS

    named = CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]
    if light in named:
        x, y = named[light]
        return (float(x), float(y)), light if light in SDS_ILLUMINANTS else ""
    try:
        x, y = (float(part) for part in light.split(","))
    except ValueError:
        raise InputError(
            f'--light: wanted D65, D50, A, … or its CIE "x,y", got {light!r}'
        ) from None
    if not (0 < x < 1 and 0.05 < y < 1 and x + y <= 1):
        raise InputError(f"--light: {light} is no light's chromaticity")
    return (x, y), ""


def _parse_corners(text: str) -> list[list[float]]:
    try:
        corners = [[float(part) for part in point.split(",")] for point in text.split()]
    except ValueError:
        corners = []
    if len(corners) != 4 or any(len(point) != 2 for point in corners):
        raise InputError(f'--corners: wanted "x,y x,y x,y x,y", got {text!r}')
    return corners
