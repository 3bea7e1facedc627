"""Ghosts: what moved while a bracket was taken, found where its exposures contradict each other.

Input  : Bracket and Sensor.
Output : which pixels moved; the merged picture with each ghost taken from one exposure.
Cost   : 40 ns per channel value of each exposure on one core, of at most 2 megapixels.
Fails  : a ghost is not seen where no two neighbouring exposures measure both of its states (one is
         full, or in the dark), nor where it differs by less than 0.25 EV, after larger pictures
         were reduced to 2 megapixels. Two ghosts may be taken from two exposures: what moved
         between places of unlike brightness may then stand in both, or in neither.
"""

import math
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.frame import Bracket, Frame
from capture.merge import merge_bracket
from capture.radiance import RadianceImage
from capture.reduced import reduced_brightest, reduced_linear, reduction
from capture.sensor import Sensor, clear_level

_LOOKED_AT_PX = 2**21
"""Ghosts are looked for in pictures reduced to at most so many pixels."""

_LEAST_SNR = 5.0
"""Signal to noise ratio of the noisiest values compared. In a mean of nine the noise is 0.1 EV, and
the neighbourhood allows for more."""

_LARGEST_VALUE = 0.9
"""Part of saturation above which values are not compared: curves are least known there."""

_DEVIATIONS = 5.0

_LEAST_CONTRADICTION_EV = 0.25
"""What moved by less is hardly seen, and a JPEG's blocks contradict by as much."""

_CHANNELS = 2
"""Channels that must agree: in one alone, a camera's treatment of strong colours contradicts."""

_SAMPLE_PX, _FEWEST_PX = 2**14, 100
_FITS = 6

_SMALLEST_PX, _MARGIN_PX = 3, 3

Mask = NDArray[np.bool_]
Plane = NDArray[np.float32]


class _Seen(NamedTuple):
    """A frame as it is compared, (H, W, 3): reduced, and smoothed over 3 by 3 pixels.

    `log2_radiance` is held above what noise allows to measure, where `is_measured` ends.
    """

    frame: Frame
    log2_radiance: Plane
    is_measured: Mask
    is_full: Mask


def find_ghosts(bracket: Bracket, sensor: Sensor) -> Mask:
    """Return the pixels, (H, W), that two exposures contradict each other about.

    Neighbouring exposures are compared, channel by channel, where neither is full and where the
    darker one does not predict that the brighter is: what contradicts there, the merge leaves out
    by itself. Means over 3 by 3 pixels contradict each other if one lies outside of all that the
    other has within a pixel, which the edges of a frame that lies a little askew do not, by more
    than 0.25 EV and five standard deviations of what they usually differ by. What exposures differ
    by everywhere, as a smooth function of brightness, comes of a wrong label or response and is no
    contradiction.

    Float counts have no noise model and show no ghosts.
    """
    frames = bracket.by_signal()
    sensor.check_counts(frames[0].counts.dtype)
    width, height = frames[0].size_px
    if frames[0].counts.dtype == np.float32:
        return np.zeros((height, width), np.bool_)
    step = reduction((width, height), _LOOKED_AT_PX)
    found = np.zeros((height // step, width // step), np.bool_)
    for darker, brighter in pairwise(_seen(frame, sensor, step) for frame in frames):
        found |= _contradicting(darker, brighter, sensor)
    square = np.ones((_SMALLEST_PX, _SMALLEST_PX), np.uint8)
    solid = cv2.morphologyEx(found.astype(np.uint8), cv2.MORPH_OPEN, square)
    margin = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * _MARGIN_PX + 1,) * 2)
    grown = cv2.dilate(cv2.morphologyEx(solid, cv2.MORPH_CLOSE, margin), margin)
    return np.asarray(cv2.resize(grown, (width, height), interpolation=cv2.INTER_NEAREST)) > 0


def without_ghosts(
    image: RadianceImage, bracket: Bracket, sensor: Sensor, ghosts: Mask
) -> RadianceImage:
    """Return the merged picture of a bracket with each ghost taken from a single exposure.

    For each connected ghost it is the brightest exposure that is nowhere full in it, or the
    darkest. Radiance, variance and the mark `clipped` are those of that exposure alone.
    """
    if not ghosts.any():
        return image
    frames = bracket.by_signal()
    count, label = cv2.connectedComponents(ghosts.astype(np.uint8))
    chosen = np.zeros(count, np.intp)
    for position, frame in enumerate(frames[1:], start=1):
        full = sensor.linear_table()[frame.counts[ghosts], np.arange(3)] >= sensor.saturation
        full_px = np.bincount(label[ghosts], weights=full.any(axis=1), minlength=count)
        chosen[full_px == 0] = position
    position_of = np.where(ghosts, chosen[label], -1)
    radiance, variance, clipped = image.radiance.copy(), image.variance.copy(), image.clipped.copy()
    for position in np.unique(chosen[1:]):
        here = position_of == position
        only = replace(frames[position], counts=frames[position].counts[here][None])
        single = merge_bracket(Bracket((only,)), sensor)
        radiance[here] = single.radiance[0]
        variance[here] = single.variance[0]
        clipped[here] = single.clipped[0]
    return replace(image, radiance=radiance, variance=variance, clipped=clipped)


def _seen(frame: Frame, sensor: Sensor, step: int) -> _Seen:
    linear = np.asarray(cv2.blur(reduced_linear(frame, sensor, step), (3, 3)), np.float32)
    least = min(clear_level(sensor, frame.exposure.gain, _LEAST_SNR), sensor.saturation)
    held = np.maximum(linear, np.float32(least))
    brightest = sensor.linear_table()[reduced_brightest(frame.counts, step), np.arange(3)]
    is_full = brightest >= _LARGEST_VALUE * sensor.saturation
    log2_radiance = np.log2(held) - np.float32(math.log2(frame.exposure.signal))
    return _Seen(frame, log2_radiance, linear >= least, is_full)


def _contradicting(darker: _Seen, brighter: _Seen, sensor: Sensor) -> Mask:
    """Return where the two frames contradict each other, (H, W)."""
    neither_full = ~(darker.is_full | brighter.is_full)
    both = neither_full & darker.is_measured & brighter.is_measured
    excess_ev = brighter.log2_radiance - darker.log2_radiance
    expected = np.empty_like(excess_ev)
    allowed_ev = np.empty(3, np.float32)
    for c in range(3):
        level = darker.log2_radiance[..., c]
        usual_ev, spread_ev = _usual(level, excess_ev[..., c], both[..., c], sensor)
        expected[..., c] = level + usual_ev
        allowed_ev[c] = max(_DEVIATIONS * spread_ev, _LEAST_CONTRADICTION_EV)
    square = np.ones((3, 3), np.uint8)
    least = np.asarray(cv2.erode(expected, square)) - allowed_ev
    most = np.asarray(cv2.dilate(expected, square)) + allowed_ev
    full_log2 = math.log2(_LARGEST_VALUE * sensor.saturation / brighter.frame.exposure.signal)
    is_darker = darker.is_measured & (brighter.log2_radiance < least) & (most < full_log2)
    is_brighter = brighter.is_measured & (brighter.log2_radiance > most)
    channels = ((neither_full & one).sum(axis=-1) for one in (is_darker, is_brighter))
    return np.maximum(*channels) >= _CHANNELS


def _usual(level: Plane, excess_ev: Plane, both: Mask, sensor: Sensor) -> tuple[Plane, float]:
    """Return by how much the brighter frame exceeds the darker one where nothing moved, ± how much.

    It is one number for a linear sensor, and else a parabola over the level: too stiff to follow
    what moved, even if nothing else has its brightness. Fitted with Tukey's biweight.
    """
    known = np.flatnonzero(both)
    if len(known) < _FEWEST_PX:
        return np.zeros_like(level), 0.0
    sample = known[:: -(-len(known) // _SAMPLE_PX)]
    x, y = level.ravel()[sample].astype(np.float64), excess_ev.ravel()[sample].astype(np.float64)
    middle = float(np.median(x))
    powers = np.vander(x - middle, 1 if sensor.response is None else 3)
    fit = np.array([float(np.median(y))])
    for _ in range(_FITS):
        off = np.abs(y - np.polyval(fit, x - middle))
        reach_ev = 6 * float(np.median(off)) + 0.02
        weight = np.maximum(1 - (off / reach_ev) ** 2, 0)
        # Not polyfit, which fails where all is of one brightness.
        fit = np.linalg.lstsq(powers * weight[:, None], y * weight, rcond=None)[0]
    inside = np.clip(level, x.min(), x.max()) - np.float32(middle)
    spread_ev = 1.4826 * float(np.median(np.abs(y - np.polyval(fit, x - middle))))
    return np.polyval(fit, inside).astype(np.float32), spread_ev
