"""The OpenGL context: what it says where there is none."""

import moderngl
import pytest

from render.opengl.context import (
    REMEDY,
    GlUnavailable,
    create_context,
    describe,
    draw_in_context,
)


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


def spoil(context):
    """Leave the error of a call that OpenGL does not know."""
    context.enable_direct(0x1234)


@pytest.mark.gl
def test_what_a_lost_context_took_is_drawn_once_more_in_another():
    contexts = []

    def draw(context):
        contexts.append(context)
        if len(contexts) == 1:
            spoil(context)
        return len(contexts)

    assert draw_in_context(draw) == 2
    assert contexts[0] is not contexts[1]

    def fail_once(context):
        contexts.append(context)
        if len(contexts) == 3:
            raise moderngl.Error("cannot create program")
        return len(contexts)

    assert draw_in_context(fail_once) == 4
    assert draw_in_context(fail_once) == 5  # a context that is well is kept to


@pytest.mark.gl
def test_two_lost_contexts_are_no_opengl_and_a_defect_stays_one():
    with pytest.raises(GlUnavailable, match="GL_INVALID_ENUM"):
        draw_in_context(spoil)
    with pytest.raises(moderngl.Error):
        draw_in_context(lambda context: context.program(vertex_shader="nonsense"))
