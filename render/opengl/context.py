"""The OpenGL context, made without a window.

Output : one moderngl context per process, on EGL.    Cost : 60–160 ms, up to 1 s the first time.
Fails  : without EGL or a driver, with the line that installs both. A machine without a GPU draws
         with Mesa's llvmpipe, which gives the same bits on every run.
"""

import importlib.resources
from collections.abc import Callable
from typing import Any, TypeVar

import moderngl
import numpy as np

from capture.errors import FishlightError

REMEDY = "apt-get install -y --no-install-recommends libegl1 libgl1-mesa-dri libgl1"

# The second pair are the names of a system that has libopengl0 in place of libgl1.
_SETTINGS: tuple[dict[str, Any], ...] = (
    {"backend": "egl"},
    {"backend": "egl", "libgl": "libOpenGL.so.0", "libegl": "libEGL.so.1"},
)
NO_ERROR = "GL_NO_ERROR"
_SOFTWARE_NAMES = ("llvmpipe", "softpipe", "swrast")

Drawn = TypeVar("Drawn")


class GlUnavailable(FishlightError):
    """No OpenGL 3.3 context can be made on this machine."""


def create_context() -> moderngl.Context:
    """Return an OpenGL 3.3 core context without a window, current in this thread.

    Raises
    ------
    GlUnavailable
        If EGL or a driver is missing.
    """
    failures = []
    for settings in _SETTINGS:
        try:
            context = moderngl.create_context(require=330, standalone=True, **settings)
        except Exception as error:  # glcontext raises bare Exception
            failures.append(str(error))
        else:
            context.gc_mode = "auto"
            return context
    raise GlUnavailable(f"OpenGL is not available ({'; '.join(failures)}). Install it: {REMEDY}")


def draw_in_context(draw: Callable[[moderngl.Context], Drawn]) -> Drawn:
    """Return what `draw` makes in a new context; if that is lost meanwhile, once more in another.

    A driver that is restarted, or out of memory, takes with it what was drawn; `draw` has all it
    needs outside of OpenGL.

    Raises
    ------
    GlUnavailable
        If there is no context, or two are lost.
    """
    try:
        with create_context() as context:
            drawn = draw(context)
            if context.error == NO_ERROR:
                return drawn
    except moderngl.Error:  # nothing can be made in a lost context; any other cause comes again
        pass
    with create_context() as context:
        drawn = draw(context)
        if (error := context.error) == NO_ERROR:
            return drawn
    raise GlUnavailable(f"OpenGL failed twice while it drew ({error})")


def is_software(context: moderngl.Context) -> bool:
    """Whether the processor draws: slower, but bit for bit the same on every run."""
    renderer = context.info["GL_RENDERER"].lower()
    return any(name in renderer for name in _SOFTWARE_NAMES)


def describe(context: moderngl.Context) -> str:
    """Return renderer and version of the context in one line."""
    kind = "software" if is_software(context) else "hardware"
    return f"{context.info['GL_RENDERER']}, OpenGL {context.info['GL_VERSION']} ({kind})"


def release(context: moderngl.Context, *items: Any) -> None:
    """Free GL objects; None is passed over.

    No framebuffer stays bound: moderngl binds the previous one again after making another, which
    fails if it is gone.
    """
    context.detect_framebuffer(0).use()
    for item in items:
        if item is not None:
            item.release()


def load_program(
    context: moderngl.Context, vertex: str, *fragment: str, **constants: int
) -> moderngl.Program:
    """Return the program made of files of render/opengl/shaders, `fragment` one after the other.

    `constants` become #defines in both shaders, which lets the compiler unroll loops.
    """
    folder = importlib.resources.files("render.opengl.shaders")
    defines = "".join(f"#define {name} {value}\n" for name, value in constants.items())
    vertex_source, fragment_source = (
        "#version 330 core\n"
        + defines
        + "".join((folder / name).read_text(encoding="utf-8") for name in names)
        for names in ((vertex,), fragment)
    )
    return context.program(vertex_shader=vertex_source, fragment_shader=fragment_source)


def set_uniforms(program: moderngl.Program, **values: Any) -> None:
    """Set uniforms by name; arrays are sent as float32 in the order of their memory.

    A matrix (n, n) is thus given by its columns: `M.T` where the shader multiplies M with a column
    vector.
    """
    for name, value in values.items():
        uniform: Any = program[name]
        if isinstance(value, np.ndarray):
            uniform.write(value.astype(np.float32).tobytes())
        else:
            uniform.value = value
