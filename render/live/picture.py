"""The rendered picture of a session whose viewer may walk around: a draft at once, then better.

When scene or viewpoint change, shadow maps draw a draft in the next frame, and transport is traced
for the new view on a thread of its own; once it is there, pictures come from it.

Input  : settings and LightSets.    Output : linear radiance and alpha.
Cost   : a draft takes as long as `Renderer` does, at a quarter of the pixels and with few lights
         where the processor draws; tracing takes seconds, and the loop has to share its cores.
Fails  : where numba's threads cannot be entered from two threads (its workqueue layer), tracing
         stops the loop while it lasts.
"""

import time
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
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
from render.opengl.context import create_context, describe, is_software
from render.opengl.renderer import Renderer
from render.scenes.scene import Camera, Scene

RESTING_S = 0.7
"""A view that was not changed for so long is worth tracing."""

_DRAFT_LIGHTS = 16
_SAFE_LAYERS = ("tbb", "omp")


class LivePicture:
    """Draws what the settings ask for; a context manager, for one thread.

    Attributes
    ----------
    gl : str
        Renderer and version of the OpenGL context.
    is_draft : bool
        Whether the last picture was one.
    """

    def __init__(self, models: Models, size_px: tuple[int, int]) -> None:
        """Make the OpenGL context; GlUnavailable if there is none."""
        self._open = ExitStack()
        self._context = self._open.enter_context(create_context())
        self._tracer = ThreadPoolExecutor(1, "fishlight-tracer")
        self._open.callback(self._close)
        self._models = models
        self._size_px = size_px
        self._is_slow = is_software(self._context)
        half_px = (max(size_px[0] // 2, 1), max(size_px[1] // 2, 1))
        self._draft_px = half_px if self._is_slow else size_px
        self._view: tuple[object, ...] | None = None
        self._changed_s = 0.0
        self._draft: Renderer | None = None
        self._baked: BakedRenderer | None = None
        self._tracing: tuple[tuple[object, ...], Future[BakedRenderer]] | None = None
        self.gl = describe(self._context)
        self.is_draft = True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._open.close()

    def render(
        self, settings: Settings, lights: LightSet, background: EnvironmentMap | None
    ) -> NDArray[np.float32]:
        """Return the picture (H, W, 4); a draft may be smaller."""
        view = _view_of(settings)
        if view != self._view:
            self._release()
            # The first view of all is traced at once.
            self._changed_s = time.monotonic() - (RESTING_S if self._view is None else 0.0)
            self._view = view
        self._trace(settings, view)
        if self._baked is not None:
            self.is_draft = False
            return self._baked.render(lights, background, through_ground=background is not None)
        if self._draft is None:
            scene, camera = self._models.view(settings, self._draft_px)
            self._draft = Renderer(self._context, scene, camera)
        self.is_draft = True
        if self._is_slow:
            lights = _strongest(lights)
        return self._draft.render(lights, background)

    def _trace(self, settings: Settings, view: tuple[object, ...]) -> None:
        """Take over what was traced, if it is still wanted; have traced what is wanted."""
        if self._tracing is not None:
            traced_view, future = self._tracing
            if not future.done():
                return
            self._tracing = None
            traced = future.result()
            if traced_view == view:
                self._release()
                self._baked = traced
            else:
                traced.release()
        is_resting = time.monotonic() - self._changed_s >= RESTING_S
        if self._baked is None and is_resting:
            scene, camera = self._models.view(settings, self._size_px)
            future = self._tracer.submit(_baked, scene, camera)
            self._tracing = view, future
            if not _may_trace_beside():
                future.exception()  # waits for it

    def _release(self) -> None:
        for renderer in (self._draft, self._baked):
            if renderer is not None:
                renderer.release()
        self._draft = self._baked = None

    def _close(self) -> None:
        self._tracer.shutdown(cancel_futures=True)
        if self._tracing is not None and not self._tracing[1].cancelled():
            self._tracing[1].result().release()
        self._release()


def _strongest(lights: LightSet) -> LightSet:
    """Return the strongest few lights, made as strong together as all were."""
    power = lights.irradiance.sum(axis=1)
    kept = np.argsort(-power, kind="stable")[:_DRAFT_LIGHTS]
    total, left = lights.irradiance.sum(axis=0), lights.irradiance[kept].sum(axis=0)
    scale = np.divide(total, left, out=np.ones(3), where=left > 0)
    return replace(
        lights,
        directions=lights.directions[kept],
        irradiance=lights.irradiance[kept] * scale,
        angular_radius_rad=lights.angular_radius_rad[kept],
        is_key=lights.is_key[kept],
    )


def _view_of(settings: Settings) -> tuple[object, ...]:
    return (
        settings.model,
        settings.material,
        settings.azimuth_rad,
        settings.elevation_rad,
        settings.distance,
    )


def _baked(scene: Scene, camera: Camera) -> BakedRenderer:
    """Trace with an OpenGL context of this thread, which is only needed for the samples' places."""
    with create_context() as context:
        return BakedRenderer(context, scene, camera)


def _may_trace_beside() -> bool:
    """Whether numba's threads may be entered from two threads; known once they have started."""
    try:
        return threading_layer() in _SAFE_LAYERS  # type: ignore[no-untyped-call]
    except ValueError:  # none has started
        return False
