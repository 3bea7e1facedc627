"""`fishlight calibrate ball`: where a mirror ball is in a picture, and what it shows where."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from cyclopts import Parameter

from capture.arguments import Output
from capture.errors import InputError
from capture.output import check_place
from capture.radiance_files import read_radiance

if TYPE_CHECKING:
    from calibration.ball import Array, BallFit
    from calibration.ball_cone import Pinhole


def calibrate_ball(
    radiance: Path,
    *,
    output: Output,
    focal_px: float | None = None,
    principal: Annotated[str, Parameter(allow_leading_hyphen=True)] = "",
    distance_ratio: float | None = None,
    ball: Annotated[str, Parameter(allow_leading_hyphen=True)] = "",
    marked_px: float | None = None,
    yaw_deg: float = 0.0,
    pitch_deg: float = 0.0,
    roll_deg: float = 0.0,
    reflectance: str = "",
    seen_twice: str = "",
    force: Annotated[bool, Parameter(negative=())] = False,
) -> None:
    """Calibrate a mirror ball from a picture of it.

    The ball's outline is found to a few hundredths of a pixel. Photograph it sharp, with a long
    lens, before a background that differs from what it mirrors, filling the picture but for a rim.

    Parameters
    ----------
    radiance
        Linear radiance of a picture of the ball, EXR or Radiance .hdr.
    output
        The calibration file.
    focal_px
        The camera's focal length in pixels: that in mm over the width of a pixel in mm. It tells
        the distance of the ball, and how a ball away from the middle of the picture is distorted.
    principal
        Pixel x,y where the camera's axis meets the picture, for a picture that was cropped (it
        may lie outside); by default the middle.
    distance_ratio
        Without --focal-px: distance from the camera to the ball's centre, over the ball's radius.
    ball
        Pixels x,y,radius of the ball, to within 15 % of the radius, where it is not found.
    marked_px
        The ball is where --ball says, marked by hand to within so many pixels, and is not looked
        for: where its outline is blurred.
    yaw_deg
        How far the camera was turned to the left from the world's +Z.
    pitch_deg
        How far it looked up.
    roll_deg
        How far it was tilted clockwise, as seen from behind it.
    reflectance
        Shares r,g,b of the light falling straight on the ball that it reflects, such as
        0.55,0.56,0.55 of chrome. What it shows is divided by them, at each angle by Fresnel's
        equations; without it, the ball is taken to reflect all.
    seen_twice
        Instead of --reflectance: pixels "x,y x,y" of a matt thing that the picture shows past the
        ball and in it, far from the ball over its radius.
    force
        Replace the output if it exists.
    """
    # Here, so that no other command waits for scipy.
    from calibration.ball import ASSUMED_RATIO, fit_ball, measure_reflectance, pose
    from calibration.ball_cone import Pinhole, distant_pinhole
    from calibration.ball_outline import find_outline, marked_outline
    from calibration.ball_record import ball_record
    from calibration.files import write_calibration

    check_place(output, force=force)
    if focal_px is not None and distance_ratio is not None:
        raise InputError("give --focal-px or --distance-ratio, not both: each tells the other")
    if focal_px is None and principal:
        raise InputError("--principal goes with --focal-px")
    if focal_px is not None and not focal_px > 0:
        raise InputError(f"--focal-px must be positive, got {focal_px}")
    if marked_px is not None and not ball:
        raise InputError("--marked-px goes with --ball")
    if reflectance and seen_twice:
        raise InputError("give --reflectance or --seen-twice, not both: each tells the other")
    hint = np.array(_numbers("--ball", ball, "x,y,radius")) if ball else None
    shares = _numbers("--reflectance", reflectance, "r,g,b") if reflectance else ()
    pixels = _two_pixels(seen_twice) if seen_twice else None
    image, cleaned = read_radiance(radiance)
    pinhole = distant_pinhole(image.size_px)
    ratio = None
    if focal_px is not None:
        x, y = _numbers("--principal", principal, "x,y") if principal else pinhole.principal_px
        pinhole = Pinhole(focal_px, (x, y))
    else:
        ratio = ASSUMED_RATIO if distance_ratio is None else (distance_ratio, 0.0)
    try:
        if marked_px is not None and hint is not None:
            outline = marked_outline(hint, marked_px, pinhole)
        else:
            outline = find_outline(image.radiance, pinhole, hint)
    except InputError as error:
        raise InputError(f"{radiance}: {error}") from None
    stood = pose(*np.radians([yaw_deg, pitch_deg, roll_deg]))
    fit = fit_ball(outline, image.size_px, pinhole, ratio, stood)
    if pixels is not None:
        shares = measure_reflectance(image, fit.calibration, *pixels)
    calibration = replace(fit.calibration, reflectance=shares)
    write_calibration(output, calibration, ball_fit=ball_record(fit, radiance.name), force=force)

    for line in _told(fit, pinhole):
        print(line)
    if focal_px is None:
        print("  the outline was taken for a circle; --focal-px makes it exact off the axis")
    if focal_px is None and distance_ratio is None:
        print(
            f"  D/R {ASSUMED_RATIO[0]:g} ± {ASSUMED_RATIO[1]:g} is assumed, not measured: give "
            "--focal-px, or --distance-ratio by a tape measure"
        )
    if seen_twice:
        print(f"  reflects {', '.join(f'{each:.3f}' for each in shares)} of red, green and blue")
    for remark in cleaned.remarks:
        print(f"  {remark}")
    x, y = fit.outline.centre_px
    print(f"{output}: ball at {x:.2f}, {y:.2f} px, D/R {fit.distance_ratio:.2f}")


def _told(fit: "BallFit", pinhole: "Pinhole") -> list[str]:
    """Return how well the ball is known, for people."""
    outline = fit.outline
    x_px, y_px, half_rad = np.sqrt(np.diag(outline.covariance))
    radius_px = pinhole.focal_px * np.tan(outline.half_angle_rad)
    seen = f"{outline.support:.0%} of the outline seen" if outline.support > 0 else "marked by hand"
    halfway, end = np.degrees(fit.deviation_rad[[len(fit.deviation_rad) // 2, -1]])
    return [
        f"  radius {radius_px:.2f} ± {half_rad * pinhole.focal_px:.2f} px, centre to "
        f"±{max(x_px, y_px):.2f} px, {seen}",
        f"  directions to ±{halfway:.2f}° halfway out and ±{end:.2f}° at the end of what is valid, "
        f"{np.degrees(fit.calibration.valid_angle_rad):.1f}° from the direction back to the camera",
    ]


def _numbers(flag: str, text: str, wanted: str) -> tuple[float, ...]:
    """Return the numbers of "x,y", "x,y,radius" or "r,g,b"; InputError for anything else."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != len(wanted.split(",")) or not np.all(np.isfinite(numbers)):
        unit = "" if wanted == "r,g,b" else " in pixels"
        raise InputError(f"{flag} is {wanted}{unit}, got {text!r}")
    return numbers


def _two_pixels(text: str) -> "tuple[Array, Array]":
    pixels = [np.array(_numbers("--seen-twice", part, "x,y")) for part in text.split()]
    if len(pixels) != 2:
        raise InputError(f'--seen-twice is "x,y x,y", got {text!r}')
    return pixels[0], pixels[1]
