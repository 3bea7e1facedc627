"""What tests of every stage may ask for: `ctx`, the OpenGL context of this process."""

import os

# As the command does, before numpy is loaded: threads that wait sleep, and leave their core to the
# other test process.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import settings

from capture.kernel_cache import drop_stale_kernels

drop_stale_kernels()

settings.register_profile("fuzz", max_examples=20_000, deadline=5000)


@pytest.fixture(scope="session")
def _context() -> Iterator[Any]:
    # Without EGL this fails, with the line that installs it; deselect with -m "not gl".
    from render.opengl.context import create_context

    with create_context() as context:
        yield context


@pytest.fixture
def ctx(_context: Any) -> Iterator[Any]:
    """Return the context, in which neither an earlier test nor this one has left an error."""
    with _context:  # current again, whatever context a command has made meanwhile
        assert _context.error == "GL_NO_ERROR"
        yield _context
        assert _context.error == "GL_NO_ERROR"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests that wait for a guest first: other processes test while it boots and runs."""
    items.sort(key=lambda item: item.get_closest_marker("camera") is None)
