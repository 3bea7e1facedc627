"""A scene as the emulated camera sends it at each of its exposures, with shot and read noise.

Input  : a radiance map.    Output : pictures.bin and pictures.json, which uvc_pictures.py reads.
The camera's linear value is radiance × time × 2^gain, and 1 is white: so what a merge should find
is `radiance` itself.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.sensor import srgb_encode
from tests.camera.uvc_stamp import STAMP_ROWS

UNIT_S = 1e-4
"""The unit of a USB camera's exposure time."""

FULL_WELL_E, READ_NOISE_E = 10_000.0, 5.0
_MEAN_WANTED = 0.3
"""The linear value that the automatic exposure brings the picture's mean to."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PictureSet:
    """Which pictures the camera has; `exposures` in units of 100 µs, rising."""

    formats: tuple[str, ...] = ("YUYV", "MJPG", "RG16", "GREY")
    exposures: tuple[int, ...] = (1, 2, 5, 10, 20, 50, 100, 200, 500)
    gain_count: int = 2
    noises: int = 4  # no divisor of a bracket's length, or each bracket would have the same noise


def patches(columns: int = 10, rows: int = 7, side_px: int = 16) -> Array:
    """Return a radiance map of coloured squares, from 6 to 6000, of which no two are alike.

    The squares are multiples of a JPEG's blocks; below them lie the rows of the stamp, black.
    """
    step = np.arange(columns * rows) * 37 % (columns * rows)  # neighbours differ by much
    level = 6.0 * 1000.0 ** (step / (columns * rows - 1))
    tint = 1 + 0.25 * np.sin(step[:, None] * 2.4 + np.array([0.0, 2.1, 4.2]))
    squares = (level[:, None] * tint).reshape(rows, columns, 3)
    radiance = squares.repeat(side_px, axis=0).repeat(side_px, axis=1)
    return np.pad(radiance, ((0, STAMP_ROWS), (0, 0), (0, 0)))


def write_pictures(folder: Path, radiance: Array, wanted: PictureSet, seed: int = 0) -> None:
    """Compute every picture of a scene, (H, W, 3), H and W even, and write them to `folder`."""
    rng = np.random.default_rng(seed)
    places: list[tuple[str, int, int, list[tuple[int, int]]]] = []
    with (folder / "pictures.bin").open("wb") as file:
        for exposure in wanted.exposures:
            for gain in range(wanted.gain_count):
                found: dict[str, list[tuple[int, int]]] = {name: [] for name in wanted.formats}
                for _ in range(wanted.noises):
                    linear = noisy(radiance * exposure * UNIT_S, 2.0**gain, rng)
                    for name in wanted.formats:
                        picture = encoded(linear, name)
                        found[name].append((file.tell(), len(picture)))
                        file.write(picture)
                places.extend((name, exposure, gain, found[name]) for name in wanted.formats)
    index = {
        "size_px": (radiance.shape[1], radiance.shape[0]),
        "formats": wanted.formats,
        "exposures": wanted.exposures,
        "gain_count": wanted.gain_count,
        "auto_exposure": _automatic(radiance, wanted.exposures),
        "places": places,
    }
    (folder / "pictures.json").write_text(json.dumps(index))


def noisy(exposed: Array, gain: float, rng: np.random.Generator) -> Array:
    """Return linear values, clipped to [0, 1], of light that would give `exposed` at gain 1."""
    variance = np.minimum(exposed, 1.0) / FULL_WELL_E + (READ_NOISE_E / FULL_WELL_E) ** 2
    noise = rng.standard_normal(exposed.shape) * np.sqrt(variance)
    return np.clip((exposed + noise) * gain, 0.0, 1.0)


def encoded(linear: Array, pixel_format: str) -> bytes:
    """Return linear values in [0, 1] as the camera sends them.

    YUYV is BT.601 in the limited range, GREY its luma in the full range, both of sRGB-coded colour,
    as MJPG is; RG16 is linear, 12 bits in the upper ones of 16, RGGB.
    """
    if pixel_format == "RG16":
        mosaic = np.empty(linear.shape[:2])
        for row, column, channel in ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)):
            mosaic[row::2, column::2] = linear[row::2, column::2, channel]
        return (np.rint(mosaic * 4095).astype("<u2") << 4).tobytes()
    coded = srgb_encode(linear)
    if pixel_format == "MJPG":
        bgr = np.rint(coded[..., ::-1] * 255).astype(np.uint8)
        return bytes(cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, 95])[1])
    luma = coded @ (0.299, 0.587, 0.114)
    if pixel_format == "GREY":
        return np.rint(luma * 255).astype(np.uint8).tobytes()
    blue = 128 + 224 * (coded[..., 2] - luma) / 1.772
    red = 128 + 224 * (coded[..., 0] - luma) / 1.402
    packed = np.empty((*luma.shape, 2))
    packed[..., 0] = 16 + 219 * luma
    packed[:, 0::2, 1] = (blue[:, 0::2] + blue[:, 1::2]) / 2
    packed[:, 1::2, 1] = (red[:, 0::2] + red[:, 1::2]) / 2
    return np.rint(packed).astype(np.uint8).tobytes()


def _automatic(radiance: Array, exposures: Sequence[int]) -> int:
    means = [np.minimum(radiance * exposure * UNIT_S, 1).mean() for exposure in exposures]
    return exposures[int(np.argmin(np.abs(np.array(means) - _MEAN_WANTED)))]
