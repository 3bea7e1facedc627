"""Where camera models end that see less than their picture could show.

Claim    : beyond its limit a model refuses directions and pixels; it never mirrors them.
Setup    : double spheres, OCam polynomials, and unified models with tangential distortion.
Expected : a double sphere ends where the radius turns or has no bound, for usual numbers near 110°;
           the bound of its paper, acos(−w2), is up to 1.5° short of that. An OCam polynomial that
           turns ends at the first radius of the same angle to both sides. Tangential distortion p
           folds one side first, and the others are cut off as far out: with 2 Δ|m| / |m| of the
           order of 6 |p| |m|, under half a degree at |p| = 0.001.
Measured : double sphere, ξ = −0.2: 105.0° at α = 0.3 and 0.7, 123.2° at 0.6. OCam (−0.4, 0.2):
           64.2° at 1.78 focal lengths. Unified, ξ = 1, k1 = −0.05: 137.66° without p, 137.36° at
           0.001, 131.4° at 0.02.
"""

import numpy as np
import pytest

from calibration.camera import CameraModel
from calibration.models.double_sphere import DoubleSphere
from calibration.models.ocam import OCam
from calibration.models.unified import Unified

CENTRE = (0.0, 0.0)


def refuses_beyond(model: CameraModel, radius_px: float) -> None:
    """Assert that nothing past the limit is seen, neither by its direction nor by its pixel."""
    angle = np.linspace(model.limit_angle_rad + 1e-9, np.pi, 500)
    for azimuth in np.linspace(0, 6, 7):
        flat = np.stack([np.cos(azimuth) * np.sin(angle), np.sin(azimuth) * np.sin(angle)], axis=1)
        assert not model.project(np.column_stack([flat, np.cos(angle)]))[1].any()
        outward = np.linspace(1.001, 30, 500)[:, None] * radius_px
        assert not model.unproject(outward * [np.cos(azimuth), np.sin(azimuth)])[1].any()


@pytest.mark.parametrize(("alpha", "limit_deg"), [(0.3, 105.0), (0.6, 123.2), (0.7, 105.0)])
def test_a_double_sphere_ends_short_of_the_back(alpha: float, limit_deg: float) -> None:
    model = DoubleSphere(CENTRE, 100.0, -0.2, alpha)
    w1 = min(alpha, 1 - alpha) / max(alpha, 1 - alpha)
    # cos ψ = −w1 on the second sphere, seen from the first one's centre.
    cosine = 0.2 * (1 - w1**2) - w1 * np.sqrt(1 - 0.04 * (1 - w1**2))
    assert model.limit_angle_rad == pytest.approx(np.arccos(cosine), abs=1e-5)
    w2 = (w1 - 0.2) / np.sqrt(1 - 2 * w1 * 0.2 + 0.04)
    assert 0 < np.degrees(model.limit_angle_rad - np.arccos(-w2)) < 1.5
    assert np.degrees(model.limit_angle_rad) == pytest.approx(limit_deg, abs=0.1)
    unbounded = alpha <= 0.5
    refuses_beyond(model, 1e9 if unbounded else 100 / np.sqrt(2 * alpha - 1))


def test_a_unified_sphere_seen_from_outside_ends_at_its_outline() -> None:
    model = Unified(CENTRE, 100.0, 2.0)  # sin θ / (cos θ + ξ) turns at cos θ = −1/ξ
    assert np.degrees(model.limit_angle_rad) == pytest.approx(120.0)
    refuses_beyond(model, 100 / np.sqrt(3))


def test_an_ocam_polynomial_that_turns_ends_there() -> None:
    model = OCam(CENTRE, 100.0, (-0.4, 0.2))
    assert np.degrees(model.limit_angle_rad) == pytest.approx(64.2, abs=0.1)
    refuses_beyond(model, 178.48)
    # Beyond, the polynomial would give the angles of the inside once more.
    radius = np.array([1.5, 2.1])
    inner, outer = np.arctan2(radius, 1 - 0.4 * radius**2 + 0.2 * radius**3)
    assert outer < inner < model.limit_angle_rad


@pytest.mark.parametrize(("p1", "lost_deg"), [(0.001, 0.3), (0.02, 6.3)])
def test_tangential_distortion_cuts_all_sides_at_the_first_fold(p1: float, lost_deg: float) -> None:
    model = Unified(CENTRE, 100.0, 1.0, -0.05, 0.0, p1, 0.0)
    plain = Unified(CENTRE, 100.0, 1.0, -0.05)
    lost = np.degrees(plain.limit_angle_rad - model.limit_angle_rad)
    assert lost == pytest.approx(lost_deg, rel=0.05)
    # p1 > 0 folds the picture upward, at −y, and it stretches it downward.
    folding, stretched = (
        (0.0, sign * np.sin(model.limit_angle_rad - 1e-7), 0.0) for sign in (-1, 1)
    )
    z = np.array([0.0, 0.0, np.cos(model.limit_angle_rad - 1e-7)])
    scales = [
        np.linalg.det(model.project_jacobian(z + side)[0][:, :2]) for side in (folding, stretched)
    ]
    assert abs(scales[0]) < 1e-4 * abs(scales[1])
    refuses_beyond(plain, 100 * 2 / 3 * np.sqrt(1 / 0.15))
