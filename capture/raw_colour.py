"""The colours of a RAW file's camera: from its own channels to linear Rec.709.

Input  : matrices of a DNG file, or of LibRaw's table of cameras.
Output : a matrix that takes camera RGB to Rec.709, and a line on where it comes from.
Fails  : no matrix is exact for all spectra, for no camera's channels are sums of the eye's. One
         that was made for daylight is off by several percent under lamps, and more under LEDs.

The white balance is daylight's, always: light of D65 is neutral, an incandescent lamp is orange.
What is captured lights a scene, so its colour must be that of the light, and not depend on what a
photographer or a camera's automatic took for white. A camera's "as shot" balance would make the
lamp white, and no balance at all would make daylight green.

Of a DNG's two matrices the one made for the light nearest to daylight is used, with its
ForwardMatrix if there is one. "Digital Negative (DNG) Specification" by Adobe, chapter "Mapping
Camera Color Space to CIE XYZ Space", says what the tags mean.
"""

import math
from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from capture.primaries import REC709, adaptation, rgb_to_xyz

_DAYLIGHT_K = 6504.0
_TEMPERATURE_K = {
    1: 5500, 2: 4200, 3: 2856, 4: 5500, 9: 5500, 10: 6500, 11: 7500, 12: 6400, 13: 5050, 14: 4150,
    15: 3525, 17: 2856, 18: 4874, 19: 6774, 20: 5503, 21: 6504, 22: 7504, 23: 5003, 24: 3200,
}  # fmt: skip
"""Correlated colour temperature of EXIF's light sources, by their numbers."""
_NAMES = {0: "an unnamed light", 17: "standard light A", 20: "D55", 21: "D65", 22: "D75", 23: "D50"}

_UNUSABLE = "no colour matrix, the camera's channels are taken for Rec.709"
_LARGEST, _LARGEST_CONDITION = 100.0, 1e4
"""A camera's numbers are below 10. Beyond these, noise is all that would be seen."""
_D50_XY = (0.3457, 0.3585)

_Nine = tuple[float, float, float, float, float, float, float, float, float]


class DngMatrix(msgspec.Struct, frozen=True):
    """What a DNG file says for one illuminant (EXIF's number); matrices row by row."""

    xyz_to_camera: _Nine
    illuminant: int = 0
    calibration: _Nine | None = None
    camera_to_d50: _Nine | None = None


def camera_to_rec709(
    matrices: Sequence[DngMatrix],
    analog_balance: Sequence[float] | None,
    table: ArrayLike,
) -> tuple[NDArray[np.float64] | None, str]:
    """Return the (3, 3) matrix from a camera's linear RGB to linear Rec.709, and its origin.

    Light of D65 that just fills the most sensitive channel has the radiance (1, 1, 1).

    Parameters
    ----------
    matrices : sequence of DngMatrix
        Empty for a file that is no DNG.
    analog_balance : (3,) sequence or None
        DNG's AnalogBalance.
    table : (3, 3) array_like
        XYZ to camera RGB as LibRaw's table of cameras has it, for D65; zeros if it has none.

    Returns
    -------
    matrix : (3, 3) float64, or None
        None if there is no usable matrix.
    origin : str
        For people.
    """
    forward = None
    if matrices:
        chosen = min(matrices, key=_distance_from_daylight)
        gains = np.diag(analog_balance or (1.0, 1.0, 1.0))
        if chosen.calibration is not None:
            gains = gains @ np.reshape(chosen.calibration, (3, 3))
        xyz_to_camera = gains @ np.reshape(chosen.xyz_to_camera, (3, 3))
        origin = f"colour matrix of the file for {_name(chosen.illuminant)}"
        if chosen.camera_to_d50 is not None:
            forward = np.reshape(chosen.camera_to_d50, (3, 3))
            origin = f"forward and {origin}"
    else:
        xyz_to_camera, gains = np.asarray(table, np.float64), np.eye(3)
        origin = "colour matrix of LibRaw's table for D65"
    rec709_to_xyz = rgb_to_xyz(REC709)
    rec709_to_camera = xyz_to_camera @ rec709_to_xyz
    neutral = rec709_to_camera.sum(axis=1)
    if not np.all(neutral > 0) or np.linalg.cond(rec709_to_camera) > _LARGEST_CONDITION:
        return None, _UNUSABLE
    neutral /= neutral.max()
    if forward is None:
        matrix = np.linalg.inv(rec709_to_camera)
    else:
        balanced = np.diag(1 / (np.linalg.inv(gains) @ neutral)) @ np.linalg.inv(gains)
        matrix = np.linalg.inv(rec709_to_xyz) @ adaptation(_D50_XY, REC709[3]) @ forward @ balanced
    white = matrix @ neutral
    if not np.all(white > 0):
        return None, _UNUSABLE
    matrix /= white[:, None]
    if np.abs(matrix).max() > _LARGEST or np.linalg.cond(matrix) > _LARGEST_CONDITION:
        return None, _UNUSABLE
    return matrix, f"{origin}, daylight white"


def _distance_from_daylight(matrix: DngMatrix) -> float:
    temperature_k = _TEMPERATURE_K.get(matrix.illuminant)
    return math.inf if temperature_k is None else abs(1 / temperature_k - 1 / _DAYLIGHT_K)


def _name(illuminant: int) -> str:
    return _NAMES.get(illuminant, f"light source {illuminant} of EXIF")
