"""Colour primaries: from the ones a file names to Rec.709.

The matrices are colour-science's, which takes two seconds to import: it is imported only when a
file calls for it.
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

REC709 = np.array([[0.640, 0.330], [0.300, 0.600], [0.150, 0.060], [0.3127, 0.3290]])
"""CIE xy of red, green, blue and white (ITU-R BT.709-6, item 1)."""

PrimariesName = Literal["rec709", "rec2020", "acescg"]

PRIMARIES: dict[PrimariesName, NDArray[np.float64]] = {
    "rec709": REC709,
    "rec2020": np.array([[0.708, 0.292], [0.170, 0.797], [0.131, 0.046], [0.3127, 0.3290]]),
    "acescg": np.array([[0.713, 0.293], [0.165, 0.830], [0.128, 0.044], [0.32168, 0.33767]]),
}
"""Primaries that radiance can be written in: CIE xy as of REC709 (ITU-R BT.2020-2; Academy
S-2014-004)."""


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
    from colour import normalised_primary_matrix

    xy = _checked(chromaticities)
    return np.asarray(normalised_primary_matrix(xy[:3], xy[3]), np.float64)


def to_rec709(chromaticities: ArrayLike) -> NDArray[np.float64]:
    """Return the matrix from linear RGB of these chromaticities to linear Rec.709.

    White is adapted to Rec.709's D65 by the Bradford transform: RGB (1, 1, 1) stays (1, 1, 1), as
    a picture's author saw it. Raises as `rgb_to_xyz` does.
    """
    from colour import RGB_Colourspace, matrix_RGB_to_RGB

    source, target = (
        RGB_Colourspace(name, xy[:3], xy[3])
        for name, xy in (("file", _checked(chromaticities)), ("Rec.709", REC709))
    )
    return np.asarray(matrix_RGB_to_RGB(source, target, "Bradford"), np.float64)


def adaptation(white: ArrayLike, wanted_white: ArrayLike) -> NDArray[np.float64]:
    """Return the Bradford transform of XYZ under one white, CIE xy (2,), to XYZ under another."""
    from colour import xy_to_XYZ
    from colour.adaptation import matrix_chromatic_adaptation_VonKries

    return np.asarray(
        matrix_chromatic_adaptation_VonKries(
            xy_to_XYZ(white), xy_to_XYZ(wanted_white), transform="Bradford"
        ),
        np.float64,
    )


def are_rec709(chromaticities: ArrayLike) -> bool:
    """Tell whether they are Rec.709's, to the three or four digits that files give."""
    xy = np.asarray(chromaticities, np.float64).reshape(4, 2)
    return bool(np.allclose(xy, REC709, rtol=0, atol=5e-4))


def _checked(chromaticities: ArrayLike) -> NDArray[np.float64]:
    xy = np.asarray(chromaticities, np.float64).reshape(4, 2)
    if not np.all(np.isfinite(xy)) or np.any(np.abs(xy[:, 1]) < 1e-6):
        raise ValueError(f"{xy.tolist()} are not chromaticities")
    primaries = np.column_stack([xy[:3], 1.0 - xy[:3].sum(axis=1)]) / xy[:3, 1:]
    if np.linalg.cond(primaries) > 1e6:
        raise ValueError(f"the primaries {xy[:3].tolist()} lie on one line")
    return xy
