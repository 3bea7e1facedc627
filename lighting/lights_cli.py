"""`fishlight lights`: from an environment map, or a camera picture, to lights.json."""

from pathlib import Path

from calibration.files import read_calibration
from capture.arguments import Output
from capture.errors import InputError
from capture.output import check_place
from capture.radiance import Cleaned
from capture.radiance_files import read_radiance
from lighting.blocks.fill import Fill
from lighting.light_arguments import Count, Error, MethodName, most_lights
from lighting.light_files import write_lights
from lighting.light_set import LightSet
from lighting.maps.environment_files import read_environment
from lighting.reduce import ADAPTIVE, reduce_to_lights
from lighting.reduce_picture import reduce_picture_to_lights


def lights(
    picture: Path,
    *,
    output: Output,
    calibration: Path | None = None,
    count: Count = 64,
    error: Error = None,
    method: MethodName = ADAPTIVE,
    fill: Fill = "black",
    strict: bool = False,
    force: bool = False,
) -> None:
    """Reduce an environment map, or a camera's radiance picture, to distant lights.

    Parameters
    ----------
    picture
        Lat-long map, or with --calibration a camera's linear radiance; EXR or Radiance .hdr.
    output
        The lights, as JSON.
    calibration
        The calibration of the camera that took the picture, JSON.
    fill
        What directions hold that the camera did not see: black, mean (of the seen) or mirror (at
        the horizon). Only with --calibration: a map is filled by `fishlight remap`.
    strict
        Refuse a picture with NaN, infinite or negative values instead of setting them to 0.
    force
        Replace the output if it exists.
    """
    check_place(output, force=force)  # refused before the work, not after
    most, error = most_lights(count, error, method)
    if calibration is None:
        if fill != "black":
            raise InputError(
                "--fill is for a camera's picture, with --calibration; "
                "`fishlight remap --fill` fills a map"
            )
        environment, cleaned = read_environment(picture)
        light_set = reduce_to_lights(environment, most, method, error=error, source=picture.name)
    else:
        light_set, cleaned = _lights_of_picture(picture, calibration, most, error, method, fill)
    if strict:
        cleaned.refuse(picture)
    write_lights(output, light_set, force=force)

    red, green, blue = light_set.integral()
    print(
        f"{output}: {'; '.join(_about(light_set))}; "
        f"∫ L dω {red:.4g} {green:.4g} {blue:.4g} ({light_set.scale} × sr)"
    )
    if error is None and len(light_set) < most:
        print(f"  {len(light_set)} instead of {most}: {_why_fewer(light_set)}")
    if error is not None and (light_set.predicted_error or 0.0) > error:
        print(f"  the error of {error:g} is not met: no more than {most} lights are tried")
    for remark in cleaned.remarks:
        print(f"  {remark}")
    if light_set.clipped_fraction > 0:
        print(
            f"  {light_set.clipped_fraction:.1%} of the light comes from clipped pixels: "
            "the lights are a lower bound"
        )


def _lights_of_picture(
    picture: Path, calibration: Path, most: int, error: float | None, method: str, fill: Fill
) -> tuple[LightSet, Cleaned]:
    camera = read_calibration(calibration)
    image, cleaned = read_radiance(picture)
    camera.check_size(image.size_px, str(picture))
    light_set = reduce_picture_to_lights(
        camera, image, most, method, error=error, fill=fill, source=picture.name
    )
    return light_set, cleaned


def _why_fewer(lights: LightSet) -> str:
    if not any(lights.integral()):
        return "there is no light"
    beside = " beside the fill" if lights.fill.any() else ""
    return f"no more are needed to hold all the light{beside}"


def _about(lights: LightSet) -> list[str]:
    """Return what there is to say of the lights: only some methods have a fill, or predict."""
    parts = [lights.source]
    if lights.fill_order is not None:
        parts.append(f"fill of order {lights.fill_order}")
    if lights.predicted_error is not None:
        parts.append(f"predicted error {lights.predicted_error:.2%}")
    if lights.block_rows is not None:
        parts.append(f"block rows {lights.block_rows}")
    return parts
