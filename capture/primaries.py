"""Colour primaries: from the ones a file names to Rec.709."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

REC709 = np.array([[0.640, 0.330], [0.300, 0.600], [0.150, 0.060], [0.3127, 0.3290]])
"""CIE xy of red, green, blue and white (ITU-R BT.709-6, item 1)."""

# The Bradford transform, XYZ to sharpened cone responses, as ICC profiles use it.
_BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)


def rgb_to_xyz(chromaticities: ArrayLike) -> NDArray[np.float64]:
    """Return the matrix from linear RGB to XYZ, in which RGB (1, 1, 1) has Y = 1.

    Parameters
    ----------
    chromaticities : (4, 2) array_like
        CIE xy of red, green, blue and white.

    Raises
    ------
    ValueError
        If they span no colours: an infinite value, a y of 0, or primaries on one line.
    """
    xy = np.asarray(chromaticities, np.float64).reshape(4, 2)
    if not np.all(np.isfinite(xy)) or np.any(np.abs(xy[:, 1]) < 1e-6):
        raise ValueError(f"{xy.tolist()} are not chromaticities")
    xyz = np.column_stack([xy, 1.0 - xy.sum(axis=1)]) / xy[:, 1:]
    primaries, white = xyz[:3].T, xyz[3]
    if np.linalg.cond(primaries) > 1e6:
        raise ValueError(f"the primaries {xy[:3].tolist()} lie on one line")
    return primaries * np.linalg.solve(primaries, white)


def to_rec709(chromaticities: ArrayLike) -> NDArray[np.float64]:
    """Return the matrix from linear RGB of these chromaticities to linear Rec.709.

    White is adapted to Rec.709's D65 by the Bradford transform: RGB (1, 1, 1) stays (1, 1, 1), as
    a picture's author saw it. Raises as `rgb_to_xyz` does.
    """
    source = rgb_to_xyz(chromaticities)
    target = rgb_to_xyz(REC709)
    source_white, target_white = (_BRADFORD @ matrix.sum(axis=1) for matrix in (source, target))
    adaptation = np.linalg.solve(_BRADFORD, (target_white / source_white)[:, None] * _BRADFORD)
    return np.asarray(np.linalg.solve(target, adaptation @ source), np.float64)


def are_rec709(chromaticities: ArrayLike) -> bool:
    """Tell whether they are Rec.709's, to the three or four digits that files give."""
    xy = np.asarray(chromaticities, np.float64).reshape(4, 2)
    return bool(np.allclose(xy, REC709, rtol=0, atol=5e-4))
