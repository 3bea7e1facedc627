"""The response of Mitsunaga and Nayar: a polynomial, and exposure ratios estimated with it.

Source : T. Mitsunaga and S. K. Nayar, "Radiometric Self Calibration", CVPR 1999. Each channel has
         a polynomial, 0 at black and 1 at white, of the order up to 10 whose residual is least;
         the ratios of neighbouring exposures are those of all channels together.
Input  : Samples.    Output : Curve without a deviation, and corrected exposures.
Cost   : 0.2 s for 4,000 patches at 5 exposures.
Fails  : a polynomial does not follow a toe. A power of the curve and of the ratios fits as well,
         and both drift together; here the ratios therefore keep their labelled trend, and stay as
         labelled unless the samples have a tolerance.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from calibration.response_curve import COUNTS, Curve, scaled
from calibration.response_samples import Samples

_HIGHEST_ORDER = 10
_ROUNDS = 10


def fit_mitsunaga(samples: Samples) -> Curve:
    """Return the polynomials' curve and the corrections of the exposures."""
    log_signal = samples.log_signal.copy()
    for _ in range(_ROUNDS if samples.tolerance > 0 else 1):
        fits = [_best_polynomial(samples, channel, log_signal) for channel in range(3)]
        if samples.tolerance > 0:
            log_signal = _estimated(samples, fits, log_signal)
    values = np.stack([_value(COUNTS, coefficients) for coefficients in fits], axis=-1)
    return Curve(scaled(values), None, (log_signal - samples.log_signal) / np.log(2))


def _value(counts: NDArray[np.float64], coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return Σ cₙ uⁿ, n from 1 on, of counts of any shape."""
    powers = np.arange(1, len(coefficients) + 1)
    return (counts[..., None] / 255.0) ** powers @ coefficients


def _best_polynomial(
    samples: Samples, channel: int, log_signal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return coefficients whose sum is 1, of the order with the least residual that rises."""
    fits = [
        _polynomial(samples, channel, log_signal, order) for order in range(1, _HIGHEST_ORDER + 1)
    ]
    rising = [
        (residual, order)
        for order, (residual, coefficients) in enumerate(fits)
        if (np.diff(_value(COUNTS, coefficients)) >= 0).all()
    ]
    return fits[min(rising)[1]][1]


def _polynomial(
    samples: Samples, channel: int, log_signal: NDArray[np.float64], order: int
) -> tuple[float, NDArray[np.float64]]:
    """Return mean squared residual and coefficients (order,) of Σ cₙ (uⁿ − R u′ⁿ) = 0, Σ cₙ = 1."""
    powers = np.arange(1, order + 1)
    rows = []
    for k, following in pairwise(range(len(log_signal))):
        both = samples.counts[:, [k, following], channel]
        darker, brighter = both[np.isfinite(both).all(axis=1)].T / 255.0
        ratio = np.exp(log_signal[k] - log_signal[following])
        rows.append(darker[:, None] ** powers - ratio * brighter[:, None] ** powers)
    design = np.concatenate(rows)
    # The last coefficient is 1 less the others.
    target = -design[:, -1]
    others = np.linalg.lstsq(design[:, :-1] - design[:, -1:], target, rcond=None)[0]
    coefficients = np.append(others, 1.0 - others.sum())
    return float(np.mean((design @ coefficients) ** 2)), coefficients


def _estimated(
    samples: Samples, fits: list[NDArray[np.float64]], log_signal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return log signals whose neighbours' ratios are those of the values, about the old trend."""
    values = np.stack(
        [_value(samples.counts[..., channel], fit) for channel, fit in enumerate(fits)], axis=-1
    )
    steps = []
    for k, following in pairwise(range(len(log_signal))):
        both = np.isfinite(values[:, k]) & np.isfinite(values[:, following])
        darker, brighter = values[:, k][both].sum(), values[:, following][both].sum()
        labelled = log_signal[following] - log_signal[k]
        steps.append(np.log(brighter / darker) if darker > 0 else labelled)
    estimated = np.concatenate([[0.0], np.cumsum(steps)])
    change = estimated - samples.log_signal
    trend = np.stack([np.ones(len(change)), samples.log_signal], axis=1)
    return estimated - trend @ np.linalg.lstsq(trend, change, rcond=None)[0]
