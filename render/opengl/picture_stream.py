"""Pictures without a stall: while one is drawn, those before it are on their way back.

A picture is copied to a buffer on the device's side when it was drawn, and read from there when two
more have been asked for; the same goes for the times that its parts took. So neither waits for what
is being drawn.

To hold a frame rate, shadow maps are drawn anew in turns: how many, follows the device's clock.
Shadows of what turns then lag; nothing jumps.

Input  : a Renderer; lights of each picture.
Output : pictures and times, two behind.
Cost   : two pictures of latency, and a buffer of 16 bytes per sample for each.
Fails  : where not even one map a picture is in time, the rate is missed; fewer lights or pixels
         are the caller's to choose. On llvmpipe, where the processor draws, copies are made twice
         and gain nothing. A part that takes longer than the device's clock can tell counts as
         4.3 s.
"""

import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.stream.budget import FIRST_COUNT, FRAMES, next_count
from render.opengl.context import release
from render.opengl.renderer import Renderer
from render.owner import Owner

BEHIND = 2
"""Pictures that are on their way."""
_SAMPLE_BYTES = 16


class StreamedPicture(NamedTuple):
    """A picture and what it took.

    Attributes
    ----------
    picture : (H, W, 4) float32
        As `Renderer.render` returns it.
    device_ms : dict of str to float
        What the device took for each part, by its own clock.
    issue_ms : dict of str to float
        What this thread took to ask for each part.
    most_maps : int or None
        How many shadow maps of lights that turned there was time for; None for all.
    """

    picture: NDArray[np.float32]
    device_ms: dict[str, float]
    issue_ms: dict[str, float]
    most_maps: int | None


class PictureStream(Owner):
    """Draws pictures one after the other, and hands each out `BEHIND` later.

    Owns GL objects: use it as a context manager, from the renderer's thread and within its life.

    Parameters
    ----------
    context : moderngl.Context
    renderer : Renderer
        Nobody else may draw with it meanwhile.
    frame_rate_hz : float or None
        To be held; None draws all maps of every picture.
    """

    def __init__(
        self, context: moderngl.Context, renderer: Renderer, frame_rate_hz: float | None = None
    ) -> None:
        self._context = context
        self._budget_ms = None if frame_rate_hz is None else 1e3 / frame_rate_hz
        self._most_maps = None if frame_rate_hz is None else FIRST_COUNT
        self._took_ms: list[float] = []
        self._renderer = renderer
        width, height = renderer.framebuffer.size
        self._free = [
            _Slot(context, context.buffer(reserve=width * height * _SAMPLE_BYTES))
            for _ in range(BEHIND + 1)
        ]
        self._on_the_way: deque[_Slot] = deque()

    def release(self) -> None:
        """Free the buffers."""
        for slot in (*self._free, *self._on_the_way):
            slot.release()

    def draw(
        self, lights: LightSet, background: EnvironmentMap | None = None
    ) -> StreamedPicture | None:
        """Draw a picture; return the one asked for `BEHIND` before, None as long as there is none.

        Parameters
        ----------
        lights, background
            As in `Renderer.render`.
        """
        slot = self._free.pop()
        slot.begin(self._most_maps)
        slot.maps = self._renderer.draw(
            lights, background, most_maps=self._most_maps, timed=slot.timed
        )
        with slot.timed("copy"):
            self._renderer.framebuffer.read_into(slot.buffer, components=4, dtype="f4")
        self._on_the_way.append(slot)
        return self._next() if len(self._on_the_way) > BEHIND else None

    def rest(self) -> Iterator[StreamedPicture]:
        """Yield the pictures that are still on their way."""
        while self._on_the_way:
            yield self._next()

    def _next(self) -> StreamedPicture:
        slot = self._on_the_way.popleft()
        self._free.append(slot)
        picture = self._renderer.as_picture(slot.buffer.read())
        device_ms = slot.device_ms()
        self._judge(slot, sum(device_ms.values()))
        return StreamedPicture(picture, device_ms, slot.issue_ms, slot.most_maps)

    def _judge(self, slot: "_Slot", took_ms: float) -> None:
        """Choose how many maps there is time for, from pictures drawn with as many as now."""
        if self._budget_ms is None or self._most_maps is None or slot.most_maps != self._most_maps:
            return
        self._took_ms = [*self._took_ms, took_ms][-FRAMES:]
        drawn = min(slot.maps, self._most_maps)  # new lights' maps come on top
        most = next_count(self._most_maps, drawn, self._took_ms, self._budget_ms)
        if most != self._most_maps:
            self._most_maps, self._took_ms = most, []


class _Slot:
    """A buffer for a picture, and the clocks of its parts."""

    def __init__(self, context: moderngl.Context, buffer: moderngl.Buffer) -> None:
        self.buffer = buffer
        self.issue_ms: dict[str, float] = {}
        self.most_maps: int | None = None
        self.maps = 0
        self._context = context
        self._queries: list[moderngl.Query] = []
        self._asked: list[str] = []

    def begin(self, most_maps: int | None) -> None:
        self._asked, self.issue_ms, self.most_maps = [], {}, most_maps

    @contextmanager
    def timed(self, part: str) -> Iterator[None]:
        """Have both clocks measure what the block asks for; a part may have several blocks."""
        if len(self._asked) == len(self._queries):
            self._queries.append(self._context.query(time=True))
        query = self._queries[len(self._asked)]
        self._asked.append(part)
        start_s = time.perf_counter()
        with query:
            yield
        took_ms = 1e3 * (time.perf_counter() - start_s)
        self.issue_ms[part] = self.issue_ms.get(part, 0.0) + took_ms

    def device_ms(self) -> dict[str, float]:
        """Return what the parts took; waits for the device if it is not through yet."""
        times: dict[str, float] = dict.fromkeys(self._asked, 0.0)
        for part, query in zip(self._asked, self._queries, strict=False):
            times[part] += 1e-6 * query.elapsed
        return times

    def release(self) -> None:
        release(self._context, self.buffer)
