"""How surely a calibrated lens knows the direction that a pixel sees, by its angle from the axis.

Domain : errors of directions at pixels, in rad, after the rotation that fits them best is taken
out: where the camera frame points is set anew whenever the camera is set up, so that a common
rotation of all directions is no error of the lens. The rotation is fitted over the angles at which
corners were seen, every solid angle with the same weight.
Source : the idea of D. Kogan's mrcal, covariance of the parameters carried to the projection with
the board poses marginalised; there the rotation comes from the poses, here from the directions.
Fails  : where the lens is of another kind than the model: see `spread` and the split difference.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel

Array = NDArray[np.float64]

_AZIMUTHS = 16

_LEAST_AREA = 1e-6
"""Square pixels a steradian below which a direction has no pixel of its own."""


@dataclass(frozen=True, eq=False)
class Fan:
    """Directions at steps of angle and azimuth, and how a rotation of all of them is taken out.

    Attributes
    ----------
    angle_rad : (A,) float64
        From the axis, from just off it to the last.
    directions : (A, 16, 3) float64
    tangents : (A, 16, 3, 2) float64
        Outward and around, unit vectors orthogonal to the direction.
    weight : (A, 16) float64
        Of the rotation's fit: the solid angle, 0 where nothing was seen.
    """

    angle_rad: Array
    directions: Array
    tangents: Array
    weight: Array

    def without_rotation(self, errors: Array) -> Array:
        """Return errors (A, 16, 2, …) along the tangents less the rotation that fits them best."""
        turns = np.cross(self.directions[..., None, :], np.swapaxes(self.tangents, -1, -2))
        normal = np.einsum("aj,ajkc,ajkd->cd", self.weight, turns, turns)
        pull = np.einsum("aj,ajkc,ajk...->c...", self.weight, turns, errors)
        # Where no direction has weight there is no rotation to be taken out.
        rotation = (np.linalg.pinv(normal) @ pull.reshape(3, -1)).reshape(pull.shape)
        return np.asarray(errors - np.einsum("ajkc,c...->ajk...", turns, rotation))


def fan(seen_rad: tuple[float, float], last_angle_rad: float, count: int = 64) -> Fan:
    """Return directions at `count` angles up to the last; rotations are fitted to those seen."""
    angle = np.linspace(0.0, last_angle_rad, count + 1)[1:]
    azimuth = np.arange(_AZIMUTHS) * (2 * np.pi / _AZIMUTHS)
    sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]
    x, y = np.cos(azimuth), np.sin(azimuth)
    zero = np.zeros((count, _AZIMUTHS))
    directions = np.stack([sine * x, sine * y, cosine + zero], axis=-1)
    outward = np.stack([cosine * x, cosine * y, zero - sine], axis=-1)
    around = np.stack([zero - y, zero + x, zero], axis=-1)
    seen = (angle >= seen_rad[0]) & (angle <= seen_rad[1])
    weight = np.where(seen, np.sin(angle), 0.0)[:, None] + zero
    return Fan(angle, directions, np.stack([outward, around], axis=-1), weight)


def direction_covariance(
    model: CameraModel, free: NDArray[np.bool_], covariance: Array, at: Fan
) -> Array:
    """Return the covariance (A, 16, 2, 2) of directions along the tangents, in rad².

    Of the model with the covariance (P', P') of its free parameters; NaN where it has no pixel.
    """
    by_direction, by_parameters = model.project_jacobian(at.directions)
    by_tangent = by_direction @ at.tangents
    # At the model's own limit the pixel does not move with the angle: NaN and 0 both fail this.
    (a, b), (c, d) = np.moveaxis(by_tangent, (-2, -1), (0, 1))
    seen = np.asarray(np.abs(a * d - b * c) > _LEAST_AREA)
    by_tangent[~seen] = np.eye(2)
    # A pixel stays where it is: what the parameters move, the direction moves back.
    moved = np.asarray(-np.linalg.solve(by_tangent, np.nan_to_num(by_parameters[..., free])))
    moved = at.without_rotation(moved)
    result = moved @ covariance @ np.swapaxes(moved, -1, -2)
    result[~seen] = np.nan
    return np.asarray(result)


def direction_difference(model: CameraModel, truth: CameraModel, at: Fan) -> Array:
    """Return by how much (A, 16, 2) the model's directions differ from the truth's, in rad.

    At the pixels where the truth sees the fan's directions, along the tangents, without the
    rotation that fits best; NaN where either has none.
    """
    pixels, _ = truth.project(at.directions)
    directions, seen = model.unproject(pixels)
    offset = np.nan_to_num(directions - at.directions)
    along = np.einsum("ajc,ajck->ajk", offset, at.tangents)
    seen &= np.isfinite(pixels).all(axis=-1)
    inside = Fan(at.angle_rad, at.directions, at.tangents, at.weight * seen)
    difference = inside.without_rotation(along)
    difference[~seen] = np.nan
    return np.asarray(difference)


def sigma_by_angle(covariance: Array) -> Array:
    """Return the standard deviation (A,) along the worst tangent, rms over each angle's azimuths.

    Infinite where any azimuth has none.
    """
    known = np.asarray(np.isfinite(covariance).all(axis=(-1, -2)))
    largest = np.linalg.eigvalsh(np.where(known[..., None, None], covariance, 0.0))[..., -1]
    return np.sqrt(np.where(known, np.maximum(largest, 0.0), np.inf).mean(axis=-1))
