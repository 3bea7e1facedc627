"""Objects set into a plate: lit as their surroundings are, with their shadows on its ground.

Differential rendering in its multiplicative form: the plate's ground is multiplied by the ratio
of light with and without the objects, which holds for matt ground of any albedo. Each sample of a
pixel shows the plate, the plate in shadow, or an object; their mean is taken in linear light.

Input  : a plate, its camera, a scene in it, lights, and a map for mirrors to show.
Output : the picture, linear as the plate is; pixels that objects do not change are the plate's own.
Cost   : 2 µs of CPU time a pixel under 64 lights, 600 bytes while it lasts.
Fails  : ground that mirrors keeps its reflections, and shows none of the objects. Things in the
         plate neither hide the objects nor take their shadows, but as the level ground would. Edges
         of less than 5 % of the light, in a shadow, are blurred by four pixels. Of a plate of more
         than 16 Mpx each pixel is one sample, and outlines are jagged.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from capture.errors import InputError
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.lights.all_lights import all_lights, unshaded_ground
from render.moving.renderer import MovingRenderer
from render.moving.shared_rays import Effort
from render.output.view import roll_off
from render.plates.plate import Plate
from render.rays.floor_light import add_floor_light, floor_shade
from render.rays.surface_rows import DULL, GROUND, KIND, empty_surfaces, in_picture
from render.rays.traced_scene import TracedScene
from render.scenes.scene import Camera, Scene

_FLOATS = NDArray[np.float32]

SAMPLES_PER_AXIS = 2

MOST_SAMPLES = 2**26
"""Each takes 150 bytes while it is drawn."""

_UNCHANGED = 1e-3
"""Of the light: what is less is rounding, or would not be seen."""

_GRAIN, _GRAIN_PX = 0.05, 11
"""Changes of light up to which, in the mean of channels, and pixels over which it is smoothed."""
_APART = 1e3
"""Farther from any light that the ground keeps than is smoothed over."""


@dataclass(frozen=True, eq=False)
class Composite:
    """A plate with objects in it.

    Attributes
    ----------
    picture : (H, W, 3) float32
        Linear, in the plate's scale.
    changed : (H, W) bool
        Where it is not the plate.
    """

    picture: _FLOATS
    changed: NDArray[np.bool_]


def composite(
    plate: Plate,
    camera: Camera,
    scene: Scene,
    lights: LightSet,
    gain: NDArray[np.float64],
    environment: EnvironmentMap | None = None,
) -> Composite:
    """Return the plate with a scene's meshes in it.

    Parameters
    ----------
    plate : Plate
    camera : Camera
        That took it.
    scene : Scene
        The objects, on a ground of the plate's reflectance.
    lights : LightSet
    gain : (3,) float64
        The plate's linear value of radiance 1 of the lights.
    environment : EnvironmentMap, optional
        What mirrors show, in the lights' scale; without it, the lights.

    Raises
    ------
    InputError
        If the plate has more pixels than can be drawn at once.
    """
    width, height = plate.size_px
    if width * height > MOST_SAMPLES:
        raise InputError(f"a plate of {width}×{height} pixels is too large; scale it down")
    n = SAMPLES_PER_AXIS if SAMPLES_PER_AXIS**2 * width * height <= MOST_SAMPLES else 1
    fine = replace(camera, size_px=(n * width, n * height))
    kinds, of_floor, unshaded = _surfaces_and_floor(scene, fine, lights)
    with MovingRenderer(scene, fine, effort=Effort(floor_rays=0)) as renderer:
        drawn = renderer.render(lights)
        ground = drawn if environment is None else drawn.copy()
        if environment is not None:
            drawn = renderer.render(lights, environment, through_ground=True)
    is_object = kinds >= DULL
    objects = (drawn[is_object, :3] + of_floor) * gain
    ground[is_object, :3] = objects if plate.codes is None else roll_off(objects)
    in_front = np.zeros((height, width, 4), np.float32)
    shade = np.ones((height, width, 3), np.float32)
    _add_up(kinds, ground, unshaded, in_front, shade)
    shade = _without_grain(shade, in_front[..., 3] == 1)
    picture = in_front[..., :3] + (1 - in_front[..., 3:]) * shade * plate.radiance
    changed = np.any(shade != 1, axis=-1) | (in_front[..., 3] > 0)
    picture[~changed] = plate.radiance[~changed]
    return Composite(picture, changed)


def _surfaces_and_floor(
    scene: Scene, camera: Camera, lights: LightSet
) -> tuple[NDArray[np.uint8], _FLOATS, _FLOATS]:
    """Return what each sample shows (H, W), and the ground's radiance (3,) without shadow.

    Between them the light that the ground sends to those samples (M, 3) that show objects.
    """
    discs = all_lights(lights, scene)
    unshaded = unshaded_ground(scene, *discs)
    width, height = camera.size_px
    surfaces = empty_surfaces(camera.size_px)
    picture = np.zeros((height, width, 4), np.float32)
    traced = TracedScene(scene)
    try:
        traced.find_surfaces(camera, camera.size_px, surfaces)
        shade = floor_shade(traced, *discs)
        add_floor_light(traced, surfaces, unshaded, shade, picture)
    finally:
        traced.release()
    kinds = in_picture(surfaces[:, :, KIND : KIND + 1], camera.size_px)[..., 0].astype(np.uint8)
    return kinds, picture[kinds >= DULL, :3], unshaded


def _without_grain(shade: _FLOATS, is_object: NDArray[np.bool_]) -> _FLOATS:
    """Return what is left of the light, (H, W, 3), smoothed between edges of shadows; 1 is exact.

    Neighbouring pixels share shadow rays, which leaves a pattern of a few per cent.
    """
    apart = np.where(is_object[..., None], _APART, shade)
    smooth = cv2.bilateralFilter(apart, _GRAIN_PX, 3 * _GRAIN, _GRAIN_PX / 3)
    smooth[is_object | np.all(np.abs(smooth - 1) < _UNCHANGED, axis=-1)] = 1
    return np.asarray(smooth, np.float32)


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _add_up(
    kinds: NDArray[np.uint8],
    samples: _FLOATS,
    unshaded: _FLOATS,
    in_front: _FLOATS,
    shade: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Set what a pixel's samples show of objects, their share as alpha, and the others' light.

    `samples` (nH, nW, 4) is what objects show, in the plate's scale, and the ground's radiance.
    """
    n = len(kinds) // len(shade)
    each = np.float32(1 / n**2)
    for y in prange(shade.shape[0]):
        left = np.empty(3, np.float32)
        for x in range(shade.shape[1]):
            count = 0
            left[:] = 0
            for s in range(n * n):
                v, u = n * y + s // n, n * x + s % n
                if kinds[v, u] >= DULL:
                    count += 1
                    for c in range(3):
                        in_front[y, x, c] += each * samples[v, u, c]
                    continue
                for c in range(3):
                    is_lit = kinds[v, u] == GROUND and unshaded[c] > 0
                    left[c] += samples[v, u, c] / unshaded[c] if is_lit else np.float32(1)
            in_front[y, x, 3] = each * count
            for c in range(3):
                if count < n * n:
                    shade[y, x, c] = left[c] / (n * n - count)
