"""Which way is up, from what a picture or an instrument says of it.

Input  : camera-frame unit directions of marked points, or a gravity vector.
Output : the camera-frame direction of the zenith with its uncertainty, and R_world_camera from it.
Method : a straight vertical edge lies in a plane with the zenith, whatever the lens; the zenith is
the direction that least squares on the sphere find in all of these planes. It lies 90° from every
point of the horizon. Both are solved by reweighting, so that a wrong mark is found and left out.
Fails  : where marks agree in a wrong direction (a leaning tower's edges), and by the dip of the
horizon, 1.76′ √(height in m) [1]_: 0.1° from a tall house above the sea.

.. [1] N. Bowditch, The American Practical Navigator, table of the dip of the sea horizon.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError

Array = NDArray[np.float64]

LOOKS = {"level": (0.0, -1.0, 0.0), "up": (0.0, 0.0, 1.0), "down": (0.0, 0.0, -1.0)}
"""Zenith in the frame of a camera that is held level, looks at the zenith, or at the ground."""

_LARGEST_SIGMA_RAD = np.deg2rad(2.0)
"""Beyond it a result would be a guess: the marks hardly differ in what they say."""

_LEAST_LENGTH_RAD = np.deg2rad(0.5)
_WRONG_SIGMAS = 4.0
_ROUNDS = 30


@dataclass(frozen=True, eq=False)
class Zenith:
    """The direction of the zenith in the camera frame.

    Attributes
    ----------
    direction : (3,) float64
        Unit vector.
    sigma_rad : float
        Standard deviation in the worse of its two coordinates.
    residual_rad : (N,) float64
        By how much each mark misses it: the angle between the zenith and an edge's plane, or
        between a horizon point and the horizon.
    kept : (N,) bool
        False for marks that contradict the others and were left out.
    """

    direction: Array
    sigma_rad: float
    residual_rad: Array
    kept: NDArray[np.bool_]


def with_zenith(R_world_camera: Array, zenith: Array) -> Array:
    """Return the rotation nearest to `R_world_camera` that takes the camera's `zenith` to +Y.

    The heading is kept as far as the smallest turn keeps it: nothing here tells where north is.
    """
    x, y, z = R_world_camera @ (zenith / np.linalg.norm(zenith))
    if y < -1.0 + 1e-12:  # upside down: any horizontal axis is as near
        return np.asarray(np.diag([1.0, -1.0, -1.0]) @ R_world_camera)
    share = 1.0 / (1.0 + y) if y > 0 else (1.0 - y) / (x * x + z * z)
    turn = np.array(
        [
            [1.0 - share * x * x, -x, -share * x * z],
            [x, y, z],
            [-share * x * z, -z, 1.0 - share * z * z],
        ]
    )
    return np.asarray(turn @ R_world_camera)


def zenith_of_gravity(gravity: Sequence[float]) -> Array:
    """Return the zenith (3,) opposite a gravity vector, of any length, in the camera frame."""
    down = np.array(gravity, np.float64)
    if down.shape != (3,) or not np.isfinite(down).all() or not np.any(down):
        raise InputError(f"gravity must be three numbers x,y,z, not all zero; got {list(gravity)}")
    down = down / np.abs(down).max()  # else the squares of extreme numbers over- or underflow
    return np.asarray(-down / np.linalg.norm(down))


def zenith_of_edges(edges: Sequence[Array], mark_sigma_rad: float) -> Zenith:
    """Return the zenith that vertical edges meet in.

    Parameters
    ----------
    edges : sequence of (N, 3) float64
        Directions of points along each edge, from its foot to its head.
    mark_sigma_rad : float
        Standard deviation of a marked point; more if the marks themselves scatter more.

    Raises
    ------
    InputError
        If there are fewer than two edges, one is no line, the edges contradict one another, or lie
        so nearly in one plane that they leave the zenith uncertain by more than 2°.
    """
    if len(edges) < 2:
        raise InputError(
            f"one vertical edge leaves the zenith free along it; got {len(edges)}, mark two or "
            "more, well apart round the picture"
        )
    scatters = np.stack([edge.T @ edge for edge in edges])
    for number, edge in enumerate(edges, start=1):
        if len(edge) < 2 or _angle(edge[0], edge[-1]) < _LEAST_LENGTH_RAD:
            raise InputError(
                f"vertical {number} needs two points or more, its ends at least 0.5° apart"
            )
    values, axes = np.linalg.eigh(scatters)  # ascending: the plane's normal is first
    normals = axes[:, :, 0]

    def sigmas(zenith: Array) -> Array:
        # A normal is known to mark_sigma / √eigenvalue about each axis in its plane.
        along = np.einsum("eck,c->ek", axes[:, :, 1:], zenith) ** 2 / values[:, 1:]
        return np.asarray(mark_sigma_rad * np.sqrt(along.sum(axis=-1)))

    found = _orthogonal_to(normals, sigmas, "verticals", "mark edges further apart")
    rises = np.array([(edge[-1] - edge[0]) @ found.direction for edge in edges])[found.kept]
    upward = int(np.sum(rises > 0))
    if 0 < upward < len(rises):
        raise InputError(
            f"{upward} of {len(rises)} verticals rise where the others fall: "
            "mark every edge from its foot to its head"
        )
    direction = found.direction if upward else -found.direction
    return Zenith(direction, found.sigma_rad, found.residual_rad, found.kept)


def zenith_of_horizon(points: Array, near: Array, mark_sigma_rad: float) -> Zenith:
    """Return the zenith 90° from points on the horizon.

    Parameters
    ----------
    points : (N, 3) float64
        Unit directions.
    near : (3,) float64
        Roughly the zenith: the horizon does not tell up from down.
    mark_sigma_rad : float
        Standard deviation of a marked point; more if the marks themselves scatter more.

    Raises
    ------
    InputError
        If there are fewer than two points, they contradict one another, span so little of the
        horizon that the zenith is uncertain by more than 2°, or `near` is within 10° of the
        horizon.
    """
    if len(points) < 2:
        raise InputError(f"the horizon needs two points or more, well apart; got {len(points)}")

    def sigmas(_zenith: Array) -> Array:
        return np.full(len(points), mark_sigma_rad)

    found = _orthogonal_to(points, sigmas, "horizon points", "mark points round more of it")
    side = float(found.direction @ near)
    if abs(side) < np.sin(np.deg2rad(10.0)):
        raise InputError(
            "the horizon stands upright in the world of the starting calibration, so that up and "
            "down are alike; set it roughly first, with --looks level, up or down"
        )
    direction = found.direction if side > 0 else -found.direction
    return Zenith(direction, found.sigma_rad, found.residual_rad, found.kept)


def _orthogonal_to(
    normals: Array, sigmas: Callable[[Array], Array], what: str, remedy: str
) -> Zenith:
    """Return the direction, up to its sign, that is orthogonal to normals (N, 3).

    `sigmas` gives the standard deviation (N,) of the normals' residuals at a direction. The start
    is the pair that most others agree with, in the median of what they miss it by.
    """
    first, second = np.triu_indices(len(normals), 1)
    candidates = np.cross(normals[first], normals[second])
    lengths = np.linalg.norm(candidates, axis=-1)
    if lengths.max() < np.sin(_LARGEST_SIGMA_RAD):
        raise InputError(f"{len(normals)} {what} all say nearly the same: {remedy}")
    candidates = candidates[lengths > 1e-6] / lengths[lengths > 1e-6, None]
    misses = np.abs(candidates @ normals.T)
    direction = candidates[np.argmin(np.sort(misses, axis=-1)[:, len(normals) // 2])]
    kept = np.ones(len(normals), np.bool_)
    for _ in range(_ROUNDS):
        scaled = normals @ direction / sigmas(direction)
        typical = max(1.0, 1.4826 * float(np.median(np.abs(scaled))))
        kept = np.abs(scaled) <= _WRONG_SIGMAS * typical
        weights = kept / sigmas(direction) ** 2
        values, axes = np.linalg.eigh((normals * weights[:, None]).T @ normals)
        before, direction = direction, axes[:, 0]
        if abs(before @ direction) > 1.0 - 1e-15:
            break
    residual = np.arcsin(np.clip(normals @ direction, -1.0, 1.0))
    if 2 * kept.sum() <= len(normals):
        raise InputError(f"only {kept.sum()} of {len(normals)} {what} agree: check the marks")
    spare = int(kept.sum()) - 2
    chi2 = float(np.sum((residual / sigmas(direction))[kept] ** 2))
    excess = max(1.0, chi2 / spare) if spare else 1.0
    sigma = float(np.sqrt(excess / max(values[1], 1e-30)))
    if sigma > _LARGEST_SIGMA_RAD:
        raise InputError(
            f"{kept.sum()} {what} leave up uncertain by {np.rad2deg(sigma):.1f}°: {remedy}"
        )
    return Zenith(direction, sigma, residual, kept)


def _angle(first: Array, second: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(first, second)), first @ second))
