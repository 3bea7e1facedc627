"""One way to a picture, whatever moves: the renderer is chosen by what changed since the last one.

| scene | camera | drawn by | how |
|---|---|---|---|
| stands | stands | `BakedRenderer` | transport of each sample traced once, a product per picture |
| stands | moves | `RoamingRenderer` | transport of points all over the scene, looked up by rays |
| moves | moves | `MovingRenderer` | rays for every picture, nothing kept |

Input  : a scene, a camera and LightSets, one of each per picture.
Output : linear radiance, in the lights' scale.
Cost   : that of the renderer; tracing the transport takes seconds, in the picture that asks for it.
Fails  : the picture changes a little where renderers change: their errors are not the same.
"""

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.baked.renderer import BakedRenderer
from render.baked.roaming import RoamingRenderer
from render.moving.renderer import MovingRenderer
from render.owner import Owner
from render.scenes.scene import Camera, Scene


class SceneRenderer(Owner):
    """Draws any scene from any camera under any lights, each picture in the cheapest way.

    Owns the renderers: use it as a context manager, from one thread.

    Parameters
    ----------
    still_pictures : int
        How many pictures of what stands are drawn before its transport is traced.
        With 0 it is traced at once: for those who know that nothing will move.
    """

    def __init__(self, still_pictures: int) -> None:
        self._still_pictures = still_pictures
        self._moving: MovingRenderer | None = None
        self._roaming: RoamingRenderer | None = None
        self._baked: BakedRenderer | None = None
        self._scene: Scene | None = None
        self._camera: Camera | None = None
        self._of_scene = self._of_camera = 0  # pictures of them so far

    def release(self) -> None:
        """Free what the renderers own."""
        for renderer in (self._baked, self._roaming, self._moving):
            if renderer is not None:
                renderer.release()
        self._baked = self._roaming = self._moving = self._scene = self._camera = None

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
        self._note(scene, camera)
        self._of_scene += 1
        self._of_camera += 1
        if self._of_camera > self._still_pictures:
            self._baked = self._baked or BakedRenderer(scene, camera)
            return self._baked.render(lights, background, through_ground=through_ground)
        if self._of_scene > self._still_pictures:
            self._roaming = self._roaming or RoamingRenderer(scene)
            return self._roaming.render(camera, lights, background, through_ground=through_ground)
        if self._moving is None:
            self._moving = MovingRenderer(scene, camera)
        self._moving.move(scene, camera)
        return self._moving.render(lights, background, through_ground=through_ground)

    def _note(self, scene: Scene, camera: Camera) -> None:
        """Free what was traced of another scene or view."""
        if scene is self._scene and camera is self._camera:
            return
        if self._baked is not None:
            self._baked.release()
        self._baked, self._camera, self._of_camera = None, camera, 0
        if scene is not self._scene:
            if self._roaming is not None:
                self._roaming.release()
            self._roaming, self._scene, self._of_scene = None, scene, 0
