"""The ways to a picture that the chart compares, each with what may move in it moving.

Input  : a scene and a camera.    Output : pictures, frame after frame.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from functools import partial

import moderngl
import numpy as np
from numpy.typing import NDArray

from calibration.camera import yaw_rotation
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.baked.renderer import BakedRenderer
from render.baked.roaming import RoamingRenderer
from render.moving.renderer import MovingRenderer
from render.moving.shared_rays import Effort
from render.opengl.context import GlUnavailable, create_context
from render.opengl.renderer import Renderer
from render.scenes.scene import Camera, Scene

Draw = Callable[[LightSet, EnvironmentMap, int], NDArray[np.float32]]
"""From lights, the map they stand for, and the number of the frame to its picture (H, W, 4)."""

Way = Callable[[Scene, Camera], AbstractContextManager[Draw]]
"""Makes ready to draw a scene from a camera, and frees what that took in the end."""

RAYS, TRANSPORT, SHADOW_MAPS = "rays", "transport", "shadow maps"
ROAMING = "roaming"
MAIN_WAYS = (RAYS, TRANSPORT, ROAMING, SHADOW_MAPS)
"""As they are used; the others differ from one of them in a setting."""

_STEP_M = 1e-3  # that the camera moves from frame to frame
_TURN_RAD = np.radians(0.5)  # that all lights turn about the vertical


@contextmanager
def ways() -> Iterator[Mapping[str, Way]]:
    """Give the ways by name, good as long as the context lasts: without OpenGL those without.

    Lights turn in all of them; with "rays" objects and camera move too, with "transport" neither,
    otherwise the camera does: "roaming" is transport that may be looked at from anywhere. n × n
    pixels share the looking at weak lights: 4 × 4 unless the name says another number. Shadow maps
    of weak lights have 256² texels or what the name says.
    """
    found: dict[str, Way] = {
        RAYS if side == 4 else f"{RAYS}, {side}×{side}": partial(_rays, side) for side in (4, 2, 1)
    }
    found |= {TRANSPORT: _transport, ROAMING: _roaming}
    try:
        context = create_context()
    except GlUnavailable:
        yield found
        return
    with context:
        for name, side, map_px in (
            (SHADOW_MAPS, 4, 256),
            ("maps, 128²", 4, 128),
            ("maps, 512²", 4, 512),
            ("maps, 1×1", 1, 256),
        ):
            found[name] = partial(_shadow_maps, context, side, map_px)
        yield found


def turned(lights: LightSet, frame: int) -> LightSet:
    """Return the lights of a frame: every one has turned a little further."""
    turn = yaw_rotation(frame * _TURN_RAD)
    return replace(lights, directions=lights.directions @ turn.T)


def _moved(camera: Camera, frame: int) -> Camera:
    return replace(camera, eye=camera.eye + _STEP_M * frame)


@contextmanager
def _rays(side: int, scene: Scene, camera: Camera) -> Iterator[Draw]:
    with MovingRenderer(scene, camera, effort=Effort(interleaving=side)) as renderer:

        def draw(lights: LightSet, environment: EnvironmentMap, frame: int) -> NDArray[np.float32]:
            # Other objects of the same shape: all triangles count as moved.
            renderer.move(replace(scene), _moved(camera, frame))
            return renderer.render(turned(lights, frame), environment)

        yield draw


@contextmanager
def _transport(scene: Scene, camera: Camera) -> Iterator[Draw]:
    with BakedRenderer(scene, camera) as renderer:
        yield lambda lights, environment, frame: renderer.render(turned(lights, frame), environment)


@contextmanager
def _roaming(scene: Scene, camera: Camera) -> Iterator[Draw]:
    with RoamingRenderer(scene) as renderer:
        yield lambda lights, environment, frame: renderer.render(
            _moved(camera, frame), turned(lights, frame), environment
        )


@contextmanager
def _shadow_maps(
    context: moderngl.Context, side: int, map_px: int, scene: Scene, camera: Camera
) -> Iterator[Draw]:
    with Renderer(context, scene, camera, interleaving=side, map_px=map_px) as renderer:

        def draw(lights: LightSet, environment: EnvironmentMap, frame: int) -> NDArray[np.float32]:
            renderer.look_from(_moved(camera, frame))
            return renderer.render(turned(lights, frame), environment)

        yield draw
