"""What the models that project through a sphere or an ellipsoid share: their radius by the angle.

Domain : ρ(θ) = sin θ / (α d + (1 − α) cos θ) with d = √(β sin² θ + cos² θ), α ≥ 0 and β > 0, up to
where ρ stops growing (α > ½) or has no bound (α ≤ ½).
Source : B. Khomutenko, G. Garcia, P. Martinet, "An Enhanced Unified Camera Model", IEEE RA-L 1(1),
2016, for 0 ≤ α ≤ 1; the limits and derivatives follow from ρ(θ).
"""

import numpy as np
from numpy.typing import NDArray

from calibration.models.radial import FARTHEST, Derivatives
from capture.errors import InputError

Array = NDArray[np.float64]


def check_alpha(alpha: float) -> None:
    """Raise InputError unless α is finite and not negative."""
    if not 0 <= alpha < np.inf:
        raise InputError(f"alpha must not be negative, 0.5 to 0.7 for most fisheyes; got {alpha}")


def sphere_radius(angle: Array, alpha: float, beta: float) -> Array:
    """Return ρ (n,) at the angles θ (n,)."""
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.asarray(sine / _depth(sine, cosine, alpha, beta))


def sphere_angle(radius: Array, alpha: float, beta: float) -> Array:
    """Return θ (n,) at the radii ρ (n,), up to the limit."""
    squared = beta * radius**2
    root = np.sqrt(np.maximum(1.0 - (2.0 * alpha - 1.0) * squared, 0.0))
    # Two forms of the same ray: the first is 0/0 at α ≥ 1, the second at α = ½.
    if alpha < 0.75:
        forward = (1.0 - alpha**2 * squared) / (alpha * root + 1.0 - alpha)
    else:
        forward = (alpha * root + alpha - 1.0) / (2.0 * alpha - 1.0)
    return np.asarray(np.arctan2(radius, forward))


def sphere_limit(alpha: float, beta: float) -> float:
    """Return the largest θ: where ρ stops growing, or reaches `FARTHEST`."""
    if alpha <= 0.5:
        return float(sphere_angle(np.array(FARTHEST), alpha, beta))
    cosine_share = (1.0 - alpha) / alpha  # −cos θ / d where dρ/dθ = 0
    return float(np.arctan2(np.sqrt(1.0 - cosine_share**2), -cosine_share * np.sqrt(beta)))


def sphere_derivatives(angle: Array, alpha: float, beta: float) -> Derivatives:
    """Return ρ, dρ/dθ, (∂ρ/∂α, ∂ρ/∂β), each (n,), at the angles θ (n,)."""
    sine, cosine = np.sin(angle), np.cos(angle)
    length = np.sqrt(beta * sine**2 + cosine**2)
    depth = _depth(sine, cosine, alpha, beta)
    slope = (1.0 - alpha + alpha * cosine / length) / depth**2
    by_alpha = -sine * (length - cosine) / depth**2
    by_beta = -alpha * sine**3 / (2.0 * length * depth**2)
    return sine / depth, slope, (by_alpha, by_beta)


def _depth(sine: Array, cosine: Array, alpha: float, beta: float) -> Array:
    return alpha * np.sqrt(beta * sine**2 + cosine**2) + (1.0 - alpha) * cosine
