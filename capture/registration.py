"""Two pictures of one scene laid over each other: shift and rotation, to a fraction of a pixel.

Input  : two grey pictures of equal size and like brightness, and where they may be looked at.
Output : Registration: the motion, and how well it is known.
Cost   : some 0.4 s per megapixel on one core.
Fails  : where most of what is seen moves by itself, or repeats itself within the search range.

The coarsest level of a pyramid is searched over all shifts and some rotations by correlation. On
each finer level Gauss-Newton steps follow, with the mean of both pictures' gradients as in
Benhimane and Malis, "Real-time image-based tracking of planes using efficient second-order
minimization" (2004). Gain and offset of brightness are solved for as well, and Tukey's biweight
leaves out what moved by itself.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

_COARSEST_PX = 128
"""The longer side of the coarsest level is at most this."""

_SEARCHED_RAD = np.radians(np.linspace(-6.0, 6.0, 9))
_DETAIL_PX = 6.0
"""The search sees what is smaller than this: wide slopes of brightness hide the peak."""

_BLUR_PX = 1.0
_MOST_STEPS, _SMALL_STEP_PX = 12, 0.005
_USED_SHARE = 0.25
"""Share of pixels, those of steepest gradient, that a step looks at."""

_TUKEY = 4.685
"""Where the biweight ends, in standard deviations: 95 % efficient on normal residuals."""

_ALIKE_PX = 4 * math.pi * _BLUR_PX**2
"""Pixels that share one independent residual after the blur."""

_FEWEST_PX = 100

Motion = NDArray[np.float64]
Plane = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Registration:
    """How a picture lies against its reference.

    Attributes
    ----------
    motion : (3, 3) float64
        Takes (x, y, 1) of the reference to where the same thing stands in the picture.
    deviation_px : float
        Standard deviation of where `motion` puts the picture's corners; infinite where the pictures
        show nothing.
    correlation : float
        Of both pictures after the motion, over the pixels looked at.
    """

    motion: Motion
    deviation_px: float
    correlation: float


def register(reference: Plane, picture: Plane, use: Mask) -> Registration:
    """Return the rigid motion that lays `picture` over `reference`.

    Parameters
    ----------
    reference, picture : (H, W) float32
    use : (H, W) bool
        Where both may be looked at: False on what stands still though the camera moves, such as the
        rim of a fisheye's circle.
    """
    levels = [(reference, picture, use)]
    while max(levels[-1][2].shape) > _COARSEST_PX:
        one, other, mask = levels[-1]
        levels.append((_halved(one), _halved(other), mask[::2, ::2]))
    motion = _searched(*levels[-1])
    for one, other, mask in reversed(levels[1:]):
        motion = _scaled(_refined(one, other, mask, motion).motion, 2.0)
    return _refined(reference, picture, use, motion)


def rigid_motion(
    shift_px: tuple[float, float], rotation_rad: float, size_px: tuple[int, int]
) -> Motion:
    """Return the (3, 3) motion that turns about the picture's middle, from +x to +y, and shifts."""
    x_px, y_px = (size_px[0] - 1) / 2, (size_px[1] - 1) / 2
    cos, sin = math.cos(rotation_rad), math.sin(rotation_rad)
    return np.array(
        [
            [cos, -sin, x_px - cos * x_px + sin * y_px + shift_px[0]],
            [sin, cos, y_px - sin * x_px - cos * y_px + shift_px[1]],
            [0.0, 0.0, 1.0],
        ]
    )


def warped(picture: NDArray[np.float32], motion: Motion) -> NDArray[np.float32]:
    """Return what the picture shows where `motion` takes each pixel; beyond its edge, the edge."""
    height, width = picture.shape[:2]
    moved = cv2.warpAffine(
        picture,
        motion[:2],
        (width, height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(moved, np.float32)


def warped_mask(mask: Mask, motion: Motion) -> Mask:
    """Return where all pixels that `motion` reads lie in the picture and in the mask."""
    height, width = mask.shape
    moved = cv2.warpAffine(
        mask.astype(np.float32),
        motion[:2],
        (width, height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT,
    )
    return np.asarray(moved, np.float32) > 1 - 1e-3


def _searched(reference: Plane, picture: Plane, use: Mask) -> Motion:
    """Return the best of all whole shifts and of some rotations, by circular correlation."""
    height, width = use.shape
    conjugate = np.fft.rfft2(_detail(reference, use)).conj()
    best, motion = -np.inf, np.eye(3)
    for rotation_rad in _SEARCHED_RAD:
        turn = rigid_motion((0.0, 0.0), rotation_rad, (width, height))
        turned = _detail(warped(picture, turn), use & warped_mask(use, turn))
        surface = np.fft.irfft2(np.fft.rfft2(turned) * conjugate, (height, width))
        row, column = np.unravel_index(int(np.argmax(surface)), surface.shape)
        if surface[row, column] > best:
            best = surface[row, column]
            shift_px = _signed(column, width), _signed(row, height)
            motion = turn @ rigid_motion(shift_px, 0.0, (width, height))
    return motion


def _signed(shift_px: np.intp, length_px: int) -> float:
    """Return a circular shift as the nearer of the two that it may be."""
    half = length_px // 2
    return float((shift_px + half) % length_px - half)


def _detail(picture: Plane, use: Mask) -> Plane:
    """Return the small detail of a picture, of unit norm."""
    smooth = np.asarray(cv2.GaussianBlur(picture, (0, 0), _DETAIL_PX), np.float32)
    fine = np.where(use, picture - smooth, np.float32(0))
    norm = np.linalg.norm(fine)
    return np.asarray(fine / norm if norm > 0 else fine, np.float32)


def _refined(reference: Plane, picture: Plane, use: Mask, motion: Motion) -> Registration:
    """Return the motion after Gauss-Newton steps from `motion`."""
    height, width = use.shape
    still, moving = _blurred(reference), _blurred(picture)
    still_x, still_y = _gradients(still)
    steep = np.hypot(still_x, still_y)
    covered = _shrunk(use)
    seen = covered & warped_mask(covered, motion) & (steep > 0)
    if np.count_nonzero(seen) < _FEWEST_PX:
        return Registration(motion, np.inf, 0.0)
    at = np.nonzero(seen & (steep >= np.quantile(steep[seen], 1 - _USED_SHARE)))
    x_px, y_px = at[1] - (width - 1) / 2, at[0] - (height - 1) / 2
    radius_px = math.hypot(width, height) / 2
    before = still[at].astype(np.float64)

    def columns(slope_x: Plane, slope_y: Plane) -> NDArray[np.float64]:
        turned = (x_px * slope_y - y_px * slope_x) / radius_px  # by one pixel at the corners
        return np.stack([slope_x, slope_y, turned, before, np.ones_like(before)], axis=1)

    still_columns = columns(still_x[at], still_y[at])
    for _ in range(_MOST_STEPS):
        moved = warped(moving, motion)
        moved_x, moved_y = _gradients(moved)
        moved_columns = columns(moved_x[at], moved_y[at])
        both_columns = (still_columns + moved_columns) / 2
        residual = before - moved[at]
        weight = _biweight(residual)
        weighted = both_columns * weight[:, None]
        normal = weighted.T @ both_columns
        if np.linalg.matrix_rank(normal, hermitian=True) < len(normal):
            return Registration(motion, np.inf, 0.0)
        step = np.linalg.solve(normal, weighted.T @ residual)
        motion = motion @ rigid_motion((step[0], step[1]), step[2] / radius_px, (width, height))
        if np.abs(step[:3]).max() < _SMALL_STEP_PX:
            break
    # Noise has slopes too, but not the same in both pictures: their products tell of what is there.
    shared = (still_columns * weight[:, None]).T @ moved_columns
    shared = (shared + shared.T) / 2
    if np.linalg.eigvalsh(shared).min() <= 0:
        return Registration(motion, np.inf, 0.0)
    variance = _ALIKE_PX * float(weight @ residual**2 / weight.sum())
    deviation_px = math.sqrt(variance * np.trace(np.linalg.inv(shared)[:3, :3]))
    return Registration(motion, deviation_px, _correlation(before, moved[at]))


def _correlation(one: NDArray[np.float64], other: Plane) -> float:
    return float(np.corrcoef(one, other)[0, 1]) if min(one.std(), other.std()) > 0 else 0.0


def _biweight(residual: NDArray[np.float64]) -> NDArray[np.float64]:
    middle = np.median(residual)
    deviation = 1.4826 * np.median(np.abs(residual - middle)) + 1e-6
    return np.square(np.maximum(1 - np.square((residual - middle) / (_TUKEY * deviation)), 0.0))


def _scaled(motion: Motion, factor: float) -> Motion:
    """Return the motion in pixels that are `factor` times smaller, pixel 0 staying pixel 0."""
    scaled = motion.copy()
    scaled[:2, 2] *= factor
    return scaled


def _halved(picture: Plane) -> Plane:
    return np.asarray(cv2.pyrDown(picture), np.float32)


def _blurred(picture: Plane) -> Plane:
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), _BLUR_PX), np.float32)


def _gradients(picture: Plane) -> tuple[Plane, Plane]:
    return (
        np.asarray(cv2.Scharr(picture, cv2.CV_32F, 1, 0, scale=1 / 32), np.float32),
        np.asarray(cv2.Scharr(picture, cv2.CV_32F, 0, 1, scale=1 / 32), np.float32),
    )


def _shrunk(use: Mask) -> Mask:
    """Return the mask without the pixels that blur and gradients mix with others."""
    margin_px = math.ceil(3 * _BLUR_PX) + 1
    bordered = cv2.copyMakeBorder(use.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    kernel = np.ones((2 * margin_px + 1,) * 2, np.uint8)
    return np.asarray(cv2.erode(bordered, kernel)[1:-1, 1:-1]) > 0
