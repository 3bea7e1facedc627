"""Skies that change in the ways that make lights flicker, slide or lag, with their truth.

Each of `SEQUENCES` is a sky of known sources that move, dim, are covered or switched; what happens
once (a switch, the crossing of a seam or pole) happens in the frame in the middle. Sources narrower
than a cell are put onto the grid with exact energy and direction (point_sources.py).

Input  : a sequence, rows of the map, number of frames.    Output : TimedMaps.
Cost   : about 1 ms a frame of 64 rows.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from lighting.maps.environment import EnvironmentMap, luminance
from lighting.simulation.point_sources import shares_of_points
from lighting.simulation.scenario import Disc
from lighting.sphere.caps import SUN_RADIUS_RAD
from lighting.sphere.latlong import cell_directions, solid_angles

Array = NDArray[np.float64]

RATE_HZ = 30.0
"""Frames a second; the steps per frame that sequences are named after are at this rate."""

_WARM = (1.25, 0.96, 0.66)
_WHITE = (1.0, 1.0, 1.0)
_POINTS = 256
_SOFT_RADIUS_RAD = np.radians(8.0)
_LAMP_RADIUS_RAD = np.radians(2.5)
_MAINS_RIPPLE_HZ = 100.0
_MAINS_DEPTH = 0.2
_SUN_ELEVATION_RAD = np.radians(40.0)
_FRONT_WIDTH = 0.15
_PASSER_BY_RADIUS_RAD = np.radians(18.0)


@dataclass(frozen=True, eq=False)
class TimedMap:
    """One frame of a sequence.

    Attributes
    ----------
    timestamp_s : float
        Since the first frame.
    environment : EnvironmentMap
        What the camera sees, with noise and the ripple of lamps.
    truth : EnvironmentMap
        What there is: without noise, and lamps as bright as they are in the mean over a ripple.
    sources : tuple of Disc
        The sources in `truth`, as they shine through what covers them.
    """

    timestamp_s: float
    environment: EnvironmentMap
    truth: EnvironmentMap
    sources: tuple[Disc, ...]


@dataclass(frozen=True, eq=False)
class Source:
    """A disc and what becomes of it.

    Attributes
    ----------
    flux : float
        Its ∫Y dω over that of the uncovered sky.
    path : callable
        From the time in s, 0 in the middle, to a direction (3,), of any length.
    dimming : callable
        From the time in s and the number of the frame, 0 in the middle, to a factor.
    ripple : float
        Share by which its brightness swings at 100 Hz.
    """

    flux: float
    path: Callable[[float], Array]
    angular_radius_rad: float = SUN_RADIUS_RAD
    colour: tuple[float, float, float] = _WHITE
    dimming: Callable[[float, int], float] = lambda _time_s, _frame: 1.0
    ripple: float = 0.0


@dataclass(frozen=True, eq=False)
class Sequence:
    """A sky and what happens in it.

    Attributes
    ----------
    sources : tuple of Source
    sky : float
        Brightness of the sky without them; a flux of 1 is that of a sky of 1.
    noise : float
        Standard deviation of each cell and channel, relative to the radiance.
    cover : callable or None
        From directions (..., 3) and time in s to how much of what is there is covered, 0 to 1.
    covered_sky, covered_source : float
        Factor on what is wholly covered.
    """

    sources: tuple[Source, ...] = ()
    sky: float = 1.0
    noise: float = 0.0
    cover: Callable[[Array, float], Array] | None = None
    covered_sky: float = 1.0
    covered_source: float = 1.0


def frames(
    sequence: Sequence, height: int, count: int, *, irregular: bool = False
) -> Iterator[TimedMap]:
    """Yield the maps of a sequence, at 30 a second.

    Parameters
    ----------
    sequence : Sequence
        One of `SEQUENCES`, or any other.
    height, count : int
        Rows of the maps, at least 8; number of frames.
    irregular : bool
        Frames come up to 0.4 frames early or late, and every tenth is missing. The same every time.

    Raises
    ------
    InputError
        If the height or count is too small.
    """
    if height < 8 or count < 1:
        raise InputError(
            f"wanted maps of 8 rows or more and 1 frame or more, got {height}, {count}"
        )
    random = np.random.default_rng(0)
    numbers, times_s = _frame_times(count, irregular)
    sky = _sky(height)
    unit = float(luminance(np.tensordot(solid_angles(height), sky.sum(axis=1), axes=1)))
    for number, time_s in zip(numbers, times_s, strict=True):
        discs = [_disc(source, sequence, unit, time_s, int(number)) for source in sequence.sources]
        of_sources = [_radiance(disc, height) for disc in discs]
        background = sequence.sky * sky
        if sequence.cover:
            covered = sequence.cover(cell_directions(height), time_s)[..., None]
            background *= 1 - (1 - sequence.covered_sky) * covered
        swing = np.sin(2 * np.pi * _MAINS_RIPPLE_HZ * time_s)
        seen = background + sum(
            (1 + source.ripple * swing) * radiance
            for source, radiance in zip(sequence.sources, of_sources, strict=True)
        )
        if sequence.noise:
            seen = seen * (1 + sequence.noise * random.standard_normal(seen.shape))
        yield TimedMap(
            float(time_s - times_s[0]),
            _map(np.maximum(seen, 0.0)),
            _map(background + sum(of_sources)),
            tuple(discs),
        )


def _frame_times(count: int, irregular: bool) -> tuple[NDArray[np.int64], Array]:
    """Return the numbers and the times in s of the frames, both 0 for the one in the middle."""
    numbers = np.arange(count) - count // 2
    if not irregular:
        return numbers, numbers / RATE_HZ
    numbers += np.arange(count) // 9
    numbers -= numbers[count // 2]
    times_s = (numbers + np.random.default_rng(1).uniform(-0.4, 0.4, count)) / RATE_HZ
    return numbers, times_s - times_s[count // 2]


def _disc(source: Source, sequence: Sequence, unit: float, time_s: float, number: int) -> Disc:
    direction = source.path(time_s)
    direction = direction / np.linalg.norm(direction)
    covered = float(sequence.cover(direction, time_s)) if sequence.cover else 0.0
    factor = source.dimming(time_s, number) * (1 - (1 - sequence.covered_source) * covered)
    irradiance = source.flux * unit * factor * np.array(source.colour)
    return Disc("source", direction, source.angular_radius_rad, irradiance)


def _radiance(disc: Disc, height: int) -> Array:
    """Return the radiance (N, 2N, 3) that a disc adds to the cells of a map."""
    points = disc.direction[None]
    if disc.angular_radius_rad > np.pi / (2 * height):
        points = disc.points(_POINTS)
        # With each point its opposite across the centre, so that the centre is their centroid.
        across = 2 * (points @ disc.direction)[:, None] * disc.direction - points
        points = np.concatenate([points, across])
    shares = shares_of_points(points, height) / solid_angles(height)[:, None]
    return shares[..., None] * disc.irradiance


def _sky(height: int) -> Array:
    """Return a blue sky, paler at the horizon, above a dark textured ground, (N, 2N, 3)."""
    up = cell_directions(height)[..., 1:2]
    texture = np.random.default_rng(1).uniform(0.5, 1.5, (height, 2 * height, 1))
    ground = np.array([0.30, 0.25, 0.18]) * texture
    return np.where(up > 0, np.array([0.4, 0.6, 1.0]) * (1.2 - up), ground)


def _map(radiance: Array) -> EnvironmentMap:
    seen = np.ones(radiance.shape[:2], bool)
    return EnvironmentMap(radiance.astype(np.float32), seen, ~seen)


def _standing(azimuth_deg: float, elevation_deg: float) -> Callable[[float], Array]:
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    level = np.cos(elevation)
    direction = np.array([level * np.sin(azimuth), np.sin(elevation), level * np.cos(azimuth)])
    return lambda _time_s: direction


def _along(middle: Array, end: Array, deg_per_frame: float) -> Callable[[float], Array]:
    """Return a path on the great circle through `middle`, at time 0, and `end`, 90° on."""
    rate = np.radians(deg_per_frame) * RATE_HZ
    return lambda time_s: np.cos(rate * time_s) * middle + np.sin(rate * time_s) * end


def _over_the_seam(time_s: float) -> Array:
    azimuth = np.pi + np.radians(0.5) * RATE_HZ * time_s
    level = np.cos(_SUN_ELEVATION_RAD)
    return np.array([level * np.sin(azimuth), np.sin(_SUN_ELEVATION_RAD), level * np.cos(azimuth)])


def _fade(time_s: float) -> float:
    """0 before, 1 after, and half a second of smooth change in the middle."""
    x = float(np.clip(2 * time_s + 0.5, 0, 1))
    return x * x * (3 - 2 * x)


def _front(directions: Array, time_s: float) -> Array:
    """Cover by a cloud that comes from +X and reaches the zenith at time 0."""
    x = np.clip((directions[..., 0] + 1.0 * time_s) / _FRONT_WIDTH + 0.5, 0, 1)
    return x * x * (3 - 2 * x) * (directions[..., 1] > 0)


def _passer_by(directions: Array, time_s: float) -> Array:
    """Cover by someone who walks along the horizon, 1° a frame, and is ahead (+Z) at time 0."""
    azimuth = np.radians(1.0) * RATE_HZ * time_s
    centre = np.array([np.sin(azimuth), 0.0, np.cos(azimuth)])
    angle = np.arccos(np.clip(directions @ centre, -1, 1))
    return np.clip((_PASSER_BY_RADIUS_RAD - angle) / np.radians(3) + 0.5, 0, 1)


_UP, _AHEAD, _LEFT = np.array([0.0, 1, 0]), np.array([0.0, 0, 1]), np.array([1.0, 0, 0])
_HIGH_SUN = _standing(5.0, 75.0)
_LAMP, _OTHER_LAMP = _standing(60.0, 35.0), _standing(-80.0, 30.0)

SEQUENCES: Mapping[str, Sequence] = MappingProxyType(
    {
        "hard sun over the seam": Sequence((Source(4.0, _over_the_seam),)),
        "soft sun over the seam": Sequence((Source(4.0, _over_the_seam, _SOFT_RADIUS_RAD),)),
        "hard sun over the pole": Sequence((Source(4.0, _along(_UP, _LEFT, 0.5)),)),
        "soft sun over the pole": Sequence(
            (Source(4.0, _along(_UP, _LEFT, 0.5), _SOFT_RADIUS_RAD),)
        ),
        "two suns": Sequence(
            (
                Source(2.0, _LAMP, dimming=lambda _, frame: 1.02 if frame % 2 else 0.98),
                Source(2.0, _OTHER_LAMP, dimming=lambda _, frame: 0.98 if frame % 2 else 1.02),
            )
        ),
        "one lamp for another": Sequence(
            (
                Source(1.0, _LAMP, _LAMP_RADIUS_RAD, _WARM, lambda time_s, _: 1 - _fade(time_s)),
                Source(1.0, _OTHER_LAMP, _LAMP_RADIUS_RAD, dimming=lambda time_s, _: _fade(time_s)),
            ),
            sky=0.02,
        ),
        "cloud front": Sequence(
            (Source(4.0, _HIGH_SUN),), cover=_front, covered_sky=1.1, covered_source=0.02
        ),
        "still, 1 % noise": Sequence((Source(4.0, _HIGH_SUN),), noise=0.01),
        "small lamp, 3 % noise": Sequence(
            (Source(0.15 / 0.85, _along(_AHEAD + _UP, _LEFT * np.sqrt(2), 0.4), _LAMP_RADIUS_RAD),),
            noise=0.03,
        ),
        "mains alias": Sequence(
            (Source(1.0, _LAMP, _LAMP_RADIUS_RAD, _WARM, ripple=_MAINS_DEPTH),), sky=0.2
        ),
        "light switch": Sequence(
            (
                Source(
                    1.5, _LAMP, _LAMP_RADIUS_RAD, _WARM, lambda _, frame: 1.0 if frame >= 0 else 0.0
                ),
            )
        ),
        "passer-by": Sequence(
            (Source(1.0, _standing(0.0, 10.0), _LAMP_RADIUS_RAD),),
            cover=_passer_by,
            covered_sky=0.1,
            covered_source=0.0,
        ),
    }
)
"""Every sequence by its name."""
