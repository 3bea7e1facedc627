"""Memory that is given out again, and never while anyone still looks at it."""

import gc

import numpy as np

from capture.frame import Bracket, Exposure, Frame
from capture.merge import merge_bracket
from capture.picture_memory import PictureMemory
from tests.capture.simulated_bracket import SRGB_8_BIT

SIZE_PX = (7, 5)


def bracket(seed, size_px=SIZE_PX):
    width, height = size_px
    counts = np.random.default_rng(seed).integers(0, 256, (2, height, width, 3), np.uint8)
    exposures = [Exposure(0.1), Exposure(1.0)]
    return Bracket(tuple(map(Frame, counts, exposures)))


def address(image):
    return image.radiance.ctypes.data


def test_pictures_are_those_without_it():
    memory = PictureMemory()
    for seed in range(4):
        ours = merge_bracket(bracket(seed), SRGB_8_BIT, memory)
        plain = merge_bracket(bracket(seed), SRGB_8_BIT)
        for name in ("radiance", "variance", "valid", "clipped"):
            np.testing.assert_array_equal(getattr(ours, name), getattr(plain, name))


def test_a_stream_takes_two_pieces_of_memory():
    memory = PictureMemory()
    addresses = set()
    for seed in range(6):
        image = merge_bracket(bracket(seed), SRGB_8_BIT, memory)  # the one before is still held
        addresses.add(address(image))
    assert len(addresses) == 2


def test_pictures_that_are_kept_stay_as_they_are():
    memory = PictureMemory()
    kept = [merge_bracket(bracket(seed), SRGB_8_BIT, memory) for seed in range(5)]
    for seed, image in enumerate(kept):
        plain = merge_bracket(bracket(seed), SRGB_8_BIT)
        np.testing.assert_array_equal(image.radiance, plain.radiance)


def test_a_view_of_one_array_keeps_the_picture():
    memory = PictureMemory()
    corner = merge_bracket(bracket(0), SRGB_8_BIT, memory).radiance[1:3, ::2].T
    before = corner.copy()
    gc.collect()
    for seed in range(1, 6):
        merge_bracket(bracket(seed), SRGB_8_BIT, memory)
    np.testing.assert_array_equal(corner, before)


def test_another_size_gets_memory_of_its_own():
    memory = PictureMemory()
    for size_px in (SIZE_PX, (9, 8), (3, 2)):
        image = merge_bracket(bracket(0, size_px), SRGB_8_BIT, memory)
        assert image.size_px == size_px
        plain = merge_bracket(bracket(0, size_px), SRGB_8_BIT)
        np.testing.assert_array_equal(image.radiance, plain.radiance)
        del image


def test_pictures_are_read_only():
    image = merge_bracket(bracket(0), SRGB_8_BIT, PictureMemory())
    assert not image.radiance.flags.writeable
    assert not image.clipped.flags.writeable
