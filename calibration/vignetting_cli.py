"""`fishlight calibrate vignetting`: how a lens darkens toward the rim, put into its calibration."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from cyclopts import Parameter

from calibration.camera import Calibration
from calibration.files import read_calibration, read_records, write_calibration
from capture.arguments import Output, tell
from capture.errors import InputError
from capture.output import check_place
from capture.radiance_files import read_radiance

if TYPE_CHECKING:
    from calibration.vignetting_record import VignettingRecord

_NEAR_RIM_RAD = np.radians(3)


def calibrate_vignetting(
    *pictures: Path,
    calibration: Annotated[list[Path], Parameter(negative=())],
    source: Annotated[Literal["flat", "lamp", "overlap", "published"], Parameter(name=["--from"])],
    output: Output,
    lamp_radius_deg: float = 3.0,
    coefficients: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    corner_px: float | None = None,
    force: Annotated[bool, Parameter(negative=())] = False,
) -> None:
    """Estimate a lens's vignetting and put it into its calibration.

    It holds for one aperture and focus: keep a calibration file for each. It is taken no more
    complicated than predicting left-out samples needs, and may differ around the axis where the
    pictures can tell that (all but a single flat field).

    Parameters
    ----------
    pictures
        Linear radiance as `merge` writes it, EXR, nothing clipped. Of an evenly lit field that
        fills the view (flat), the camera turned about its axis between two or more; of one steady
        lamp, which the camera is turned past from rim to rim in 20 steps or more (lamp); or of a
        still scene in several turns of the camera (overlap). None for published.
    calibration
        The camera's calibration, JSON. For overlap one for each picture, in their order, each with
        its R_world_camera.
    source
        What the pictures show; or published, for a polynomial of lensfun or Hugin.
    output
        The (first) calibration with the vignetting.
    lamp_radius_deg
        Holds the lamp and its blur.
    coefficients
        K1,K2,K3 of 1 + k1 R² + k2 R⁴ + k3 R⁶, for published.
    corner_px
        Distance from the centre at which R is 1, for published; a corner of the picture by default.
    force
        Replace the output if it exists.
    """
    # Here, so that no other command waits for OpenCV.
    from calibration.vignetting import fit_vignetting
    from calibration.vignetting_record import vignetting_record
    from calibration.vignetting_samples import Shot, flat_samples, lamp_samples, overlap_samples

    check_place(output, force=force)
    if (source == "published") != (coefficients is not None) or (source == "published") == bool(
        pictures
    ):
        raise InputError("give pictures; or, with --from published, --coefficients and no picture")
    cameras = [read_calibration(path) for path in calibration]
    if source == "published":
        assert coefficients is not None
        _import_published(calibration, cameras, output, coefficients, corner_px, force)
        return
    if len(cameras) not in ((len(pictures),) if source == "overlap" else (1, len(pictures))):
        raise InputError(
            f"{len(pictures)} pictures and {len(cameras)} calibrations: give "
            + ("one for each picture" if source == "overlap" else "one, or one for each picture")
        )
    if len(cameras) == 1:
        cameras *= len(pictures)
    shots = [
        Shot(str(path), read_radiance(path)[0], camera)
        for path, camera in zip(pictures, cameras, strict=True)
    ]
    if source == "flat":
        samples = flat_samples(shots)
    elif source == "lamp":
        samples = lamp_samples(shots, np.radians(lamp_radius_deg))
    else:
        samples = overlap_samples(shots)
    fit = fit_vignetting(samples)
    camera = _with_vignetting(cameras[0], fit.chosen.radial, fit.chosen.uneven)
    record = vignetting_record(fit, camera, source, [path.name for path in pictures])
    _write(output, calibration[0], camera, record, force=force)
    rim_rad = record.angle_rad[-1]
    if fit.seen_rad[1] < rim_rad - _NEAR_RIM_RAD:
        seen_deg, rim_deg = np.degrees([fit.seen_rad[1], rim_rad])
        tell([f"nothing was measured beyond {seen_deg:.0f}°; V is extrapolated to {rim_deg:.0f}°"])
    print(
        f"{output}: V({np.degrees(rim_rad):.0f}°) = {camera.relative_illumination(rim_rad):.3f} "
        f"± {record.sigma[-1]:.3f} from {fit.sample_count} samples, "
        f"{len(camera.vignetting)} radial and {len(camera.uneven_vignetting)} uneven coefficients; "
        f"left-out samples differ by {fit.chosen.held_out:.2%}"
    )


def _import_published(
    paths: Sequence[Path],
    cameras: Sequence[Calibration],
    output: Path,
    coefficients: str,
    corner_px: float | None,
    force: bool,
) -> None:
    from calibration.vignetting_published import from_published

    if len(cameras) != 1:
        raise InputError(f"--from published takes one --calibration, got {len(cameras)}")
    try:
        numbers = [float(part) for part in coefficients.split(",")]
    except ValueError:
        raise InputError(f"--coefficients: wanted K1,K2,K3, got {coefficients!r}") from None
    radial, worst = from_published(cameras[0], numbers, corner_px)
    camera = _with_vignetting(cameras[0], radial, ())
    _write(output, paths[0], camera, None, force=force)
    print(
        f"{output}: {len(radial)} coefficients in θ², within {worst:.2%} of the polynomial in R "
        "everywhere in the picture"
    )


def _with_vignetting(
    camera: Calibration, radial: tuple[float, ...], uneven: tuple[float, ...]
) -> Calibration:
    try:
        return replace(camera, vignetting=radial, uneven_vignetting=uneven)
    except InputError as error:
        raise InputError(
            f"{error}; measure nearer to the rim, or reduce valid_angle_rad to what was measured"
        ) from None


def _write(
    output: Path,
    start: Path,
    camera: Calibration,
    record: "VignettingRecord | None",
    *,
    force: bool,
) -> None:
    """Write the calibration with all else that its file held of its making."""
    write_calibration(
        output,
        camera,
        **{**read_records(start), "vignetting_fit": record},
        force=force,
    )
