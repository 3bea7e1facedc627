"""A response curve: the linear value of every count, comparable between methods.

Scale  : brackets tell a response up to a factor for each channel. It is fixed so that the channels
         agree at the middle count, for white balance makes equal counts grey, and the highest of
         them is 1 at MOST_COUNT. What lies above is taken to be full.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from calibration.response_samples import MOST_COUNT, Samples
from capture.arrays import read_only

COUNTS = np.arange(256.0)

MIDDLE_COUNT = 128
"""Where the uncertainty holds the scale: it is that of a curve over its value here."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Linear value of each count, per channel.

    Attributes
    ----------
    values : (256, 3) float64
        Rising from 0 at count 0 to 1 from MOST_COUNT + 1 on.
    deviation : (256, 3) float64, or None
        Standard deviation of `values` where the scale is held by count 128: whatever is wrong with
        the scale changes no ratio of radiances. None where the method cannot tell.
    correction_ev : (K,) float64
        What the method added to the labelled exposures, in stops.
    """

    values: NDArray[np.float64]
    deviation: NDArray[np.float64] | None
    correction_ev: NDArray[np.float64]

    def __post_init__(self) -> None:
        values = read_only("values", self.values, np.float64, (256, 3))
        if not np.isfinite(values).all() or (np.diff(values, axis=0) < 0).any():
            raise ValueError("a response must be finite and must not fall")
        object.__setattr__(self, "values", values)
        if self.deviation is not None:
            deviation = read_only("deviation", self.deviation, np.float64, (256, 3))
            object.__setattr__(self, "deviation", deviation)


def scaled(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values (256, 3) at the scale that this module's docstring fixes, and never falling."""
    risen = np.maximum.accumulate(np.maximum(values, 0.0), axis=0)
    risen = risen / risen[MIDDLE_COUNT]
    risen = risen / risen[MOST_COUNT].max()
    risen[0] = 0.0
    risen[MOST_COUNT + 1 :] = 1.0
    return risen


def shares_of_counts(samples: Samples, channel: int) -> tuple[Any, NDArray[np.bool_]]:
    """Return each patch's share in each count, sparse (N·K, 256), and where it is used, (N, K).

    A mean count lies between two counts and belongs to both, for methods that know whole counts.
    """
    counts = samples.counts[..., channel]
    used = np.isfinite(counts)
    inside = np.where(used, counts, 0.0).ravel()
    below = np.minimum(inside.astype(int), 254)
    rows = np.arange(len(inside))
    shares = csr_array(
        (
            np.concatenate([below + 1 - inside, inside - below]),
            (np.concatenate([rows, rows]), np.concatenate([below, below + 1])),
        ),
        shape=(len(inside), 256),
    )
    return shares, used


def disagreement_ev(samples: Samples, curve: Curve) -> float:
    """Return by how much the same patch in neighbouring exposures disagrees, in stops.

    The median over patches, channels and neighbouring exposures of |log2| of the ratio of their
    radiances. Its noise alone makes 0.01; what moved is too little to change a median.
    """
    with np.errstate(divide="ignore"):
        table = np.log2(curve.values)
    ev = samples.log_signal / np.log(2) + curve.correction_ev
    light = np.stack(
        [np.interp(samples.counts[..., c], COUNTS, table[:, c]) for c in range(3)], axis=-1
    )
    step = np.abs(np.diff(light - ev[:, None], axis=1))
    return float(np.median(step[np.isfinite(step)]))
