"""`fishlight calibrate import` and `export`: camera files of other programs."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from calibration.camera import LEVEL, Calibration
from calibration.files import read_calibration, write_calibration
from calibration.formats import FORMATS, read_camera
from calibration.formats.foreign import NoCounterpart, as_calibration
from calibration.models import MODELS
from calibration.models.kannala_brandt import KannalaBrandt
from capture.arguments import Output
from capture.errors import InputError
from capture.output import check_place, write_text

if TYPE_CHECKING:
    from calibration.formats.approximation import Approximation

FormatName = Literal["mrcal", "ocamcalib", "nerfstudio", "kalibr", "opencv", "colmap"]


def import_calibration(
    file: Path,
    *,
    output: Output,
    camera: str = "",
    approximate: bool = False,
    valid_angle_deg: float | None = None,
    force: bool = False,
) -> None:
    """Write a calibration file from one of another program.

    Read are OpenCV's YAML (fisheye and omnidir), Kalibr's camchain, OCamCalib's calib_results.txt,
    mrcal's .cameramodel, COLMAP's cameras.txt and nerfstudio's transforms.json, whichever it is.

    Parameters
    ----------
    file
        The file of the other program.
    output
        The calibration file, cal.json.
    camera
        Which camera, where a file holds several: Kalibr's cam1, COLMAP's number.
    approximate
        If no lens here is that of the file (mrcal's splined ones), take the nearest up to
        --valid-angle-deg, and print its error.
    valid_angle_deg
        Angle from the axis up to which the lens was measured. No such file tells; without it, all
        of the picture is taken for valid.
    force
        Replace the output if it exists.
    """
    check_place(output, force=force)
    if valid_angle_deg is not None and not 0 < valid_angle_deg <= 180:
        raise InputError(f"--valid-angle-deg must be in (0, 180], got {valid_angle_deg}")
    name, found = read_camera(file, camera)
    valid_angle_rad = None if valid_angle_deg is None else float(np.deg2rad(valid_angle_deg))
    try:
        calibration = as_calibration(found, valid_angle_rad)
    except InputError as error:
        raise InputError(f"{file}: {error}") from None
    remark = ""
    if found.model.name not in MODELS:
        if not approximate:
            raise InputError(
                f"{file}: no lens here projects as {found.model.name} does; with --approximate the "
                "nearest is fitted and its error printed"
            )
        if valid_angle_deg is None:
            raise InputError(
                f"{file}: a splined lens means nothing beyond what was measured, where another "
                "would follow it: give --valid-angle-deg with --approximate"
            )
        # Here, so that an exact import does not wait for scipy.
        from calibration.formats.approximation import approximate as follow

        near = follow(calibration, KannalaBrandt)
        calibration = near.calibration
        remark = _remark(found.model.name, near)
    write_calibration(output, calibration, force=force)
    width, height = found.image_size_px
    print(
        f"{output}: {calibration.model.name} for {width}×{height} px from {name}{remark}, valid to "
        f"{np.rad2deg(calibration.valid_angle_rad):.1f}°"
        + ("" if valid_angle_deg is not None else ": as far as picture and model reach")
    )


def export_calibration(
    calibration: Path,
    *,
    output: Output,
    format: FormatName,
    approximate: bool = False,
    force: bool = False,
) -> None:
    """Write the lens of a calibration file for another program.

    Parameters
    ----------
    calibration
        The calibration file, cal.json.
    output
        The file of the other program.
    format
        opencv, kalibr, ocamcalib, mrcal, colmap or nerfstudio.
    approximate
        If the format has no such lens, write the nearest one it has, and print its error.
    force
        Replace the output if it exists.
    """
    check_place(output, force=force)
    camera = read_calibration(calibration)
    written = camera
    remark = ""
    try:
        text = FORMATS[format].write(camera)
    except NoCounterpart as error:
        if not approximate:
            raise InputError(f"{calibration}: {error}") from None
        # Here, so that an exact export does not wait for scipy.
        from calibration.formats.approximation import approximate as follow

        try:
            near = follow(camera, FORMATS[format].nearest)
        except InputError as failure:
            raise InputError(f"{calibration}: {failure}") from None
        written = near.calibration
        text = FORMATS[format].write(written)
        remark = _remark(camera.model.name, near)
    write_text(output, text, force=force)
    print(f"{output}: {written.model.name} for {format}{remark}")
    print(f"  left out, for want of a place: {', '.join(_left_out(camera))}")


def _remark(name: str, near: "Approximation") -> str:
    return (
        f", an approximation of {name}: off by {1e3 * near.rms_rad:.2g} mrad rms, "
        f"{1e3 * near.max_rad:.2g} at most"
    )


def _left_out(camera: Calibration) -> list[str]:
    """Return what the formats have no place for."""
    parts = [f"valid angle ({np.rad2deg(camera.valid_angle_rad):.1f}°)"]
    if camera.inner_angle_rad:
        parts.append(f"inner angle ({np.rad2deg(camera.inner_angle_rad):.1f}°)")
    if camera.image_circle is not None:
        parts.append("image circle")
    if camera.vignetting or camera.uneven_vignetting:
        parts.append("vignetting")
    if not np.allclose(camera.R_world_camera, LEVEL):
        parts.append("R_world_camera")
    return parts
