"""Narrow lights of a baked scene: what is traced of them once they stand, and which of them move.

Tracing the transport of a light takes as long as its rays in some five pictures. One that moves on
from picture to picture is left to rays, and traced when it has stood for a few, or moves so slowly
that what is traced will serve.

Input  : the narrow lights of each picture.
Output : those with their transport, and those without.
Cost   : one light is traced in a picture at most, all of them in the first.
Fails  : a picture changes by the error of the rays where a light begins to stand.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from render.baked.transport import NarrowTransport
from render.lights.discs import Discs

Array = NDArray[np.float64]

STANDING = 3
"""Pictures in a row in which a light is seen at one place before it is traced."""

_SERVES = 12
"""Pictures that what is traced should serve, should the light move on as it did."""

_STILL = 0.25  # of a light's radius: it moves by less without being elsewhere
_STILL_LEAST_RAD = 1e-3


@dataclass(frozen=True, eq=False)
class NarrowLight:
    """Where a light was first seen, since how many pictures, and its transport if it has one."""

    direction: Array
    radius_rad: float
    pictures: int
    transport: NarrowTransport | None

    def is_near(self, direction: Array, radius_rad: float) -> bool:
        """Whether a light is so like this one that its transport serves."""
        still_rad = _still_rad(radius_rad)
        is_like = abs(radius_rad - self.radius_rad) < still_rad
        return is_like and self.moved_rad(direction) < still_rad

    def moved_rad(self, direction: Array) -> float:
        """Return how far a direction is from where the light was first seen."""
        return float(np.linalg.norm(direction - self.direction))

    def stands(self, direction: Array) -> bool:
        """Whether it is worth tracing, now that it is seen there."""
        steps = self.pictures - 1
        would_move_rad = _SERVES * self.moved_rad(direction) / max(steps, 1)
        return self.pictures >= STANDING and would_move_rad <= _still_rad(self.radius_rad)


def _still_rad(radius_rad: float) -> float:
    return max(_STILL * radius_rad, _STILL_LEAST_RAD)


class NarrowLights:
    """Remembers the narrow lights of the picture before."""

    def __init__(self) -> None:
        self._before: list[NarrowLight] | None = None

    def follow(
        self, lights: Discs, trace: Callable[[Array, float], NarrowTransport]
    ) -> tuple[list[NarrowTransport], NDArray[np.bool_]]:
        """Return the transport of the lights that have one, and which of all (K,) have none.

        `trace` returns the transport of a light of a direction (3,) and an angular radius.
        """
        is_first = self._before is None
        now, traced = [], 0
        for direction, radius_rad in zip(lights.directions, lights.radius_rad, strict=True):
            near = (each for each in self._before or () if each.is_near(direction, radius_rad))
            light = next(near, NarrowLight(direction, float(radius_rad), 0, None))
            light = replace(light, pictures=light.pictures + 1)
            is_due = is_first or (traced == 0 and light.stands(direction))
            if light.transport is None and is_due:
                transport = trace(direction, float(radius_rad))
                light = NarrowLight(direction, float(radius_rad), light.pictures, transport)
                traced += 1
            now.append(light)
        self._before = now
        found = [light.transport for light in now if light.transport is not None]
        return found, np.array([light.transport is None for light in now], np.bool_)
