"""Lights by shadow rays that neighbouring pixels share: what a few dozen lights give a picture.

Light without shadows is summed exactly at every pixel. What is estimated is only its share that
gets through: for the strongest lights by rays from every pixel, for all others by one ray from one
pixel of sixteen, whose neighbours on the same surface take over what it saw. Wide lights, whose
shadows have no edges, get half as many.

Input  : surfaces, as `first_hits` finds them; discs of light.    Output : radiance.
Cost   : see shadow_rays.py and shaded_light.py.
Fails  : penumbrae of wide lights that are not the strongest are grainy, in a pattern that stands
         still on the screen. A single wide light is blurred by four pixels, and each point of its
         disc counts alike, whatever its cosine (tests/limits/test_render_moving.py).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.maps.environment import LUMINANCE_WEIGHTS
from render.lights.discs import Discs, irradiance_curves
from render.moving.open_ground import add_to_ground, open_ground, weigh_on_ground
from render.moving.shaded_light import add_lights
from render.moving.shadow_rays import (
    CURVE,
    DIRECTION,
    HALF,
    IRRADIANCE,
    MIRRORED,
    POINTS,
    SPREAD,
    WIDTH,
    trace_lights,
)
from render.moving.softening import soften
from render.rays.disc_net import disc_net
from render.rays.embree import occluded16_address
from render.rays.surface_rows import LANES
from render.rays.traced_scene import TracedScene

Array = NDArray[np.float64]
_FLOATS = NDArray[np.float32]

_POINT_RAD = 1e-3
_WIDE_RAD = 0.03
_PAIR = 2  # the kernels move so many lights at once


@dataclass(frozen=True)
class Effort:
    """How many rays a picture is worth.

    Attributes
    ----------
    interleaving : int
        n of n × n pixels that share the rays to a light: 1, 2 or 4.
    key_lights : int
        Most lights to which every pixel sends rays.
    key_share : float
        Least share of all light that makes one.
    key_rays : int
        Rays of a pixel to a key light that is no point; a power of 2.
    is_sparing : bool
        Whether pixels of a tile send a key light one ray each, and the others only if these differ.
    soft_rad : float
        Radius from which on the penumbra of a key light is averaged over 4 × 4 pixels, being wider.
    is_softened : bool
        Whether, if any other light is wide, every second tile of 4 × 4 pixels sends rays to them,
        and all take the mean of what their neighbours saw.
    floor_rays : int
        Rays of a surface to a floor that lights it; 0 leaves that light out.
    """

    interleaving: int = 4
    key_lights: int = 4
    key_share: float = 0.1
    key_rays: int = 4
    is_sparing: bool = True
    soft_rad: float = 0.03
    is_softened: bool = True
    floor_rays: int = 16


DEFAULT_EFFORT = Effort()


class SharedRays:
    """Adds lights to pictures; keeps only memory from one to the next."""

    def __init__(self, effort: Effort) -> None:
        self._effort = effort
        self._keys = self._weighed = np.zeros((0, 0, 0, 0), np.float32)
        self._shared = self._softened = np.zeros((0, 0, 0, 0), np.uint8)

    def add(
        self,
        traced: TracedScene,
        surfaces: _FLOATS,
        eye: Array,
        pixel_rad: float,
        lights: Discs,
        power: float,
        picture: _FLOATS,
        rough_alpha2: float = np.inf,
    ) -> None:
        """Add the radiance of what is seen under `lights` to `picture` (H, W, 4).

        Parameters
        ----------
        traced : TracedScene
        surfaces : (rows, LANES, FIELDS, columns) float32
            What its picture shows.
        eye, pixel_rad : (3,) float64, float
            Where from; the angle between neighbouring pixels.
        lights : Discs
        power : float
            Luminance of the irradiance of all light, of which a key light has its share.
        rough_alpha2 : float
            Surfaces from this α² on mirror a light's irradiance instead of what is `mirrored`.
        """
        each = lights.irradiance @ LUMINANCE_WEIGHTS
        order = np.argsort(-each, kind="stable")
        lights = lights.taken(order)
        strong = int(np.count_nonzero(each >= self._effort.key_share * power))
        keys = min(strong, self._effort.key_lights) if each.any() else 0
        side, key_rays = self._effort.interleaving, self._effort.key_rays
        per_turn, chosen = take_turns(len(lights), keys, side)
        turns = (len(chosen) - keys) // max(per_turn, 1)
        table = np.take(_light_table(lights), chosen, axis=1)
        table[IRRADIANCE : MIRRORED + 3, chosen < 0] = 0.0
        radius_rad = lights.radius_rad[:keys]
        ray_count = np.where(radius_rad >= _POINT_RAD, key_rays, 1)
        is_soft = radius_rad >= self._effort.soft_rad
        net = disc_net(lights.directions, lights.radius_rad, POINTS * key_rays)
        net[keys:, :POINTS] = disc_net(lights.directions[keys:], lights.radius_rad[keys:], POINTS)
        points = net.astype(np.float32)[chosen]
        self._make_room(surfaces, keys, per_turn)
        is_wide = bool(np.any(lights.radius_rad[keys:] >= _WIDE_RAD))
        is_staggered = self._effort.is_softened and is_wide
        function, seen_from = occluded16_address(), eye.astype(np.float32)
        trace_lights(
            function, traced.address, traced.sphere, traced.offset_m, surfaces, table, points,
            ray_count, self._effort.is_sparing, side, is_staggered, self._keys, self._shared,
        )  # fmt: skip
        is_open, shared = open_ground(surfaces), self._shared
        if is_staggered:
            soften(surfaces, is_open, shared, seen_from, pixel_rad, side, turns, self._softened)
            shared = self._softened
        ground, weights = traced.scene.ground, np.empty((3, table.shape[1]), np.float32)
        up = 1.0 if ground is not None and eye[1] > ground.y_m else -1.0
        weigh_on_ground(is_open, shared, table, keys, side, up, weights, self._weighed)
        add_to_ground(
            is_open, surfaces, self._keys, weights, self._weighed, is_soft, side, turns, picture
        )
        add_lights(
            function, traced.address, traced.offset_m, surfaces, is_open, self._keys, shared,
            table, points, is_soft, side, seen_from, pixel_rad, rough_alpha2, picture,
        )  # fmt: skip

    def _make_room(self, surfaces: _FLOATS, keys: int, per_turn: int) -> None:
        """Have memory for what rays see of `keys` lights, and of others in turn."""
        rows, _, _, columns = surfaces.shape
        if self._keys.shape != (rows, LANES, keys, columns):
            self._keys = np.zeros((rows, LANES, keys, columns), np.float32)
            self._weighed = np.zeros((rows, LANES, 3, columns), np.float32)
        if self._shared.shape != (rows, LANES, columns, per_turn):
            self._shared = np.zeros((rows, LANES, columns, per_turn), np.uint8)
            self._softened = np.zeros_like(self._shared)


def take_turns(count: int, keys: int, side: int) -> tuple[int, NDArray[np.int64]]:
    """Return how many lights have each turn, and which: the keys, then those of every turn.

    Turns get lights of any power alike: of each side² in a row, one. −1 stands for none; there are
    no turns without a light.
    """
    turns = max(min(side * side, count - keys), 1)
    per_turn = _PAIR * -(-(count - keys) // (_PAIR * turns))
    chosen = keys + np.arange(per_turn * turns).reshape(per_turn, turns).T.ravel()
    chosen[chosen >= count] = -1
    return per_turn, np.concatenate([np.arange(keys), chosen])


def _light_table(lights: Discs) -> _FLOATS:
    """Return the lights as the kernels have them, (WIDTH, K)."""
    table = np.zeros((WIDTH, len(lights)), np.float32)
    table[DIRECTION : DIRECTION + 3] = lights.directions.T
    table[IRRADIANCE : IRRADIANCE + 3] = lights.irradiance.T
    table[MIRRORED : MIRRORED + 3] = lights.mirrored.T
    curves = irradiance_curves(lights.radius_rad).T
    table[HALF], table[CURVE - 1], table[CURVE : CURVE + 3] = curves[0], curves[1], curves[2:]
    table[SPREAD] = lights.radius_rad**2 / 8  # as in renderer.pack_lights
    return table
