"""The rendered picture of a session whose viewer may walk around: a draft at once, then better.

When scene or viewpoint change, rays draw a draft in the next frame, and transport is traced for the
new view on a thread of its own; once it is there, pictures come from it. A smaller picture, where
there is time for no other, is traced beside in the same way. Neither needs OpenGL.

Input  : settings and LightSets.    Output : linear radiance and alpha.
Cost   : a draft has a quarter of the pixels and takes about a quarter of what `MovingRenderer`
         does; tracing takes seconds, and the loop has to share its cores.
Fails  : where numba's threads cannot be entered from two threads (its workqueue layer), tracing
         stops the loop while it lasts.
"""

import time
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Self

import numpy as np
from numba.np.ufunc.parallel import threading_layer
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.baked.renderer import BakedRenderer
from render.live.models import Models
from render.live.settings import Settings
from render.moving.renderer import MovingRenderer
from render.scenes.scene import Camera, Scene

RESTING_S = 0.7
"""A view that was not changed for so long is worth tracing."""

_SAFE_LAYERS = ("tbb", "omp")

_View = tuple[object, ...]


class LivePicture:
    """Draws what the settings ask for; a context manager, for one thread.

    Attributes
    ----------
    size_px : (int, int)
        (width, height) of a whole picture.
    is_draft : bool
        Whether the last picture was one.
    is_settled : bool
        Whether it was as it was asked for, and nothing is being traced beside.
    """

    def __init__(self, models: Models, size_px: tuple[int, int]) -> None:
        self._tracer = ThreadPoolExecutor(1, "fishlight-tracer")
        self._models = models
        self.size_px = size_px
        self._draft_px = max(size_px[0] // 2, 1), max(size_px[1] // 2, 1)
        self._view: _View | None = None
        self._changed_s = 0.0
        self._moving: MovingRenderer | None = None
        self._baked: BakedRenderer | None = None
        self._baked_px = size_px
        self._tracing: tuple[_View, tuple[int, int], Future[BakedRenderer]] | None = None
        self.is_draft = True
        self.is_settled = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._tracer.shutdown(cancel_futures=True)
        if self._tracing is not None and not self._tracing[2].cancelled():
            self._tracing[2].result().release()
        self._release_baked()
        if self._moving is not None:
            self._moving.release()

    def render(
        self,
        settings: Settings,
        lights: LightSet,
        background: EnvironmentMap | None,
        wanted_px: tuple[int, int] | None = None,
    ) -> NDArray[np.float32]:
        """Return the picture (H, W, 4), whole if no size is wanted; a draft is smaller.

        One of another size comes when it is traced, some pictures after it is first wanted.
        """
        wanted_px = wanted_px or self.size_px
        view = _view_of(settings)
        if view != self._view:
            self._release_baked()
            self._look_from(settings)
            # The first view of all is traced at once.
            self._changed_s = time.monotonic() - (RESTING_S if self._view is None else 0.0)
            self._view = view
        self._trace(settings, view, wanted_px)
        self.is_draft = self._baked is None
        is_wanted = not self.is_draft and self._baked_px == wanted_px
        self.is_settled = is_wanted and self._tracing is None
        drawer = self._baked or self._moving
        assert drawer is not None
        return drawer.render(lights, background, through_ground=background is not None)

    def _look_from(self, settings: Settings) -> None:
        scene, camera = self._models.view(settings, self._draft_px)
        if self._moving is None:
            self._moving = MovingRenderer(scene, camera)
        else:
            self._moving.move(scene, camera)

    def _trace(self, settings: Settings, view: _View, wanted_px: tuple[int, int]) -> None:
        """Take over what was traced, if it is still wanted; have traced what is wanted."""
        if self._tracing is not None:
            traced_view, traced_px, future = self._tracing
            if not future.done():
                return
            self._tracing = None
            traced = future.result()
            if traced_view == view:
                self._release_baked()
                self._baked, self._baked_px = traced, traced_px
            else:
                traced.release()
        is_resting = time.monotonic() - self._changed_s >= RESTING_S
        is_there = self._baked is not None and self._baked_px == wanted_px
        if is_resting and not is_there:
            scene, camera = self._models.view(settings, wanted_px)
            future = self._tracer.submit(_traced, scene, camera)
            self._tracing = view, wanted_px, future
            if not may_enter_beside():
                future.exception()  # waits for it

    def _release_baked(self) -> None:
        if self._baked is not None:
            self._baked.release()
        self._baked = None


def _traced(scene: Scene, camera: Camera) -> BakedRenderer:
    """Return a renderer that has traced all that its pictures will show."""
    renderer = BakedRenderer(scene, camera)
    if scene.ground is not None:
        renderer.trace_floor()
    return renderer


def may_enter_beside() -> bool:
    """Whether numba's threads may be entered from two threads; known once they have started."""
    try:
        return threading_layer() in _SAFE_LAYERS  # type: ignore[no-untyped-call]
    except ValueError:  # none has started
        return False


def _view_of(settings: Settings) -> _View:
    return (
        settings.model,
        settings.material,
        settings.azimuth_rad,
        settings.elevation_rad,
        settings.distance,
    )
