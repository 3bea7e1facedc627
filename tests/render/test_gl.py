"""The OpenGL context: what it says where there is none."""

import moderngl
import pytest

from render.opengl.context import REMEDY, GlUnavailable, create_context, describe


def test_without_egl_the_message_holds_the_remedy(monkeypatch):
    def fail(**settings):
        raise Exception("libEGL.so not loaded")

    monkeypatch.setattr(moderngl, "create_context", fail)
    with pytest.raises(GlUnavailable) as failure:
        create_context()
    message = str(failure.value)
    assert "libEGL.so not loaded" in message
    assert REMEDY in message
    assert "\n" not in message


def test_the_second_pair_of_library_names_is_tried(monkeypatch):
    tried = []

    class Context:
        gc_mode = None

    def fail_once(**settings):
        tried.append(settings)
        if len(tried) == 1:
            raise Exception("libGL.so not loaded")
        return Context()

    monkeypatch.setattr(moderngl, "create_context", fail_once)
    assert isinstance(create_context(), Context)
    assert tried[1]["libgl"] == "libOpenGL.so.0"


@pytest.mark.gl
def test_the_description_names_renderer_and_version(ctx):
    text = describe(ctx)
    assert ctx.info["GL_RENDERER"] in text
    assert "OpenGL" in text
    assert "\n" not in text
