"""A guest for tests: without one they skip, or fail where FISHLIGHT_REQUIRE_GUEST is set (CI)."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.camera.guest import run_in_guest
from tests.camera.unavailable import GuestUnavailable

LIMIT_S = 240


def run_schedule(name: str, share: Path, modules: Sequence[str]) -> None:
    """Run a module of this folder in a guest; its argument is the folder that is shared."""
    command = [sys.executable, "-m", f"tests.camera.{name}", str(share)]
    try:
        done = run_in_guest(command, share=share, modules=modules, limit_s=LIMIT_S)
    except GuestUnavailable as error:
        if os.environ.get("FISHLIGHT_REQUIRE_GUEST"):
            pytest.fail(f"FISHLIGHT_REQUIRE_GUEST is set, but there is no guest: {error}")
        pytest.skip(f"no guest: {error}")
    assert done.status == 0, done.output
