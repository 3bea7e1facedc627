"""Who draws the pictures of a replay: rays at once, or OpenGL, which hands them out later.

| drawn with | needs | what stands is |
|---|---|---|
| rays | nothing | traced once, in seconds, and costs a product per picture |
| OpenGL | a driver, a GPU to be fast | drawn anew where lights moved: nothing to wait for |

Input  : a scene; camera, lights and map of each picture.    Output : linear radiance, in order.
Fails  : rays and OpenGL agree within a few per cent, not to the bit. With OpenGL a floor that only
         carries shadows cannot be had, and a second context that is lost ends the replay.
"""

from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.opengl.context import NO_ERROR, GlUnavailable, create_context, describe
from render.opengl.picture_stream import BEHIND, PictureStream, StreamedPicture
from render.opengl.renderer import Renderer
from render.owner import Owner
from render.scene_renderer import SceneRenderer
from render.scenes.scene import Camera, Scene
from render.session import StageClock

Picture = NDArray[np.float32]

Name = TypeVar("Name")

_Ask = Callable[[], list[StreamedPicture]]


class Pictures(Owner, Generic[Name]):
    """Draws a scene, picture after picture; a context manager, for one thread.

    Each picture goes by a name, whatever the caller wants with it when it is there.
    """

    about: str
    """What draws, for people."""

    @abstractmethod
    def draw(
        self,
        name: Name,
        camera: Camera,
        lights: LightSet,
        environment: EnvironmentMap,
        clock: StageClock,
    ) -> list[tuple[Name, Picture]]:
        """Have a picture drawn; return those (H, W, 4) that are there now, by their names."""

    @abstractmethod
    def rest(self) -> list[tuple[Name, Picture]]:
        """Return the pictures that are not there yet."""


class RayPictures(Pictures[Name]):
    """Pictures of `SceneRenderer`, each at once."""

    about = "rays"

    def __init__(self, scene: Scene, *, through_ground: bool) -> None:
        self._scene = scene
        self._through_ground = through_ground
        self._renderer = SceneRenderer(still_pictures=0)

    def draw(
        self,
        name: Name,
        camera: Camera,
        lights: LightSet,
        environment: EnvironmentMap,
        clock: StageClock,
    ) -> list[tuple[Name, Picture]]:
        """Return the picture."""
        picture = self._renderer.render(
            self._scene, camera, lights, environment, through_ground=self._through_ground
        )
        return [(name, picture)]

    def rest(self) -> list[tuple[Name, Picture]]:
        """Return none."""
        return []

    def release(self) -> None:
        """Free what the renderers own."""
        self._renderer.release()


class OpenGLPictures(Pictures[Name]):
    """Pictures of a `PictureStream`, each `BEHIND` later.

    What the device took for each part of a picture is a stage of the frame that gets it. Pictures
    that are lost with their context are drawn once more in another.

    Parameters
    ----------
    scene : Scene
    frame_rate_hz : float or None
        To be held by drawing fewer shadow maps anew.

    Raises
    ------
    GlUnavailable
        If there is no OpenGL; from pictures, if a second context is lost.
    """

    def __init__(self, scene: Scene, frame_rate_hz: float | None) -> None:
        self._scene = scene
        self._frame_rate_hz = frame_rate_hz
        self._context = create_context()
        self.about = f"OpenGL, {BEHIND} brackets behind: {describe(self._context)}"
        self._was_lost = False
        self._camera: Camera | None = None
        self._renderer: Renderer | None = None
        self._stream: PictureStream | None = None
        self._asked: deque[tuple[Name, LightSet, EnvironmentMap]] = deque()

    def draw(
        self,
        name: Name,
        camera: Camera,
        lights: LightSet,
        environment: EnvironmentMap,
        clock: StageClock,
    ) -> list[tuple[Name, Picture]]:
        """Return the picture before the last one, if there was one; all, for a new camera."""
        finished = [] if camera is self._camera else self.rest()
        if camera is not self._camera:
            self._release_stream()
            self._camera = camera
        self._asked.append((name, lights, environment))
        streamed = self._get(lambda: _some(self._drawing().draw(lights, environment)), _nothing)
        for each in streamed:
            for part, took_ms in each.device_ms.items():
                clock.add(f"device {part}", took_ms)
        return finished + self._named(streamed)

    def rest(self) -> list[tuple[Name, Picture]]:
        """Wait for the pictures that are on their way, and return them."""
        return self._named(self._get(self._on_the_way, self._on_the_way)) if self._asked else []

    def release(self) -> None:
        """Free the context and what was made in it."""
        self._release_stream()
        self._context.release()

    def _get(self, ask: _Ask, ask_once_more: _Ask) -> list[StreamedPicture]:
        """Return what is asked for; if the context is lost, what another draws of all that was."""
        try:
            streamed = ask()
            is_lost = self._context.error != NO_ERROR
        except moderngl.Error:  # any other cause comes again
            is_lost = True
        if not is_lost:
            return streamed
        if self._was_lost:
            raise GlUnavailable("OpenGL failed twice while it drew")
        self._was_lost = True
        self.release()
        self._context = create_context()
        streamed = []
        for _, lights, environment in self._asked:
            streamed += _some(self._drawing().draw(lights, environment))
        return streamed + ask_once_more()

    def _on_the_way(self) -> list[StreamedPicture]:
        return list(self._drawing().rest())

    def _named(self, streamed: list[StreamedPicture]) -> list[tuple[Name, Picture]]:
        return [(self._asked.popleft()[0], each.picture) for each in streamed]

    def _drawing(self) -> PictureStream:
        if self._stream is None:
            assert self._camera is not None
            self._renderer = Renderer(self._context, self._scene, self._camera)
            self._stream = PictureStream(self._context, self._renderer, self._frame_rate_hz)
        return self._stream

    def _release_stream(self) -> None:
        if self._stream is not None:
            self._stream.release()
        if self._renderer is not None:
            self._renderer.release()
        self._stream = self._renderer = None


def _some(streamed: StreamedPicture | None) -> list[StreamedPicture]:
    return [] if streamed is None else [streamed]


def _nothing() -> list[StreamedPicture]:
    return []
