"""Exposure labels against the pixels: simulated brackets of known truth, then real ones."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from capture.errors import InputError
from capture.exif import read_exif
from capture.exposure_check import exposure_disagreement_ev, exposure_warning
from capture.frame import Bracket, Exposure, Frame
from tests.capture.simulated_bracket import LINEAR_16_BIT, SRGB_8_BIT, record

DATA = Path(__file__).resolve().parents[2].parent / "shared/data"
LUMILAB = DATA / "brackets-lumilab-fisheye/JPEG"
BIGCHOU = DATA / "brackets-bigchou/exp/ex_1"

TIMES_S = (1 / 64, 1 / 8, 1.0)


def recorded(sensor):
    rng = np.random.default_rng(1)
    # Six decades with a smooth distribution, as outdoor scenes have.
    radiance = np.exp(rng.normal(-1.0, 2.0, (80, 120, 3)))
    return record(radiance, [Exposure(time_s) for time_s in TIMES_S], sensor, rng)


def relabelled(bracket, exposures):
    return Bracket(
        tuple(
            Frame(frame.counts, exposure, index=frame.index)
            for frame, exposure in zip(bracket.frames, exposures, strict=True)
        )
    )


@pytest.mark.parametrize("sensor", [SRGB_8_BIT, LINEAR_16_BIT], ids=["sRGB 8 bit", "linear 16 bit"])
def test_right_labels_agree(sensor):
    bracket = recorded(sensor)
    np.testing.assert_allclose(exposure_disagreement_ev(bracket, sensor), 0, atol=0.1)
    assert exposure_warning(bracket, sensor) == ""


@pytest.mark.parametrize("error_ev", [-0.8, 0.4, 0.9])
def test_a_wrong_label_is_measured_in_both_its_pairs(error_ev):
    exposures = [Exposure(time_s) for time_s in TIMES_S]
    exposures[1] = Exposure(TIMES_S[1] * 2**error_ev)
    bracket = relabelled(recorded(LINEAR_16_BIT), exposures)
    disagreement = exposure_disagreement_ev(bracket, LINEAR_16_BIT)
    np.testing.assert_allclose(disagreement, [-error_ev, error_ev], atol=0.1)
    assert "and 3.0 EV by their pixels" in exposure_warning(bracket, LINEAR_16_BIT)


def test_shadows_of_mere_noise_have_no_say():
    rng = np.random.default_rng(4)
    radiance = np.full((80, 120, 3), 1e-5)
    radiance[:10] = rng.uniform(0.05, 0.9, (10, 120, 3))
    for sensor in (SRGB_8_BIT, LINEAR_16_BIT):
        bracket = record(radiance, [Exposure(time_s) for time_s in TIMES_S], sensor, rng)
        np.testing.assert_allclose(exposure_disagreement_ev(bracket, sensor), 0, atol=0.1)


def test_gain_and_aperture_count_as_exposure():
    exposures = [Exposure(1 / 64, 1.0, 2.0), Exposure(1 / 64, 8.0, 2.0), Exposure(1.0, 4.0, 4.0)]
    bracket = relabelled(recorded(LINEAR_16_BIT), exposures)
    np.testing.assert_allclose(exposure_disagreement_ev(bracket, LINEAR_16_BIT), 0, atol=0.1)


@pytest.mark.parametrize("sensor", [SRGB_8_BIT, LINEAR_16_BIT], ids=["sRGB 8 bit", "linear 16 bit"])
def test_swapped_labels_are_refused(sensor):
    swapped = [Exposure(TIMES_S[k]) for k in (1, 0, 2)]
    with pytest.raises(InputError, match=r"frames 1 .* and 0 .* by their pixels"):
        exposure_warning(relabelled(recorded(sensor), swapped), sensor)


def test_a_stop_of_disagreement_is_refused_only_where_the_response_is_known():
    wide = [Exposure(1 / 64), Exposure(1.0), Exposure(64.0)]  # 6 EV by label, 3 by pixels
    with pytest.raises(InputError, match=r"6\.0 EV apart"):
        exposure_warning(relabelled(recorded(LINEAR_16_BIT), wide), LINEAR_16_BIT)
    photographs = relabelled(recorded(SRGB_8_BIT), wide)
    assert "6.0 EV apart" in exposure_warning(photographs, SRGB_8_BIT)
    measured = replace(SRGB_8_BIT, response_deviation=np.zeros((256, 3)), source="measured")
    with pytest.raises(InputError, match=r"6\.0 EV apart.*measured"):
        exposure_warning(photographs, measured)


def test_frames_without_common_pixels_give_no_figure():
    exposures = [Exposure(1e-4), Exposure(10.0)]
    rng = np.random.default_rng(2)
    bracket = record(np.full((20, 20, 3), 0.5), exposures, LINEAR_16_BIT, rng)
    np.testing.assert_array_equal(exposure_disagreement_ev(bracket, LINEAR_16_BIT), [np.nan])
    assert exposure_warning(bracket, LINEAR_16_BIT) == ""
    single = Bracket(bracket.frames[:1])
    assert exposure_disagreement_ev(single, LINEAR_16_BIT).shape == (0,)


def test_float_frames_compare_without_a_sensor_model():
    values = np.random.default_rng(3).uniform(0, 5, (30, 30, 3)).astype(np.float32)
    values[0, :2] = [[np.nan, -1.0, np.inf], [0.0, 0.0, 0.0]]
    bracket = Bracket((Frame(values, Exposure(1.0)), Frame(3 * values, Exposure(2.0))))
    expected = np.log2(3 / 2)
    np.testing.assert_allclose(exposure_disagreement_ev(bracket, SRGB_8_BIT), expected, atol=1e-6)


def photographed(paths):
    frames = []
    for index, path in enumerate(paths):
        exif = read_exif(path)
        counts = cv2.imread(str(path), cv2.IMREAD_REDUCED_COLOR_4)[..., ::-1]
        exposure = Exposure(exif.time_s, exif.gain or 1.0, exif.f_number)
        frames.append(Frame(counts, exposure, index=index))
    return Bracket(tuple(frames))


@pytest.mark.data
@pytest.mark.skipif(not BIGCHOU.is_dir(), reason=f"{BIGCHOU} is not there")
def test_real_bracket_in_third_stops_agrees():
    paths = sorted(path for path in BIGCHOU.iterdir() if path.suffix.lower() in (".jpg", ".jpeg"))
    bracket = photographed(paths)
    assert len(bracket.frames) >= 10
    assert np.abs(exposure_disagreement_ev(bracket, SRGB_8_BIT)).max() < 0.3


@pytest.mark.data
@pytest.mark.skipif(not LUMILAB.is_dir(), reason=f"{LUMILAB} is not there")
def test_real_camera_curve_warns_and_swapped_labels_are_refused():
    # This camera's JPEG curve is not sRGB: mid exposures disagree by about a stop.
    bracket = photographed(sorted(LUMILAB.glob("*.JPG"))[3:6])
    disagreement = exposure_disagreement_ev(bracket, SRGB_8_BIT)
    assert (np.abs(disagreement) < 1.5).all()
    assert (np.abs(disagreement) > 0.3).any()
    assert "assumed sRGB" in exposure_warning(bracket, SRGB_8_BIT)
    exposures = [frame.exposure for frame in bracket.frames]
    with pytest.raises(InputError, match="by their pixels"):
        exposure_warning(relabelled(bracket, exposures[::-1]), SRGB_8_BIT)
