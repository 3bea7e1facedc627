"""The response of Debevec and Malik: one value per count, smooth in its second difference.

Source : P. E. Debevec and J. Malik, "Recovering High Dynamic Range Radiance Maps from Photographs",
         SIGGRAPH 1997. Each channel by itself; the radiances are eliminated, which leaves the 256
         unknowns of the same least-squares problem.
Input  : Samples.    Output : Curve without a deviation.
Cost   : 0.1 s for 4,000 patches at 5 exposures.
Fails  : its one smoothness serves all brackets: too small where patches are few, too large at the
         bend of a toe. With exposures in one ratio it ripples with that ratio's period. Nothing
         keeps it rising; where it falls, it is held.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from calibration.response_curve import MIDDLE_COUNT, Curve, scaled, shares_of_counts
from calibration.response_samples import Samples

_SMOOTHNESS = 10.0
"""Weight λ of a second difference of log g, in squares as OpenCV's CalibrateDebevec has it."""


def fit_debevec(samples: Samples) -> Curve:
    """Return the curve that explains all patches best, with hat weights."""
    values = np.stack([_channel(samples, channel) for channel in range(3)], axis=-1)
    return Curve(scaled(np.exp(values)), None, np.zeros(len(samples.log_signal)))


def _channel(samples: Samples, channel: int) -> NDArray[np.float64]:
    """Return log g of one channel, (256,), 0 at the middle count."""
    shares, used = shares_of_counts(samples, channel)
    hat = np.minimum(np.arange(256), 255 - np.arange(256)) / 128.0
    weight = (shares @ hat).reshape(used.shape) ** 2 * used
    total = np.maximum(weight.sum(axis=1), 1e-12)
    weighted = shares.multiply(weight.ravel()[:, None]).tocsr()
    # Eliminating log E_i takes the weighted mean over a patch's exposures out of each equation.
    patch = np.repeat(np.arange(len(weight)), weight.shape[1])
    by_patch = csr_array((np.ones(len(patch)), (patch, np.arange(len(patch)))))
    sums = by_patch @ weighted
    light = samples.log_signal - (weight @ samples.log_signal / total)[:, None]
    normal = (shares.T @ weighted - sums.T @ sums.multiply(1.0 / total[:, None])).toarray()
    right = shares.T @ (light * weight).ravel()
    bend = np.diff(np.eye(256), 2, axis=0) * hat[1:-1, None]
    normal += _SMOOTHNESS * bend.T @ bend
    normal[MIDDLE_COUNT, MIDDLE_COUNT] += 1.0
    normal += 1e-9 * np.eye(256)  # counts without data and without weight
    return np.linalg.solve(normal, right)
