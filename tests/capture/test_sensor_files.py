"""The sensor of a response file, and what is refused."""

import msgspec
import numpy as np
import pytest

from capture.errors import InputError
from capture.manifest import sensor_record
from capture.sensor_files import SCHEMA, read_sensor
from tests.capture.test_fine_counts import ESTIMATED


def written(path, **changed):
    content = {"schema": SCHEMA, "method": "for people", "sensor": sensor_record(ESTIMATED)}
    path.write_bytes(msgspec.json.encode(content | changed))
    return path


def test_the_sensor_comes_back(tmp_path):
    sensor = read_sensor(written(tmp_path / "response.json"))
    np.testing.assert_array_equal(sensor.response, ESTIMATED.response)
    np.testing.assert_array_equal(sensor.response_deviation, ESTIMATED.response_deviation)
    assert (sensor.white_dn, sensor.saturation, sensor.source) == (255.0, 0.98, "estimated")


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ({"schema": "fishlight-calibration/1"}, "fishlight-calibration/1.*calibrate response"),
        ({"sensor": {"black_dn": 0}}, "white_dn"),
        ({"sensor": {**msgspec.to_builtins(sensor_record(ESTIMATED)), "white_dn": 254}}, "shape"),
    ],
    ids=["schema", "incomplete", "contradiction"],
)
def test_other_files_are_refused_by_name(tmp_path, content, told):
    with pytest.raises(InputError, match=rf"response\.json: .*{told}"):
        read_sensor(written(tmp_path / "response.json", **content))


def test_what_is_no_json_is_refused(tmp_path):
    (tmp_path / "response.json").write_bytes(b"\xff[")
    with pytest.raises(InputError, match=r"response\.json"):
        read_sensor(tmp_path / "response.json")
    with pytest.raises(InputError, match="no such file"):
        read_sensor(tmp_path / "missing.json")
