"""The patches of a 24-patch ColorChecker: found in a picture, measured, and what they should be.

Input  : a RadianceImage in the camera's own colours.    Output : (24, 3) mean colours, in the order
of the chart: dark skin to bluish green, orange to orange yellow, blue to cyan, white to black.
Fails  : a chart that is unevenly lit or that a fisheye bends strongly; keep it small and near the
axis. Detection is OpenCV's (mcc) and misses charts that are small, tilted or in a cluttered scene;
then the corner patches have to be pointed out.
"""

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from capture.errors import InputError
from capture.primaries import REC709, adaptation, rgb_to_xyz
from capture.radiance import RadianceImage
from capture.sensor import srgb_encode

Array = NDArray[np.float64]

COLUMNS, ROWS = 6, 4
NEUTRALS = slice(18, 24)
"""White to black."""

_CHART = "ColorChecker24 - After November 2014"
_MARGIN = 0.25
"""A patch is measured as far from its centre, in distances between centres; it ends at 0.4."""
_LEAST_PIXELS = 9
_EXPOSED_PERCENTILE = 99.0


def reference_colours(white_xy: ArrayLike, light: str = "") -> Array:
    """Return the linear Rec.709 of the patches, (24, 3), under a light.

    A white that reflects all light has the luminance 1; under D65 it is (1, 1, 1). X-Rite's values
    for D50, as colour-science has them, are adapted to the light by the Bradford transform, and
    corrected by how far that is off for the mean spectra of such charts (BabelColor's), if the
    light's spectrum is known. They then differ from simulated charts of other makers by ΔE00 of
    0.8 to 1.2; without a spectrum by 2 under a filament, and by 5 under fluorescent lamps.

    Parameters
    ----------
    white_xy : (2,) array_like
        The light's chromaticity.
    light : str
        The name of its spectrum in colour-science; empty if that is not known.
    """
    from colour import CCS_COLOURCHECKERS, xyY_to_XYZ

    chart = CCS_COLOURCHECKERS[_CHART]
    to_light = adaptation(chart.illuminant, white_xy).T
    xyz = xyY_to_XYZ(list(chart.data.values())) @ to_light
    if light:
        xyz = xyz * _from_spectra(light) / (_from_spectra("D50") @ to_light)
    return np.asarray(np.linalg.solve(rgb_to_xyz(REC709), xyz.T).T, np.float64)


def _from_spectra(light: str) -> Array:
    """Return CIE XYZ (24, 3) of a chart's mean spectra under a light, white being Y = 1."""
    from colour import MSDS_CMFS, SDS_COLOURCHECKERS, SDS_ILLUMINANTS, SpectralShape

    shape = SpectralShape(400, 700, 10)
    chart = SDS_COLOURCHECKERS["BabelColor Average"].values()
    patches = np.array([each.copy().align(shape).values for each in chart])
    lamp = SDS_ILLUMINANTS[light].copy().align(shape).values
    eye = MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values
    return np.asarray((patches * lamp) @ eye / (lamp @ eye[:, 1]), np.float64)


def find_corners(image: RadianceImage) -> Array:
    """Return the centres (4, 2) in pixels of the corner patches of the one chart in a picture.

    Dark skin, bluish green, black and white: clockwise, if the chart is not mirrored.

    Raises
    ------
    InputError
        If no chart is found.
    """
    bright = float(np.percentile(image.radiance, _EXPOSED_PERCENTILE))
    shown = srgb_encode(np.clip(image.radiance / (bright or 1.0), 0, 1)) * 255
    detector = cv2.mcc.CCheckerDetector.create()
    detector.setColorChartType(cv2.mcc.MCC24)
    if not detector.process(np.ascontiguousarray(shown[..., ::-1].round().astype(np.uint8)), 1):
        raise InputError(
            "no ColorChecker was found: give --corners, the centres of its corner patches"
        )
    quads = np.asarray(detector.getBestColorChecker().getColorCharts(), np.float64)
    centres = quads.reshape(COLUMNS * ROWS, 4, 2).mean(axis=1)
    return centres[[0, COLUMNS - 1, COLUMNS * ROWS - 1, COLUMNS * (ROWS - 1)]]


def measure_patches(image: RadianceImage, corners_px: ArrayLike) -> Array:
    """Return the median colour of each patch's middle, (24, 3).

    Parameters
    ----------
    image : RadianceImage
    corners_px : (4, 2) array_like
        Centres (x, y) of the corner patches: dark skin, bluish green, black and white.

    Raises
    ------
    InputError
        If a patch is clipped, not in the picture or too small; or the bottom row does not darken
        from white to black, so that the corners are not in this order.
    """
    corners = np.asarray(corners_px, np.float32)
    if corners.shape != (4, 2) or not np.isfinite(corners).all():
        raise InputError("the corners are four points x,y")
    last = COLUMNS - 1, ROWS - 1
    places = np.array([[0, 0], [last[0], 0], last, [0, last[1]]], np.float32)
    to_chart = cv2.getPerspectiveTransform(corners, places)
    width, height = image.size_px
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).astype(np.float64)
    place = cv2.perspectiveTransform(pixels, to_chart.astype(np.float64))
    nearest = np.rint(place)
    inside = (np.abs(place - nearest) <= _MARGIN).all(axis=-1)
    inside &= ((nearest >= 0) & (nearest <= last)).all(axis=-1)
    number = (nearest[..., 1] * COLUMNS + nearest[..., 0])[inside].astype(np.int64)
    colours = image.radiance[inside].astype(np.float64)
    good = (image.valid & ~image.clipped)[inside]
    patches = np.empty((COLUMNS * ROWS, 3))
    for patch in range(COLUMNS * ROWS):
        chosen = number == patch
        where = f"row {patch // COLUMNS + 1}, column {patch % COLUMNS + 1} of the chart"
        if chosen.sum() < _LEAST_PIXELS:
            raise InputError(f"{where} has {chosen.sum()} pixels; photograph it larger")
        if not good[chosen].all():
            raise InputError(f"{where} is clipped or not valid; expose it shorter")
        patches[patch] = np.median(colours[chosen], axis=0)
    neutral = patches[NEUTRALS].sum(axis=1)
    if np.any(np.diff(neutral) >= 0) or not np.all(patches > 0):
        raise InputError(
            "the bottom row does not darken from white to black: give the corners in the order "
            "dark skin, bluish green, black, white"
        )
    return patches
