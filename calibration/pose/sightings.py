"""Sightings of the sun: in which direction pictures show it, and the pose that follows.

Input  : pictures of the sky with their moments, the camera's lens, the place.
Output : a Sighting for each picture, and a SunPose from those that are right.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import Calibration
from calibration.pose.sky_pictures import SkyPicture
from calibration.pose.sun_disc import NoSun, find_sun
from calibration.pose.sun_lens import LensBySun, lens_by_sun
from calibration.pose.sun_position import sun_directions
from calibration.pose.sun_track import SunPose, pose_by_sun
from capture.errors import InputError, UnreadableFrame

_LEAST_ALTITUDE_RAD = np.deg2rad(5.0)
"""Below it refraction changes with the weather, and haze takes the sun's lower half."""

_LEAST_SIGMA_PX = 0.1
"""No better is a sun found whose glare a cloud or the lens deforms."""

_FULL_SHARE = 0.98
"""Of the white level: JPEG rings around a clipped sun."""

_ROWS = 64


@dataclass(frozen=True)
class Sighting:
    """What a picture shows of the sun; without pixel or residual it was left out for `reason`."""

    name: str
    timestamp_s: float
    pixel_px: tuple[float, float] | None = None
    residual_rad: float | None = None
    reason: str = ""


def sight(pictures: Iterable[SkyPicture], camera: Calibration) -> list[Sighting]:
    """Return for each picture the pixel in which it shows the sun, or why it does not.

    Raises
    ------
    InputError
        If a picture is not of the size that the calibration holds for.
    """
    seen = _seen(camera)
    return [_sight(picture, camera, seen) for picture in pictures]


def solve(
    camera: Calibration, sightings: list[Sighting], latitude_rad: float, longitude_rad: float
) -> tuple[SunPose, list[Sighting]]:
    """Return the pose, and the sightings with residuals and with reasons of those left out.

    Raises
    ------
    InputError
        If the sightings do not tell the pose: see `pose_by_sun`.
    """
    judged, used, pixels, sun = _judged(sightings, latitude_rad, longitude_rad)
    sighted, _ = camera.model.unproject(pixels)
    try:
        pose = pose_by_sun(sighted, sun, _sigma_rad(camera, pixels))
    except InputError as error:
        raise InputError(f"{error}{_main_reason(judged)}") from None
    for row, number in enumerate(used):
        residual = float(pose.residual_rad[row])
        reason = "" if pose.kept[row] else "it is not on the sun's path"
        judged[number] = replace(judged[number], residual_rad=residual, reason=reason)
    return pose, judged


def solve_with_lens(
    camera: Calibration, sightings: list[Sighting], latitude_rad: float, longitude_rad: float
) -> tuple[LensBySun, SunPose, list[Sighting]]:
    """Return what `solve` does for the lens, too, whose focal length and centre are sought.

    Raises
    ------
    InputError
        If the sightings do not tell pose and lens: see `lens_by_sun`.
    """
    judged, _, pixels, sun = _judged(sightings, latitude_rad, longitude_rad)
    try:
        lens = lens_by_sun(camera.model, pixels, sun, _LEAST_SIGMA_PX)
    except InputError as error:
        raise InputError(f"{error}{_main_reason(judged)}") from None
    found = replace(camera, model=lens.model)
    pose, judged = solve(found, sightings, latitude_rad, longitude_rad)
    of_pose = lens.covariance[:3, :3]
    return lens, replace(pose, R_world_camera=lens.R_world_camera, covariance_rad2=of_pose), judged


def _judged(
    sightings: list[Sighting], latitude_rad: float, longitude_rad: float
) -> tuple[list[Sighting], list[int], NDArray[np.float64], NDArray[np.float64]]:
    """Return the sightings, which of them are of use, and their pixels (n, 2) and suns (n, 3)."""
    moments = np.array([each.timestamp_s for each in sightings])
    sun = sun_directions(moments, latitude_rad, longitude_rad)
    judged = [
        _high_enough(sighting, altitude)
        for sighting, altitude in zip(sightings, np.arcsin(sun[:, 1]), strict=True)
    ]
    used = [number for number, each in enumerate(judged) if not each.reason]
    pixels = np.array([judged[number].pixel_px for number in used]).reshape(-1, 2)
    return judged, used, pixels, sun[used]


def _sight(picture: SkyPicture, camera: Calibration, seen: NDArray[np.bool_]) -> Sighting:
    missing = Sighting(picture.name, picture.timestamp_s)
    try:
        counts, sensor = picture.read()
    except UnreadableFrame as error:
        return replace(missing, reason=str(error))
    camera.check_size((counts.shape[1], counts.shape[0]), picture.name)
    brightness = np.nan_to_num(counts.min(axis=2).astype(np.float32), posinf=0.0)
    full = np.inf
    if counts.dtype != np.float32:
        full = sensor.black_dn + _FULL_SHARE * (sensor.white_dn - sensor.black_dn)
    found = find_sun(brightness, full, seen)
    if isinstance(found, NoSun):
        return replace(missing, reason=found.reason)
    return replace(missing, pixel_px=found.centre_px)


def _high_enough(sighting: Sighting, altitude_rad: float) -> Sighting:
    if sighting.reason or altitude_rad >= _LEAST_ALTITUDE_RAD:
        return sighting
    return replace(sighting, reason="the sun stood below 5° above the horizon")


def _seen(camera: Calibration) -> NDArray[np.bool_]:
    """Return where (H, W) the picture shows directions that are known; in strips, to save room."""
    width, height = camera.image_size_px
    columns = np.arange(width, dtype=np.float64)
    strips = []
    for upper in range(0, height, _ROWS):
        rows = np.arange(upper, min(upper + _ROWS, height), dtype=np.float64)
        strips.append(camera.unproject(np.stack(np.meshgrid(columns, rows), axis=-1))[1])
    return np.concatenate(strips)


def _sigma_rad(camera: Calibration, pixels: NDArray[np.float64]) -> float:
    """Return the angle that the least standard deviation of a sighting is, in the median."""
    if not len(pixels):
        return 0.0
    half = np.array([[[0.5, 0.0]], [[0.0, 0.5]]])
    ahead, _ = camera.model.unproject(pixels + half)
    behind, _ = camera.model.unproject(pixels - half)
    return _LEAST_SIGMA_PX * float(np.nanmedian(np.linalg.norm(ahead - behind, axis=-1)))


def _main_reason(sightings: list[Sighting]) -> str:
    reasons = [each.reason for each in sightings if each.reason]
    if not reasons:
        return ""
    most = max(set(reasons), key=reasons.count)
    return f" (of {len(sightings)} pictures {len(reasons)} show no sun, most often: {most})"
