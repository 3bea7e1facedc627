"""What lenses with an axis of symmetry share: only the radius as a function of the angle differs.

Domain : a direction at the angle θ from +z and the azimuth φ (from +x toward +y) lands at the pixel
c + f ρ(θ) (cos φ, sin φ). ρ is the lens: the radius in focal lengths.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError

Focal = float | tuple[float, float]
"""Pixels per unit of ρ: one number, or (fx, fy) where the pixels are not square."""

RadialFunction = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def check_lens(centre_px: tuple[float, float], focal_px: Focal) -> None:
    """Raise InputError unless the centre is finite and the focal lengths are positive."""
    if not np.all(np.isfinite(centre_px)):
        raise InputError(f"centre_px must be finite, got {centre_px}")
    if not (np.all(np.isfinite(focal_px)) and np.all(np.asarray(focal_px) > 0)):
        raise InputError(f"focal_px must be positive, got {focal_px}")


def project_radial(
    directions: NDArray[np.floating],
    centre_px: tuple[float, float],
    focal_px: Focal,
    radius_of_angle: RadialFunction,
    limit_angle_rad: float,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return pixels (..., 2) and validity (...) of directions (..., 3) in the camera frame.

    Valid are finite, non-zero directions up to `limit_angle_rad` from the axis; others are NaN.
    Opposite the axis, where every azimuth meets, φ = 0 is taken. `radius_of_angle` is only asked
    for angles (n,) up to the limit.
    """
    directions = np.asarray(directions, np.float64)
    sideways = np.hypot(directions[..., 0], directions[..., 1])
    angle = np.arctan2(sideways, directions[..., 2])
    valid = np.isfinite(directions).all(axis=-1) & directions.any(axis=-1)
    valid &= angle <= limit_angle_rad
    azimuth = np.broadcast_to([1.0, 0.0], (*angle.shape, 2)).copy()
    off_axis = (valid & (sideways > 0))[..., None]
    np.divide(directions[..., :2], sideways[..., None], out=azimuth, where=off_axis)
    pixels = np.full((*angle.shape, 2), np.nan)
    radius = radius_of_angle(angle[valid])
    pixels[valid] = np.asarray(centre_px) + np.asarray(focal_px) * radius[:, None] * azimuth[valid]
    return pixels, np.asarray(valid)


def unproject_radial(
    pixels: NDArray[np.floating],
    centre_px: tuple[float, float],
    focal_px: Focal,
    angle_of_radius: RadialFunction,
    limit_radius: float,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return camera-frame unit directions (..., 3) and validity (...) of pixels (..., 2).

    Valid are pixels up to ρ = `limit_radius` from the centre; the directions of others are NaN.
    `angle_of_radius` is only asked for radii (n,) up to the limit.
    """
    offset = (np.asarray(pixels, np.float64) - np.asarray(centre_px)) / np.asarray(focal_px)
    radius = np.hypot(offset[..., 0], offset[..., 1])
    valid = radius <= limit_radius
    radius, offset = radius[valid], offset[valid]
    angle = angle_of_radius(radius)
    sine_per_radius = np.divide(np.sin(angle), radius, out=np.ones_like(radius), where=radius > 0)
    directions = np.full((*valid.shape, 3), np.nan)
    directions[valid] = np.concatenate(
        [offset * sine_per_radius[:, None], np.cos(angle)[:, None]], axis=1
    )
    return directions, np.asarray(valid)
