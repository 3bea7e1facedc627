"""What a simulated camera stands in: maps that turn, a lamp that moves, a cloud over the sun.

Input  : environment maps.    Output : Moments, one for each bracket.
Sources smaller than the cells of a map (the sun, a lamp) are discs of uniform radiance, kept apart
from it, so that their direction and flux are known exactly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.camera import yaw_rotation
from capture.errors import InputError
from lighting.maps.environment import EnvironmentMap, luminance
from lighting.sphere.caps import SUN_RADIUS_RAD
from lighting.sphere.latlong import cell_directions, direction_to_grid, solid_angles

_GLARE_RAD = np.radians(3.0)
"""Around its peak a photographed sun, blurred by lens and grid, is gathered from this far."""
_SUN_OVER_MEAN = 100.0
"""A peak below this many times the mean of the sphere is no sun."""
_CLOUD_TRANSMITTANCE = 0.02
_CLOUD_BRIGHTENING = 0.1

_LAMP_RADIUS_RAD = np.radians(2.5)
_LAMP_SHARE = 0.3
"""Irradiance of the lamp over ∫ L dω of the map."""
_LAMP_COLOUR = np.array([1.25, 0.96, 0.63])
"""Warm white of luminance 1."""
_LAMP_ELEVATION_RAD = np.radians(35.0)
_LAMP_REACH_RAD = np.radians(70.0)


@dataclass(frozen=True)
class Disc:
    """A source with an edge, of uniform radiance.

    Attributes
    ----------
    name : str
    direction : (3,) float64
        Of its centre; a unit vector in the world frame.
    angular_radius_rad : float
    irradiance : (3,) float64
        ∫ L dω over the disc: the irradiance on a surface that faces it.
    """

    name: str
    direction: NDArray[np.float64]
    angular_radius_rad: float
    irradiance: NDArray[np.float64]

    @property
    def solid_angle_sr(self) -> float:
        """Solid angle of the cap that the disc covers."""
        return float(4 * np.pi * np.sin(self.angular_radius_rad / 2) ** 2)

    @property
    def radiance(self) -> NDArray[np.float64]:
        """Radiance of the disc, (3,)."""
        return self.irradiance / self.solid_angle_sr

    def points(self, count: int) -> NDArray[np.float64]:
        """Return `count` directions (count, 3) that stand for equal solid angles of the disc."""
        steps = np.arange(count) + 0.5
        cosine = 1 - self.solid_angle_sr / (2 * np.pi) * steps / count
        azimuth = np.pi * (3 - np.sqrt(5)) * steps  # the golden angle spreads them evenly
        sine = np.sqrt((1 - cosine) * (1 + cosine))
        helper = np.eye(3)[np.argmin(np.abs(self.direction))]
        across = np.cross(self.direction, helper)
        across /= np.linalg.norm(across)
        frame = np.stack([across, np.cross(self.direction, across), self.direction])
        return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=1) @ frame


@dataclass(frozen=True)
class Moment:
    """What there is to see during one bracket.

    Attributes
    ----------
    timestamp_s : float
    environment : EnvironmentMap
        Constant within each cell.
    brightness : float
        Factor on the map's radiance.
    yaw_rad : float
        Turn of the map about the world's +Y, from +Z toward +X: what the map shows at the longitude
        φ = atan2(x, z) stands at φ + yaw_rad.
    discs : tuple of Disc
        Added to the map.
    """

    timestamp_s: float
    environment: EnvironmentMap
    brightness: float = 1.0
    yaw_rad: float = 0.0
    discs: tuple[Disc, ...] = ()

    def true_map(self) -> EnvironmentMap:
        """Return the mean radiance over each cell of the map's grid in the world, exact in yaw.

        This is what a perfect camera and remap would give. The map's marks turn with it.
        """
        height = self.environment.height
        turn = self.yaw_rad * height / np.pi
        whole = int(np.floor(turn))
        part = turn - whole

        def near_and_far(cells: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
            """Return the two cells of the turned map that each cell in the world lies on."""
            near = np.roll(cells, -whole, axis=1)
            return near, np.roll(near, -1, axis=1) if part else near

        near, far = near_and_far(self.environment.radiance.astype(np.float64))
        radiance = self.brightness * ((1 - part) * near + part * far)
        cell_sr = solid_angles(height)
        for disc in self.discs:
            columns, rows = np.rint(direction_to_grid(disc.points(1 << 14), height)).astype(int).T
            shares = np.zeros((height, 2 * height))
            np.add.at(shares, (np.clip(rows, 0, height - 1), columns % (2 * height)), 2.0**-14)
            radiance += shares[..., None] * disc.irradiance / cell_sr[:, None, None]
        return replace(
            self.environment,
            radiance=radiance.astype(np.float32),
            valid=np.logical_and(*near_and_far(self.environment.valid)),
            clipped=np.logical_or(*near_and_far(self.environment.clipped)),
        )


def scenario(
    maps: Sequence[EnvironmentMap],
    *,
    bracket_count: int,
    rate_hz: float,
    yaw_rad_per_s: float = 0.0,
    lamp: bool = False,
    cloud: bool = False,
) -> tuple[Moment, ...]:
    """Return one moment per bracket.

    Parameters
    ----------
    maps : sequence of EnvironmentMap
        One that stays, or one for each bracket.
    bracket_count : int
    rate_hz : float
        Brackets per second.
    yaw_rad_per_s : float
        Rate at which the maps turn about +Y.
    lamp : bool
        A lamp moves along a great circle that passes above +Z, from +X to −X.
    cloud : bool
        The maps' sun becomes a disc, and a cloud covers it in the middle of the time: its light
        falls to 2 % and returns, and the sky is up to a tenth brighter meanwhile.

    Raises
    ------
    InputError
        If the number of maps does not fit, a number is out of range, or a cloud finds no sun.
    """
    if bracket_count < 1 or not (np.isfinite(rate_hz) and rate_hz > 0):
        raise InputError(
            f"wanted 1 bracket or more at a positive rate, got {bracket_count} at {rate_hz} Hz"
        )
    if len(maps) not in (1, bracket_count):
        raise InputError(
            f"{len(maps)} maps for {bracket_count} brackets: give one map, or one for each bracket"
        )
    duration_s = (bracket_count - 1) / rate_hz
    if not (np.isfinite(duration_s) and np.isfinite(yaw_rad_per_s * duration_s)):
        raise InputError(
            f"rate and yaw rate must leave time and turn finite, got {rate_hz:g} Hz and "
            f"{yaw_rad_per_s:g} rad/s"
        )
    split = [split_sun(each) if cloud else (each, None) for each in maps]
    moments = []
    for index in range(bracket_count):
        timestamp_s = index / rate_hz
        progress = index / max(bracket_count - 1, 1)
        environment, sun = split[index % len(maps)]
        yaw_rad = float(np.fmod(yaw_rad_per_s * timestamp_s, 2 * np.pi))
        cover = _cloud_cover(progress) if cloud else 0.0
        discs = []
        if sun is not None:
            passed = 1 - (1 - _CLOUD_TRANSMITTANCE) * cover
            direction = yaw_rotation(yaw_rad) @ sun.direction
            discs.append(replace(sun, direction=direction, irradiance=passed * sun.irradiance))
        if lamp:
            discs.append(_lamp(progress, maps[0]))
        brightness = 1 + _CLOUD_BRIGHTENING * cover
        moments.append(Moment(timestamp_s, environment, brightness, yaw_rad, tuple(discs)))
    return tuple(moments)


def split_sun(environment: EnvironmentMap) -> tuple[EnvironmentMap, Disc]:
    """Return a map without its sun, and the sun as a disc with the flux that the map lost.

    The disc stands at the centroid of what was brighter than its surroundings.

    Raises
    ------
    InputError
        If the map's peak is less than 100 times its mean.
    """
    height = environment.height
    radiance = environment.radiance.astype(np.float64)
    light = luminance(radiance)
    mean = float(luminance(environment.integral())) / (4 * np.pi)
    if not light.max() > _SUN_OVER_MEAN * mean:
        raise InputError(
            f"a cloud needs a sun to cover: a peak of more than {_SUN_OVER_MEAN:.0f} times the "
            f"map's mean; here the peak is {light.max():.4g} and the mean {mean:.4g}"
        )
    directions = cell_directions(height)
    cosine = directions @ directions.reshape(-1, 3)[light.argmax()]
    inside = cosine >= np.cos(_GLARE_RAD)
    ring = ~inside & (cosine >= np.cos(1.5 * _GLARE_RAD))
    if not ring.any():
        raise InputError(f"a map of {2 * height}×{height} cells is too coarse to cut a sun out of")
    sky = np.median(radiance[ring], axis=0)
    excess = np.where(inside[..., None], np.maximum(radiance - sky, 0.0), 0.0)
    flux = excess * solid_angles(height)[:, None, None]
    direction = np.tensordot(luminance(flux), directions, axes=2)
    sun = Disc("sun", direction / np.linalg.norm(direction), SUN_RADIUS_RAD, flux.sum(axis=(0, 1)))
    return replace(environment, radiance=(radiance - excess).astype(np.float32)), sun


def _lamp(progress: float, environment: EnvironmentMap) -> Disc:
    along = _LAMP_REACH_RAD * (1 - 2 * progress)
    above_z = np.array([0.0, np.sin(_LAMP_ELEVATION_RAD), np.cos(_LAMP_ELEVATION_RAD)])
    direction = np.cos(along) * above_z + np.sin(along) * np.array([1.0, 0.0, 0.0])
    irradiance = _LAMP_SHARE * luminance(environment.integral()) * _LAMP_COLOUR
    return Disc("lamp", direction, _LAMP_RADIUS_RAD, irradiance)


def _cloud_cover(progress: float) -> float:
    """0 for a free sun, 1 for a covered one, with smooth edges."""

    def smooth_step(x: float) -> float:
        x = min(max(x, 0.0), 1.0)
        return x * x * (3 - 2 * x)

    return smooth_step((progress - 0.2) / 0.2) - smooth_step((progress - 0.6) / 0.2)
