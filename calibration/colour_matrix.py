"""The matrix from a camera's channels to linear Rec.709, by colours that are known.

Input  : (n, 3) measured and (n, 3) true colours, some of which are neutral.
Output : ColourFit: a matrix, and the colour difference ΔE00 on patches it was not fitted to.
The exposure is not known: colours are compared after a common factor. Of three forms, white balance
alone, a matrix that leaves grey exactly grey, and any matrix, the simplest is taken that predicts
left-out patches not significantly worse than the best (as calibration/vignetting.py does).
Cost   : 1 s, and 2 s to import colour-science.
Fails  : for spectra unlike the chart's. Lamps with narrow bands shift colours that the chart, lit
by another light, did not show.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.primaries import REC709, rgb_to_xyz

Array = NDArray[np.float64]
_Form = Callable[[Array, Array, NDArray[np.bool_]], Array]
"""Measured and true colours, and which are grey, to the matrix (3, 3) that fits them best."""

_SIGNIFICANT_SIGMAS = 2.0
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_LARGEST_CONDITION = 1e4


@dataclass(frozen=True)
class ColourTrial:
    """A form of matrix that was tried, and its mean ΔE00 on left-out patches."""

    form: str
    held_out: float
    is_plausible: bool


@dataclass(frozen=True, eq=False)
class ColourFit:
    """A colour matrix and how well it does.

    Attributes
    ----------
    matrix : (3, 3) float64
        Takes the camera's colours to linear Rec.709. The luminance of grey is what it was before.
    form : str
    before, after, worst : float
        ΔE00 of the patches: the mean before, and the mean and largest after, each patch as it is
        predicted by a fit to the others.
    trials : tuple of ColourTrial
        Simplest first.
    """

    matrix: Array
    form: str
    before: float
    after: float
    worst: float
    trials: tuple[ColourTrial, ...]


def fit_colours(measured: Array, true: Array, neutrals: slice, old_matrix: Array) -> ColourFit:
    """Return the matrix that takes measured colours (n, 3) to the true ones (n, 3).

    Parameters
    ----------
    measured : (n, 3) float64
        In the camera's own channels, of any common scale.
    true : (n, 3) float64
        Linear Rec.709; a perfect white has the luminance 1.
    neutrals : slice
        Which of them are grey.
    old_matrix : (3, 3) float64
        What the camera's channels were multiplied by before; the identity if nothing.

    Raises
    ------
    InputError
        If the colours do not determine a matrix.
    """
    if np.linalg.cond(measured) > _LARGEST_CONDITION:
        raise InputError("the measured colours hardly differ; is this the chart?")
    forms: dict[str, _Form] = {
        "white balance": _diagonal,
        "grey stays grey": _grey_preserving,
        "any matrix": _any,
    }
    is_neutral = np.zeros(len(true), np.bool_)
    is_neutral[neutrals] = True
    matrices, errors = [], []
    for fit in forms.values():
        matrices.append(fit(measured, true, is_neutral))
        predicted = np.empty_like(true)
        for left_out in range(len(true)):
            kept = np.arange(len(true)) != left_out
            matrix = fit(measured[kept], true[kept], is_neutral[kept])
            predicted[left_out] = measured[left_out] @ matrix.T
        errors.append(difference(predicted, true))
    mean = np.array([each.mean() for each in errors])
    excess = np.array(errors) - errors[int(np.argmin(mean))]
    limit = _SIGNIFICANT_SIGMAS * excess.std(axis=1, ddof=1) / np.sqrt(len(true))
    plausible = excess.mean(axis=1) <= limit
    chosen = int(np.argmax(plausible))
    matrix = matrices[chosen]
    grey = measured[is_neutral].sum(axis=0)
    matrix = matrix * (_LUMINANCE @ old_matrix @ grey) / (_LUMINANCE @ matrix @ grey)
    return ColourFit(
        matrix=matrix,
        form=list(forms)[chosen],
        before=float(difference(_exposed(measured @ old_matrix.T, true), true).mean()),
        after=float(mean[chosen]),
        worst=float(errors[chosen].max()),
        trials=tuple(
            ColourTrial(form, float(error), bool(good))
            for form, error, good in zip(forms, mean, plausible, strict=True)
        ),
    )


def difference(colours: Array, true: Array) -> Array:
    """Return ΔE00 (n,) between linear Rec.709 colours (n, 3), the eye adapted to D65."""
    from colour import XYZ_to_Lab, delta_E

    to_xyz = rgb_to_xyz(REC709)
    lab, true_lab = (XYZ_to_Lab(each @ to_xyz.T, REC709[3]) for each in (colours, true))
    return np.asarray(delta_E(lab, true_lab, method="CIE 2000"), np.float64)


def _diagonal(measured: Array, true: Array, _: NDArray[np.bool_]) -> Array:
    return np.diag((measured * true).sum(axis=0) / (measured**2).sum(axis=0))


def _any(measured: Array, true: Array, _: NDArray[np.bool_]) -> Array:
    return np.asarray(np.linalg.lstsq(measured, true, rcond=None)[0].T, np.float64)


def _grey_preserving(measured: Array, true: Array, neutral: NDArray[np.bool_]) -> Array:
    """Return the best matrix of those that take the camera's grey to the true one exactly."""
    luminance = true[neutral] @ _LUMINANCE
    camera_grey = luminance @ measured[neutral] / (luminance @ luminance)
    grey = luminance @ true[neutral] / (luminance @ luminance)
    start = np.outer(grey, camera_grey) / (camera_grey @ camera_grey)
    aside = np.linalg.svd(camera_grey[None])[2][1:]  # both directions in which nothing is grey
    rest = np.linalg.lstsq(measured @ aside.T, true - measured @ start.T, rcond=None)[0]
    return np.asarray(start + rest.T @ aside, np.float64)


def _exposed(colours: Array, true: Array) -> Array:
    """Return colours times the factor that gives them the luminance of the true ones."""
    luminance, wanted = colours @ _LUMINANCE, true @ _LUMINANCE
    return colours * ((luminance * wanted).sum() / (luminance**2).sum())
