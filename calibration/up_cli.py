"""`fishlight calibrate up`: the camera's tilt, from gravity, vertical edges or the horizon."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from calibration.camera import Calibration
from calibration.files import read_calibration
from calibration.pose.files import write_posed
from calibration.pose.up import (
    LOOKS,
    Zenith,
    with_zenith,
    zenith_of_edges,
    zenith_of_gravity,
    zenith_of_horizon,
)
from capture.arguments import Output, tell
from capture.errors import InputError
from capture.output import check_place

_MARK_SIGMA_PX = 1.0
"""How well a point is marked by hand; where marks scatter more, they say so themselves."""


def calibrate_up(
    calibration: Path,
    *,
    output: Output,
    looks: Literal["level", "up", "down"] | None = None,
    gravity: Annotated[str, Parameter(allow_leading_hyphen=True)] = "",
    vertical: Annotated[list[str] | None, Parameter(negative=())] = None,
    horizon: str = "",
    force: Annotated[bool, Parameter(negative=())] = False,
) -> None:
    """Set which way is up in a calibration. One of the four ways is given.

    The heading stays as near to what it was as can be: `fishlight calibrate sun` finds north.

    Parameters
    ----------
    calibration
        The calibration file of the lens.
    output
        The calibration file with the new R_world_camera.
    looks
        How the camera stands on its spirit level: level (the bottom of the picture is down), up or
        down.
    gravity
        The direction in which things fall as "x,y,z" of any length in the camera's frame: +x to the
        right of the picture, +y to its bottom, +z where it looks. An accelerometer at rest shows
        the opposite of it.
    vertical
        Pixels along a straight vertical edge, from its foot to its head: "412,900 415,610
        418,310". Give it for each edge, two at least and well apart; with three or more a wrong one
        shows.
    horizon
        Pixels on the true horizon, such as the sea's, two at least: "10,502 480,488 950,497".
    force
        Replace the output if it exists.
    """
    check_place(output, force=force)
    ways = [looks is not None, bool(gravity), bool(vertical), bool(horizon)]
    if sum(ways) != 1:
        raise InputError(
            "one of --looks, --gravity, --vertical and --horizon says which way is up; "
            f"{sum(ways)} were given"
        )
    camera = read_calibration(calibration)
    R_world_camera = camera.R_world_camera
    found = None
    if looks is not None:
        zenith = np.array(LOOKS[looks])
    elif gravity:
        zenith = zenith_of_gravity(_numbers(gravity, 3, "--gravity"))
    elif vertical:
        edges = [_directions(camera, text, "--vertical") for text in vertical]
        found = zenith_of_edges(edges, _mark_sigma_rad(camera, vertical))
        zenith = found.direction
    else:
        points = _directions(camera, horizon, "--horizon")
        sigma_rad = _mark_sigma_rad(camera, [horizon])
        found = zenith_of_horizon(points, R_world_camera[1], sigma_rad)
        zenith = found.direction
    posed = with_zenith(R_world_camera, zenith)
    write_posed(output, calibration, camera, posed, force=force)
    turned_rad = np.arccos(np.clip((np.trace(posed @ R_world_camera.T) - 1) / 2, -1, 1))
    sureness = ""
    if found is not None:
        tell(_left_out(found))
        sureness = f" to ±{np.rad2deg(found.sigma_rad):.2g}°"
    print(f"{output}: up is set{sureness}, {np.rad2deg(turned_rad):.2f}° from where it was")


def _left_out(found: Zenith) -> list[str]:
    return [
        f"mark {number + 1} left out: {abs(np.rad2deg(found.residual_rad[number])):.1f}° off the "
        "others"
        for number in np.flatnonzero(~found.kept)
    ]


def _pixels(text: str, flag: str) -> NDArray[np.float64]:
    if not text.strip():
        raise InputError(f"{flag}: wanted pixels as x,y x,y, got none")
    return np.array([_numbers(pair, 2, flag) for pair in text.split()])


def _directions(camera: Calibration, text: str, flag: str) -> NDArray[np.float64]:
    """Return camera-frame directions (N, 3) of the pixels that an argument lists."""
    pixels = _pixels(text, flag)
    directions, seen = camera.unproject(pixels)
    if not seen.all():
        x, y = pixels[~seen][0]
        raise InputError(f"{flag}: the lens sees nothing at {x:g},{y:g}, or is not valid there")
    return np.asarray(directions @ camera.R_world_camera)


def _mark_sigma_rad(camera: Calibration, texts: list[str]) -> float:
    """Return the angle that a mark's standard deviation in pixels is where marks were set."""
    at = np.concatenate([_pixels(text, "") for text in texts])
    step = np.array([[0.5, 0.0], [0.0, 0.5]])[:, None]
    ahead, seen_ahead = camera.model.unproject(at + step)
    behind, seen_behind = camera.model.unproject(at - step)
    lengths = np.linalg.norm(ahead - behind, axis=-1)[seen_ahead & seen_behind]
    return _MARK_SIGMA_PX * float(np.median(lengths))


def _numbers(text: str, count: int, flag: str) -> list[float]:
    parts = text.split(",")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) != count or not np.isfinite(numbers).all():
        wanted = ",".join("xyz"[:count])
        raise InputError(f"{flag}: wanted {wanted} in numbers, got {text!r}")
    return numbers
