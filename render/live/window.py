"""The rendered picture of a session in a window of this desktop.

Input  : what the desk publishes.    Output : the newest picture, as large as the window lets it be;
         the window's title says how the session is. Closing it, or Escape, ends the session.
Needs  : moderngl-window, which is not installed with the rest, and a display; one thread, on some
         systems the main one.
"""

import os
import sys
from collections.abc import Callable
from threading import Event
from types import TracebackType
from typing import Self

import moderngl
import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from render.live.desk import Desk, LiveFrame
from render.output.view import to_display

_LOOKS_S = 0.05
"""Between two looks after the window's own events, while nothing new is published."""

_TITLE = "fishlight live"

_VERTEX = """
#version 330
out vec2 at;
void main() {
    at = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    gl_Position = vec4(2 * at - 1, 0, 1);
}
"""
_FRAGMENT = """
#version 330
uniform sampler2D picture;
in vec2 at;
out vec4 colour;
void main() { colour = texture(picture, vec2(at.x, 1 - at.y)); }
"""


def has_desktop() -> bool:
    """Whether there is a display to open windows on."""
    return sys.platform == "darwin" or bool(
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )


class PictureWindow:
    """A window; a context manager.

    Parameters
    ----------
    size_px : (int, int)
        Of the window at first.

    Raises
    ------
    InputError
        If moderngl-window is not installed, or no window can be opened.
    """

    def __init__(self, size_px: tuple[int, int]) -> None:
        if not has_desktop():
            raise InputError("--window: there is no display; leave it out and use the page")
        try:
            from moderngl_window.context.pyglet.window import Window

            self._window = Window(title=_TITLE, size=size_px, gl_version=(3, 3), vsync=False)
        except ModuleNotFoundError:
            raise InputError(
                "--window needs moderngl-window; type: pip install moderngl-window"
            ) from None
        except Exception as error:  # pyglet's are of many kinds, by system, some when imported
            reason = str(error) or type(error).__name__
            raise InputError(f"--window: no window can be opened ({reason})") from error
        self._context = self._window.ctx
        program = self._context.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
        self._quad = self._context.vertex_array(program, [])
        self._texture: moderngl.Texture | None = None
        self._shown = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._window.destroy()

    def show(self, desk: Desk, is_over: Callable[[], bool]) -> None:
        """Show what is published until `is_over` says so or the window is closed."""
        news = Event()
        desk.listen(news.set)
        desk.begin_watching()
        try:
            while not self._window.is_closing and not is_over():
                moment = desk.newest
                if moment is not None and moment.number != self._shown:
                    self._take(moment)
                self._draw()
                news.wait(_LOOKS_S)
                news.clear()
        finally:
            desk.end_watching()

    def _take(self, moment: LiveFrame) -> None:
        state = moment.state
        self._shown = moment.number
        self._window.title = " · ".join(filter(None, (_TITLE, state.name, state.message)))
        if moment.seen is not None and moment.seen.picture is not None:
            self._load(to_display(moment.seen.picture, moment.seen.view_ev))

    def _load(self, picture: NDArray[np.uint8]) -> None:
        size_px = picture.shape[1], picture.shape[0]
        if self._texture is None or self._texture.size != size_px:
            if self._texture is not None:
                self._texture.release()
            self._texture = self._context.texture(size_px, 3, alignment=1)
        self._texture.write(np.ascontiguousarray(picture), alignment=1)

    def _draw(self) -> None:
        self._context.screen.use()
        self._context.viewport = 0, 0, *self._window.buffer_size
        self._context.clear()
        if self._texture is not None:
            self._context.viewport = _fitted(self._texture.size, self._window.buffer_size)
            self._texture.use()
            self._quad.render(moderngl.TRIANGLE_STRIP, vertices=4)
        self._window.swap_buffers()  # and looks after the window's events


def _fitted(size_px: tuple[int, int], window_px: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return where a picture goes in a window: all of it, in the middle, in its own proportions."""
    scale = min(window_px[0] / size_px[0], window_px[1] / size_px[1])
    width, height = round(scale * size_px[0]), round(scale * size_px[1])
    return (window_px[0] - width) // 2, (window_px[1] - height) // 2, width, height
