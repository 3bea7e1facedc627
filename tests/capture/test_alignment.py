"""Hand-held brackets of known motions, laid straight and merged."""

import cv2
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from capture.alignment import LARGEST_SHIFT, _full_size, align_bracket
from capture.errors import InputError
from capture.exif import read_exif
from capture.frame import Bracket, Exposure, Frame
from capture.merge import merge_bracket
from capture.registration import Registration, rigid_motion
from tests.capture.photo_files import DATA
from tests.capture.simulated_bracket import (
    DOUBTFUL_AT_WHITE,
    LINEAR_16_BIT,
    SRGB_8_BIT,
    record,
)

WIDTH, HEIGHT, MARGIN_PX = 240, 160, 40
TIMES_S = (1 / 64, 1 / 8, 1.0)
MOTIONS = [((0.0, 0.0), 0.0), ((3.3, -2.6), 0.01), ((-4.2, 1.7), -0.015)]

MPI = DATA / "brackets-mpi-exposures/exposures"

both_sensors = pytest.mark.parametrize(
    "sensor", [SRGB_8_BIT, LINEAR_16_BIT], ids=["sRGB 8 bit", "linear 16 bit"]
)


def scene(seed=0, grain_px=4.0):
    """Radiance with a margin, five decades smooth over some pixels."""
    shape = (HEIGHT + 2 * MARGIN_PX, WIDTH + 2 * MARGIN_PX)
    noise = np.random.default_rng(seed).normal(0, 1, shape)
    smooth = cv2.GaussianBlur(noise, (0, 0), grain_px)
    grey = np.exp(2.0 * smooth / smooth.std() - 1)
    return grey[..., None] * np.array([1.0, 0.8, 0.6])


def seen(radiance, motion):
    y_px, x_px = np.mgrid[:HEIGHT, :WIDTH]
    at = np.linalg.inv(motion) @ np.stack([x_px.ravel(), y_px.ravel(), np.ones(x_px.size)])
    logarithm = [
        map_coordinates(np.log(plane), [at[1] + MARGIN_PX, at[0] + MARGIN_PX], order=3)
        for plane in np.moveaxis(radiance, -1, 0)
    ]
    return np.exp(np.stack(logarithm, axis=-1)).reshape(HEIGHT, WIDTH, 3)


def hand_held(radiance, motions, sensor, times_s=TIMES_S, seed=1):
    rng = np.random.default_rng(seed)
    frames = []
    for index, (time_s, (shift_px, rotation_rad)) in enumerate(zip(times_s, motions, strict=True)):
        view = seen(radiance, rigid_motion(shift_px, rotation_rad, (WIDTH, HEIGHT)))
        (frame,) = record(view, [Exposure(time_s)], sensor, rng).frames
        frames.append(Frame(frame.counts, frame.exposure, index=index))
    return Bracket(tuple(frames))


@both_sensors
def test_motions_are_found_and_undone(sensor):
    bracket = hand_held(scene(), MOTIONS, sensor)
    aligned = align_bracket(Bracket(bracket.frames[::-1]), sensor)
    for found, (shift_px, rotation_rad) in zip(aligned.alignments, MOTIONS, strict=True):
        assert found.is_certain
        np.testing.assert_allclose(found.shift_px, shift_px, atol=0.05)
        assert found.rotation_rad == pytest.approx(rotation_rad, abs=3e-4)
        true = rigid_motion(shift_px, rotation_rad, (WIDTH, HEIGHT))
        np.testing.assert_allclose(found.motion, true, atol=0.08)
    assert [found.is_moved for found in aligned.alignments] == [False, True, True]

    truth = seen(scene(), np.eye(3))
    inner = np.s_[12:-12, 12:-12]
    still = hand_held(scene(), [MOTIONS[0]] * 3, sensor)

    def rms_ev(bracket, sensor):
        radiance = merge_bracket(bracket, sensor).radiance
        return np.sqrt(np.mean(np.log2(radiance[inner] / truth[inner]) ** 2))

    assert rms_ev(bracket, sensor) > 0.5
    # Bilinear resampling blurs: on top of what noise a still bracket has.
    assert rms_ev(aligned.bracket, aligned.sensor) < rms_ev(still, sensor) + 0.03


def test_counts_that_are_in_doubt_hide_no_motion_of_others():
    bracket = hand_held(scene(), MOTIONS, DOUBTFUL_AT_WHITE)
    found = align_bracket(bracket, DOUBTFUL_AT_WHITE).alignments
    expected = align_bracket(bracket, SRGB_8_BIT).alignments
    for one, other in zip(found, expected, strict=True):
        assert one.is_certain
        np.testing.assert_array_equal(one.motion, other.motion)


@both_sensors
def test_a_still_bracket_is_returned_as_it_came(sensor):
    bracket = hand_held(scene(), [((0.0, 0.0), 0.0)] * 3, sensor)
    aligned = align_bracket(bracket, sensor)
    assert aligned.bracket is bracket
    assert aligned.sensor is sensor
    assert all(found.is_certain for found in aligned.alignments)


def test_a_frame_that_did_not_move_keeps_its_values():
    motions = [MOTIONS[0], MOTIONS[1], MOTIONS[0]]
    bracket = hand_held(scene(), motions, SRGB_8_BIT)
    aligned = align_bracket(bracket, SRGB_8_BIT)
    for before, after in zip(bracket.frames[::2], aligned.bracket.frames[::2], strict=True):
        np.testing.assert_array_equal(after.counts, 257 * before.counts.astype(np.uint16))


def test_what_a_frame_does_not_show_is_left_to_the_others():
    motions = [((0.0, 0.0), 0.0), ((0.0, 0.0), 0.0), ((6.0, 0.0), 0.0)]
    bracket = hand_held(scene(), motions, LINEAR_16_BIT)
    aligned = align_bracket(bracket, LINEAR_16_BIT)
    image = merge_bracket(aligned.bracket, aligned.sensor)
    others = merge_bracket(
        Bracket(aligned.bracket.frames[:2]), aligned.sensor
    )  # columns 234 to 239 have moved out of the third
    np.testing.assert_array_equal(image.radiance[:, 234:], others.radiance[:, 234:])
    assert (image.variance[:, 20:220] < others.variance[:, 20:220]).mean() > 0.5


def test_a_repeat_of_the_darkest_marks_nothing_where_it_shows_nothing():
    motions = [((0.0, 0.0), 0.0), ((6.0, 0.0), 0.0)]
    bracket = hand_held(0.01 * scene(), motions, LINEAR_16_BIT, times_s=(0.1, 0.1))
    aligned = align_bracket(bracket, LINEAR_16_BIT)
    assert aligned.alignments[1].is_moved
    assert not merge_bracket(aligned.bracket, aligned.sensor).clipped.any()


def test_any_part_of_a_full_value_makes_a_value_full():
    radiance = scene()
    radiance[MARGIN_PX + 80, MARGIN_PX + 120] = 1e4
    motions = [((0.0, 0.0), 0.0), ((0.5, 0.0), 0.0), ((-3.5, 0.0), 0.0)]
    bracket = hand_held(radiance, motions, LINEAR_16_BIT)
    aligned = align_bracket(bracket, LINEAR_16_BIT)
    table = aligned.sensor.linear_table()
    before = LINEAR_16_BIT.linear_table()[bracket.frames[2].counts, np.arange(3)]
    after = table[aligned.bracket.frames[2].counts, np.arange(3)]
    full = before[80, 100:140, 0] >= LINEAR_16_BIT.saturation
    reached = after[80, 100:140, 0] >= aligned.sensor.saturation
    # Pixel x shows what the frame has between x − 4 and x − 3.
    columns = np.nonzero(full)[0]
    assert len(columns) > 0
    assert reached[columns + 3].all()
    assert reached[columns + 4].all()


def test_light_below_saturation_keeps_its_sum():
    y_px, x_px = np.mgrid[: HEIGHT + 2 * MARGIN_PX, : WIDTH + 2 * MARGIN_PX]
    lamp = np.exp(-((x_px - 160.3) ** 2 + (y_px - 110.8) ** 2) / 4)[..., None]
    radiance = 1e-3 * scene() + 0.5 * lamp
    motions = [((0.0, 0.0), 0.0), ((2.3, 1.6), 0.01)]
    bracket = hand_held(radiance, motions, LINEAR_16_BIT, times_s=(0.5, 1.0))
    aligned = align_bracket(bracket, LINEAR_16_BIT)
    assert aligned.alignments[1].is_moved
    still, moved = (
        aligned.sensor.linear_table()[frame.counts, 0][60:82, 108:132] / frame.exposure.signal
        for frame in aligned.bracket.frames
    )
    assert moved.sum() == pytest.approx(still.sum(), rel=0.003)


def test_the_variance_is_that_of_sums():
    # A flat sheet seen half a pixel off: a resampled value has a quarter of the variance, but the
    # sum over 8×8 pixels has what their stated variances add up to, but for its rim.
    rng = np.random.default_rng(3)
    radiance = scene()
    motion = ((0.5, 0.5), 0.0)
    still, moved = hand_held(radiance, [MOTIONS[0], motion], LINEAR_16_BIT, (1.0, 4.0)).frames
    flat = np.full((HEIGHT, WIDTH, 3), 0.1)
    flat[:, :60] = 0
    sheets = [
        record(flat, [frame.exposure], LINEAR_16_BIT, rng).frames[0] for frame in (still, moved)
    ]
    mixed = [
        Frame(np.where(np.arange(WIDTH)[:, None] < 60, frame.counts, sheet.counts), frame.exposure)
        for frame, sheet in zip((still, moved), sheets, strict=True)
    ]
    aligned = align_bracket(Bracket(tuple(mixed)), LINEAR_16_BIT)
    assert aligned.alignments[1].is_moved
    image = merge_bracket(Bracket(aligned.bracket.frames[1:]), aligned.sensor)
    sheet = np.s_[8:152, 72:232]
    ratio = [
        blocks(image.radiance[sheet], 8).var() / blocks(image.variance[sheet], 8).mean(),
        image.radiance[sheet].var() / image.variance[sheet].mean(),
    ]
    assert ratio[0] == pytest.approx(0.88, abs=0.1)  # (1 − 1/16)²: the rim's share
    assert ratio[1] == pytest.approx(0.25, abs=0.03)


def blocks(values, side):
    height, width = values.shape[:2]
    split = values.astype(np.float64).reshape(height // side, side, width // side, side, 3)
    return split.sum(axis=(1, 3))


@pytest.mark.parametrize("motion", [((12.0, 0.0), 0.0), ((0.0, 0.0), 0.09)], ids=["shift", "turn"])
def test_large_motions_are_refused(motion):
    assert LARGEST_SHIFT * HEIGHT < 12
    bracket = hand_held(scene(), [MOTIONS[0], MOTIONS[0], motion], LINEAR_16_BIT)
    with pytest.raises(InputError, match=r"frames 0 and 2 \(1 s\) lie .*--no-align"):
        align_bracket(bracket, LINEAR_16_BIT)


def test_no_motion_is_made_up_where_frames_have_nothing_in_common():
    flat = np.full_like(scene(), 0.05)
    noise = align_bracket(hand_held(flat, MOTIONS, LINEAR_16_BIT), LINEAR_16_BIT)
    assert [found.is_certain for found in noise.alignments] == [True, False, False]
    apart = hand_held(scene(), MOTIONS[:2], SRGB_8_BIT, times_s=(1e-5, 1.0))
    aligned = align_bracket(apart, SRGB_8_BIT)
    assert aligned.bracket is apart
    assert not aligned.alignments[1].is_certain
    stripes = scene()
    stripes[:] = stripes[100]  # they tell nothing of a motion along them
    striped = align_bracket(hand_held(stripes, MOTIONS, LINEAR_16_BIT), LINEAR_16_BIT)
    assert not striped.alignments[1].is_certain
    first, second = (
        hand_held(scene(seed, 1.5), MOTIONS[:2], SRGB_8_BIT, TIMES_S[:2]).frames[seed]
        for seed in range(2)
    )
    assert not align_bracket(Bracket((first, second)), SRGB_8_BIT).alignments[1].is_certain


def test_a_motion_of_reduced_pictures_grows_about_the_same_middle():
    small = rigid_motion((1.0, -2.0), 0.1, (WIDTH // 4, HEIGHT // 4))
    np.testing.assert_allclose(
        _full_size(small, 4), rigid_motion((4.0, -8.0), 0.1, (WIDTH, HEIGHT)), atol=1e-12
    )


@pytest.mark.parametrize("most_px", [2**21, 2**14], ids=["full size", "reduced"])
def test_motions_follow_one_another(monkeypatch, most_px):
    # A turn and then a shift: in the other order they differ by 0.3 px.
    monkeypatch.setattr("capture.alignment._FOUND_PX", most_px)
    motions = [((0.0, 0.0), 0.0), ((0.0, 0.0), 0.05), ((5.0, 6.0), 0.05)]
    aligned = align_bracket(hand_held(scene(), motions, LINEAR_16_BIT), LINEAR_16_BIT)
    for found, (shift_px, rotation_rad) in zip(aligned.alignments, motions, strict=True):
        true = rigid_motion(shift_px, rotation_rad, (WIDTH, HEIGHT))
        corner = np.array([WIDTH - 1, HEIGHT - 1, 1])
        np.testing.assert_allclose(found.motion @ corner, true @ corner, atol=0.1)


def test_the_black_round_a_fisheye_does_not_hold_the_picture():
    bracket = hand_held(scene(), MOTIONS, LINEAR_16_BIT)
    y_px, x_px = np.mgrid[:HEIGHT, :WIDTH]
    inside = (np.hypot(x_px - 118, y_px - 81) < 76)[..., None]
    frames = [
        Frame(np.where(inside, frame.counts, 1024).astype(np.uint16), frame.exposure)
        for frame in bracket.frames
    ]
    aligned = align_bracket(Bracket(tuple(frames)), LINEAR_16_BIT)
    for found, (shift_px, _) in zip(aligned.alignments, MOTIONS, strict=True):
        np.testing.assert_allclose(found.shift_px, shift_px, atol=0.1)
    # The black of the moved frames is not merged into the picture.
    image = merge_bracket(aligned.bracket, aligned.sensor)
    truth = seen(scene(), np.eye(3))
    rim = (np.hypot(x_px - 118, y_px - 81) < 74) & (truth.max(axis=-1) > 0.5)
    assert np.median(np.abs(np.log2(image.radiance[rim] / truth[rim]))) < 0.05
    assert (image.radiance[rim] > 0.7 * truth[rim]).mean() > 0.99


def test_radiance_is_taken_to_lie_straight():
    values = np.random.default_rng(1).uniform(0, 1, (20, 30, 3)).astype(np.float32)
    bracket = Bracket((Frame(values, Exposure(1.0)), Frame(values[::-1], Exposure(2.0))))
    aligned = align_bracket(bracket, LINEAR_16_BIT)
    assert aligned.bracket is bracket
    assert len(aligned.alignments) == 2


def test_what_is_found_in_reduced_pictures_is_told_in_whole_pixels(monkeypatch):
    bracket = hand_held(scene(), [MOTIONS[0]] * 3, SRGB_8_BIT)
    width, height = bracket.frames[0].size_px
    found = Registration(rigid_motion((1.0, 0.0), 0.0, (width // 2, height // 2)), 0.1, 1.0)
    monkeypatch.setattr("capture.alignment._FOUND_PX", width * height // 4)
    monkeypatch.setattr("capture.alignment.register", lambda *_: found)
    _, second, third = align_bracket(bracket, SRGB_8_BIT).alignments
    assert second.shift_px == pytest.approx((2.0, 0.0))
    assert second.deviation_px == pytest.approx(0.2)
    # Motions between neighbours add up, and so do their variances.
    assert third.shift_px == pytest.approx((4.0, 0.0))
    assert third.deviation_px == pytest.approx(0.2 * 2**0.5)


@pytest.mark.data
@pytest.mark.skipif(not MPI.is_dir(), reason=f"{MPI} is not there")
def test_real_photographs_shifted_by_whole_pixels():
    frames = []
    for index, shift_px in ((4, (0, 0)), (6, (7, -4)), (8, (-3, 9))):
        path = sorted(MPI.glob("*.jpg"))[index]
        counts = cv2.imread(str(path))[..., ::-1]
        counts = counts[20 - shift_px[1] : 748 - shift_px[1], 20 - shift_px[0] : 1004 - shift_px[0]]
        frames.append(Frame(counts, Exposure(read_exif(path).time_s), index=index))
    aligned = align_bracket(Bracket(tuple(frames)), SRGB_8_BIT)
    darkest = np.array({4: (0, 0), 6: (7, -4), 8: (-3, 9)}[aligned.alignments[0].frame_index])
    for found in aligned.alignments:
        expected = np.array({4: (0, 0), 6: (7, -4), 8: (-3, 9)}[found.frame_index]) - darkest
        assert found.is_certain
        np.testing.assert_allclose(found.shift_px, expected, atol=0.5)
