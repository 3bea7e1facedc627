"""What lights remember, written and read: the next frames' lights are the same to the bit."""

from dataclasses import replace

import numpy as np
import pytest

from capture.errors import InputError
from lighting.maps.environment import EnvironmentMap
from lighting.stream.light_stream import LightPlan, next_lights
from render.batch.light_memory import read_memory, write_memory
from tests.environments import outdoors

MAP = outdoors(32)
PLANS = (
    LightPlan(12),
    LightPlan(48, error=0.1),
    LightPlan(12, is_steady=False),
    LightPlan(12, "median-cut"),
)


def turned(cells: int) -> EnvironmentMap:
    return replace(MAP, radiance=np.roll(MAP.radiance, cells, axis=1))


@pytest.mark.parametrize("plan", PLANS, ids=["default", "error", "not steady", "median-cut"])
def test_lights_go_on_from_a_file_as_if_there_had_been_none(tmp_path, plan):
    memory = None
    for frame in range(5):
        _, memory = next_lights(turned(3 * frame), plan, memory, timestamp_s=frame / 10)
    write_memory(tmp_path / "memory", memory)
    read = read_memory(tmp_path / "memory")
    for frame in range(5, 10):
        view = turned(3 * frame)
        expected, memory = next_lights(view, plan, memory, timestamp_s=frame / 10)
        lights, read = next_lights(view, plan, read, timestamp_s=frame / 10)
        for name in ("directions", "irradiance", "angular_radius_rad", "is_key", "fill"):
            np.testing.assert_array_equal(getattr(lights, name), getattr(expected, name))
        assert lights.predicted_error == expected.predicted_error


def test_no_memory_is_one_too_and_what_is_none_is_refused(tmp_path):
    write_memory(tmp_path / "memory", None)
    assert read_memory(tmp_path / "memory") is None
    (tmp_path / "memory").write_bytes(b"\x93abc")
    with pytest.raises(InputError, match="no memory of lights"):
        read_memory(tmp_path / "memory")
