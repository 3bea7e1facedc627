"""The most probable step of a normal distribution that satisfies linear bounds."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls


def least_step(
    covariance: NDArray[np.float64], bound: NDArray[np.float64], missing: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the step x (U,) of least xᵀ covariance⁻¹ x for which bound·x ≥ missing.

    Least distance programming: C. L. Lawson and R. J. Hanson, "Solving Least Squares Problems",
    1974, by its dual, a non-negative least-squares problem.

    Parameters
    ----------
    covariance : (U, U) float64
        May be singular: no step leaves its range.
    bound : (B, U) float64
    missing : (B,) float64
        Positive somewhere, or no step would be needed.
    """
    # With x = root·y the distance is Euclidean in y.
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    rows = bound @ root
    unit = np.max(missing / np.maximum(np.linalg.norm(rows, axis=1), 1e-12))
    stacked = np.vstack([rows.T, missing / unit])
    goal = np.zeros(len(stacked))
    goal[-1] = 1.0
    dual, _ = nnls(stacked, goal)
    residual = stacked @ dual - goal
    return root @ (-unit * residual[:-1] / residual[-1])
