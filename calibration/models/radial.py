"""What lenses with an axis of symmetry share: only the radius as a function of the angle differs.

Domain : a direction at the angle θ from +z and the azimuth φ (from +x toward +y) lands at the pixel
c + f ρ(θ) (cos φ, sin φ). ρ is the lens: the radius in focal lengths.
Cost   : about 25 ns a point either way, on one core, and what the lens's own function takes.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from capture.errors import InputError

Array = NDArray[np.float64]

Focal = float | tuple[float, float]
"""Pixels per unit of ρ: one number, or (fx, fy) where the pixels are not square."""

RadialFunction = Callable[[Array], Array]

Derivatives = tuple[Array, Array, Sequence[Array]]
"""ρ, dρ/dθ and ∂ρ/∂k for each of the lens's own parameters k, all (n,)."""

FARTHEST = 1e6
"""Radius in focal lengths where models end whose radius grows without bound."""


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
) -> tuple[Array, NDArray[np.bool_]]:
    """Return pixels (..., 2) and validity (...) of directions (..., 3) in the camera frame.

    Valid are directions up to `limit_angle_rad` from the axis whose squared length is neither 0 nor
    infinite; others are NaN. Opposite the axis, where every azimuth meets, φ = 0 is taken.
    `radius_of_angle` is only asked for angles (n,) up to the limit.
    """
    directions = np.asarray(directions, np.float64)
    shape = directions.shape[:-1]
    flat = np.ascontiguousarray(directions).reshape(-1, 3)
    angle, valid = _angles(flat, limit_angle_rad)
    centre, focal = np.array(centre_px, np.float64), _pair(focal_px)
    pixels = _pixels(flat, radius_of_angle(angle), valid, centre, focal)
    return pixels.reshape(*shape, 2), valid.reshape(shape)


def unproject_radial(
    pixels: NDArray[np.floating],
    centre_px: tuple[float, float],
    focal_px: Focal,
    angle_of_radius: RadialFunction,
    limit_radius: float,
) -> tuple[Array, NDArray[np.bool_]]:
    """Return camera-frame unit directions (..., 3) and validity (...) of pixels (..., 2).

    Valid are pixels up to ρ = `limit_radius` from the centre; the directions of others are NaN.
    `angle_of_radius` is only asked for radii (n,) up to the limit.
    """
    pixels = np.asarray(pixels, np.float64)
    shape = pixels.shape[:-1]
    flat = np.ascontiguousarray(pixels).reshape(-1, 2)
    centre, focal = np.array(centre_px, np.float64), _pair(focal_px)
    radius, valid = _radii(flat, centre, focal, limit_radius)
    directions = _directions(flat, radius, angle_of_radius(radius), valid, centre, focal)
    return directions.reshape(*shape, 3), valid.reshape(shape)


def radial_jacobian(
    directions: NDArray[np.floating],
    focal_px: Focal,
    derivatives: Callable[[Array], Derivatives],
    limit_angle_rad: float,
) -> tuple[Array, Array]:
    """Return ∂pixel/∂direction (..., 2, 3) and ∂pixel/∂parameters (..., 2, P) of project_radial.

    The parameters are the centre, the focal length or both, and the lens's own, whose derivatives
    are asked for at angles (n,) up to the limit. ∂pixel/∂f is the point at f = 1, ρ (cos φ, sin φ).
    NaN where a direction is not valid, and opposite the axis, where there is no derivative.
    """
    directions = np.asarray(directions, np.float64)
    x, y, z = directions.reshape(-1, 3).T
    angle, valid = _angles(np.ascontiguousarray(directions).reshape(-1, 3), limit_angle_rad)
    sideways = np.hypot(x, y)
    on_axis = sideways == 0
    valid &= ~on_axis | (z > 0)
    radius, slope, by_own = derivatives(angle)
    focal = _pair(focal_px)

    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        cosine = np.where(on_axis, 1.0, x / sideways)
        sine = np.where(on_axis, 0.0, y / sideways)
        # Across the azimuth a step of the direction turns it by step / sideways and moves the point
        # by that times ρ; on the axis the ratio is the limit, as along the azimuth.
        across = np.where(on_axis, slope / z, radius / sideways)
        squared = sideways**2 + z**2
        along, inward = slope * z / squared, -slope * sideways / squared

    outward = np.stack([cosine, sine], axis=-1)
    aside = np.stack([-sine, cosine], axis=-1)
    along[~valid], across[~valid], inward[~valid] = np.nan, np.nan, np.nan
    by_direction = np.empty((len(angle), 2, 3))
    by_direction[..., :2] = (
        along[:, None, None] * outward[:, :, None] * outward[:, None, :]
        + across[:, None, None] * aside[:, :, None] * aside[:, None, :]
    )
    by_direction[..., 2] = inward[:, None] * outward
    by_direction *= focal[:, None]

    columns = [(each[:, None] * outward * focal)[..., None] for each in by_own]
    by_parameters = np.concatenate(
        [by_centre_and_focal(radius[:, None] * outward, focal_px), *columns], axis=-1
    )

    by_parameters[~valid] = np.nan
    shape = directions.shape[:-1]
    return by_direction.reshape(*shape, 2, 3), by_parameters.reshape(*shape, 2, -1)


def by_centre_and_focal(spread: Array, focal_px: Focal) -> Array:
    """Return ∂pixel/∂(cx, cy, f) or /∂(cx, cy, fx, fy) where pixel = c + f · spread (..., 2)."""
    by_centre = np.broadcast_to(np.eye(2), (*spread.shape, 2))
    by_focal = spread[..., None] if np.ndim(focal_px) == 0 else spread[..., None] * np.eye(2)
    return np.concatenate([by_centre, by_focal], axis=-1)


def invert_rising(
    target: Array, rising: Callable[[Array], tuple[Array, Array]], start: Array, limit: float
) -> Array:
    """Return x (n,) in [0, limit] at which a rising function takes the values `target` (n,).

    Newton's method, kept inside a bracket that halves where it would leave. `rising` returns the
    function and its derivative at x (n,); targets beyond its range return the end nearest to them.
    """
    low, high = np.zeros_like(target), np.full_like(target, limit)
    x = np.clip(start, 0.0, limit)
    for _ in range(100):  # bisection alone would reach full precision in fewer
        value, slope = rising(x)
        error = value - target
        low = np.where(error <= 0, x, low)
        high = np.where(error >= 0, x, high)
        step = np.divide(error, slope, out=np.full_like(error, np.inf), where=slope > 0)
        newton = x - step
        inside = (newton >= low) & (newton <= high)
        following = np.where(inside, newton, (low + high) / 2)
        settled = np.abs(following - x) <= 1e-15 * np.maximum(x, 1.0)
        x = following
        if settled.all():
            break
    return x


def first_positive_root(coefficients: NDArray[np.floating]) -> float:
    """Return the least positive root of a polynomial, at most `FARTHEST`.

    The coefficients, the constant first, begin with a positive one: the greatest root of the
    reversed polynomial is the inverse of what is wanted, however small the last coefficients are.
    """
    inverse = np.roots(coefficients)
    real = inverse.real[np.abs(inverse.imag) < 1e-9]
    return float(1.0 / real.max(initial=1.0 / FARTHEST))


def _pair(focal_px: Focal) -> Array:
    return np.broadcast_to(np.asarray(focal_px, np.float64), 2).copy()


@njit(cache=True, nogil=True)
def _angles(directions: Array, limit_angle_rad: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return the angles (n,) from +z, 0 where not valid, and the validity of directions (n, 3)."""
    angle = np.empty(len(directions))
    valid = np.empty(len(directions), np.bool_)
    for i in range(len(directions)):
        x, y, z = directions[i]
        sideways_squared = x * x + y * y
        from_axis = np.arctan2(np.sqrt(sideways_squared), z)
        is_direction = 0.0 < sideways_squared + z * z < np.inf  # false where anything is NaN
        valid[i] = is_direction and from_axis <= limit_angle_rad
        angle[i] = from_axis if valid[i] else 0.0
    return angle, valid


@njit(cache=True, nogil=True)
def _pixels(
    directions: Array, radius: Array, valid: NDArray[np.bool_], centre: Array, focal: Array
) -> Array:
    """Return the pixels (n, 2) at radii (n,) in focal lengths, at the azimuths of directions."""
    pixels = np.full((len(radius), 2), np.nan)
    for i in range(len(radius)):
        if valid[i]:
            x, y = directions[i, 0], directions[i, 1]
            sideways = np.sqrt(x * x + y * y)
            cosine, sine = (x / sideways, y / sideways) if sideways > 0 else (1.0, 0.0)
            pixels[i, 0] = centre[0] + focal[0] * radius[i] * cosine
            pixels[i, 1] = centre[1] + focal[1] * radius[i] * sine
    return pixels


@njit(cache=True, nogil=True)
def _radii(
    pixels: Array, centre: Array, focal: Array, limit_radius: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the radii (n,) in focal lengths, 0 where not valid, and the validity of pixels."""
    radius = np.empty(len(pixels))
    valid = np.empty(len(pixels), np.bool_)
    for i in range(len(pixels)):
        x, y = (pixels[i, 0] - centre[0]) / focal[0], (pixels[i, 1] - centre[1]) / focal[1]
        from_centre = np.sqrt(x * x + y * y)
        valid[i] = from_centre <= limit_radius
        radius[i] = from_centre if valid[i] else 0.0
    return radius, valid


@njit(cache=True, nogil=True)
def _directions(
    pixels: Array,
    radius: Array,
    angle: Array,
    valid: NDArray[np.bool_],
    centre: Array,
    focal: Array,
) -> Array:
    """Return the unit directions (n, 3) at angles (n,) from +z, at the azimuths of pixels."""
    directions = np.full((len(radius), 3), np.nan)
    x_scale, y_scale = 1.0 / focal[0], 1.0 / focal[1]
    for i in range(len(radius)):
        if valid[i]:
            share = np.sin(angle[i]) / radius[i] if radius[i] > 0 else 1.0
            directions[i, 0] = share * x_scale * (pixels[i, 0] - centre[0])
            directions[i, 1] = share * y_scale * (pixels[i, 1] - centre[1])
            directions[i, 2] = np.cos(angle[i])
    return directions
