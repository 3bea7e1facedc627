"""Bundle adjustment: the lens, the board poses and what else fits the corners best.

Domain : the residual of a corner is its projection less where it was found, in units of its sigma.
Cost   : a step takes about 1.5 µs a corner and unknown of the lens: poses are eliminated view by
view, so that the equations left are those of the lens alone.
Source : K. Levenberg's and D. Marquardt's method; the elimination is Schur's complement, as in
B. Triggs, P. McLauchlan, R. Hartley, A. Fitzgibbon, "Bundle Adjustment: A Modern Synthesis", 2000.
The warp of the board is an idea of D. Kogan's mrcal, which seeks a parabola along either side.
Fails  : from a start too far away, in a minimum of its own: calibration/lens/start.py gives starts.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.lens.corners import WARP_DEGREES, Corners
from calibration.lens.poses import Poses, rotations_about
from calibration.models.parameters import parameters, with_parameters
from capture.errors import InputError

Array = NDArray[np.float64]

_MOST_STEPS = 60

_SETTLED = 1e-7
"""Relative fall of the cost at which a minimum counts as reached."""

_UNSEEN_PX = 1e3
"""Residual of a corner whose direction the model cannot represent."""


@dataclass(frozen=True, eq=False)
class Solution:
    """What an adjustment seeks.

    Attributes
    ----------
    model : CameraModel
    poses : Poses
    warp_m : (12,) float64
        How the board is not flat: the lengths of `Corners.warp_shapes`.
    pupil_m : float
        How far the entrance pupil moves along the axis: a ray at the angle θ passes the axis at
        z = pupil θ². It matters for a board before the lens, and not for far things.
    """

    model: CameraModel
    poses: Poses
    warp_m: Array = field(default_factory=lambda: np.zeros(len(WARP_DEGREES)))
    pupil_m: float = 0.0


@dataclass(frozen=True, eq=False)
class Free:
    """Which parts of a solution are sought, besides the poses; the others are held.

    Attributes
    ----------
    lens : (P,) bool
        Which of the model's parameters. All false seeks poses alone.
    warp_degree : int
        Up to which the board's warp is sought; below 2 it is held.
    pupil : bool
        Whether the entrance pupil's movement is sought.
    """

    lens: NDArray[np.bool_]
    warp_degree: int = 0
    pupil: bool = False

    @property
    def lens_count(self) -> int:
        """How many numbers of the lens are sought."""
        return int(self.lens.sum())

    @property
    def warp(self) -> NDArray[np.bool_]:
        """Which (12,) shapes of the warp are sought."""
        return self.warp_degree >= WARP_DEGREES

    @property
    def count(self) -> int:
        """How many numbers are sought that all views share."""
        return self.lens_count + int(self.warp.sum()) + self.pupil


@dataclass(frozen=True, eq=False)
class Adjusted:
    """A solution and what is left.

    Attributes
    ----------
    solution : Solution
    residuals_px : (N, 2) float64
        Projected less found; NaN where the model has no pixel.
    information : (V, G, G) float64
        What each view adds to the inverse covariance, at a sigma of one pixel, of what is free: the
        lens, then the warp, then the pupil. Its pose is marginalised.
    pull : (V, G) float64
        Half the slope of each view's squared residuals along what is free; they add up to 0.
    """

    solution: Solution
    residuals_px: Array
    information: Array
    pull: Array


@dataclass(frozen=True, eq=False)
class _Equations:
    cost: float
    shared: Array  # (V, G, G)
    mixed: Array  # (V, G, 6)
    own: Array  # (V, 6, 6)
    shared_slope: Array  # (V, G)
    own_slope: Array  # (V, 6)


def adjust(
    corners: Corners,
    start: Solution,
    free: Free,
    *,
    soft_px: float = np.inf,
    most_steps: int = _MOST_STEPS,
) -> Adjusted:
    """Return the solution of least squared residuals that is reached from the start.

    Parameters
    ----------
    corners : Corners
    start : Solution
    free : Free
    soft_px : float
        Residual beyond which a corner counts less and less: the scale of Cauchy's loss, for corners
        of median sigma. Infinite is plain least squares.
    most_steps : int
    """
    solution = start
    equations = _linearised(corners, solution, free, soft_px)
    damping = 1e-3
    for _ in range(most_steps):
        trial = _stepped(solution, equations, free, damping)
        cost = np.inf if trial is None else _cost(corners, trial, soft_px)
        if trial is None or not cost < equations.cost:
            if damping > 1e12:
                break
            damping *= 8.0
            continue
        fall = equations.cost - cost
        solution = trial
        equations = _linearised(corners, solution, free, soft_px)
        damping = max(damping / 8.0, 1e-12)
        if fall <= _SETTLED * cost:
            break
    return Adjusted(solution, residuals_px(corners, solution), *_marginal(equations))


def residuals_px(corners: Corners, solution: Solution) -> Array:
    """Return projected less found (N, 2); NaN where the model has no pixel."""
    projected, _ = solution.model.project(in_camera_m(corners, solution))
    return np.asarray(projected - corners.pixels)


def typical_px(residuals_px: Array) -> float:
    """Return the standard deviation of a coordinate that the median residual (N, 2) tells."""
    size = np.hypot(*residuals_px.T)
    # The length of a normal residual in two coordinates has the median σ √(2 ln 2).
    return float(np.median(np.where(np.isfinite(size), size, np.inf)) / np.sqrt(2 * np.log(2)))


def in_camera_m(corners: Corners, solution: Solution) -> Array:
    """Return the corners (N, 3) in the camera frame, from where the entrance pupil is for each."""
    return _placed(corners, solution)[0]


def _placed(corners: Corners, solution: Solution) -> tuple[Array, Array, Array, Array]:
    """Return the corners (N, 3) as `in_camera_m`, R X (N, 3), R (N, 3, 3) and θ² (N,)."""
    R, t = solution.poses.of_corners(corners)
    lifted = (corners.warp_shapes @ solution.warp_m)[:, None] * [0.0, 0.0, 1.0]
    turned = np.einsum("nij,nj->ni", R, corners.points_m + lifted)
    x, y, z = (turned + t).T
    square = np.arctan2(np.hypot(x, y), z) ** 2
    return np.stack([x, y, z - solution.pupil_m * square], axis=-1), turned, R, square


def _losses(corners: Corners, residuals: Array, soft_px: float) -> tuple[Array, Array]:
    """Return the loss (N,) of each corner and the weight (N,) of its squared residual."""
    inverse = np.median(corners.sigma_px) / corners.sigma_px
    squared = np.sum(residuals**2, axis=-1) * inverse**2
    lost = ~np.isfinite(squared)
    squared[lost] = _UNSEEN_PX**2
    if np.isinf(soft_px):
        loss, weight = squared, np.ones_like(squared)
    else:
        loss = soft_px**2 * np.log1p(squared / soft_px**2)
        weight = 1.0 / (1.0 + squared / soft_px**2)
    return loss, np.where(lost, 0.0, weight * inverse**2)


def _cost(corners: Corners, solution: Solution, soft_px: float) -> float:
    loss, _ = _losses(corners, residuals_px(corners, solution), soft_px)
    return float(loss.sum())


def _linearised(corners: Corners, solution: Solution, free: Free, soft_px: float) -> _Equations:
    in_camera, turned, R, square = _placed(corners, solution)
    residuals = solution.model.project(in_camera)[0] - corners.pixels
    loss, weight = _losses(corners, residuals, soft_px)
    by_direction, by_parameters = solution.model.project_jacobian(in_camera)
    # A turn by ω moves R X by ω × R X: the rows of ∂pixel/∂direction are crossed with it.
    by_turn = np.cross(turned[:, None, :], by_direction)
    normal = np.einsum("nij,nj->ni", by_direction, R[:, :, 2])
    columns = [
        by_parameters[:, :, free.lens],
        normal[:, :, None] * corners.warp_shapes[:, None, free.warp],
    ]
    if free.pupil:
        columns.append(-by_direction[:, :, 2:] * square[:, None, None])
    root = np.sqrt(weight)[:, None, None]
    dead = weight == 0
    shared = np.concatenate(columns, axis=-1) * root
    own = np.concatenate([by_turn, by_direction], axis=-1) * root
    error = residuals * root[:, 0]
    for each in (shared, own, error):
        each[dead] = 0.0
    views, count = corners.view_count, free.count
    equations = _Equations(
        float(loss.sum()),
        np.empty((views, count, count)),
        np.empty((views, count, 6)),
        np.empty((views, 6, 6)),
        np.empty((views, count)),
        np.empty((views, 6)),
    )
    # View by view, in products small enough for BLAS not to wake its threads, which is slower.
    for view in range(views):
        part = corners.of_view(view)
        off = error[part].ravel()
        of_all, pose = shared[part].reshape(off.size, count), own[part].reshape(off.size, 6)
        equations.shared[view] = of_all.T @ of_all
        equations.mixed[view] = of_all.T @ pose
        equations.own[view] = pose.T @ pose
        equations.shared_slope[view] = of_all.T @ off
        equations.own_slope[view] = pose.T @ off
    return equations


def _stepped(
    solution: Solution, equations: _Equations, free: Free, damping: float
) -> Solution | None:
    """Return the solution after one damped step; None where no such lens can be."""
    own, shared = _damped(equations.own, damping), _damped(equations.shared.sum(axis=0), damping)
    try:
        eliminated = np.linalg.solve(own, np.swapaxes(equations.mixed, 1, 2))
        own_part = np.linalg.solve(own, equations.own_slope[..., None])[..., 0]
        reduced = shared - np.einsum("vgi,vih->gh", equations.mixed, eliminated)
        slope = equations.shared_slope.sum(axis=0) - np.einsum(
            "vgi,vi->g", equations.mixed, own_part
        )
        step = -np.linalg.solve(reduced, slope)
    except np.linalg.LinAlgError:
        return None
    own_step = -own_part - np.einsum("vig,g->vi", eliminated, step)
    if not (np.all(np.isfinite(step)) and np.all(np.isfinite(own_step))):
        return None
    values = parameters(solution.model)
    values[free.lens] += step[: free.lens_count]
    try:
        model = with_parameters(solution.model, values)
    except InputError:
        return None
    warp = solution.warp_m.copy()
    warp[free.warp] += step[free.lens_count : free.count - free.pupil]
    poses = Poses(
        rotations_about(own_step[:, :3]) @ solution.poses.R_camera_board,
        solution.poses.t_camera_board_m + own_step[:, 3:],
    )
    pupil = solution.pupil_m + (float(step[-1]) if free.pupil else 0.0)
    return Solution(model, poses, warp, pupil)


def _damped(blocks: Array, damping: float) -> Array:
    """Return the blocks (…, K, K) with their diagonals raised by a share; none of them is 0."""
    size = np.arange(blocks.shape[-1])
    raised = blocks.copy()
    diagonal = raised[..., size, size]
    raised[..., size, size] = diagonal * (1.0 + damping) + (diagonal == 0)
    return raised


def _marginal(equations: _Equations) -> tuple[Array, Array]:
    """Return the information (V, G, G) and the pull (V, G) of each view, its pose marginalised."""
    eliminated = equations.mixed @ np.linalg.pinv(equations.own)
    information = equations.shared - eliminated @ np.swapaxes(equations.mixed, 1, 2)
    pull = equations.shared_slope - (eliminated @ equations.own_slope[..., None])[..., 0]
    return np.asarray(information), np.asarray(pull)
