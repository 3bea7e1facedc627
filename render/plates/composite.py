"""Objects set into a plate: lit as their surroundings are, with their shadows on its ground.

Differential rendering in its multiplicative form: the plate's ground is multiplied by the ratio
of light with and without the objects, which holds for matt ground of any albedo. Each sample of a
pixel shows the plate, the plate in shadow, or an object; their mean is taken in linear light.

Input  : a plate, its camera, a scene in it, lights, and a map for mirrors to show.
Output : the picture, linear as the plate is; pixels that objects do not change are the plate's own.
Cost   : at 2448 × 3264 pixels and 64 lights see tests/benchmarks/plates.py.
Fails  : ground that mirrors keeps its reflections, and shows none of the objects. Things in the
         plate neither hide the objects nor take their shadows, but as the level ground would.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from capture.errors import InputError
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.lights.all_lights import all_lights, level_irradiance
from render.moving.renderer import MovingRenderer
from render.output.view import roll_off
from render.plates.floor_light import add_floor_light, floor_shade
from render.plates.plate import Plate
from render.rays.surface_rows import DULL, GROUND, KIND, empty_surfaces, in_picture
from render.rays.traced_scene import TracedScene
from render.scenes.scene import Camera, Scene

_FLOATS = NDArray[np.float32]

SAMPLES_PER_AXIS = 2

MOST_SAMPLES = 2**26
"""Each takes some 200 bytes while it is drawn."""

_UNCHANGED = 1e-3
"""Of the light: what is less is rounding, or would not be seen."""


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
    with MovingRenderer(scene, fine) as renderer:
        drawn = renderer.render(lights)
        ground = drawn if environment is None else drawn.copy()
        if environment is not None:
            drawn = renderer.render(lights, environment, through_ground=True)
    is_object = kinds >= DULL
    objects = (drawn[is_object, :3] + of_floor) * gain
    ground[is_object, :3] = objects if plate.codes is None else roll_off(objects)
    picture, changed = np.empty_like(plate.radiance), np.empty((height, width), np.bool_)
    _lay_over(plate.radiance, kinds, ground, unshaded, picture, changed)
    return Composite(picture, changed)


def _surfaces_and_floor(
    scene: Scene, camera: Camera, lights: LightSet
) -> tuple[NDArray[np.uint8], _FLOATS, _FLOATS]:
    """Return what each sample shows (H, W), and the ground's radiance (3,) without shadow.

    Between them the light that the ground sends to those samples (M, 3) that show objects.
    """
    assert scene.ground is not None
    discs = all_lights(lights, scene)
    unshaded = (level_irradiance(*discs) * scene.ground.reflectance / np.pi).astype(np.float32)
    width, height = camera.size_px
    surfaces = empty_surfaces(camera.size_px)
    picture = np.zeros((height, width, 4), np.float32)
    traced = TracedScene(scene)
    try:
        traced.find_surfaces(camera, camera.size_px, surfaces)
        shade = floor_shade(traced, scene.ground.y_m, *discs)
        add_floor_light(traced, surfaces, scene.ground.y_m, unshaded, shade, picture)
    finally:
        traced.release()
    kinds = in_picture(surfaces[:, :, KIND : KIND + 1], camera.size_px)[..., 0].astype(np.uint8)
    return kinds, picture[kinds >= DULL, :3], unshaded


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _lay_over(
    plate: _FLOATS,
    kinds: NDArray[np.uint8],
    samples: _FLOATS,
    unshaded: _FLOATS,
    picture: _FLOATS,
    changed: NDArray[np.bool_],
) -> None:  # pragma: no cover - compiled
    """Set `picture` (H, W, 3) to the mean of each pixel's samples over the plate.

    `samples` (nH, nW, 4) is what objects show, in the plate's scale, and the ground's radiance.
    """
    n = len(kinds) // len(plate)
    for y in prange(plate.shape[0]):
        for x in range(plate.shape[1]):
            is_changed = False
            for c in range(3):
                objects = shade = np.float32(0)
                for s in range(n * n):
                    v, u = n * y + s // n, n * x + s % n
                    if kinds[v, u] >= DULL:
                        objects += samples[v, u, c]
                        is_changed = True
                        continue
                    ratio = np.float32(1)
                    if kinds[v, u] == GROUND and unshaded[c] > 0:
                        ratio = samples[v, u, c] / unshaded[c]
                    if abs(ratio - 1) > _UNCHANGED:
                        is_changed = True
                        shade += ratio
                    else:
                        shade += np.float32(1)
                share = np.float32(n * n)
                picture[y, x, c] = (objects + shade * plate[y, x, c]) / share
            changed[y, x] = is_changed
            if not is_changed:
                picture[y, x] = plate[y, x]
