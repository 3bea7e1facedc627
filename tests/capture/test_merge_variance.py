"""The variance that the merge states, against the spread of noisy repeats of known radiance."""

import numpy as np
import pytest

from capture.frame import Exposure
from capture.merge import merge_bracket
from capture.sensor import Sensor
from tests.capture.simulated_bracket import LINEAR_16_BIT, SRGB_8_BIT, record

LINEAR_12_BIT = Sensor(black_dn=256.0, white_dn=4095.0, source="linear 12 bit")
GAMMAS_8_BIT = Sensor(
    0.0,
    255.0,
    response=np.linspace(0, 1, 256)[:, None] ** np.array([1.8, 2.2, 2.9]),
    source="three gammas, 8 bit",
)
SENSORS = (SRGB_8_BIT, GAMMAS_8_BIT, LINEAR_12_BIT, LINEAR_16_BIT)
WIDE_S = [1 / 64, 1 / 8, 1.0]
REPEATS = 2000

each_sensor = pytest.mark.parametrize("sensor", SENSORS, ids=lambda sensor: sensor.source)


def spread(levels, times_s, gain, sensor):
    """Return mean squared error over mean stated variance of each level, and σ over the level.

    Levels vary by 4 % from repeat to repeat, so that they fall all over a count's step.
    """
    rng = np.random.default_rng(1)
    truth = levels * rng.uniform(0.98, 1.02, (REPEATS, len(levels)))
    truth = np.repeat(truth[..., None], 3, axis=-1)
    exposures = [Exposure(time_s, gain) for time_s in times_s]
    image = merge_bracket(record(truth, exposures, sensor, rng), sensor)
    assert not image.clipped.any()
    error = ((image.radiance - truth) ** 2).mean(axis=(0, 2))
    stated = image.variance.mean(axis=(0, 2), dtype=np.float64)
    return error / stated, np.sqrt(stated) / levels


@each_sensor
@pytest.mark.parametrize(
    ("times_s", "gain"),
    [([1.0], 1.0), ([1 / 4, 1 / 2, 1.0], 1.0), (WIDE_S, 1.0), (WIDE_S, 8.0)],
    ids=["one", "close", "wide", "high gain"],
)
def test_it_is_within_a_tenth_from_the_shadows_to_just_below_white(sensor, times_s, gain):
    # From ten times the read-out's noise above black to five times the photons' noise below what
    # fills the darkest exposure; what fills the others lies between.
    photon_noise = np.sqrt(gain / sensor.full_well_e)
    lowest = 10 * sensor.read_noise_e / sensor.full_well_e
    highest = (sensor.saturation - 5 * photon_noise) / (1.02 * gain * times_s[0])
    ratio, _ = spread(np.geomspace(lowest, highest, 24), times_s, gain, sensor)
    np.testing.assert_allclose(ratio, 1, atol=0.1)


@each_sensor
def test_near_black_it_is_an_upper_bound(sensor):
    # Below 3 σ the cut at 0 takes part of the spread away: all of it below 0 but the mean, so
    # that (1 − 1/π)/2 = 0.34 remain at L = 0.
    levels = np.geomspace(1e-5, 10 * sensor.read_noise_e / sensor.full_well_e, 12)
    ratio, relative = spread(levels, WIDE_S, 1.0, sensor)
    assert (ratio < 1.1).all()
    assert (ratio > 0.34).all()
    np.testing.assert_allclose(ratio[relative < 1 / 3], 1, atol=0.12)
