"""ꟻLIP against what its papers say of it, and its authors' program where that is installed."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from capture.sensor import srgb_encode
from render.measures.flip import PIXELS_PER_DEGREE, exposures, flip, hdr_flip


def flat(*colour, size=8):
    return np.tile(np.float32(colour), (size, size, 1))


def picture(seed, shape=(40, 56)):
    rng = np.random.default_rng(seed)
    return np.kron(rng.uniform(0, 1, (shape[0] // 8, shape[1] // 8, 3)), np.ones((8, 8, 1)))


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 2**16), st.integers(0, 2**16))
def test_laws(one, other):
    first, second = picture(one), picture(other)
    difference = flip(first, second)
    assert difference.shape == first.shape[:2]
    assert difference.dtype == np.float32
    assert np.all((difference >= 0) & (difference <= 1))
    assert_allclose(flip(second, first), difference, atol=1e-5)  # of no order
    assert_array_equal(flip(first, first), 0)
    turned = flip(first.swapaxes(0, 1), second.swapaxes(0, 1)).T  # of no direction
    assert_allclose(turned, difference, atol=1e-4)


def test_green_and_blue_are_as_different_as_colours_can_be():
    assert_allclose(flip(flat(0, 1, 0), flat(0, 0, 1)), 1, rtol=1e-5)


@pytest.mark.parametrize("grey", [0.05, 0.3, 0.9])
def test_greys_differ_by_their_lightness(grey):
    # L* alone: 0.95 (ΔL)^0.7 / (0.4 c), up to the knee at 0.4 of the largest, c, to the same power.
    lightness = [116 * np.cbrt(value) - 16 for value in (grey, 1.1 * grey)]
    green, blue = (87.735, 0.87735 * -86.183, 0.87735 * 83.179), (32.297, 25.578, -34.841)
    largest = abs(green[0] - blue[0]) + math.hypot(green[1] - blue[1], green[2] - blue[2])
    expected = 0.95 / 0.4 * ((lightness[1] - lightness[0]) / largest) ** 0.7
    assert_allclose(flip(flat(*[1.1 * grey] * 3), flat(*[grey] * 3)), expected, rtol=1e-3)


def test_an_edge_that_is_not_there_counts_for_more_than_its_colours():
    step, even = flat(0.4, 0.4, 0.4), flat(0.45, 0.45, 0.45)
    step[:, 4:] = 0.5
    # Seen from so near that neither eye nor detector of edges reaches beyond the next pixel.
    difference = flip(step, even, pixels_per_degree=2)
    colour, beside_the_edge = difference[4, 1], difference[4, 3]
    assert beside_the_edge == pytest.approx(colour ** (1 - math.sqrt(0.1 / math.sqrt(2))), rel=1e-4)


def test_what_is_too_fine_to_see_counts_for_little():
    rows, columns = np.indices((64, 64))
    fine = np.repeat(((rows + columns) % 2)[..., None], 3, axis=-1).astype(float)
    inside = np.s_[16:-16, 16:-16]
    near, far = (flip(fine, flat(0.5, 0.5, 0.5, size=64), ppd)[inside] for ppd in (5, 120))
    assert near.mean() > 0.5
    assert far.mean() < 0.05


def test_radiance_has_no_exposure_of_its_own():
    truth = 10 * picture(0) ** 4
    test = 1.3 * truth
    assert_allclose(hdr_flip(16 * test, 16 * truth), hdr_flip(test, truth), atol=1e-4)
    assert_array_equal(hdr_flip(truth, truth), 0)


def test_a_difference_is_seen_at_the_exposure_that_shows_it():
    truth = flat(0.01, 0.01, 0.01, size=48)
    truth[:, 32:] = 40.0
    dark_is_off, bright_is_off = truth.copy(), truth.copy()
    dark_is_off[:, :32] *= 1.5
    bright_is_off[:, 32:] *= 1.5
    far_from_the_edge = np.s_[:, 2:12], np.s_[:, -12:-2]
    for test, part in zip((dark_is_off, bright_is_off), far_from_the_edge, strict=True):
        assert hdr_flip(test, truth)[part].min() > 0.05


def test_exposures_go_from_the_brightest_pixel_to_the_median_of_those_not_black():
    truth = flat(0, 0, 0)
    truth[0, :5] = np.array([1, 4, 4, 4, 64])[:, None]
    stops = exposures(truth)
    assert len(stops) == 4
    assert stops[-1] - stops[0] == pytest.approx(4)
    # Where the tone curve is at 0.85.
    bright = 64 * 2 ** stops[0] * 0.6
    shown = bright * (2.51 * bright + 0.03) / (bright * (2.43 * bright + 0.59) + 0.14)
    assert shown == pytest.approx(0.85)


def test_black_and_glaring_pictures_have_numbers():
    black, glaring = flat(0, 0, 0), flat(1e30, 1e30, 1e30)
    assert_array_equal(hdr_flip(black, black), 0)
    assert np.all(np.isfinite(hdr_flip(black, glaring)))
    assert np.all(np.isfinite(hdr_flip(glaring, picture(0, (8, 8)))))


def test_agrees_with_the_authors_program():
    peer = pytest.importorskip("flip_evaluator")
    truth = np.float32(picture(1))
    rng = np.random.default_rng(2)
    test = np.float32(np.clip(truth + 0.1 * rng.normal(size=truth.shape), 0, 1))

    def theirs(reference, ours, kind):
        return peer.evaluate(reference, ours, kind, applyMagma=False)[0].squeeze()

    coded = [srgb_encode(each).astype(np.float32) for each in (truth, test)]
    settings = peer.evaluate(*coded, "LDR")[2]
    assert settings["ppd"] == pytest.approx(PIXELS_PER_DEGREE, rel=1e-6)
    assert_allclose(flip(test, truth), theirs(*coded, "LDR"), atol=1e-4)
    radiance = [np.float32(30 * each**4) for each in (truth, test)]
    assert_allclose(hdr_flip(*radiance[::-1]), theirs(*radiance, "HDR"), atol=1e-3)
