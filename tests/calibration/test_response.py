"""The response of our own method: its uncertainty, its robustness, its refusals, its use."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.response import estimate_response, sensor_with
from calibration.response_family import curve_family
from calibration.response_monotone import fit_monotone
from calibration.response_samples import MOST_COUNT, sample_brackets
from capture.errors import InputError
from capture.frame import Bracket, Exposure, Frame
from capture.manifest import sensor_of, sensor_record
from capture.merge import merge_bracket
from capture.sensor import Sensor, assumed_sensor
from tests.calibration.response_scenes import (
    CURVES,
    bracket,
    error_ev,
    exposures,
    relabelled,
    scene,
)


@pytest.mark.slow
def test_the_deviation_covers_the_true_curve_as_often_as_it_says():
    inside, total = 0, 0
    for seed in range(2):
        for name in CURVES:
            curve = fit_monotone(sample_brackets([bracket(name, seed)]))
            counts = slice(16, 249, 8)
            deviation_ev = curve.deviation[counts] / curve.values[counts] / np.log(2)
            known = deviation_ev > 0  # not at the middle, which holds the scale
            inside += np.sum(
                np.abs(error_ev(curve, name, counts))[known] <= 1.96 * deviation_ev[known]
            )
            total += np.sum(known)
    assert 0.9 <= inside / total <= 1.0


def test_fewer_patches_are_less_certain():
    samples = sample_brackets([bracket("film")])
    few = samples.subset(np.arange(len(samples)) % 16 == 0)
    ratio = fit_monotone(few).deviation[64] / fit_monotone(samples).deviation[64]
    assert (ratio > 1.3).all()


def test_what_moved_does_not_bend_the_curve():
    still = bracket("film")
    frames = list(still.frames)
    counts = frames[2].counts.copy()
    counts[:64, :96] = counts[128:192, 96:192]  # 9 % of the picture shows something else
    frames[2] = replace(frames[2], counts=counts)
    error = error_ev(fit_monotone(sample_brackets([Bracket(tuple(frames))])), "film")
    assert np.sqrt(np.mean(error**2)) < 0.01


def test_a_camera_that_moved_by_a_pixel_does_not_bend_the_curve():
    frames = [
        replace(frame, counts=np.roll(frame.counts, k % 2, axis=1))
        for k, frame in enumerate(bracket("film").frames)
    ]
    error = error_ev(fit_monotone(sample_brackets([Bracket(tuple(frames))])), "film")
    assert np.sqrt(np.mean(error**2)) < 0.01


def test_a_tolerance_finds_the_wrong_label_and_none_believes_it():
    wrong = relabelled(bracket("film"), [0.0, 0.0, 0.06, 0.0, 0.0])
    free = estimate_response([wrong], exposure_tolerance_ev=0.05)
    believed = estimate_response([wrong])
    correction = free.curve.correction_ev
    assert correction[2] - np.delete(correction, 2).mean() == pytest.approx(-0.06, abs=0.01)
    assert not believed.curve.correction_ev.any()
    assert free.held_out_ev < 0.7 * believed.held_out_ev


def test_corrections_stay_within_two_tolerances():
    wrong = relabelled(bracket("film"), [0.0, 0.0, 0.5, 0.0, 0.0])
    free = estimate_response([wrong], exposure_tolerance_ev=0.05)
    assert np.abs(free.curve.correction_ev).max() <= 0.1 + 1e-6


def test_a_tolerance_widens_the_deviation_by_what_the_trend_may_be_off():
    samples = sample_brackets([bracket("gamma")])
    curve = fit_monotone(replace(samples, tolerance=0.05 * np.log(2)))
    # Five exposures 2 EV apart: the trend is known to 0.05 / √40 of itself.
    by_trend = 0.05 / np.sqrt(40) * np.abs(np.log(curve.values[32] / curve.values[128]))
    assert (curve.deviation[32] / curve.values[32] >= 0.99 * by_trend).all()


def test_merging_with_the_estimated_response_comes_close_to_the_known_one():
    radiance = scene(3)
    recorded = bracket("film", 3, radiance)
    sensor = sensor_with(assumed_sensor(np.uint8), estimate_response([recorded]))
    image = merge_bracket(recorded, sensor)
    seen = (radiance * recorded.frames[-1].exposure.signal > 0.02) & ~image.clipped[..., None]
    ratio = image.radiance / radiance
    scale = np.exp(np.median(np.log(ratio[seen])))
    assert np.sqrt(np.mean(np.log2(ratio[seen] / scale) ** 2)) < 0.02
    deviations = (image.radiance / scale - radiance) / (np.sqrt(image.variance) / scale)
    assert 0.92 <= np.mean(np.abs(deviations[seen]) < 1.96) <= 0.98


def test_the_sensor_ends_where_the_patches_did_and_says_where_it_came_from():
    response = estimate_response([bracket("gamma")])
    sensor = sensor_with(Sensor(16.0, 235.0), response)  # of which a curve takes nothing over
    assert (sensor.black_dn, sensor.white_dn) == (0.0, 255.0)
    assert sensor.saturation == response.curve.values[MOST_COUNT].min()
    assert sensor.source.startswith(f"response estimated (monotone, {response.patch_count} patches")
    read_back = sensor_of(sensor_record(sensor))
    assert np.array_equal(read_back.response, response.curve.values)
    assert np.array_equal(read_back.response_deviation, response.curve.deviation)


def test_every_plausible_curve_rises():
    mean, components = curve_family()
    assert (np.diff(mean) > 0).all()
    assert (np.linalg.norm(components, axis=0) >= 0.02 - 1e-12).all()
    assert np.abs(components[128]).max() < 1e-9  # all agree where the scale is held


def flat_scene():
    return np.full((256, 256, 3), 0.1)


def rough_scene():
    return np.random.default_rng(0).uniform(0.001, 1, (256, 256, 3))


@pytest.mark.parametrize(
    ("recorded", "message"),
    [
        (lambda: bracket("srgb", times=exposures(1)), "two or more different exposures"),
        (lambda: bracket("srgb", times=exposures(3, 0.05)), "two or more different exposures"),
        (lambda: bracket("srgb", times=exposures(3, 4.0)), "4.0 EV apart or more"),
        (lambda: bracket("srgb", radiance=flat_scene()), "only 64 smooth patches"),
        (lambda: bracket("srgb", radiance=rough_scene()), "smooth patches"),
        (lambda: bracket("srgb", radiance=scene() * 1e-4), "red counts from .* too flat"),
    ],
)
def test_brackets_that_do_not_determine_a_response_are_refused(recorded, message):
    with pytest.raises(InputError, match=message):
        estimate_response([recorded()])


def test_linear_counts_unknown_methods_and_wild_tolerances_are_refused():
    counts = np.zeros((16, 16, 3), np.uint16)
    linear = Bracket((Frame(counts, Exposure(1.0)), Frame(counts, Exposure(4.0), index=1)))
    with pytest.raises(InputError, match="8-bit counts, got uint16"):
        estimate_response([linear])
    with pytest.raises(InputError, match="must be one of monotone"):
        estimate_response([linear], "guess")
    with pytest.raises(InputError, match="from 0 to 1 EV, got -1"):
        estimate_response([linear], exposure_tolerance_ev=-1)
