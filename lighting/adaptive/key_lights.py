"""Key lights: the sun, lamps and other concentrated sources, taken out of the blocks of a map.

A key light is what stands out, within a small cap, above the median of the ring around it: its
irradiance is the sum of the excess, its direction the excess's centroid and its radius that of the
uniform disc as spread as the excess. What it does not take stays in the blocks.

Domain : world frame; blocks of a lat-long grid (summed_area.py, block_grid.py).
Cost   : a pass over the blocks for each source that is tried, at most 16.
Fails  : what is wider than the cap, a window say, is no key light; two sources within one cap are
         one light at their centroid (tests/limits/test_key_lights_close.py).
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.blocks.block_grid import BlockGrid

Array = NDArray[np.float64]

MOST_KEY_LIGHTS = 8
_CAP_RAD = np.radians(4.0)
_RING_RAD = np.radians(8.0)
_COS_CAP = float(np.cos(_CAP_RAD))
_MOST_TRIED = 16
_WIDEST_RAD = np.radians(2.0)
"""A source that is spread more is left to the cells, which model its shape better."""
_STAYS = 0.6
"""A key light of the last frame stays one down to this part of the share that makes a new one."""


@dataclass(frozen=True, eq=False)
class KeyLights:
    """Key lights, and what they leave.

    Attributes
    ----------
    directions, irradiance : (n, 3) float64
        The irradiance and `rest` sum to the map's integral.
    angular_radius_rad : (n,) float64
    rest : (rows, columns, 7) float64
        The blocks less the key lights; nowhere negative.
    """

    directions: Array
    irradiance: Array
    angular_radius_rad: Array
    rest: Array


def take_key_lights(
    blocks: Array, grid: BlockGrid, least_share: float, most: int, before: Array
) -> KeyLights:
    """Return the key lights of blocks, and the blocks without them.

    Parameters
    ----------
    blocks : (rows, columns, 7) float64
        As from `summed_area.block_sums`.
    grid : BlockGrid
        Of these blocks.
    least_share : float
        Part of the map's luminous power that a source must have to be a key light.
    most : int
        Number of key lights at most, and never more than 8; the strongest peaks come first.
    before : (k, 3) float64
        Directions of the key lights of the last frame: looked for first, and kept in order.
    """
    rest = blocks.copy()
    found = np.empty((min(most, MOST_KEY_LIGHTS), 7))
    number = _take(rest, grid.area, least_share, before, found)
    lights = found[:number].copy()
    return KeyLights(lights[:, :3], lights[:, 3:6], lights[:, 6], rest)


@njit(cache=True, nogil=True)
def _take(rest, area, least_share, before, found):  # type: ignore[no-untyped-def]
    """Take key lights out of `rest` into the rows of `found`, and return how many there are."""
    rows, columns, _ = rest.shape
    total = 0.0
    brightness = np.empty((rows, columns))
    row_peak = np.empty(rows, np.int64)
    for r in range(rows):
        for c in range(columns):
            total += rest[r, c, 0]
            brightness[r, c] = rest[r, c, 0] / area[r, c, 0]
        row_peak[r] = np.argmax(brightness[r])
    number = 0
    for k in range(len(before)):
        if number == len(found):
            return number
        least = _STAYS * least_share * total
        if _take_one(rest, area, brightness, row_peak, before[k], least, found[number]):
            number += 1
    least = least_share * total
    cap_sr = 2 * np.pi * (1 - _COS_CAP)
    for _ in range(_MOST_TRIED):
        if number == len(found):
            break
        row = 0
        for r in range(rows):
            if brightness[r, row_peak[r]] > brightness[row, row_peak[row]]:
                row = r
        column = row_peak[row]
        if brightness[row, column] * max(cap_sr, area[row, column, 0]) < least:
            break
        moment = rest[row, column, 1:4]
        start = moment / np.sqrt((moment * moment).sum())
        if _take_one(rest, area, brightness, row_peak, start, least, found[number]):
            number += 1
    return number


@njit(cache=True, nogil=True)
def _take_one(rest, area, brightness, row_peak, start, least_power, light):  # type: ignore[no-untyped-def]
    """Take the excess within the cap around its own centroid, if it is strong and narrow enough.

    Either way the cap's blocks are not looked at as peaks again: their brightness becomes 0.
    """
    direction = start.copy()
    for _ in range(2):  # around the peak, then around the centroid of what is there
        background = _ring_median(rest, area, direction)
        moment = np.zeros(3)
        power = weights = distance = 0.0
        for r, c in _blocks_within(area, direction, _CAP_RAD):
            excess = rest[r, c, 0] - background * area[r, c, 0]
            if excess <= 0:
                continue
            part = excess / rest[r, c, 0]
            power += excess
            along = 0.0
            for k in range(3):
                moment[k] += part * rest[r, c, 1 + k]
                along += direction[k] * rest[r, c, 1 + k]
            # |d − m|² = 2 − 2 d·m, in the mean over the block's own light.
            weight = excess * excess / area[r, c, 0]
            weights += weight
            distance += weight * np.sqrt(max(2 - 2 * along / rest[r, c, 0], 0.0))
        length = np.sqrt((moment * moment).sum())
        if power <= 0.0 or length <= 0.0:
            break
        direction = moment / length
    radius = 1.5 * distance / weights if power > 0 else np.pi
    is_key = power >= least_power and power > 0 and radius <= _WIDEST_RAD
    light[:3] = direction
    light[3:6] = 0.0
    light[6] = radius
    for r, c in _blocks_within(area, direction, _CAP_RAD):
        brightness[r, c] = 0.0
        if c == row_peak[r]:
            row_peak[r] = np.argmax(brightness[r])
        excess = rest[r, c, 0] - background * area[r, c, 0]
        if is_key and excess > 0:
            # One share for all channels: what stays has the hue of what was there.
            part = excess / rest[r, c, 0]
            for k in range(3):
                light[3 + k] += part * rest[r, c, 4 + k]
            for k in range(7):
                rest[r, c, k] *= 1 - part
    return is_key


@njit(cache=True, nogil=True)
def _ring_median(rest, area, direction):  # type: ignore[no-untyped-def]
    """Return the median luminance of the ring around the cap."""
    blocks = _blocks_within(area, direction, _RING_RAD)
    values = np.empty(len(blocks))
    number = 0
    for r, c in blocks:
        if not _is_within(area[r, c], direction, _COS_CAP):
            values[number] = rest[r, c, 0] / area[r, c, 0]
            number += 1
    return np.median(values[:number]) if number else 0.0


@njit(cache=True, nogil=True)
def _blocks_within(area, direction, radius_rad):  # type: ignore[no-untyped-def]
    """Return row and column (n, 2) of the blocks within a cap, row by row."""
    first, last = _row_range(len(area), direction, radius_rad)
    left, width = _column_range(area.shape[1], direction, radius_rad)
    blocks = np.empty(((last - first) * width, 2), np.int64)
    cos_radius = np.cos(radius_rad)
    number = 0
    for r in range(first, last):
        for i in range(width):
            c = (left + i) % area.shape[1]
            if _is_within(area[r, c], direction, cos_radius):
                blocks[number] = r, c
                number += 1
    return blocks[:number]


@njit(cache=True, nogil=True)
def _row_range(rows, direction, radius_rad):  # type: ignore[no-untyped-def]
    """Return the rows [first, last) that blocks within a radius of a direction may lie in."""
    polar = np.arccos(min(max(direction[1], -1.0), 1.0))
    first = int((polar - radius_rad) / np.pi * rows) - 1
    last = int((polar + radius_rad) / np.pi * rows) + 2
    return max(first, 0), min(last, rows)


@njit(cache=True, nogil=True)
def _column_range(columns, direction, radius_rad):  # type: ignore[no-untyped-def]
    """Return the first column, and how many from there on, that such blocks may lie in."""
    level = np.sqrt(direction[0] * direction[0] + direction[2] * direction[2])
    if level <= np.sin(radius_rad):
        return 0, columns  # the cap holds a pole
    half = np.arcsin(np.sin(radius_rad) / level) / (2 * np.pi) * columns
    middle = (np.pi - np.arctan2(direction[0], direction[2])) / (2 * np.pi) * columns
    width = min(int(2 * half) + 4, columns)
    return int(np.floor(middle - half)) - 1, width


@njit(cache=True, nogil=True)
def _is_within(block, direction, cos_radius):  # type: ignore[no-untyped-def]
    """Tell whether a block lies, by its mean direction, within a cap of that cosine."""
    cosine = block[1] * direction[0] + block[2] * direction[1] + block[3] * direction[2]
    return cosine > cos_radius * block[0]
