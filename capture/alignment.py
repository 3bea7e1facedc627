"""Hand-held brackets: how the frames lie against each other, and the bracket laid straight.

Input  : Bracket and Sensor.
Output : Alignment of each frame against the darkest; Bracket and Sensor for capture.merge.
Cost   : on one core 0.3 s per frame and megapixel, of at most 2 megapixels, to find a motion, and
         0.4 s per megapixel, of all, to undo it.
Fails  : a motion is a shift and a turn about the lens axis. A fisheye that is tilted by hand moves
         the middle of its picture, but hardly the rim beside the axis that it is tilted about: what
         is left there is as large as the shift, which is why large ones are refused. Dirt on the
         lens and hot pixels stand still; a scene with no more detail than theirs seems to as well.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.fine_counts import encode, fine_counts, fine_sensor
from capture.frame import Bracket, Frame
from capture.lens_circle import outside_circle
from capture.reduced import reduced_linear, reduction
from capture.registration import Mask, Motion, Registration, register, warped, warped_mask
from capture.sensor import Sensor, clear_level

LARGEST_SHIFT = 0.05
"""Shift beyond which a bracket is refused, in shorter sides of the picture: what a shift and a turn
cannot follow (parallax, the rim of a fisheye) grows with it."""

LARGEST_ROTATION_RAD = math.radians(4.0)

STILL_PX = 0.5
"""A frame whose corners have moved by less stays as it is, to the bit: frames from a tripod are
found to move by up to 0.45 px, and resampling would blur by as much."""

_SURE = 3.0
"""Standard deviations that a motion must have to be more than an error of finding it."""

_LEAST_CORRELATION = 0.7
_LARGEST_DEVIATION = 0.5
"""In pixels of the pictures compared."""

_FOUND_PX = 2**21
"""Motions are found in pictures reduced to at most so many pixels."""

_LEAST_SNR = 10.0
_LARGEST_VALUE = 0.9


@dataclass(frozen=True, eq=False)
class Alignment:
    """How one frame lies against the darkest frame of its bracket.

    Attributes
    ----------
    frame_index : int
        Frame.index.
    motion : (3, 3) float64
        Takes (x, y, 1) of the darkest frame to where the same thing stands in this one.
    motion_px : float
        By how much it moves the corner of the picture that moves most.
    is_moved : bool
        True where that is STILL_PX or more, and more than the error of finding it.
    shift_px : (float, float)
        By which the picture's middle has moved, (x, y).
    rotation_rad : float
        By which the picture has turned about its middle, positive from +x to +y.
    deviation_px : float
        Standard deviation of the motion, at the picture's corners.
    is_certain : bool
        False where this frame and the next darker one show too little in common: it is then taken
        to lie as that one does.
    """

    frame_index: int
    motion: Motion
    motion_px: float
    is_moved: bool
    shift_px: tuple[float, float]
    rotation_rad: float
    deviation_px: float
    is_certain: bool


@dataclass(frozen=True, eq=False)
class AlignedBracket:
    """A bracket laid straight, the sensor of its counts, and what was found of its frames.

    `alignments` stand in rising order of `signal`.
    """

    bracket: Bracket
    sensor: Sensor
    alignments: tuple[Alignment, ...]


def align_bracket(bracket: Bracket, sensor: Sensor) -> AlignedBracket:
    """Return the bracket with the frames that moved laid over the darkest one.

    Each frame is compared with the next darker one, which sees most of what it sees. What is
    compared is the logarithm of radiance, held between what the brighter frame can hold and what
    the darker one sees above its noise: both then show the same, whatever their exposures. What a
    fisheye's circle leaves black is not looked at.

    Frames that have not moved are not resampled; if none has, the bracket and the sensor are those
    that came. Otherwise all counts become finer ones (capture.fine_counts).

    Resampled is linear light, which keeps sums of light, and bilinearly: cubic kernels overshoot
    beside lights, and on five of six real maps their rms error was larger, by up to 0.07 stops. It
    becomes counts again so that the merge judges saturation, contradiction and noise as
    ever. A value that any full one has a part in is full. What a frame does not show is full too,
    and the merge leaves it out. It keeps the darkest exposures whatever they show, so a repeat of
    the darkest frame shows there what that shows. The variance is that of a value before
    resampling: a single one is less noisy, but neighbours now share their noise, and a sum over
    many has the variance that the sum of theirs says.

    Float counts are radiance already, and are taken to lie straight.

    Raises
    ------
    InputError
        If a frame has moved by more than LARGEST_SHIFT or LARGEST_ROTATION_RAD; or if the counts
        cannot be the sensor's.
    """
    frames = bracket.by_signal()
    sensor.check_counts(frames[0].counts.dtype)
    if frames[0].counts.dtype == np.float32:
        still = tuple(_alignment(frame, np.eye(3), 0.0, is_certain=True) for frame in frames)
        return AlignedBracket(bracket, sensor, still)
    step = reduction(frames[0].size_px, _FOUND_PX)
    pictures = [reduced_linear(frame, sensor, step) for frame in frames]
    outside = outside_circle(reversed(pictures))
    alignments = _found(frames, pictures, sensor, step, outside)
    del pictures
    if not any(each.is_moved for each in alignments):
        return AlignedBracket(bracket, sensor, alignments)
    inside = np.ones(frames[0].counts.shape[:2], np.bool_)
    if outside is not None:
        inside = cv2.resize((~outside).astype(np.uint8), frames[0].size_px) > 0
    fine = fine_sensor(sensor)
    straight: list[Frame] = []
    for frame, each in zip(frames, alignments, strict=True):
        counts = fine_counts(frame.counts, sensor)
        if each.is_moved:
            counts = _resampled(counts, fine, each.motion)
            hidden = ~warped_mask(inside, each.motion) & inside
            is_darkest = frame.exposure.signal == frames[0].exposure.signal
            counts[hidden] = straight[0].counts[hidden] if is_darkest else int(fine.white_dn)
        straight.append(Frame(counts, frame.exposure, frame.timestamp_s, frame.index))
    return AlignedBracket(Bracket(tuple(straight), bracket.index), fine, alignments)


def _found(
    frames: list[Frame],
    pictures: list[NDArray[np.float32]],
    sensor: Sensor,
    step: int,
    outside: Mask | None,
) -> tuple[Alignment, ...]:
    use = np.ones(pictures[0].shape[:2], np.bool_) if outside is None else ~outside
    motion, variance_px2 = np.eye(3), 0.0
    alignments = [_alignment(frames[0], motion, 0.0, is_certain=True)]
    for (darker, brighter), (dark, bright) in zip(
        pairwise(frames), pairwise(pictures), strict=True
    ):
        low, high = _common_range(darker, brighter, sensor)
        found = register(
            _logarithm(dark / darker.exposure.signal, low, high),
            _logarithm(bright / brighter.exposure.signal, low, high),
            use,
        )
        is_certain = _is_certain(found)
        if is_certain:
            motion = _full_size(found.motion, step) @ motion
            variance_px2 += (found.deviation_px * step) ** 2
        alignment = _alignment(brighter, motion, math.sqrt(variance_px2), is_certain=is_certain)
        _check_limits(alignment, frames[0], brighter)
        alignments.append(alignment)
    return tuple(alignments)


def _common_range(darker: Frame, brighter: Frame, sensor: Sensor) -> tuple[float, float]:
    """Return the least and the largest radiance that both frames measure in all channels.

    Where they measure none in common the largest is the lesser, and what is held by it is flat.
    """
    least = clear_level(sensor, darker.exposure.gain, _LEAST_SNR)
    most = _LARGEST_VALUE * sensor.saturation
    return least / darker.exposure.signal, most / brighter.exposure.signal


def _logarithm(radiance: NDArray[np.float32], low: float, high: float) -> NDArray[np.float32]:
    red, green, blue = np.moveaxis(np.log2(np.clip(radiance, low, high)), -1, 0)
    return (red + green + blue) / np.float32(3)


def _is_certain(found: Registration) -> bool:
    return found.correlation > _LEAST_CORRELATION and found.deviation_px < _LARGEST_DEVIATION


def _full_size(motion: Motion, step: int) -> Motion:
    """Return a motion of pictures whose pixels are means over `step` by `step`, in whole pixels."""
    middle = (step - 1) / 2
    grow = np.array([[step, 0.0, middle], [0.0, step, middle], [0.0, 0.0, 1.0]])
    return grow @ motion @ np.linalg.inv(grow)


def _alignment(frame: Frame, motion: Motion, deviation_px: float, *, is_certain: bool) -> Alignment:
    width, height = frame.size_px
    right, bottom = width - 1.0, height - 1.0
    corners = np.array([[0, right, 0, right], [0, 0, bottom, bottom], [1, 1, 1, 1]])
    middle = np.array([right / 2, bottom / 2, 1.0])
    shift = motion @ middle - middle
    motion_px = float(np.hypot(*(motion @ corners - corners)[:2]).max())
    return Alignment(
        frame_index=frame.index,
        motion=motion,
        motion_px=motion_px,
        is_moved=motion_px > max(STILL_PX, _SURE * deviation_px),
        shift_px=(float(shift[0]), float(shift[1])),
        rotation_rad=math.atan2(motion[1, 0], motion[0, 0]),
        deviation_px=deviation_px,
        is_certain=is_certain,
    )


def _check_limits(alignment: Alignment, darkest: Frame, frame: Frame) -> None:
    shift_px = math.hypot(*alignment.shift_px)
    most_px = LARGEST_SHIFT * min(frame.size_px)
    if shift_px > most_px or abs(alignment.rotation_rad) > LARGEST_ROTATION_RAD:
        raise InputError(
            f"frames {darkest.index} and {frame.index} ({frame.exposure.time_s:g} s) lie "
            f"{shift_px:.0f} px and {math.degrees(alignment.rotation_rad):.1f}° apart, and at most "
            f"{most_px:.0f} px and {math.degrees(LARGEST_ROTATION_RAD):.0f}° can be aligned; leave "
            "out frames that do not belong, or merge them as they lie with --no-align"
        )


def _resampled(counts: NDArray[np.uint16], fine: Sensor, motion: Motion) -> NDArray[np.uint16]:
    """Return what finer counts show where `motion` takes each pixel."""
    white_dn = int(fine.white_dn)
    linear = fine.linear_table()[counts, np.arange(3)]
    is_full = linear >= fine.saturation
    moved = encode(warped(linear, motion), fine)
    if is_full.any():
        moved[warped(is_full.astype(np.float32), motion) > 0] = white_dn
    return moved
