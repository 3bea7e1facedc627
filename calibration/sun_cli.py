"""`fishlight calibrate sun`: a camera's pose, and its lens's scale, from the path of the sun."""

import csv
import io
from collections import Counter
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from calibration.files import read_calibration, read_object
from calibration.pose.files import write_posed
from calibration.pose.sightings import Sighting, sight, solve, solve_with_lens
from calibration.pose.sky_pictures import parse_moment, parse_utc_offset, sky_pictures
from calibration.pose.sun_lens import LensBySun
from calibration.pose.sun_track import SunPose, clock_error
from capture.arguments import Output, tell
from capture.errors import InputError
from capture.output import check_place, write_text
from capture.progress import progress

_WORTH_TELLING_RAD = np.deg2rad(2.0)
"""A levelled camera's tilt is within it; an hour's error of the clock is 15° or somewhat less."""


def calibrate_sun(
    pictures: list[Path],
    *,
    calibration: Path,
    latitude_deg: float,
    longitude_deg: float,
    output: Output,
    time_zone: str = "",
    start: str = "",
    refine_lens: Annotated[bool, Parameter(negative=())] = False,
    residuals: Path | None = None,
    force: Annotated[bool, Parameter(negative=())] = False,
) -> None:
    """Find how a camera stands in the world from pictures of the sun over some hours.

    The world's +Y is then up, +X east and −Z north. The lens has to be calibrated, or with
    --refine-lens to be of the kind that the calibration has. Expose so short that the sun is a
    small spot: of a bracket the shortest exposure is used. A clock that is wrong turns the camera
    about the pole and shows in no residual; if the calibration has a pose already, such as from
    `fishlight calibrate up`, a difference from it is told.

    Parameters
    ----------
    pictures
        A recording of the sky, or pictures with EXIF.
    calibration
        The calibration file of the lens.
    latitude_deg
        North is positive.
    longitude_deg
        East is positive.
    output
        The calibration file with the new R_world_camera.
    time_zone
        What the camera's clock is ahead of universal time, such as +02:00 or UTC, if its files do
        not tell.
    start
        Moment of the first picture, such as 2026-06-21T09:30:00+02:00, if the pictures have no
        date: those of live cameras and of videos.
    refine_lens
        Find the lens's focal length and centre, too, for which the calibration has to have the
        right kind of lens and its focal length to a tenth. Needs the sun from morning to afternoon;
        beyond the angles that it passed nothing is measured.
    residuals
        A CSV file with a row for each picture: where the sun was seen and computed, and why not.
    force
        Replace outputs that exist.
    """
    for path in (output, residuals):
        if path is not None:
            check_place(path, force=force)
    if not (-90 <= latitude_deg <= 90 and -180 <= longitude_deg <= 180):
        raise InputError(
            "--latitude-deg must be from -90 to 90 and --longitude-deg from -180 to 180, got "
            f"{latitude_deg:g} and {longitude_deg:g}"
        )
    latitude_rad, longitude_rad = np.deg2rad([latitude_deg, longitude_deg])
    camera = read_calibration(calibration)
    found = sky_pictures(
        pictures,
        parse_utc_offset(time_zone) if time_zone else None,
        parse_moment(start) if start else None,
    )
    lens = None
    try:
        sightings = sight(progress(found, "finding the sun", len(found)), camera)
        if refine_lens:
            lens, pose, sightings = solve_with_lens(camera, sightings, latitude_rad, longitude_rad)
            camera = replace(camera, model=lens.model)
        else:
            pose, sightings = solve(camera, sightings, latitude_rad, longitude_rad)
    except InputError as error:
        raise InputError(f"{pictures[0]}: {error}") from None
    if residuals is not None:
        write_text(residuals, _table(sightings), force=force)
    write_posed(output, calibration, camera, pose.R_world_camera, force=force)
    tell(_left_out(sightings))
    if "R_world_camera" in read_object(calibration):
        tell(_disagreement(pose, camera.R_world_camera[1], latitude_rad))
    if lens is not None:
        print(_described(lens))
    print(
        f"{output}: north to ±{np.rad2deg(pose.heading_sigma_rad):.2g}°, up to "
        f"±{np.rad2deg(pose.up_sigma_rad):.2g}°, by {pose.kept.sum()} of {len(sightings)} pictures "
        f"over {np.rad2deg(pose.span_rad):.0f}° of the sun's path; residual "
        f"{np.rad2deg(pose.rms_rad):.2g}° rms"
    )


def _described(lens: LensBySun) -> str:
    inner, outer = np.rad2deg(lens.seen_rad)
    focal_px, (x, y) = getattr(lens.model, "focal_px"), getattr(lens.model, "centre_px")  # noqa: B009
    return (
        f"focal length {np.mean(focal_px):.2f} px to ±{100 * lens.focal_sigma:.2g} %, centre "
        f"({x:.2f}, {y:.2f}) px to ±{lens.centre_sigma_px:.2g}, directions to "
        f"±{np.rad2deg(lens.direction_sigma_rad):.2g}°: the sun passed {inner:.0f}° to "
        f"{outer:.0f}° off the axis"
    )


def _left_out(sightings: list[Sighting]) -> list[str]:
    reasons = Counter(each.reason for each in sightings if each.reason)
    return [f"{count} left out: {reason}" for reason, count in reasons.most_common()]


def _disagreement(pose: SunPose, zenith: NDArray[np.float64], latitude_rad: float) -> list[str]:
    """Return a line if the zenith (3,) that the calibration had is another than the sun's."""
    tilt_rad, fast_s, left_rad = clock_error(pose.R_world_camera, zenith, latitude_rad)
    if tilt_rad < _WORTH_TELLING_RAD:
        return []
    return [
        f"up is {np.rad2deg(tilt_rad):.1f}° from where the calibration had it; if that was right, "
        f"the clock is {abs(fast_s) / 60:.0f} min {'fast' if fast_s > 0 else 'slow'}, or the place "
        f"wrong, which explains all but {np.rad2deg(left_rad):.1f}°"
    ]


def _table(sightings: list[Sighting]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["picture", "utc", "x_px", "y_px", "residual_rad", "left_out"])
    for each in sightings:
        x, y = each.pixel_px or ("", "")
        moment = datetime.fromtimestamp(each.timestamp_s, UTC).isoformat(timespec="milliseconds")
        residual = "" if each.residual_rad is None else each.residual_rad
        writer.writerow([each.name, moment, x, y, residual, each.reason])
    return text.getvalue()
