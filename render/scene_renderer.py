"""One way to a picture, whatever moves: the renderer is chosen by what changed since the last one.

| scene and camera | light | drawn by | how |
|---|---|---|---|
| stand | moves | `BakedRenderer` | transport traced once, a product per picture |
| move | moves | `MovingRenderer` | rays for every picture, nothing kept |

Input  : a scene, a camera and LightSets, one of each per picture.
Output : linear radiance, in the lights' scale.
Cost   : that of the renderer; tracing the transport takes seconds, in the picture that asks for it.
Fails  : the picture changes a little where renderers change: their errors are not the same.
"""

from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.baked.renderer import BakedRenderer
from render.moving.renderer import MovingRenderer
from render.scenes.scene import Camera, Scene


class SceneRenderer:
    """Draws any scene from any camera under any lights, each picture in the cheapest way.

    Owns the renderers: use it as a context manager, from one thread.

    Parameters
    ----------
    still_pictures : int
        How many pictures of the same scene and camera are drawn before their transport is traced.
        With 0 it is traced at once: for those who know that nothing will move.
    """

    def __init__(self, still_pictures: int) -> None:
        self._still_pictures = still_pictures
        self._moving: MovingRenderer | None = None
        self._baked: BakedRenderer | None = None
        self._shown: tuple[Scene, Camera] | None = None
        self._count = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.release()

    def release(self) -> None:
        """Free what the renderers own."""
        if self._baked is not None:
            self._baked.release()
        if self._moving is not None:
            self._moving.release()
        self._baked = self._moving = self._shown = None

    def render(
        self,
        scene: Scene,
        camera: Camera,
        lights: LightSet,
        background: EnvironmentMap | None = None,
        *,
        through_ground: bool = False,
    ) -> NDArray[np.float32]:
        """Return the picture, as `BakedRenderer.render` does.

        A scene or camera stands still while it is the same object.
        """
        if self._shown is None or scene is not self._shown[0] or camera is not self._shown[1]:
            self._shown, self._count = (scene, camera), 0
            if self._baked is not None:
                self._baked.release()
                self._baked = None
        if self._count >= self._still_pictures:
            self._baked = self._baked or BakedRenderer(scene, camera)
            return self._baked.render(lights, background, through_ground=through_ground)
        self._count += 1
        if self._moving is None:
            self._moving = MovingRenderer(scene, camera)
        self._moving.move(scene, camera)
        return self._moving.render(lights, background, through_ground=through_ground)
