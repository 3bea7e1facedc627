"""lights.json: a round trip loses no bit, and what cannot be meant is refused with its place."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.errors import InputError
from lighting.light_files import read_lights, write_lights
from lighting.light_set import LightSet
from lighting.reduce import reduce_to_lights
from lighting.sphere.harmonics import windowed
from tests.environments import constant, outdoors

LIGHT_KEYS = {"direction", "irradiance", "angular_radius_rad", "is_key", "shadow_map_px"}
LIGHT = {"direction": [0, 1, 0], "irradiance": [1, 2, 3], "angular_radius_rad": 0.5}


def write_json(path, **fields):
    path.write_text(json.dumps({"schema": "fishlight-lights/1", "lights": [LIGHT], **fields}))
    return path


@settings(deadline=None, max_examples=30)
@given(
    st.lists(
        st.tuples(
            st.floats(-1, 1),
            st.floats(-np.pi, np.pi),
            *[st.floats(0, 1e300)] * 3,
            st.floats(0, np.pi),
            st.booleans(),
        ),
        max_size=5,
    ),
    st.floats(-1e12, 1e12),
    st.floats(0, 1),
    st.text(),
    st.none() | st.floats(0, 1e300),
)
def test_what_is_written_is_read_back_bit_for_bit(
    tmp_path_factory, rows, timestamp_s, clipped_fraction, source, error
):
    table = np.array(rows).reshape(-1, 7)
    y, phi = table[:, 0], table[:, 1]
    level = np.sqrt(1 - y * y)
    lights = LightSet(
        np.stack([level * np.sin(phi), y, level * np.cos(phi)], axis=-1),
        table[:, 2:5],
        table[:, 5],
        timestamp_s=timestamp_s,
        clipped_fraction=clipped_fraction,
        scale="cd/m²",
        source=source,
        is_key=table[:, 6] == 1,
        fill=windowed(np.random.default_rng(len(rows)).uniform(0, 1, (9, 3))) * (len(rows) % 2),
        predicted_error=error,
        block_rows=len(rows) or None,
    )
    path = tmp_path_factory.mktemp("lights") / "lights.json"
    write_lights(path, lights)
    again = read_lights(path)
    for name in ("directions", "irradiance", "angular_radius_rad", "is_key", "fill"):
        np.testing.assert_array_equal(getattr(again, name), getattr(lights, name))
    for name in (
        "timestamp_s",
        "clipped_fraction",
        "scale",
        "source",
        "predicted_error",
        "block_rows",
    ):
        assert getattr(again, name) == getattr(lights, name)


def test_the_file_says_what_its_numbers_mean(tmp_path):
    path = tmp_path / "lights.json"
    write_lights(path, reduce_to_lights(constant(), 3, "cells", source="map.exr", timestamp_s=1.5))
    content = json.loads(path.read_text())
    assert content["schema"] == "fishlight-lights/1"
    assert content["coordinate_frame"].startswith("world: right-handed, +Y up")
    assert content["colour_space"] == "linear Rec.709"
    assert content["scale"] == "relative"
    assert content["source"] == "map.exr: 3 lights by cells"
    assert content["timestamp_s"] == 1.5
    assert content["clipped_fraction"] == 0
    assert [set(light) for light in content["lights"]] == [LIGHT_KEYS] * 3


def test_the_file_has_a_light_a_line(tmp_path):
    path = tmp_path / "lights.json"
    write_lights(path, reduce_to_lights(outdoors(8), 5, "cells"))
    lines = path.read_text().splitlines()
    assert sum('"direction"' in line for line in lines) == 5


def test_a_map_without_light_is_a_file_without_lights(tmp_path):
    path = tmp_path / "lights.json"
    write_lights(path, LightSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0)))
    assert json.loads(path.read_text())["lights"] == []
    assert len(read_lights(path)) == 0


def test_an_existing_file_stays_unless_forced(tmp_path):
    path = write_json(tmp_path / "lights.json")
    before = path.read_text()
    lights = reduce_to_lights(constant(), 3, "cells")
    with pytest.raises(InputError, match="--force"):
        write_lights(path, lights)
    assert path.read_text() == before
    write_lights(path, lights, force=True)
    assert len(read_lights(path)) == 3


def test_lights_alone_are_enough_for_a_file_written_by_hand(tmp_path):
    path = tmp_path / "lights.json"
    path.write_text('{"lights": [{"direction": [0, 0, 1], "irradiance": [1, 1, 1]}]}')
    lights = read_lights(path)
    np.testing.assert_array_equal(lights.directions, [[0, 0, 1]])
    assert lights.angular_radius_rad[0] == 0


def test_keys_of_a_later_version_are_ignored(tmp_path):
    path = write_json(tmp_path / "a.json", schema="fishlight-lights/1.4", glare=[1, 2])
    assert len(read_lights(path)) == 1


@pytest.mark.parametrize("frame", ["world", "world: right-handed, +Y up, metres"])
def test_a_shorter_name_of_the_world_is_understood(tmp_path, frame):
    assert len(read_lights(write_json(tmp_path / "a.json", coordinate_frame=frame))) == 1


def test_a_direction_rounded_to_four_digits_is_brought_to_unit_length(tmp_path):
    light = LIGHT | {"direction": [0.5774, 0.5774, 0.5774]}
    lights = read_lights(write_json(tmp_path / "a.json", lights=[light]))
    np.testing.assert_allclose(lights.directions, 3**-0.5, rtol=1e-15)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"schema": "fishlight-lights/2"}, "fishlight-lights/1.*'fishlight-lights/2'"),
        ({"schema": "fishlight-lights"}, "schema must be"),
        ({"schema": "other/1"}, "schema must be"),
        ({"coordinate_frame": "right-handed, +Z up"}, "coordinate_frame.*Z up"),
        ({"coordinate_frame": ""}, "coordinate_frame"),
        ({"colour_space": "sRGB"}, "colour_space.*'sRGB'"),
        ({"clipped_fraction": 1.5}, "clipped_fraction"),
        ({"lights": {}}, "lights"),
        ({"lights": [LIGHT, LIGHT | {"direction": [0, 2, 0]}]}, "light 1 .*length is 2"),
        ({"lights": [LIGHT, LIGHT | {"direction": [0, 0, 0]}]}, "light 1 .*length is 0"),
        ({"lights": [LIGHT, LIGHT | {"direction": [1.5e308] * 3}]}, "light 1 .*length is inf"),
        ({"lights": [LIGHT, LIGHT | {"direction": [1, 0]}]}, r"lights\[1\].direction"),
        ({"lights": [LIGHT, LIGHT | {"direction": ["1", 0, 0]}]}, r"lights\[1\].direction\[0\]"),
        (
            {"lights": [LIGHT, LIGHT | {"irradiance": [1, -1, 0]}]},
            r">= 0.*lights\[1\].irradiance\[1\]",
        ),
        ({"lights": [LIGHT, LIGHT | {"irradiance": [1, None, 0]}]}, "irradiance"),
        ({"lights": [LIGHT, LIGHT | {"irradiance": [1, float("nan"), 0]}]}, "not a lights.json"),
        ({"lights": [LIGHT, LIGHT | {"irradiance": [1, float("inf"), 0]}]}, "not a lights.json"),
        ({"lights": [LIGHT | {"angular_radius_rad": -0.1}]}, "angular_radius_rad"),
        ({"lights": [LIGHT | {"angular_radius_rad": 4}]}, "angular_radius_rad"),
        ({"lights": [{"direction": [0, 1, 0]}]}, "irradiance"),
        ({"fill": [[1, 1, 1]] * 8}, "9 coefficients, got 8"),
        ({"fill": [[1, 1]] * 9}, "fill"),
        ({"fill": [[0, 0, 0], *[[1, 1, 1]] * 8]}, "at least 0 in every direction"),
        ({"predicted_error": -1}, "predicted_error"),
        ({"scale": "cd\u001b[2J"}, "its scale is .*wanted a unit"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path, fields, message):
    path = write_json(tmp_path / "lights.json", **fields)
    with pytest.raises(InputError, match=message) as caught:
        read_lights(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "content",
    [
        b"{",
        b"[]",
        b'{"lights": [1e999]}',
        b"\xff\xfe",
        b'{"source": "\xff"}',
        b'{"unknown": ' + b"[" * 9999,
    ],
)
def test_what_is_no_json_object_is_refused(tmp_path, content):
    path = tmp_path / "lights.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match="is not a lights"):
        read_lights(path)


def test_a_number_beyond_float64_is_refused(tmp_path):
    path = tmp_path / "lights.json"
    path.write_text('{"lights": [{"direction": [0, 0, 1], "irradiance": [1e999, 1, 1]}]}')
    with pytest.raises(InputError, match="is not a lights"):
        read_lights(path)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match=r"gone\.json: no such file"):
        read_lights(tmp_path / "gone.json")


def test_an_empty_file_is_named(tmp_path):
    (tmp_path / "lights.json").touch()
    with pytest.raises(InputError, match=r"lights\.json: the file is empty"):
        read_lights(tmp_path / "lights.json")


def test_a_point_is_worth_a_larger_shadow_map_than_a_wide_light():
    lights = LightSet(np.tile([0.0, 1, 0], (4, 1)), np.ones((4, 3)), np.array([0, 0.005, 0.1, 1.5]))
    np.testing.assert_array_equal(lights.shadow_map_px, [2048, 1024, 64, 64])


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_the_order_of_a_fill_is_its_highest_degree(degree):
    fill = np.zeros((9, 3))
    fill[0] = 1
    fill[degree * degree, 1] = 0.1 if degree else 1
    lights = LightSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), fill=fill)
    assert lights.fill_order == degree
    np.testing.assert_allclose(lights.integral(), np.sqrt(4 * np.pi) * fill[0])


def test_a_set_without_fill_has_no_order():
    assert reduce_to_lights(constant(), 3, "cells").fill_order is None


def test_a_giant_is_refused_unread(tmp_path, monkeypatch):
    path = tmp_path / "giant.json"
    path.touch()
    os.truncate(path, 2**26 + 1)  # takes no place on the disk
    monkeypatch.setattr(Path, "read_bytes", None)
    with pytest.raises(InputError, match=r"giant\.json: .* more than"):
        read_lights(path)
