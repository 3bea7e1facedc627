"""The uncertainty of an estimated response: kept with the sensor, and felt by the merge."""

from dataclasses import replace

import numpy as np
import pytest

from capture.errors import InputError
from capture.frame import Bracket, Exposure, Frame
from capture.manifest import sensor_of, sensor_record
from capture.merge import merge_bracket
from capture.sensor import Sensor
from tests.capture.simulated_bracket import SRGB_8_BIT


def with_deviation(relative):
    return replace(SRGB_8_BIT, response_deviation=relative * SRGB_8_BIT.response)


def test_the_variance_of_one_exposure_grows_by_that_of_its_value():
    frame = Frame(np.full((4, 4, 3), 120, np.uint8), Exposure(0.5))
    known = merge_bracket(Bracket((frame,)), SRGB_8_BIT)
    estimated = merge_bracket(Bracket((frame,)), with_deviation(0.1))
    added = (0.1 * known.radiance) ** 2
    assert np.allclose(estimated.variance, known.variance + added, rtol=1e-5)
    assert np.array_equal(estimated.radiance, known.radiance)


def test_a_doubtful_part_of_the_curve_counts_less():
    frames = (
        Frame(np.full((1, 1, 3), 60, np.uint8), Exposure(1.0)),
        Frame(np.full((1, 1, 3), 200, np.uint8), Exposure(8.0), index=1),
    )
    deviation = np.zeros((256, 3))
    deviation[190:210] = 0.2
    bracket = Bracket(frames)
    doubted = merge_bracket(bracket, replace(SRGB_8_BIT, response_deviation=deviation)).radiance
    believed = merge_bracket(bracket, SRGB_8_BIT).radiance
    dark = SRGB_8_BIT.response[60, 0]
    assert (np.abs(doubted - dark) < np.abs(believed - dark)).all()


def test_the_manifest_keeps_it():
    sensor = with_deviation(0.03)
    assert np.array_equal(
        sensor_of(sensor_record(sensor)).response_deviation, sensor.response_deviation
    )
    assert sensor_of(sensor_record(SRGB_8_BIT)).response_deviation is None


@pytest.mark.parametrize(
    ("deviation", "message"),
    [
        (np.full((256, 3), -0.1), "from 0 to 1"),
        (np.full((256, 3), 1.1), "from 0 to 1"),
        (np.full((256, 3), np.nan), "from 0 to 1"),
        (np.zeros((255, 3)), "shape"),
    ],
)
def test_a_deviation_that_cannot_be_is_refused(deviation, message):
    with pytest.raises(ValueError, match=message):
        replace(SRGB_8_BIT, response_deviation=deviation)


def test_a_linear_sensor_has_none_and_a_manifest_that_says_so_is_refused():
    with pytest.raises(ValueError, match="linear response"):
        Sensor(0.0, 255.0, response_deviation=np.zeros((256, 3)))
    record = sensor_record(with_deviation(0.03))
    shortened = type(record)(
        **{name: getattr(record, name) for name in record.__struct_fields__}
        | {"response_deviation": [(0.0, 0.0, 0.0)]}
    )
    with pytest.raises(InputError, match="the sensor cannot be used: response_deviation"):
        sensor_of(shortened)
