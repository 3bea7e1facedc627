"""RAW files decoded by LibRaw, in the process of capture.decoding_worker.

Input  : a RAW file that LibRaw knows, DNG among them.
Output : linear counts of the camera's own channels, and what the file says of levels and colours.
Fails  : light that the camera itself cut off at count 0 is lost. Corrections that a file asks for
         (lens shading, defective pixels, baseline exposure) are not made: a count stays what the
         sensor gave. Of a linear DNG, LibRaw tells the white level of the first channel only; the
         others' are taken from the file's tags, where these are in its first directories.

LibRaw only unpacks. Its own development cuts off at black before anything is averaged, and at
white after channels were multiplied, which loses measured light at both ends.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import rawpy
from numpy.typing import NDArray

from capture.errors import InputError, UnreadableFrame
from capture.exif import read_tags
from capture.files import check_size
from capture.raw import BLACK_DN, WHITE_DN

_STRIP_ROWS = 256
_NEIGHBOURS = np.array([1.0, 2.0, 1.0], np.float32)
"""Weights, along each axis, of the neighbours that a missing colour is interpolated from: in a
Bayer mosaic the mean of the two or four nearest."""


def decode(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[np.uint16]]]:
    """Return the facts that capture.raw_colour and capture.raw read, and `counts`, (H, W, 3).

    Counts are BLACK_DN at the black level and WHITE_DN at the white level of each channel. They are
    WHITE_DN exactly where a full pixel took part in the interpolation: the mark of saturation is
    made before colours are interpolated, and travels as the count.
    """
    with _unpacked(path) as raw:
        black, white = _levels(path, raw)
        if raw.raw_type == rawpy.RawType.Stack:
            counts = _marked(raw.raw_image_visible[..., :3], np.arange(3), black, white)
        elif raw.num_colors == 1:
            counts = _marked(raw.raw_image_visible[..., None], np.zeros(1, int), black, white)
            counts = np.repeat(counts, 3, axis=2)
        else:
            counts = _demosaic(raw.raw_image_visible, raw.raw_colors_visible, black, white)
        facts = {
            "black_dn": black.tolist(),
            "white_dn": white.tolist(),
            "is_grey": raw.num_colors == 1,
            "table": raw.rgb_xyz_matrix[:3].tolist(),
            **_dng_colours(path),
        }
    return facts, {"counts": counts}


@contextmanager
def _unpacked(path: Path) -> Iterator[rawpy.RawPy]:
    with rawpy.RawPy() as raw:
        try:
            raw.open_file(str(path))
            check_size(path, raw.sizes.raw_width, raw.sizes.raw_height)
            raw.unpack()
            colours = raw.color_desc.decode()
            if raw.num_colors != 1 and colours[: raw.num_colors] != "RGB":
                raise InputError(
                    f"{path}: a sensor of colours {colours}; wanted red, green and blue"
                )
            yield raw
        except (rawpy.LibRawError, rawpy.NotSupportedError) as error:
            # LibRaw's messages are bytes: b'Unsupported file format or not RAW file'
            reason = error.args[0] if error.args else error
            text = reason.decode(errors="replace") if isinstance(reason, bytes) else str(reason)
            raise UnreadableFrame(f"{path}: cannot be developed ({text})") from None


def _levels(path: Path, raw: rawpy.RawPy) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the black and the white level of LibRaw's four colours."""
    black = np.array(raw.black_level_per_channel, np.float64)
    if raw.raw_type == rawpy.RawType.Stack:
        black[3] = black[1]  # there is no second green
    white = np.full(4, float(raw.white_level))
    # Where the camera stops being linear, if it tells; and what a linear DNG says by channel.
    for told in (raw.camera_white_level_per_channel, _linear_dng_white(path, raw)):
        if told:
            usable = (black < told) & (told < white)
            white[usable] = np.asarray(told, np.float64)[usable]
    if not np.all(black < white):
        raise UnreadableFrame(f"{path}: black level {black.tolist()} above white {white.tolist()}")
    return black, white


def _marked(
    values: NDArray[np.uint16],
    colours: NDArray[Any],
    black: NDArray[np.float64],
    white: NDArray[np.float64],
) -> NDArray[np.uint16]:
    """Return counts of values that need no interpolation."""
    counts = np.rint(_scaled(values, colours, black, white))
    return np.where(values >= white[colours], WHITE_DN, counts).astype(np.uint16)


def _scaled(
    values: NDArray[np.uint16],
    colours: NDArray[Any],
    black: NDArray[np.float64],
    white: NDArray[np.float64],
) -> NDArray[np.float32]:
    """Return counts between BLACK_DN and WHITE_DN, each by the levels of its colour."""
    scale = ((WHITE_DN - BLACK_DN) / (white - black)).astype(np.float32)
    linear = (values - black.astype(np.float32)[colours]) * scale[colours]
    return np.clip(linear + np.float32(BLACK_DN), 0, WHITE_DN)


def _demosaic(
    values: NDArray[np.uint16],
    colours: NDArray[np.uint8],
    black: NDArray[np.float64],
    white: NDArray[np.float64],
) -> NDArray[np.uint16]:
    """Return (H, W, 3) counts of a mosaic: the site's own colour, and means of its neighbours'.

    A mean is proportional to light, where methods that seek edges decide differently from frame to
    frame of a bracket.
    """
    height, width = values.shape
    counts = np.empty((height, width, 3), np.uint16)
    for first in range(0, height, _STRIP_ROWS):  # so that memory does not grow with the picture
        last = min(first + _STRIP_ROWS, height)
        halo = slice(max(first - 2, 0), min(last + 2, height))
        inside = slice(first - halo.start, last - halo.start)
        strip, strip_colours = values[halo], colours[halo]
        scaled = _scaled(strip, strip_colours, black, white)
        full = strip >= white[strip_colours]
        for channel, numbers in enumerate(((0,), (1, 3), (2,))):
            sites = np.isin(strip_colours, numbers)
            share = _blurred(sites.astype(np.float32))[inside]
            mean = _blurred(np.where(sites, scaled, 0))[inside] / share
            near_full = cv2.dilate((full & sites).astype(np.uint8), np.ones((3, 3)))[inside] > 0
            own = sites[inside]
            marked = np.where(own, full[inside], near_full)
            result = np.where(own, scaled[inside], mean)
            counts[first:last, :, channel] = np.where(marked, WHITE_DN, np.rint(result))
    return counts


def _blurred(plane: NDArray[np.float32]) -> NDArray[np.float32]:
    # Reflected about the outermost pixels, where a mosaic goes on as it is.
    reflected = cv2.BORDER_REFLECT_101
    return np.asarray(
        cv2.sepFilter2D(plane, cv2.CV_32F, _NEIGHBOURS, _NEIGHBOURS, borderType=reflected),
        np.float32,
    )


_WHITE_LEVEL = "0xC61D"
_ANALOG_BALANCE = "0xC627"
_MATRICES = (
    ("0xC621", "0xC623", "0xC714", "0xC65A"),
    ("0xC622", "0xC624", "0xC715", "0xC65B"),
)
"""ColorMatrix, CameraCalibration, ForwardMatrix, CalibrationIlluminant: DNG's tags, twice."""


def _linear_dng_white(path: Path, raw: rawpy.RawPy) -> list[float] | None:
    if raw.raw_type != rawpy.RawType.Stack:
        return None
    levels = _numbers(read_tags(path), _WHITE_LEVEL, 3)
    return [*levels, levels[1]] if levels else None


def _dng_colours(path: Path) -> dict[str, Any]:
    """Return DNG's colour tags; no matrices for a file of another kind."""
    tags = read_tags(path)
    matrices = []
    for colour, calibration, forward, illuminant in _MATRICES:
        if numbers := _numbers(tags, colour, 9):
            matrices.append(
                {
                    "xyz_to_camera": numbers,
                    "calibration": _numbers(tags, calibration, 9),
                    "camera_to_d50": _numbers(tags, forward, 9),
                    "illuminant": int((_numbers(tags, illuminant, 1) or [0])[0]),
                }
            )
    return {"matrices": matrices, "analog_balance": _numbers(tags, _ANALOG_BALANCE, 3)}


def _numbers(tags: dict[str, Any], tag: str, count: int) -> list[float] | None:
    for name, value in tags.items():
        if name.endswith(tag):
            try:
                numbers = [float(number) for number in value.values]
            except (TypeError, ValueError, ZeroDivisionError, OverflowError):
                continue
            if len(numbers) == count and np.all(np.isfinite(numbers)):
                return numbers
    return None
