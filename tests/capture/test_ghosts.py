"""Ghosts of known place in simulated brackets, and none in still ones."""

import cv2
import numpy as np
import pytest

from capture.frame import Bracket, Exposure, Frame
from capture.ghosts import find_ghosts, without_ghosts
from capture.merge import merge_bracket
from capture.radiance_files import read_hdr
from tests.calibration.response_scenes import true_sensor
from tests.capture.photo_files import DATA
from tests.capture.simulated_bracket import (
    DOUBTFUL_AT_WHITE,
    LINEAR_16_BIT,
    SRGB_8_BIT,
    record,
)

WIDTH, HEIGHT = 240, 160
TIMES_S = (1 / 16, 1 / 4, 1.0)
PLACES_PX = ((60, 80), (110, 80), (160, 70))
RADIUS_PX = 14
MAPS = DATA / "env-polyhaven-drei"

both_sensors = pytest.mark.parametrize(
    "sensor", [SRGB_8_BIT, LINEAR_16_BIT], ids=["sRGB 8 bit", "linear 16 bit"]
)


def scene(stops=1.0, seed=0):
    noise = np.random.default_rng(seed).normal(0, 1, (HEIGHT, WIDTH))
    smooth = cv2.GaussianBlur(noise, (0, 0), 3)
    grey = 0.3 * 2.0 ** (stops * smooth / smooth.std())
    return grey[..., None] * np.array([1.0, 0.8, 0.6])


def disc(place_px, radius_px=RADIUS_PX, size_px=(WIDTH, HEIGHT)):
    rows, columns = np.ogrid[: size_px[1], : size_px[0]]
    return np.hypot(columns - place_px[0], rows - place_px[1]) <= radius_px


def taken(views, sensor, times_s=TIMES_S, seed=1, gain=1.0):
    rng = np.random.default_rng(seed)
    frames = []
    for index, (view, time_s) in enumerate(zip(views, times_s, strict=True)):
        (frame,) = record(view, [Exposure(time_s, gain)], sensor, rng).frames
        frames.append(Frame(frame.counts, frame.exposure, index=index))
    return Bracket(tuple(frames))


def with_disc(radiance, place_px, value):
    return np.where(disc(place_px)[..., None], np.asarray(value), radiance)


def moving(sensor, value, **options):
    """A disc of grey `value` that stands elsewhere in each exposure, and the truth of where."""
    bracket = taken([with_disc(scene(), place, value) for place in PLACES_PX], sensor, **options)
    return bracket, np.any([disc(place) for place in PLACES_PX], axis=0)


def test_counts_that_are_in_doubt_hide_no_ghost_of_others():
    bracket, _ = moving(SRGB_8_BIT, 0.1)
    found = find_ghosts(bracket, DOUBTFUL_AT_WHITE)
    assert found.any()
    np.testing.assert_array_equal(found, find_ghosts(bracket, SRGB_8_BIT))


@both_sensors
@pytest.mark.parametrize("value", [0.03, 0.1, 0.8], ids=["dark", "dim", "bright"])
def test_a_moving_disc_is_found_and_little_else(sensor, value):
    bracket, truth = moving(sensor, value)
    found = find_ghosts(Bracket(bracket.frames[::-1]), sensor)
    # What it is as bright as moves unseen.
    unlike = np.abs(np.log2(scene().mean(axis=-1) / value)) > 0.7
    # The longest exposure is full above 1, and there says nothing.
    seen = unlike & (scene().max(axis=-1) < 0.8) & truth
    assert found[seen].mean() > 0.95
    # A margin of 3 px and a smoothing of 1 px around a radius of 14 px: (14 / 18)² of it is true.
    near = cv2.dilate(truth.astype(np.uint8), np.ones((13, 13), np.uint8)) > 0
    assert truth[found].mean() > 0.6
    assert not found[~near].any()


@both_sensors
@pytest.mark.parametrize("gain", [1.0, 16.0])
def test_still_brackets_have_none_whatever_their_noise(sensor, gain):
    # Half of it bright, so that the noise of the dark half is not what exposures usually differ by.
    radiance = scene(2.0) / gain
    radiance[:, : WIDTH // 3] *= 0.1
    for seed in range(2):
        assert not find_ghosts(taken([radiance] * 3, sensor, seed=seed, gain=gain), sensor).any()


def test_what_only_the_darker_exposure_measures_is_no_contradiction():
    # The brighter one has an eighth of the light at 16 times the gain, and sees its noise alone.
    exposures = [Exposure(1.0, 1.0), Exposure(1 / 8, 16.0)]
    radiance = 0.3 * scene()
    radiance[40:120, 60:180] = 2e-3
    bracket = record(radiance, exposures, LINEAR_16_BIT, np.random.default_rng(1))
    assert not find_ghosts(bracket, LINEAR_16_BIT).any()


@both_sensors
def test_frames_half_a_pixel_askew_have_none(sensor):
    radiance = scene(3.0)
    half = np.float32([[1, 0, 0.5], [0, 1, 0.3]])
    askew = np.exp(cv2.warpAffine(np.log(radiance), half, (WIDTH, HEIGHT), borderMode=1))
    assert not find_ghosts(taken([radiance, askew, radiance], sensor), sensor).any()


@pytest.mark.parametrize("levels", [(60,), (60, 90)], ids=["one level", "two levels"])
def test_pictures_of_few_levels_have_none(levels):
    counts = np.repeat(np.array(levels, np.uint8), 20 * 40 * 3).reshape(-1, 40, 3)
    frames = [Frame(counts + np.uint8(k * 20), Exposure(2.0**k), index=k) for k in range(2)]
    assert not find_ghosts(Bracket(tuple(frames)), SRGB_8_BIT).any()


def test_a_wrong_response_makes_no_ghosts():
    film = true_sensor("film")
    assert not find_ghosts(taken([scene(2.0)] * 3, film), SRGB_8_BIT).any()
    labelled = taken([scene(1.5)] * 3, LINEAR_16_BIT)
    wrong = [Frame(f.counts, Exposure(f.exposure.time_s**1.2)) for f in labelled.frames]
    assert not find_ghosts(Bracket(tuple(wrong)), LINEAR_16_BIT).any()


def test_a_light_that_fills_the_longer_exposures_is_left_to_the_merge():
    # It stands still and fills the longest exposure, of which a full pixel is brought back below
    # white, as a JPEG's ringing does. The merge leaves that out.
    radiance = with_disc(scene(), PLACES_PX[0], 2.5)
    bracket = taken([radiance] * 3, LINEAR_16_BIT)
    counts = bracket.frames[2].counts.copy()
    counts[disc(PLACES_PX[0])] = 50_000
    counts[disc(PLACES_PX[2])] = 65_535  # another light, which the others did not see
    frames = (*bracket.frames[:2], Frame(counts, bracket.frames[2].exposure, index=2))
    assert not find_ghosts(Bracket(frames), LINEAR_16_BIT).any()


@both_sensors
def test_each_ghost_is_taken_from_the_brightest_exposure_that_holds_it(sensor):
    bracket, truth = moving(sensor, 0.03)
    ghosts = find_ghosts(bracket, sensor)
    merged = merge_bracket(bracket, sensor)
    image = without_ghosts(merged, bracket, sensor, ghosts)
    np.testing.assert_array_equal(image.radiance[~ghosts], merged.radiance[~ghosts])
    singles = [merge_bracket(Bracket((frame,)), sensor) for frame in bracket.frames]
    _, label = cv2.connectedComponents(ghosts.astype(np.uint8))
    for number in range(1, label.max() + 1):
        here = label == number
        whole = [k for k, single in enumerate(singles) if not single.clipped[here].any()]
        chosen = singles[max(whole, default=0)]
        np.testing.assert_array_equal(image.radiance[here], chosen.radiance[here])
        np.testing.assert_array_equal(image.variance[here], chosen.variance[here])
        np.testing.assert_array_equal(image.clipped[here], chosen.clipped[here])
    assert (image.variance[ghosts & truth] > merged.variance[ghosts & truth]).mean() > 0.9


def test_a_ghost_that_every_exposure_is_full_in_is_the_darkest_and_marked():
    full = with_disc(scene(), PLACES_PX[0], 100.0)
    bracket = taken([full] * 3, LINEAR_16_BIT)
    ghosts = disc(PLACES_PX[0])
    merged = merge_bracket(bracket, LINEAR_16_BIT)
    image = without_ghosts(merged, bracket, LINEAR_16_BIT, ghosts)
    assert image.clipped[ghosts].all()
    np.testing.assert_allclose(image.radiance[ghosts], 16, rtol=1e-6)


def test_a_mark_goes_with_the_exposure_that_is_not_used():
    views = [with_disc(scene(), PLACES_PX[0], 100.0), scene(), scene()]
    bracket = taken(views, LINEAR_16_BIT)
    ghosts = disc(PLACES_PX[0]) & (scene().max(axis=-1) < 0.8)
    merged = merge_bracket(bracket, LINEAR_16_BIT)
    assert merged.clipped[ghosts].all()
    image = without_ghosts(merged, bracket, LINEAR_16_BIT, ghosts)
    assert not image.clipped[ghosts].any()
    np.testing.assert_allclose(image.radiance[ghosts], scene()[ghosts], rtol=0.1)


def test_without_ghosts_the_picture_is_the_one_that_came():
    bracket = taken([scene()] * 3, LINEAR_16_BIT)
    merged = merge_bracket(bracket, LINEAR_16_BIT)
    none = np.zeros((HEIGHT, WIDTH), bool)
    assert without_ghosts(merged, bracket, LINEAR_16_BIT, none) is merged


def test_large_pictures_are_looked_at_reduced(monkeypatch):
    monkeypatch.setattr("capture.ghosts._LOOKED_AT_PX", WIDTH * HEIGHT // 4)
    bracket, truth = moving(LINEAR_16_BIT, 0.03)
    found = find_ghosts(bracket, LINEAR_16_BIT)
    assert found.shape == (HEIGHT, WIDTH)
    assert found[truth].mean() > 0.9
    assert truth[found].mean() > 0.5


def test_float_counts_show_none():
    values = np.random.default_rng(1).uniform(0, 1, (8, 9, 3)).astype(np.float32)
    bracket = Bracket((Frame(values, Exposure(1.0)), Frame(values[::-1], Exposure(2.0))))
    assert not find_ghosts(bracket, LINEAR_16_BIT).any()


@pytest.mark.data
@pytest.mark.skipif(not MAPS.is_dir(), reason=f"{MAPS} is not there")
@pytest.mark.parametrize("name", ["venice_sunset_1k", "st_fagans_interior_1k"])
def test_discs_over_real_maps(name):
    radiance = np.maximum(read_hdr(MAPS / f"{name}.hdr").rgb[100:420, 200:840], 0).astype(float)
    radiance = radiance / np.median(radiance) * 0.1 + 1e-4
    size_px = (640, 320)
    places_px = ((160, 160), (300, 180), (440, 150))
    discs = [disc(place, 25, size_px) for place in places_px]
    views = [np.where(each[..., None], 0.3, radiance) for each in discs]
    for sensor in (SRGB_8_BIT, LINEAR_16_BIT):
        assert find_ghosts(taken([radiance] * 3, sensor), sensor).mean() < 1e-4
        found = find_ghosts(taken(views, sensor), sensor)
        truth = np.any(discs, axis=0)
        unlike = np.abs(np.log2(radiance.mean(axis=-1) / 0.3)) > 0.7
        seen = truth & unlike & (radiance.max(axis=-1) < 0.8) & (radiance.min(axis=-1) > 0.03)
        near = cv2.dilate(truth.astype(np.uint8), np.ones((13, 13), np.uint8)) > 0
        assert seen.sum() > 500
        assert found[seen].mean() > 0.9
        assert near[found].mean() > 0.98
