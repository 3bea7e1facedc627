"""Irradiance from lights with an extent: uniform discs that a surface's horizon may cut.

Domain : world frame; discs of angular radius 0 to π/2, each of unit ∫L dω.
Cost   : about 1 µs a light, once a picture; the shader evaluates what `irradiance_curves` returns.
Fails  : discs below 1e-4 rad would lose digits, so they are points. The curve errs by up to 0.06 %
         of ∫L dω for discs of up to 60°, by 0.3 % for wider ones.

Of a disc of radius a at the angle acos μ from a normal, what it gives wholly above the horizon,
(1 + cos a)/2 · μ, is the odd part of its irradiance over μ twice; the even part is |μ| wherever the
horizon does not cut the disc, and rounded between −sin a and sin a where it does.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SMALLEST_RADIUS_RAD = 1e-4
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Discs:
    """Lights as they are drawn.

    Attributes
    ----------
    directions, irradiance, radius_rad : (K, 3), (K, 3), (K,) float64
        As `reaching_lights` returns them.
    mirrored : (K, 3) float64
        The irradiance that mirrors show of each.
    """

    directions: Array
    irradiance: Array
    radius_rad: Array
    mirrored: Array

    def __len__(self) -> int:
        return len(self.directions)

    def taken(self, which: NDArray[np.integer] | NDArray[np.bool_] | slice) -> "Discs":
        """Return some of them, or all in another order."""
        return Discs(
            self.directions[which],
            self.irradiance[which],
            self.radius_rad[which],
            self.mirrored[which],
        )


def moment_above(directions: Array, angular_radius_rad: Array) -> Array:
    """Return ∫d dω over the part of each disc above the horizon (y > 0), (K, 3).

    Its y is the irradiance on level ground; along any other normal that sees all of the part, its
    component is the irradiance there. The outline of the part is an arc of the disc's circle and
    one of the horizon; by Stokes' theorem the integral is ½ ∮ d × dd.

    Parameters
    ----------
    directions : (K, 3) float64
        Unit vectors toward the discs' centres.
    angular_radius_rad : (K,) float64
        0 to π/2. A disc of radius 0 is a point.
    """
    cosine, sine = np.cos(angular_radius_rad), np.sin(angular_radius_rad)
    up = directions[:, 1]
    level = np.sqrt(np.maximum(1 - up * up, 0.0))
    half_arc = np.arccos(np.clip(-cosine * up / np.maximum(sine * level, _TINY), -1, 1))
    half_chord = np.arccos(np.minimum(cosine / np.maximum(level, _TINY), 1))
    vertical = np.array([0.0, 1.0, 0.0])
    toward_zenith = (vertical - up[:, None] * directions) / np.maximum(level, _TINY)[:, None]
    moment = (
        (sine**2 * half_arc)[:, None] * directions
        - (sine * cosine * np.sin(half_arc))[:, None] * toward_zenith
        + half_chord[:, None] * vertical
    )
    is_point = angular_radius_rad < _SMALLEST_RADIUS_RAD
    solid_angle = 4 * np.pi * np.sin(np.maximum(angular_radius_rad, _SMALLEST_RADIUS_RAD) / 2) ** 2
    moment /= solid_angle[:, None]
    moment[is_point] = directions[is_point] * (directions[is_point, 1:2] > 0)
    return moment


def cut_at_horizon(
    directions: Array, irradiance: Array, angular_radius_rad: Array
) -> tuple[Array, Array, Array]:
    """Return the lights (J, ...) that stand for what is above the horizon of each.

    A disc wholly above stays as it is, one wholly below is left out. Of the others, the part above
    becomes the largest disc around its mean direction that the horizon does not cut, with the same
    irradiance as the part on every surface that sees all of it, level ground included.

    Parameters
    ----------
    directions, irradiance, angular_radius_rad : (K, 3), (K, 3), (K,) float64
        As in `LightSet`, radii up to π/2.
    """
    up = directions[:, 1]
    is_cut = np.arcsin(np.clip(up, -1, 1)) < angular_radius_rad
    moment = moment_above(directions, angular_radius_rad)
    length = np.linalg.norm(moment, axis=1)
    keep = np.where(is_cut, moment[:, 1] > 0, up > 0)
    is_cut &= keep
    directions, irradiance, radius = directions.copy(), irradiance.copy(), angular_radius_rad.copy()
    directions[is_cut] = moment[is_cut] / length[is_cut, None]
    radius[is_cut] = np.minimum(radius[is_cut], np.arcsin(np.minimum(directions[is_cut, 1], 1)))
    facing = (1 + np.cos(radius[is_cut])) / 2
    irradiance[is_cut] *= (length[is_cut] / facing)[:, None]
    return directions[keep], irradiance[keep], radius[keep]


def irradiance_curves(angular_radius_rad: Array) -> Array:
    """Return the irradiance of discs as a function of μ = n·l, as shade.frag evaluates it, (K, 5).

    The columns are half, s, −1/s², p and q of half · (μ + m) with s = sin a,
    m = max(|μ|, s − t (p + q t)), t = max(1 − μ²/s², 0).
    The even part m is exact at μ = 0 and ±s/√2, and wherever the horizon does not cut the disc.
    """
    is_point = angular_radius_rad < _SMALLEST_RADIUS_RAD
    radius = np.maximum(angular_radius_rad, _SMALLEST_RADIUS_RAD)
    half = np.where(is_point, 0.5, (1 + np.cos(radius)) / 4)
    s = np.sin(radius)
    at_horizon = s - _even_part(np.zeros_like(s), radius)  # p + q
    between = s - _even_part(s / np.sqrt(2), radius)  # p / 2 + q / 4
    p = 4 * between - at_horizon
    curves = np.stack([half, s, -1 / s**2, p, at_horizon - p], axis=-1)
    curves[is_point, 1:] = 0.0
    return curves


def _even_part(cosine: Array, angular_radius_rad: Array) -> Array:
    """Return m of `irradiance_curves`, exact."""
    level = np.sqrt(1 - cosine * cosine)
    directions = np.stack([level, cosine, np.zeros_like(cosine)], axis=-1)
    received = moment_above(directions, angular_radius_rad)[:, 1]
    return received * 4 / (1 + np.cos(angular_radius_rad)) - cosine
