"""What pixels lend each other of their lobes, and which of a lobe's rays each traces."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from render.moving.lobe_sharing import FACING, GRAZING, LOBE_FIELDS, TOWARD, add_shared_lobes
from render.moving.reflected_map import _GOLDEN, _points
from render.rays.lobe import lobe_points, on_disc
from render.rays.surface_rows import ALPHA2, F0, F90, GLOSSY, KIND, LANES, SIDE, empty_surfaces

SIZE_PX = (64, 16)
WIDTH, HEIGHT = SIZE_PX


def shown(facing, grazing=0.0, toward=(0, 1, 0), alpha2=0.01, f0=1.0, f90=0.0):
    """Return the picture (H, W) of what each pixel saw by itself; all may differ by pixel."""
    surfaces = empty_surfaces(SIZE_PX)
    lobes = np.zeros((surfaces.shape[0], LANES, LOBE_FIELDS, surfaces.shape[3]), np.float32)
    for rows, first, value in (
        (surfaces, KIND, GLOSSY),
        (surfaces, ALPHA2, alpha2),
        (surfaces, F0, f0),
        (surfaces, F90, f90),
        (lobes, FACING, facing),
        (lobes, GRAZING, grazing),
        *((lobes, TOWARD + axis, toward[axis]) for axis in range(3)),
    ):
        of_pixels = np.broadcast_to(np.asarray(value, np.float32), (HEIGHT, WIDTH))
        tiles = of_pixels.reshape(HEIGHT // SIDE, SIDE, WIDTH // SIDE, SIDE)
        inside = tiles.swapaxes(1, 2).reshape(HEIGHT // SIDE, WIDTH // SIDE, LANES).swapaxes(1, 2)
        rows[1 : HEIGHT // SIDE + 1, :, first, 1 : WIDTH // SIDE + 1] = inside
    picture = np.zeros((HEIGHT, WIDTH, 4), np.float32)
    add_shared_lobes(surfaces, lobes, 0.04, picture)
    return picture[..., 0]


def test_a_pixel_has_what_all_sixteen_sharers_saw():
    saw = np.arange(16.0).reshape(4, 4) ** 2
    seen = np.tile(saw, (HEIGHT // 4, WIDTH // 4))
    assert_allclose(shown(seen)[2:-2, 2:-2], saw.mean(), rtol=1e-6)


def test_each_pixel_reflects_by_its_own_material():
    f0, f90 = np.random.default_rng(1).random((2, HEIGHT, WIDTH), np.float32)
    assert_allclose(shown(2.0, 3.0, f0=f0, f90=f90), 2 * f0 + 3 * f90, rtol=1e-5)


@pytest.mark.parametrize(
    "other",
    [
        {"toward": (0.0, np.cos(0.2), np.sin(0.2))},  # of lobes 0.1 wide
        {"alpha2": 0.03},
        {"alpha2": 0.05},  # too rough for mirrors: shows nothing
    ],
)
def test_what_mirrors_another_part_of_the_map_lends_nothing(other):
    right = np.arange(WIDTH) >= 37
    usual = {"toward": (0, 1, 0), "alpha2": 0.01}
    mixed = {
        key: [np.where(right, a, b) for a, b in zip(other[key], usual[key], strict=True)]
        if key == "toward"
        else np.where(right, other[key], usual[key])
        for key in other
    }
    picture = shown(np.where(right, 5.0, 1.0), **mixed)
    beyond = 0 if other.get("alpha2", 0) > 0.04 else 5
    assert_allclose(picture, np.broadcast_to(np.where(right, beyond, 1), picture.shape), rtol=1e-6)


@pytest.mark.parametrize("count", [4, 12])
def test_a_tile_shares_all_parts_of_a_lobe(count):
    """Sixteen times as many as each pixel has; in a row, column or square, of every quarter."""
    own, shared = _points(count)
    expected = sorted(map(tuple, on_disc(lobe_points(count))))
    assert_array_equal(sorted(map(tuple, own[:, :, 5])), expected)
    area = np.sort((shared[:, 0] ** 2 + shared[:, 1] ** 2).ravel())
    assert_allclose(area, (np.arange(4 * count) + 0.5) / (4 * count), atol=1e-6)
    for number, ring in enumerate(shared):
        turn = np.arctan2(ring[1], ring[0]) / (2 * np.pi) - number * _GOLDEN
        quarter = (4 * (turn % 1)).astype(int)
        square = quarter.reshape(2, 2, 2, 2).swapaxes(1, 2).reshape(4, 4)
        for lines in (quarter.reshape(4, 4), quarter.reshape(4, 4).T, square):
            assert np.all(np.sort(lines, axis=1) == np.arange(4))
