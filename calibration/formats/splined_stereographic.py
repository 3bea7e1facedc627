"""mrcal's splined stereographic lens: a stereographic one, corrected differently all around.

Domain : u = 2 tan(θ/2) (cos φ, sin φ) lands at the pixel centre + focal · (u + Δ(u)). Δ is a
surface of cubic B-splines, its control values evenly about u = 0; it ends at the outermost but one.
Source : mrcal, "Lens models", LENSMODEL_SPLINED_STEREOGRAPHIC of order 3.
Fails  : as a camera model (calibration/models): on its axis it is corrected too, so that it has no
centre, and it has hundreds of parameters. It is a stop on the way from one lens to another.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError

Array = NDArray[np.float64]

_BASIS = np.array([[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]]) / 6.0
"""The four cubic B-splines over one step: powers 0 to 3 of the place in the step, one a row."""
_ROUNDS = 100
_CLOSE = 1e-13
_COLUMNS = 30
_RIDGE = 1e-6
"""Holds the control values that no pixel reaches."""


@dataclass(frozen=True, eq=False)
class SplinedStereographic:
    """A stereographic lens and corrections.

    Attributes
    ----------
    centre_px, focal_px : (float, float)
    fov_x_deg : int
        Angle of view across the width that the spline covers; with the columns, it gives the step.
    corrections : (Ny, Nx, 2) float64
        Control values, in focal lengths.
    """

    name: ClassVar[str] = "splined_stereographic"
    axis_z: ClassVar[float] = 1.0

    centre_px: tuple[float, float]
    focal_px: tuple[float, float]
    fov_x_deg: int
    corrections: Array

    def __post_init__(self) -> None:
        if min(self.corrections.shape[:2]) < 4 or not 0 < self.fov_x_deg < 360:
            raise InputError("a splined lens has 4 × 4 control values or more, and a field of view")

    @property
    def step(self) -> float:
        """Between control values, in u."""
        edge = 2.0 * np.tan(np.radians(self.fov_x_deg) / 4)
        return float(2.0 * edge / (self.corrections.shape[1] - 3))

    @property
    def limit_angle_rad(self) -> float:
        """Angle of the spline's farthest corner."""
        reach = self.step * (np.array(self.corrections.shape[:2]) - 3) / 2
        return float(2.0 * np.arctan(np.hypot(*reach) / 2))

    def project(self, directions: NDArray[np.floating]) -> tuple[Array, NDArray[np.bool_]]:
        """Return pixels (..., 2) and validity (...) of directions (..., 3)."""
        rays = np.asarray(directions, np.float64)
        length = np.linalg.norm(rays, axis=-1, keepdims=True)
        with np.errstate(invalid="ignore", divide="ignore"):
            u = 2.0 * rays[..., :2] / (length + rays[..., 2:])
        valid = self._is_within(u)
        corrected = u + self._correction(np.where(valid[..., None], u, 0.0))
        pixels = self.centre_px + np.multiply(self.focal_px, corrected)
        return np.where(valid[..., None], pixels, np.nan), valid

    def unproject(self, pixels: NDArray[np.floating]) -> tuple[Array, NDArray[np.bool_]]:
        """Return unit directions (..., 3) and validity (...) of pixels (..., 2)."""
        wanted = (np.asarray(pixels, np.float64) - self.centre_px) / self.focal_px
        reach = self.step * (np.array(self.corrections.shape[1::-1]) - 3) / 2
        u: Array = np.clip(wanted, -reach, reach)
        change = np.full_like(u, np.inf)
        for _ in range(_ROUNDS):
            correction, slope = self._correction_and_slope(u)
            error = u + correction - wanted
            change[:] = -np.linalg.solve(slope + np.eye(2), error[..., None])[..., 0]
            u = np.asarray(np.clip(u + change, -reach, reach), np.float64)
            if np.nan_to_num(np.abs(change)).max(initial=0.0) < _CLOSE:
                break
        valid = self._is_within(u) & (np.linalg.norm(change, axis=-1) < 1e-9)
        squared = (u**2).sum(axis=-1, keepdims=True)
        rays = np.concatenate([4.0 * u, 4.0 - squared], axis=-1) / (4.0 + squared)
        return np.where(valid[..., None], rays, np.nan), valid

    def _is_within(self, u: Array) -> NDArray[np.bool_]:
        reach = self.step * (np.array(self.corrections.shape[1::-1]) - 3) / 2
        return np.asarray((np.abs(u) <= reach * (1 + 1e-12)).all(axis=-1))

    def _correction(self, u: Array) -> Array:
        return self._correction_and_slope(u)[0]

    def _correction_and_slope(self, u: Array) -> tuple[Array, Array]:
        """Return Δ (..., 2) and ∂Δ/∂u (..., 2, 2)."""
        rows, columns = self.corrections.shape[:2]
        i, x, x_slope = _weights(u[..., 0] / self.step, columns)
        j, y, y_slope = _weights(u[..., 1] / self.step, rows)
        four = np.arange(4)
        values = self.corrections[
            (j[..., None] + four)[..., None], (i[..., None] + four)[..., None, :]
        ]
        correction = np.einsum("...j,...i,...jik->...k", y, x, values)
        by_x = np.einsum("...j,...i,...jik->...k", y, x_slope, values)
        by_y = np.einsum("...j,...i,...jik->...k", y_slope, x, values)
        return correction, np.stack([by_x, by_y], axis=-1) / self.step


def splined_through(
    directions: Array, pixels: Array, centre_px: tuple[float, float], focal_px: tuple[float, float]
) -> SplinedStereographic:
    """Return the splined lens that takes directions (n, 3) most nearly to pixels (n, 2)."""
    u = 2.0 * directions[:, :2] / (1.0 + directions[:, 2:])
    reach = np.abs(u).max(axis=0)
    fov_x_deg = int(np.ceil(np.degrees(4 * np.arctan(reach[0] / 2)) + 0.5))
    step = 4.0 * np.tan(np.radians(fov_x_deg) / 4) / (_COLUMNS - 3)
    rows = max(int(np.ceil(2 * reach[1] / step)) + 3, 4)
    i, x, _ = _weights(u[:, 0] / step, _COLUMNS)
    j, y, _ = _weights(u[:, 1] / step, rows)
    terms = np.zeros((len(u), rows * _COLUMNS))
    for k in range(4):
        for m in range(4):
            terms[np.arange(len(u)), (j + k) * _COLUMNS + i + m] += y[:, k] * x[:, m]
    wanted = (pixels - centre_px) / focal_px - u
    squares = terms.T @ terms + _RIDGE**2 * np.eye(terms.shape[1])
    corrections = np.linalg.solve(squares, terms.T @ wanted).reshape(rows, _COLUMNS, 2)
    return SplinedStereographic(centre_px, focal_px, fov_x_deg, np.asarray(corrections, np.float64))


def _weights(place: Array, count: int) -> tuple[NDArray[np.intp], Array, Array]:
    """Return the first of four control values, their weights (..., 4), and those of the slope."""
    along = place + (count - 1) / 2
    first = np.clip(np.nan_to_num(along).astype(np.intp), 1, count - 3) - 1
    t = (along - first - 1)[..., None]
    weights = np.concatenate([np.ones_like(t), t, t**2, t**3], axis=-1) @ _BASIS.T
    slopes = np.concatenate([np.ones_like(t), 2 * t, 3 * t**2], axis=-1) @ _BASIS[:, 1:].T
    return first, weights, slopes
