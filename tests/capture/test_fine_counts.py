"""Finer counts say what the counts said that they are made of."""

import numpy as np
import pytest

from capture.fine_counts import encode, fine_counts, fine_sensor
from capture.sensor import Sensor
from tests.capture.simulated_bracket import LINEAR_16_BIT, SRGB_8_BIT

ESTIMATED = Sensor(
    0.0,
    255.0,
    response=np.linspace(0, 1, 256)[:, None] ** np.array([1.8, 2.0, 2.2]),
    response_deviation=np.full((256, 3), 0.003),
    source="estimated",
)
LINEAR_12_BIT = Sensor(black_dn=256.0, white_dn=4095.0, source="linear 12 bit")
SENSORS = (SRGB_8_BIT, ESTIMATED, LINEAR_12_BIT, LINEAR_16_BIT)

each_sensor = pytest.mark.parametrize("sensor", SENSORS, ids=lambda sensor: sensor.source)


def all_counts(sensor):
    white_dn = int(sensor.white_dn)
    counts = np.arange(white_dn + 1, dtype=np.uint8 if white_dn < 256 else np.uint16)
    return np.repeat(counts[:, None, None], 3, axis=2)


@each_sensor
@pytest.mark.parametrize("gain", [1.0, 8.0])
def test_a_count_keeps_its_value_and_its_variance(sensor, gain):
    old = all_counts(sensor)
    fine, new = fine_sensor(sensor), fine_counts(old, sensor)
    channel = np.arange(3)
    np.testing.assert_array_equal(
        fine.linear_table()[new, channel], sensor.linear_table()[old, channel]
    )
    # The finer step's own variance comes on top: as much again at 16 bits, where no room is left.
    before = sensor.variance_table(gain)[old, channel]
    after = fine.variance_table(gain)[new, channel]
    assert (after >= before * (1 - 1e-6)).all()
    assert (after <= before + sensor.step_variance_table()[old, channel] + 1e-12).all()
    if sensor is not LINEAR_16_BIT:
        np.testing.assert_allclose(after, before, rtol=0.005)


@each_sensor
def test_values_between_counts_come_back_within_half_a_finer_step(sensor):
    fine = fine_sensor(sensor)
    lowest = float(fine.linear_table()[0].max())
    values = np.linspace(lowest, 1, 50_000, dtype=np.float32)
    values = np.repeat(values[:, None, None], 3, axis=2)
    counts = encode(values, fine)
    table = fine.linear_table()
    step = np.gradient(table[: int(fine.white_dn) + 1], axis=0)
    off = np.abs(table[counts, np.arange(3)] - values)
    assert (off <= 0.6 * step[counts, np.arange(3)] + 1e-7).all()


def test_values_outside_are_the_ends():
    fine = fine_sensor(LINEAR_12_BIT)
    ends = np.array([[[-5.0] * 3, [7.0] * 3]], np.float32)
    np.testing.assert_array_equal(encode(ends, fine)[0, :, 0], [0, fine.white_dn])


def test_counts_above_white_are_white():
    above = np.full((1, 1, 3), 5000, np.uint16)
    fine = fine_sensor(LINEAR_12_BIT)
    assert (fine_counts(above, LINEAR_12_BIT) == int(fine.white_dn)).all()
