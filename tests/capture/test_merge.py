"""The merge against a plain numpy version, closed forms, laws and its own variance."""

import itertools
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.errors import InputError
from capture.frame import (
    F_NUMBER_RANGE,
    GAIN_RANGE,
    TIME_RANGE_S,
    Bracket,
    Exposure,
    Frame,
)
from capture.merge import merge_bracket
from capture.radiance_files import read_hdr
from capture.sensor import Sensor
from tests.capture.simulated_bracket import LINEAR_16_BIT, SRGB_8_BIT, record

MEMORIAL = Path(__file__).resolve().parents[2].parent / "shared/data/brackets-memorial"


def bracket_of(counts, times_s, gains=None):
    gains = gains or [1.0] * len(times_s)
    return Bracket(
        tuple(
            Frame(picture, Exposure(time_s, gain), index=index)
            for index, (picture, time_s, gain) in enumerate(
                zip(counts, times_s, gains, strict=True)
            )
        )
    )


def constant(counts, dtype=np.uint16):
    return np.full((2, 3, 3), counts, dtype)


def merge_plainly(bracket, sensor):
    """The estimator of `merge_bracket`, one array operation at a time, in float64."""
    frames = sorted(bracket.frames, key=lambda frame: frame.exposure.signal)
    least = frames[0].exposure.signal
    linear_of = sensor.linear_table().astype(np.float64)
    step_of = np.empty_like(linear_of)
    for channel in range(3):
        levels, at = np.unique(linear_of[:, channel], return_inverse=True)
        step_of[:, channel] = np.gradient(levels)[at]
    light, y, dark, used, clipped = [], [], [], [], False
    total, total_variance, total_light = 0.0, 0.0, 0.0
    for frame in frames:
        x = linear_of[frame.counts, np.arange(3)]
        is_least = frame.exposure.signal == least
        gain, light_k = frame.exposure.gain, frame.exposure.light
        step = step_of[frame.counts, np.arange(3)]
        light.append(light_k)
        y.append(x / gain)
        dark.append((sensor.read_noise_e / sensor.full_well_e) ** 2 + (step / gain) ** 2 / 12)
        if is_least:
            used.append(np.ones(x.shape, bool))
            clipped = clipped | (x >= sensor.saturation).any(axis=-1)
        else:
            predicted = total / total_light * light_k
            sigma = np.sqrt(np.maximum(total_variance, 0)) / total_light * light_k
            is_contradicted = predicted - sensor.saturation / gain > 4 * sigma
            used.append((x < sensor.saturation) & ~is_contradicted)
        photon = x / gain / sensor.full_well_e
        total = total + used[-1] * x / gain
        total_variance = total_variance + used[-1] * (dark[-1] + photon)
        total_light = total_light + used[-1] * light_k
    light = np.array(light)[:, None, None, None]
    y, dark, used = np.array(y), np.array(dark), np.array(used)
    pilot = np.maximum(total / total_light, 0)
    weight = used * light / (light * pilot / sensor.full_well_e + dark)
    information = (weight * light).sum(0)
    return np.maximum((weight * y).sum(0) / information, 0), 1 / information, clipped


def curved_16_bit():
    curve = np.linspace(0, 1, 4096)[:, None] ** np.array([1.8, 2.0, 2.2])
    return Sensor(0.0, 4095.0, response=curve, source="simulated curve")


@pytest.mark.parametrize(
    "sensor", [SRGB_8_BIT, LINEAR_16_BIT, curved_16_bit()], ids=lambda sensor: sensor.source
)
@pytest.mark.parametrize(
    ("times_s", "gains"),
    [([0.01], [1.0]), ([0.16, 0.01, 0.04], [8.0, 1.0, 2.0]), ([0.5, 0.25, 0.125] * 2, [1.0] * 6)],
    ids=["single", "mixed gains", "repeats"],
)
def test_kernel_equals_the_plain_version(sensor, times_s, gains):
    rng = np.random.default_rng(1)
    dtype = np.uint8 if sensor.white_dn <= 255 else np.uint16
    # 41 × 401 pixels: one whole task of 32 blocks, and a part of a block.
    counts = rng.integers(0, int(sensor.white_dn) + 1, (len(times_s), 41, 401, 3)).astype(dtype)
    bracket = bracket_of(counts, times_s, gains)
    image = merge_bracket(bracket, sensor)
    radiance, variance, clipped = merge_plainly(bracket, sensor)
    np.testing.assert_allclose(image.radiance, radiance, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(image.variance, variance, rtol=1e-5)
    np.testing.assert_array_equal(image.clipped, clipped)
    assert image.valid.all()
    assert 0 < image.clipped.sum() < image.clipped.size


def test_merging_beside_other_kernels_gives_the_same_bits():
    counts = np.random.default_rng(1).integers(0, 256, (3, 41, 401, 3)).astype(np.uint8)
    bracket = bracket_of(counts, [0.01, 0.04, 0.16])
    alone = merge_bracket(bracket, SRGB_8_BIT, is_beside=True)
    for name, expected in vars(merge_bracket(bracket, SRGB_8_BIT)).items():
        np.testing.assert_array_equal(getattr(alone, name), expected)


def test_more_than_four_exposures():
    counts = np.random.default_rng(5).integers(0, 256, (6, 5, 7, 3), dtype=np.uint8)
    bracket = bracket_of(counts, [4.0**-k for k in range(6)])
    radiance, _, _ = merge_plainly(bracket, SRGB_8_BIT)
    np.testing.assert_allclose(
        merge_bracket(bracket, SRGB_8_BIT).radiance, radiance, rtol=1e-5, atol=1e-5
    )


@pytest.mark.parametrize("strided_count", [1, 3])
def test_strided_counts_merge_as_contiguous_ones(strided_count):
    rng = np.random.default_rng(2)
    strided = list(rng.integers(0, 65536, (3, 8, 20, 3), dtype=np.uint16)[:, ::2, ::-2])
    contiguous = [np.ascontiguousarray(counts) for counts in strided]
    mixed = strided[:strided_count] + contiguous[strided_count:]
    np.testing.assert_array_equal(
        merge_bracket(bracket_of(mixed, [1, 4, 16]), LINEAR_16_BIT).radiance,
        merge_bracket(bracket_of(contiguous, [1, 4, 16]), LINEAR_16_BIT).radiance,
    )


def test_without_read_noise_electrons_over_light_remain():
    # y/full_well electrons, light 1 : 4 : 16 → L = (300 + 1100 + 4500) / (21 · 30000) per unit.
    sensor = Sensor(0.0, 30_000.0, full_well_e=30_000.0, read_noise_e=0.0)
    counts = [constant(300), constant(1100), constant(4500)]
    image = merge_bracket(bracket_of(counts, [1.0, 4.0, 16.0]), sensor)
    electrons, light = 300 + 1100 + 4500, 21.0
    np.testing.assert_allclose(image.radiance, electrons / light / 30_000, rtol=2e-4)
    np.testing.assert_allclose(
        image.variance, electrons / light**2 / 30_000**2, rtol=1e-3
    )  # Var[S] = S


def test_a_full_pixel_is_one_over_the_smallest_signal():
    full = constant(255, np.uint8)
    exposures = [Exposure(0.5, gain=4.0, f_number=2.0), Exposure(0.1, gain=2.0, f_number=2.0)]
    bracket = Bracket(tuple(Frame(full, exposure) for exposure in exposures))
    image = merge_bracket(bracket, SRGB_8_BIT)
    np.testing.assert_allclose(image.radiance, 1 / (0.1 / 4 * 2), rtol=1e-6)
    assert image.clipped.all()
    assert image.valid.all()


def test_one_full_channel_marks_the_pixel_and_leaves_the_others_measured():
    counts = np.zeros((1, 2, 3), np.uint16)
    counts[0, 0] = 65535, 20000, 20000
    counts[0, 1] = 20000
    image = merge_bracket(bracket_of([counts], [2.0]), LINEAR_16_BIT)
    np.testing.assert_array_equal(image.clipped, [[True, False]])
    np.testing.assert_array_equal(image.radiance[0, 0, 1:], image.radiance[0, 1, 1:])


def test_the_exposure_that_clips_last_is_the_one_of_smallest_signal():
    # 1 s at gain 8 clips before 4 s at gain 1, though it is the shorter time.
    counts = [constant(65535), constant(65535)]
    image = merge_bracket(bracket_of(counts, [1.0, 4.0], [8.0, 1.0]), LINEAR_16_BIT)
    np.testing.assert_allclose(image.radiance, 1 / 4, rtol=1e-6)
    half = [constant(65535), constant(1024 + 32255)]
    image = merge_bracket(bracket_of(half, [1.0, 4.0], [8.0, 1.0]), LINEAR_16_BIT)
    np.testing.assert_allclose(image.radiance, 0.5 / 4, rtol=1e-4)
    assert not image.clipped.any()


def test_below_black_in_every_exposure_is_zero_and_measured():
    image = merge_bracket(bracket_of([constant(1000)] * 3, [1.0, 4.0, 16.0]), LINEAR_16_BIT)
    assert (image.radiance == 0).all()
    assert image.valid.all()
    assert not image.clipped.any()
    # Read noise alone: 1 / Σ (light / σ)², and a little quantisation.
    read = (4 / 30_000) ** 2 / (1 + 16 + 256)
    np.testing.assert_allclose(image.variance, read, rtol=0.01)


def test_noise_below_black_is_not_cut_off_term_by_term():
    # 20 electrons in the longest exposure, a fraction of the read noise in the others.
    rng = np.random.default_rng(3)
    truth = 20 / 30_000 / 16
    exposures = [Exposure(time_s) for time_s in (1 / 16, 1.0, 16.0)]
    bracket = record(np.full((200, 200, 3), truth), exposures, LINEAR_16_BIT, rng)
    assert (bracket.frames[0].counts < 1024).mean() > 0.45
    relative = merge_bracket(bracket, LINEAR_16_BIT).radiance / truth
    # σ of the mean is 0.3 / √120000 ≈ 0.001; cutting each term off at 0 gives +0.02.
    assert abs(relative.mean() - 1) < 0.005


@pytest.mark.parametrize("sensor", [SRGB_8_BIT, LINEAR_16_BIT], ids=["sRGB 8 bit", "linear 16 bit"])
@pytest.mark.parametrize("gain", [1.0, 4.0])
def test_variance_predicts_the_spread(sensor, gain):
    # Mid range: 2 to 70 % of the longest exposure. Its spread over many noisy pixels is that of
    # (L − truth) / predicted σ, which has mean 0 and standard deviation 1.
    rng = np.random.default_rng(4)
    exposures = [Exposure(time_s, gain) for time_s in (1 / 64, 1 / 8, 1.0)]
    truth = np.exp(rng.uniform(np.log(0.02), np.log(0.7), (200, 300, 3))) / gain
    image = merge_bracket(record(truth, exposures, sensor, rng), sensor)
    deviation = (image.radiance - truth) / np.sqrt(image.variance)
    for low, high in [(0.02, 0.07), (0.07, 0.2), (0.2, 0.7)]:
        here = deviation[(truth * gain >= low) & (truth * gain < high)]
        assert here.std() == pytest.approx(1, abs=0.05)
        assert abs(here.mean()) < 0.05


def test_counts_of_a_flat_response_are_as_uncertain_as_the_gap():
    curve = np.linspace(0, 1, 256)
    curve[100:120] = curve[100]
    sensor = Sensor(0, 255, response=np.repeat(curve[:, None], 3, axis=1), read_noise_e=0.0)
    flat = merge_bracket(bracket_of([constant(110, np.uint8)], [1.0]), sensor)
    beside = merge_bracket(bracket_of([constant(90, np.uint8)], [1.0]), sensor)
    step = ((curve[120] - curve[99]) / 2) ** 2 / 12
    np.testing.assert_allclose(flat.variance, curve[100] / 30_000 + step, rtol=1e-4)
    assert (flat.variance > 10 * beside.variance).all()


@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_the_order_of_frames_does_not_matter(data):
    count = data.draw(st.integers(1, 4))
    times_s = data.draw(
        st.lists(st.sampled_from([0.01, 0.03, 0.1, 0.3]), min_size=count, max_size=count)
    )
    gains = data.draw(st.lists(st.sampled_from([1.0, 1.7, 8.0]), min_size=count, max_size=count))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    frames = bracket_of(
        rng.integers(0, 65536, (count, 5, 7, 3), dtype=np.uint16), times_s, gains
    ).frames
    one = merge_bracket(Bracket(frames), LINEAR_16_BIT)
    other = merge_bracket(Bracket(data.draw(st.permutations(frames))), LINEAR_16_BIT)
    assert one.radiance.tobytes() == other.radiance.tobytes()
    assert one.variance.tobytes() == other.variance.tobytes()
    assert one.clipped.tobytes() == other.clipped.tobytes()


@settings(max_examples=25, deadline=None)
@given(factor=st.floats(1e-4, 1e4), seed=st.integers(0, 2**32 - 1))
def test_longer_times_mean_less_radiance(factor, seed):
    counts = np.random.default_rng(seed).integers(0, 256, (3, 4, 5, 3), dtype=np.uint8)
    one = merge_bracket(bracket_of(counts, [0.01, 0.1, 1.0]), SRGB_8_BIT)
    scaled = merge_bracket(bracket_of(counts, [0.01 * factor, 0.1 * factor, factor]), SRGB_8_BIT)
    np.testing.assert_allclose(scaled.radiance * factor, one.radiance, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(scaled.variance * factor**2, one.variance, rtol=1e-5)


@pytest.mark.parametrize("sensor", [SRGB_8_BIT, LINEAR_16_BIT], ids=lambda sensor: sensor.source)
def test_no_exposure_is_too_extreme_for_the_arithmetic(sensor):
    exposures = itertools.starmap(
        Exposure, itertools.product(TIME_RANGE_S, GAIN_RANGE, F_NUMBER_RANGE)
    )
    dtype = np.uint8 if sensor.white_dn <= 255 else np.uint16
    ends = [np.full((1, 2, 3), count, dtype) for count in (0, sensor.white_dn)]
    for one, other in itertools.combinations(exposures, 2):
        for counts in itertools.product(ends, repeat=2):
            frames = map(Frame, counts, (one, other))
            image = merge_bracket(Bracket(tuple(frames)), sensor)
            assert np.isfinite(image.variance).all()
            assert (image.variance > 0).all()
            shortest = min((one, other), key=lambda exposure: exposure.signal)
            np.testing.assert_array_equal(image.clipped, counts[int(shortest is other)].any())
            if np.all(counts):
                np.testing.assert_allclose(image.radiance, 1 / shortest.signal, rtol=1e-5)


@pytest.mark.parametrize(
    "changed",
    [
        {"time_s": 0.0},
        {"time_s": -1.0},
        {"time_s": math.nan},
        {"time_s": math.inf},
        {"time_s": 1e-40},
        {"gain": 0.0},
        {"f_number": 1e-3},
    ],
    ids=str,
)
def test_an_exposure_no_camera_makes_is_refused(changed):
    (name,) = changed
    with pytest.raises(InputError, match=name):
        Exposure(**{"time_s": 1.0, **changed})


def test_repeats_average_and_divide_the_variance():
    once = merge_bracket(bracket_of([constant(20_000)], [1.0]), LINEAR_16_BIT)
    twice = merge_bracket(
        bracket_of([constant(19_000), constant(21_000)], [1.0] * 2), LINEAR_16_BIT
    )
    np.testing.assert_allclose(twice.radiance, once.radiance, rtol=1e-6)
    np.testing.assert_allclose(twice.variance, once.variance / 2, rtol=1e-6)


def test_all_repeats_of_the_shortest_exposure_are_kept():
    # One of two equal exposures is full: dropping it alone would hide that the pixel is clipped.
    image = merge_bracket(bracket_of([constant(65535), constant(64000)], [1.0] * 2), LINEAR_16_BIT)
    expected = (1 + (64000 - 1024) / (65535 - 1024)) / 2
    np.testing.assert_allclose(image.radiance, expected, rtol=1e-5)
    assert image.clipped.all()


def test_float_frames_are_values_over_signal_and_clip_only_where_marked():
    values = np.array([[[0.5, 2.0, 1e6]]], np.float32)
    image = merge_bracket(bracket_of([values], [0.25], [2.0]), LINEAR_16_BIT)
    np.testing.assert_allclose(image.radiance, values / 0.5, rtol=1e-6)
    assert (image.variance == 0).all()
    assert not image.clipped.any()
    # Weighted by light 1 : 3, of radiances 2 and 6.
    pair = [np.full((1, 1, 3), 2, np.float32), np.full((1, 1, 3), 18, np.float32)]
    image = merge_bracket(bracket_of(pair, [1.0, 3.0]), LINEAR_16_BIT)
    np.testing.assert_allclose(image.radiance, (1 * 2 + 3 * 6) / 4, rtol=1e-6)


def test_counts_that_show_where_they_clip_take_no_mark():
    with pytest.raises(ValueError, match="by their value"):
        Frame(constant(7), Exposure(1.0), clipped=np.zeros((2, 3), bool))


def test_float_frames_are_cleaned():
    values = np.ones((1, 4, 3), np.float32)
    values[0, 0, 0], values[0, 1, 1], values[0, 2, 2] = np.nan, np.inf, -1.0
    opposite = np.ones((1, 4, 3), np.float32)
    opposite[0, 1, 1] = -np.inf
    image = merge_bracket(bracket_of([values, opposite], [1.0, 1.0]), LINEAR_16_BIT)
    np.testing.assert_array_equal(image.valid, [[False, False, True, True]])
    np.testing.assert_array_equal(image.radiance[0, :2], 0)
    np.testing.assert_array_equal(image.radiance[0, 2], [1, 1, 0])


@pytest.mark.parametrize(("dtype", "white_dn"), [(np.uint8, 4095.0), (np.uint16, 255.0)])
def test_a_white_level_of_another_count_type_is_refused(dtype, white_dn):
    with pytest.raises(InputError, match="white at"):
        merge_bracket(bracket_of([constant(9, dtype)], [1.0]), Sensor(0.0, white_dn))


@pytest.mark.data
@pytest.mark.skipif(not MEMORIAL.is_dir(), reason=f"{MEMORIAL} is not there")
def test_memorial_church_spans_its_published_range():
    pictures, times_s = [], []
    for line in (MEMORIAL / "exposures.txt").read_text().splitlines():
        if line.startswith("memorial"):
            name, inverse_time = line.split()[:2]
            picture = cv2.imread(str(MEMORIAL / name.replace("ppm", "png")))
            pictures.append(picture[40:-40, 30:-30, ::-1])  # the rim is painted blue
            times_s.append(1 / float(inverse_time))
    image = merge_bracket(bracket_of(pictures, times_s), SRGB_8_BIT)
    published = read_hdr(MEMORIAL / "hdrify_memorial.hdr").rgb[40:-40, 30:-30]
    # Film is not sRGB: the curves differ, the order of the pixels does not.
    ours, theirs = image.radiance[..., 1].ravel(), published[..., 1].ravel()
    rank_of = [np.argsort(np.argsort(values)) for values in (ours, theirs)]
    assert np.corrcoef(rank_of)[0, 1] > 0.98
    assert image.clipped.mean() < 1e-3
    assert np.percentile(ours, 99.9) / np.percentile(ours, 1) > 1000
