"""Samples of a lens's vignetting, from pictures of even light, of one lamp, or of one scene.

Input  : linear radiance of camera pictures, and their calibrations.    Output : Samples.
Pixels that are clipped, not valid or beyond what the calibration sees are left out. Values are the
mean of the three channels: glass darkens them alike.
Fails  : on light that changes between the pictures; and a flat field that is not even all over is
taken for vignetting, so turn the camera about its axis between two or more of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from calibration.camera import Calibration
from calibration.vignetting import Samples
from capture.errors import InputError
from capture.radiance import RadianceImage

Array = NDArray[np.float64]
_Part = tuple[NDArray[Any], ...]
"""Of a picture, in the order of the fields of Samples."""

_PATCHES = 3000
"""Of a flat field: more would only be more correlated."""
_GOOD_SHARE = 0.3
_SECTORS, _RINGS = 12, 5
_POINTS = 2500
"""Directions on the sphere at which overlapping pictures are compared."""
_CLEAR = 10.0
"""How many standard deviations of the background a lamp must stand out by."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A picture, the camera that took it, and the name that messages call it by."""

    name: str
    image: RadianceImage
    calibration: Calibration

    def __post_init__(self) -> None:
        self.calibration.check_size(self.image.size_px, self.name)

    @property
    def value(self) -> Array:
        """(H, W) mean of the channels."""
        return self.image.radiance.mean(axis=-1, dtype=np.float64)

    @property
    def is_good(self) -> NDArray[np.bool_]:
        """(H, W) where the value can be used as it is."""
        return self.image.valid & ~self.image.clipped


def flat_samples(shots: Sequence[Shot]) -> Samples:
    """Return samples of evenly lit pictures: an integrating sphere, opal glass, paper, fog.

    Medians of square patches, so that dust and hot pixels do not matter. One picture cannot tell
    an uneven lens from an uneven light; of two or more, between which the camera was turned about
    its axis, the fit may find a lens that differs around it.
    """
    parts: list[_Part] = []
    for light, shot in enumerate(shots):
        width, height = shot.image.size_px
        side = max(4, int(np.ceil(np.sqrt(width * height / _PATCHES))))
        rows, columns = height // side, width // side
        if rows * columns < 100:
            raise InputError(f"{shot.name}: {width}×{height} px are too few for a flat field")
        good, value = (
            each[: rows * side, : columns * side]
            .reshape(rows, side, columns, side)
            .swapaxes(1, 2)
            .reshape(rows * columns, -1)
            for each in (shot.is_good, shot.value)
        )
        corner = (
            np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), -1).reshape(-1, 2) * side
        )
        around = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) * (side - 1)
        _, seen = shot.calibration.unproject((corner[:, None] + around).astype(np.float64))
        usable = seen.all(axis=1) & (good.mean(axis=1) >= _GOOD_SHARE)
        median = np.nanmedian(np.where(good, value, np.nan)[usable], axis=1)
        centre = corner[usable] + (side - 1) / 2
        angle, azimuth = _place(shot.calibration, centre[median > 0])
        sector = ((azimuth + np.pi) / (2 * np.pi) * _SECTORS).astype(np.int64) % _SECTORS
        ring = (angle / (angle.max(initial=0) + 1e-9) * _RINGS).astype(np.int64)
        block = (light * _RINGS + ring) * _SECTORS + sector
        parts.append(
            (angle, azimuth, np.log(median[median > 0]), np.full(angle.size, light), block)
        )
    return _joined(parts, tells_unevenness=len(shots) > 1)


def lamp_samples(shots: Sequence[Shot], lamp_radius_rad: float) -> Samples:
    """Return a sample of each picture of one lamp, past which the camera was turned.

    What counts is the lamp's flux, ∫ L dω, less that of what surrounds it; so the lens may blur it,
    within the radius.

    Parameters
    ----------
    shots : sequence of Shot
    lamp_radius_rad : float
        Holds the lamp and its blur. Its surroundings are taken up to twice that.

    Raises
    ------
    InputError
        If in a picture no lamp stands out, or it is clipped or cut off by the rim.
    """
    found = [_lamp(shot, lamp_radius_rad) for shot in shots]
    angle, azimuth, flux = (np.array(each) for each in zip(*found, strict=True))
    one = np.zeros(angle.size, np.int64)
    return _joined([(angle, azimuth, np.log(flux), one, np.arange(angle.size))], True)


def overlap_samples(shots: Sequence[Shot]) -> Samples:
    """Return samples of directions that two or more pictures of a still scene show.

    Each picture's calibration holds its own R_world_camera. Directions whose surroundings are not
    wholly good in a picture are left out there. Edges in the scene, where a small error of the lens
    or its pose looks like vignetting, are the fit's outliers.

    Raises
    ------
    InputError
        If the pictures have hardly anything in common.
    """
    order = np.arange(_POINTS)
    height = 1 - (2 * order + 1) / _POINTS
    turn = order * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - height**2)
    directions = np.stack([across * np.cos(turn), height, across * np.sin(turn)], axis=-1)
    parts: list[_Part] = []
    for shot in shots:
        pixels, seen = shot.calibration.project(directions)
        value, usable = _smooth_values(shot, np.where(seen[:, None], pixels, 0.0))
        chosen = np.flatnonzero(seen & usable)
        angle, azimuth = _place(shot.calibration, pixels[chosen])
        parts.append((angle, azimuth, np.log(value[chosen]), chosen, chosen))
    samples = _joined(parts, tells_unevenness=True)
    shared = np.bincount(samples.light, minlength=_POINTS)[samples.light] > 1
    if np.unique(samples.light[shared]).size < 100:
        raise InputError(
            "the pictures hardly overlap where they are not clipped: turn the camera "
            "by less, and see that each calibration has its picture's R_world_camera"
        )
    light = np.unique(samples.light[shared], return_inverse=True)[1]
    return Samples(
        samples.angle_rad[shared],
        samples.azimuth_rad[shared],
        samples.log_value[shared],
        light,
        light,
        tells_unevenness=True,
    )


def _lamp(shot: Shot, radius_rad: float) -> tuple[float, float, float]:
    """Return angle, azimuth and flux of the lamp in a picture."""
    width, height = shot.image.size_px
    x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    directions, seen = shot.calibration.unproject(np.stack([x, y], axis=-1))
    value = np.where(seen & shot.image.valid, shot.value, 0.0)
    row, column = np.unravel_index(int(np.argmax(cv2.blur(value, (3, 3)) * seen)), value.shape)
    towards = directions[row, column]
    for _ in range(2):  # from the brightest pixel to the middle of the light
        with np.errstate(invalid="ignore"):
            inside = seen & (directions @ towards > np.cos(radius_rad))
        towards = (value[inside, None] * directions[inside]).sum(axis=0)
        towards /= max(np.linalg.norm(towards), np.finfo(np.float64).tiny)  # 0 if all is black
    with np.errstate(invalid="ignore"):
        cosine = np.where(seen, directions @ towards, -1.0)
    inside = cosine > np.cos(radius_rad)
    around = (cosine <= np.cos(radius_rad)) & (cosine > np.cos(2 * radius_rad))
    where = f"{shot.name}: the lamp at pixel {column}, {row}"
    if not shot.is_good[inside].all():
        raise InputError(f"{where} is clipped or not valid; expose it shorter")
    pixel_sr = _pixel_solid_angles(shot.calibration, np.stack([x[inside], y[inside]], axis=-1))
    cap_sr = 2 * np.pi * (1 - np.cos(radius_rad))
    if inside.sum() < 9 or abs(pixel_sr.sum() / cap_sr - 1) > 0.2 or not around.any():
        raise InputError(f"{where} is cut off by the rim, or its radius spans too few pixels")
    background = float(np.median(value[around]))
    scatter = 1.4826 * float(np.median(np.abs(value[around] - background)))
    if value[inside].max() - background <= _CLEAR * scatter + 1e-3 * background:
        raise InputError(f"{where} does not stand out from what surrounds it")
    flux = float(((value[inside] - background) * pixel_sr).sum())
    pixel, _ = shot.calibration.project(towards)
    angle, azimuth = _place(shot.calibration, pixel[None])
    return float(angle[0]), float(azimuth[0]), flux


def _smooth_values(shot: Shot, pixels: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the mean around pixels (n, 2), and whether all around them is good and not black."""
    side = max(3, 2 * (max(shot.image.size_px) // 400) + 1)
    reach = np.ones((side + 2, side + 2), np.uint8)  # of the mean, and of its interpolation
    good = cv2.erode(
        shot.is_good.astype(np.uint8), reach, borderType=cv2.BORDER_CONSTANT, borderValue=0
    )
    mean = cv2.blur(shot.value, (side, side))
    sampled = map_coordinates(mean, pixels.T[::-1], order=1, mode="nearest")
    x, y = np.clip(np.rint(pixels).astype(int), 0, np.array(shot.image.size_px) - 1).T
    return sampled, (good[y, x] > 0) & (sampled > 0)


def _pixel_solid_angles(calibration: Calibration, pixels: Array) -> Array:
    """Return the solid angle of pixels (n, 2), in sr, by central differences."""
    right, left, down, up = (
        calibration.unproject(pixels + offset)[0]
        for offset in ((0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5))
    )
    return np.asarray(np.linalg.norm(np.cross(right - left, down - up), axis=-1))


def _place(calibration: Calibration, pixels: Array) -> tuple[Array, Array]:
    """Return angle from the axis and azimuth of pixels (n, 2) that are seen."""
    directions, _ = calibration.unproject(pixels)
    in_camera = directions @ calibration.R_world_camera
    return calibration.axis_angle(directions), np.arctan2(in_camera[:, 1], in_camera[:, 0])


def _joined(parts: Sequence[_Part], tells_unevenness: bool) -> Samples:
    angle, azimuth, log_value, light, block = (
        np.concatenate(each) for each in zip(*parts, strict=True)
    )
    return Samples(
        angle, azimuth, log_value, light.astype(np.int64), block.astype(np.int64), tells_unevenness
    )
