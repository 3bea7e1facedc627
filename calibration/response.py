"""The response of a camera, estimated from its own brackets.

Domain : 8-bit counts whose code is unknown: the curve that a camera puts on its JPEGs.
Input  : brackets of a still scene.    Output : Response: a curve, and how far to trust it.
Cost   : a second or two, whatever the size of the pictures.
Fails  : where the camera changes its curve from exposure to exposure (local tone mapping, "auto
         lighting"), no curve explains the brackets; the held-out error tells it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.response_curve import Curve, disagreement_ev, scaled
from calibration.response_debevec import fit_debevec
from calibration.response_mitsunaga import fit_mitsunaga
from calibration.response_monotone import fit_monotone
from calibration.response_robertson import fit_robertson
from calibration.response_samples import MOST_COUNT, Samples, sample_brackets
from capture.errors import InputError
from capture.frame import Bracket
from capture.sensor import Sensor, assumed_sensor

Method = Callable[[Samples], Curve]

METHODS: dict[str, Method] = {
    "monotone": fit_monotone,
    "debevec": fit_debevec,
    "robertson": fit_robertson,
    "mitsunaga": fit_mitsunaga,
}
"""Ways to estimate a response; tests/calibration/test_response_contract.py holds all to one law."""

DEFAULT_METHOD = "monotone"

_HELD_OUT = 4
"""One patch in so many is kept from the fit that the held-out error judges."""


@dataclass(frozen=True, eq=False)
class Response:
    """A camera's response and how well it was found.

    Attributes
    ----------
    method : str
        Key of METHODS.
    curve : Curve
        Fitted to all patches.
    held_out_ev : float
        Disagreement of neighbouring exposures, in stops, on patches that the judged fit did not
        see (calibration.response_curve.disagreement_ev).
    assumed_ev : float
        The same on the same patches with the assumed sRGB.
    patch_count : int
    """

    method: str
    curve: Curve
    held_out_ev: float
    assumed_ev: float
    patch_count: int


def estimate_response(
    brackets: Sequence[Bracket],
    method: str = DEFAULT_METHOD,
    exposure_tolerance_ev: float = 0.0,
) -> Response:
    """Return the response that makes the exposures of each bracket agree.

    Parameters
    ----------
    brackets : sequence of Bracket
        Of one camera with fixed settings but for the exposure.
    method : str
        Key of METHODS.
    exposure_tolerance_ev : float
        Standard deviation of the labelled exposures, in stops; 0 believes them. EXIF's rounded
        times are off by up to 0.1. `debevec` and `robertson` always believe them.

    Raises
    ------
    InputError
        If the method is unknown, the tolerance is not a small number, or the brackets do not
        determine a response (calibration.response_samples.sample_brackets).
    """
    if method not in METHODS:
        raise InputError(f"the method must be one of {', '.join(METHODS)}; got {method!r}")
    if not 0 <= exposure_tolerance_ev <= 1:
        raise InputError(
            f"the exposures' tolerance must be from 0 to 1 EV, got {exposure_tolerance_ev}"
        )
    samples = sample_brackets(brackets, exposure_tolerance_ev)
    held_out = np.arange(len(samples)) % _HELD_OUT == 0
    judged = METHODS[method](samples.subset(~held_out))
    unseen = samples.subset(held_out)
    return Response(
        method=method,
        curve=METHODS[method](samples),
        held_out_ev=disagreement_ev(unseen, judged),
        assumed_ev=disagreement_ev(unseen, _assumed_curve(len(samples.log_signal))),
        patch_count=len(samples),
    )


def sensor_with(sensor: Sensor, response: Response) -> Sensor:
    """Return the sensor with an estimated response, its deviation, and saturation where it ends."""
    values = response.curve.values
    return replace(
        sensor,
        black_dn=0.0,  # where the curve begins and ends, whatever was taken for black and white
        white_dn=255.0,
        response=values,
        response_deviation=response.curve.deviation,
        saturation=float(values[MOST_COUNT].min()),
        source=(
            f"response estimated ({response.method}, {response.patch_count} patches, held-out "
            f"error {response.held_out_ev:.3f} EV)"
        ),
    )


def _assumed_curve(exposure_count: int) -> Curve:
    response = assumed_sensor(np.uint8).response
    assert response is not None
    no_correction: NDArray[np.float64] = np.zeros(exposure_count)
    return Curve(scaled(response), None, no_correction)
