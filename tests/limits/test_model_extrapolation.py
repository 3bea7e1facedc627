"""Camera models beyond the angles they were fitted to, and lenses that they cannot follow.

Claim    : a fitted model is right as far as its points reached, if its numbers can follow the lens.
Setup    : an equisolid lens, f = 300 px; 800 points to 70° or 97° from the axis.
Expected : with noise of 0.1 px to 70°, all are within 0.15 px there and several px off at 97°,
           which nothing in the model tells: a calibration's valid angle must. Without noise to 97°,
           four odd powers of the angle leave nothing, the models of fewer numbers up to a pixel.
Measured : at 97° from points to 70°: Kannala-Brandt 14.7 px, OCam 7.1, extended unified 5.2.
           From points to 97°, largest error: 0.0002 px, 0.8 and 0.6.
"""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calibration.camera import CameraModel
from calibration.models.equisolid import Equisolid
from calibration.models.extended_unified import ExtendedUnified
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.ocam import OCam
from calibration.models.parameters import parameters, with_parameters

CENTRE = (500.0, 500.0)
LENS = Equisolid(CENTRE, 300.0)


def fitted(start: CameraModel, points_to_rad: float, noise_px: float) -> CameraModel:
    """Return the model fitted to points of the lens, the shear of an OCam left as it is."""
    rng = np.random.default_rng(1)
    angle, azimuth = points_to_rad * np.sqrt(rng.random(800)), rng.uniform(0, 2 * np.pi, 800)
    directions = at_angle(angle, azimuth)
    pixels = LENS.project(directions)[0] + noise_px * rng.normal(size=(800, 2))
    values = parameters(start)
    free = slice(None, -3) if isinstance(start, OCam) else slice(None)

    def model(estimate: NDArray[np.float64]) -> CameraModel:
        changed = values.copy()
        changed[free] = estimate
        return with_parameters(start, changed)

    solution = least_squares(
        lambda estimate: (model(estimate).project(directions)[0] - pixels).ravel(),
        values[free],
        lambda estimate: np.reshape(
            model(estimate).project_jacobian(directions)[1][..., free], (1600, -1)
        ),
        x_scale="jac",
    )
    return model(solution.x)


def at_angle(angle: NDArray[np.float64], azimuth: NDArray[np.float64]) -> NDArray[np.float64]:
    flat = np.sin(angle)[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)
    return np.column_stack([flat, np.cos(angle)])


def error_px(model: CameraModel, *angles_deg: float) -> float:
    angle, azimuth = np.meshgrid(np.radians(angles_deg), np.linspace(0, 6, 20))
    directions = at_angle(angle.ravel(), azimuth.ravel())
    apart = model.project(directions)[0] - LENS.project(directions)[0]
    return float(np.linalg.norm(apart, axis=1).max())


STARTS = {
    "kannala_brandt": KannalaBrandt(CENTRE, 290.0),
    "ocam": OCam(CENTRE, 290.0, (-0.2, 0.0, 0.0)),
    "extended_unified": ExtendedUnified(CENTRE, 290.0, 0.6, 1.0),
}


@pytest.mark.parametrize("name", STARTS)
def test_a_model_is_off_beyond_its_points_and_does_not_say_so(name: str) -> None:
    model = fitted(STARTS[name], np.radians(70), 0.1)
    assert error_px(model, *range(0, 71, 5)) < 0.15
    assert 3 < error_px(model, 97) < 20
    assert model.limit_angle_rad > np.radians(97)


@pytest.mark.parametrize(
    ("name", "least", "most"), [("ocam", 0.5, 1.0), ("extended_unified", 0.4, 0.8)]
)
def test_few_numbers_leave_up_to_a_pixel(name: str, least: float, most: float) -> None:
    angles = range(0, 98)
    assert least < error_px(fitted(STARTS[name], np.radians(97), 0.0), *angles) < most
    assert error_px(fitted(STARTS["kannala_brandt"], np.radians(97), 0.0), *angles) < 1e-3
