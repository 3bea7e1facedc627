"""The remap: constants stay constant, light keeps its flux and place, marks travel."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import lighting.maps.remap_image
from calibration.camera import LEVEL, UP, Calibration, ImageCircle
from calibration.models.equidistant import Equidistant
from calibration.models.equirectangular import full_sphere
from calibration.models.equisolid import Equisolid
from calibration.models.mirror_ball import MirrorBall
from capture.errors import InputError
from capture.radiance import RadianceImage
from lighting.maps.footprint import pixel_footprint, row_balance, triangle_solid_angle
from lighting.maps.remap import Remap, apply_remap, build_remap
from lighting.maps.remap_image import remap_image
from lighting.sphere.latlong import (
    cell_directions,
    direction_to_grid,
    grid_to_direction,
    solid_angles,
)


def rotation(axis: int, angle_rad: float) -> NDArray[np.float64]:
    """Right-handed rotation about axis 0, 1 or 2 of the world."""
    turn = np.eye(3)
    a, b = (axis + 1) % 3, (axis + 2) % 3
    turn[a, a] = turn[b, b] = np.cos(angle_rad)
    turn[b, a] = np.sin(angle_rad)
    turn[a, b] = -turn[b, a]
    return turn


def fisheye(size: int, R_world_camera: NDArray[np.float64] = UP) -> Calibration:
    """A 180° equidistant fisheye that fills a square picture."""
    centre = ((size - 1) / 2, (size - 1) / 2)
    return Calibration(
        Equidistant(centre, size / np.pi), (size, size), np.pi / 2, R_world_camera=R_world_camera
    )


TILTED = rotation(0, 0.3) @ UP
"""Sees the zenith off its axis, and the seam."""
CAMERAS = {
    "fisheye up": fisheye(96),
    "fisheye tilted": fisheye(96, TILTED),
    "fisheye level": fisheye(96, LEVEL),
    "220° equisolid, off centre": Calibration(
        Equisolid((50.2, 46.9), 34.0),
        (104, 96),
        np.radians(110),
        image_circle=ImageCircle((50, 47), 47),
    ),
    "mirror ball": Calibration(MirrorBall((47.5, 47.5), 47.0, 12.0), (96, 96), np.radians(174)),
    "equirectangular": Calibration(full_sphere((96, 48)), (96, 48), np.pi),
    "equirectangular tilted": Calibration(
        full_sphere((96, 48)), (96, 48), np.pi, R_world_camera=rotation(2, 0.7) @ LEVEL
    ),
}
every_camera = pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())


def picture(radiance: NDArray[np.floating], **marks: NDArray[np.bool_]) -> RadianceImage:
    """A radiance image from (H, W, 3), or grey (H, W)."""
    if radiance.ndim == 2:
        radiance = np.repeat(radiance[..., None], 3, axis=-1)
    plane = radiance.shape[:2]
    known = {"valid": np.ones(plane, bool), "clipped": np.zeros(plane, bool)} | marks
    return RadianceImage(radiance.astype(np.float32), np.zeros(radiance.shape), **known)


def pixel_directions(camera: Calibration) -> NDArray[np.float64]:
    width, height = camera.image_size_px
    return camera.unproject(np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1) * 1.0)[0]


def angle_between(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1))


def from_each_pixel(remap: Remap, per_cell: NDArray[np.float64]) -> NDArray[np.float64]:
    """Σ over cells of weight × per_cell (2N², k), for each pixel (H W, k)."""
    cell = np.repeat(remap.cells, np.diff(remap.starts))
    width, height = remap.image_size_px
    return np.stack(
        [
            np.bincount(remap.pixels, remap.weights * column[cell], minlength=width * height)
            for column in per_cell.T
        ],
        axis=-1,
    )


def from_each_cell(remap: Remap, per_pixel: NDArray[np.generic]) -> NDArray[np.float64]:
    """Σ over pixels of weight × per_pixel (H, W), for each cell (2N²,)."""
    cell = np.repeat(remap.cells, np.diff(remap.starts))
    values = remap.weights * per_pixel.ravel()[remap.pixels]
    return np.bincount(cell, values, minlength=remap.coverage.size)


LARGE = 512  # pixels across: cells of 512 rows are as wide as they are


@cache
def large_remap(height: int) -> tuple[Calibration, Remap]:
    camera = fisheye(LARGE, TILTED)
    return camera, build_remap(camera, height)


def test_an_octant_is_an_eighth_of_the_sphere() -> None:
    x, y, z = np.eye(3)
    assert triangle_solid_angle(x, y, z) == pytest.approx(np.pi / 2, rel=1e-14)
    # A small triangle is flat: half of 1e-3 × 2e-3, to the order of its square.
    flat = [v / np.linalg.norm(v) for v in np.array([[0, 0, 1], [1e-3, 0, 1], [0, 2e-3, 1]])]
    assert triangle_solid_angle(*flat) == pytest.approx(1e-6, rel=1e-5)


@pytest.mark.parametrize("height", [2, 3, 16, 65])
def test_row_factors_give_every_row_its_solid_angle(height: int) -> None:
    factors = row_balance(height)
    # Integrate the balanced tents over colatitude afresh, by more samples than they were fitted to.
    y = np.linspace(-0.5, height - 0.5, height * 500 + 1)
    y = (y[1:] + y[:-1]) / 2
    distance = np.abs(np.arange(-1, height + 1)[:, None] - y)
    tents = (
        np.maximum(0, 1 - distance) * np.concatenate([factors[:1], factors, factors[-1:]])[:, None]
    )
    tents[1] += tents[0]  # beyond a pole lies the edge row again
    tents[-2] += tents[-1]
    tents = tents[1:-1] / tents[1:-1].sum(axis=0)
    rows = tents @ np.sin(np.pi * (y + 0.5) / height) * np.pi / (500 * height) * np.pi / height
    np.testing.assert_allclose(rows, solid_angles(height), rtol=2e-3)


@every_camera
@pytest.mark.parametrize("height", [4, 16, 31, 128])
def test_a_constant_picture_is_a_constant_map(camera: Calibration, height: int) -> None:
    width, rows = camera.image_size_px
    colour = np.broadcast_to(np.array([0.3, 7.0, 2e5], np.float32), (rows, width, 3))
    environment = apply_remap(build_remap(camera, height), picture(colour))
    assert environment.valid.any()
    seen = environment.radiance[environment.valid]
    np.testing.assert_allclose(seen, np.broadcast_to(colour[0, 0], seen.shape), rtol=1e-6)
    assert environment.radiance[~environment.valid].max(initial=0) == 0


@every_camera
def test_cells_are_valid_where_the_camera_sees_their_centre(camera: Calibration) -> None:
    height = 32
    environment = apply_remap(
        build_remap(camera, height), picture(np.ones(camera.image_size_px[::-1]))
    )
    _, seen = camera.project(cell_directions(height))
    differ = environment.valid != seen
    # The rules may differ only on the edge: in a cell beside one of the other kind.
    rolled = [np.roll(seen, shift, axis=1) for shift in (-1, 1)]
    shifted = [np.vstack([seen[:1], seen[:-1]]), np.vstack([seen[1:], seen[-1:]])]
    edge = np.any([other != seen for other in rolled + shifted], axis=0)
    assert not np.any(differ & ~edge)
    assert environment.seen_share == pytest.approx(
        solid_angles(height) @ seen.sum(axis=1) / (4 * np.pi), abs=0.015
    )


@pytest.mark.parametrize("height", [32, 64, 128, 256, 512])
def test_every_pixel_keeps_its_flux_and_its_place(height: int) -> None:
    camera, remap = large_remap(height)
    cell_rad = np.pi / height
    directions = pixel_directions(camera).reshape(-1, 3)
    theta = camera.axis_angle(directions)
    inside = theta < np.pi / 2 - 4 * cell_rad
    # Solid angle of an equidistant pixel: sin θ / (θ f²).
    pixel_sr = np.sinc(theta / np.pi) * (np.pi / LARGE) ** 2
    cell_sr = np.repeat(solid_angles(height), 2 * height) * (remap.coverage.ravel() >= 0.5)
    flux = from_each_pixel(remap, cell_sr[:, None])[:, 0]
    error = np.abs(flux[inside] / pixel_sr[inside] - 1)
    assert np.median(error) < 5e-4
    assert np.percentile(error, 99) < 5e-3
    assert error.max() < 0.02
    placed = from_each_pixel(remap, cell_sr[:, None] * cell_directions(height).reshape(-1, 3))
    assert (angle_between(placed, directions)[inside]).max() < 0.1 * cell_rad


@pytest.mark.parametrize("height", [32, 64, 96, 128, 150])
def test_every_pixel_of_a_360_degree_picture_keeps_its_flux_to_the_poles(height: int) -> None:
    width, rows = 192, 96
    remap = build_remap(Calibration(full_sphere((width, rows)), (width, rows), np.pi), height)
    assert remap.coverage.min() == 1
    flux = from_each_pixel(remap, np.repeat(solid_angles(height), 2 * height)[:, None])
    # A pixel of a lat-long picture has the solid angle (2π/W)(cos θ_top − cos θ_bottom).
    pixel_sr = 2 * np.pi / width * -np.diff(np.cos(np.linspace(0, np.pi, rows + 1)))
    expected = np.broadcast_to(pixel_sr[:, None], (rows, width))
    np.testing.assert_allclose(flux.reshape(rows, width), expected, rtol=0.01)


@pytest.mark.parametrize("height", [32, 64, 128, 256, 512])
def test_a_sun_of_half_a_pixel_keeps_its_flux_and_its_place(height: int) -> None:
    camera, remap = large_remap(height)
    cell_rad = np.pi / height
    rng = np.random.default_rng(height)
    directions = grid_to_direction(
        rng.uniform([-0.5, -0.5], [255, 127 / 3], (4 if height > 300 else 12, 2)), 128
    )
    directions[:3] = [0, 1, 0], [1e-3, 1, 0], [1e-4, 0.6, -0.8]  # zenith and seam
    x, y = np.meshgrid(np.arange(LARGE), np.arange(LARGE))
    pixels = pixel_directions(camera)
    pixel_sr = np.sinc(camera.axis_angle(pixels) / np.pi) * (np.pi / LARGE) ** 2
    for direction in directions / np.linalg.norm(directions, axis=1, keepdims=True):
        (u, v), seen = camera.project(direction)
        if not seen or camera.axis_angle(direction) > np.pi / 2 - 4 * cell_rad:
            continue
        sun = 1e6 * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * 0.5**2))
        sun[sun < 1e-6] = 0
        environment = apply_remap(remap, picture(sun))
        flux = (sun * pixel_sr).sum()
        np.testing.assert_allclose(environment.integral(), flux, rtol=0.01)
        light = environment.radiance[..., 0] * solid_angles(height)[:, None]
        placed = np.einsum("rc,rck->k", light, cell_directions(height))
        centroid = np.einsum("rc,rck->k", sun * pixel_sr, np.nan_to_num(pixels))
        assert angle_between(placed, centroid) < 0.25 * cell_rad


def test_a_small_pixel_is_shared_out_bilinearly() -> None:
    """The kernel against numpy, away from the poles: bilinear shares, rows weighted by ρ."""
    camera, height = fisheye(64, TILTED), 32
    corners, _ = camera.unproject(np.stack(np.meshgrid(np.arange(65), np.arange(65)), -1) - 0.5)
    factors = row_balance(height)
    slot = np.full(2 * height**2, -1, np.int32)
    cells, weights = np.empty(2 * height**2, np.int32), np.empty(2 * height**2)
    for r, c in ((5, 33), (33, 60), (45, 12), (20, 51)):
        count, solid_angle = pixel_footprint(corners, r, c, 1.0, factors, slot, cells, weights)
        found = np.bincount(cells[:count], weights[:count], minlength=2 * height**2)
        middle = corners[r : r + 2, c : c + 2].sum(axis=(0, 1))
        column, row = direction_to_grid(middle, height)
        expected = np.zeros((height, 2 * height))
        for below in (0, 1):
            for beside in (0, 1):
                near_row, near_column = int(np.floor(row)) + below, int(np.floor(column)) + beside
                share = (1 - abs(row - near_row)) * (1 - abs(column - near_column))
                expected[near_row, near_column % (2 * height)] += share * factors[near_row]
        np.testing.assert_allclose(found, (expected / expected.sum()).ravel(), atol=1e-12)
        theta = camera.axis_angle(middle)
        assert solid_angle == pytest.approx(np.sinc(theta / np.pi) * (np.pi / 64) ** 2, rel=2e-3)
        assert (slot == -1).all()


@given(steps=st.integers(-32, 32))
@settings(max_examples=6, deadline=None)
def test_remapping_commutes_with_a_yaw_of_whole_cells(steps: int) -> None:
    height = 16
    image = picture(np.random.default_rng(1).random((96, 96, 3)))
    still = apply_remap(build_remap(CAMERAS["fisheye tilted"], height), image)
    turned = replace(
        CAMERAS["fisheye tilted"], R_world_camera=rotation(1, steps * np.pi / height) @ TILTED
    )
    environment = apply_remap(build_remap(turned, height), image)
    # Longitude grows to the left: a turn toward +φ moves the picture to smaller columns.
    np.testing.assert_allclose(
        environment.radiance, np.roll(still.radiance, -steps, axis=1), atol=2e-5
    )
    np.testing.assert_array_equal(environment.valid, np.roll(still.valid, -steps, axis=1))


@given(seed=st.integers(0, 1000), scale=st.floats(1e-3, 1e6))
@settings(max_examples=10, deadline=None)
def test_remapping_is_linear(seed: int, scale: float) -> None:
    remap = build_remap_once()
    rng = np.random.default_rng(seed)
    a, b = rng.random((2, 96, 96, 3), np.float32)
    total = apply_remap(remap, picture(a + np.float32(scale) * b)).radiance
    parts = [apply_remap(remap, picture(part)).radiance.astype(np.float64) for part in (a, b)]
    np.testing.assert_allclose(total, parts[0] + scale * parts[1], rtol=1e-5)


@cache
def build_remap_once() -> Remap:
    return build_remap(CAMERAS["fisheye tilted"], 24)


def test_pixels_that_are_not_valid_count_for_nothing() -> None:
    remap = build_remap_once()
    rng = np.random.default_rng(5)
    valid = rng.random((96, 96)) > 0.2
    radiance = np.where(valid, 2.5, 0)
    environment = apply_remap(remap, picture(radiance, valid=valid))
    np.testing.assert_allclose(environment.radiance[environment.valid], 2.5, rtol=1e-6)
    assert environment.valid.sum() > 0.9 * (remap.coverage >= 0.5).sum()


def test_a_cell_without_enough_valid_pixels_is_not_valid() -> None:
    valid = np.ones((96, 96), bool)
    valid[30:50, 30:50] = False
    remap = build_remap_once()
    environment = apply_remap(remap, picture(np.where(valid, 1.0, 0), valid=valid))
    middle = pixel_directions(CAMERAS["fisheye tilted"])[40, 40]
    column, row = np.rint(direction_to_grid(middle, 24)).astype(int)
    assert not environment.valid[row, column]
    assert environment.radiance[row, column].max() == 0


def test_marks_do_not_change_the_light() -> None:
    """The quick way and the way with marks give the same map."""
    rng = np.random.default_rng(2)
    radiance = rng.random((96, 96, 3))
    clipped = np.zeros((96, 96), bool)
    clipped[60, 20] = True
    plain = apply_remap(build_remap_once(), picture(radiance))
    marked = apply_remap(build_remap_once(), picture(radiance, clipped=clipped))
    np.testing.assert_allclose(marked.radiance, plain.radiance, rtol=2e-6)
    np.testing.assert_array_equal(marked.valid, plain.valid)
    assert marked.clipped.any()
    assert not plain.clipped.any()


@given(row=st.integers(20, 75), column=st.integers(20, 75), height=st.sampled_from([4, 24]))
@settings(max_examples=20, deadline=None)
def test_a_clipped_pixel_marks_the_cells_it_lights_and_no_others(
    row: int, column: int, height: int
) -> None:
    remap = {4: build_coarse_remap, 24: build_remap_once}[height]()
    clipped = np.zeros((96, 96), bool)
    clipped[row, column] = True
    sun = np.where(clipped, 1e4, 0)
    environment = apply_remap(remap, picture(sun, clipped=clipped))
    brightest = environment.radiance[..., 0] == environment.radiance.max()
    assert environment.clipped[brightest].all()
    lit = from_each_cell(remap, clipped) > 0
    np.testing.assert_array_equal(environment.clipped, lit.reshape(environment.clipped.shape))


@cache
def build_coarse_remap() -> Remap:
    return build_remap(CAMERAS["fisheye tilted"], 4)


def test_vignetting_is_divided_out_once() -> None:
    camera = replace(CAMERAS["fisheye tilted"], vignetting=(-0.2, 0.02))
    angle = camera.axis_angle(np.nan_to_num(pixel_directions(camera), nan=1.0))
    darkened = 4.0 * camera.relative_illumination(np.minimum(angle, np.pi / 2))
    remap = build_remap(camera, 24)
    environment = apply_remap(remap, picture(darkened))
    np.testing.assert_allclose(environment.radiance[environment.valid], 4.0, rtol=1e-5)
    valid = np.random.default_rng(8).random((96, 96)) > 0.1
    marked = apply_remap(remap, picture(np.where(valid, darkened, 0), valid=valid))
    np.testing.assert_allclose(marked.radiance[marked.valid], 4.0, rtol=1e-5)


def test_uneven_vignetting_is_divided_out_too() -> None:
    camera = replace(CAMERAS["fisheye tilted"], uneven_vignetting=(0.05, -0.1, 0.02, 0.03))
    darkened = 4.0 * camera.illumination(pixel_directions(camera))
    assert np.nanmin(darkened) < 3.5
    environment = apply_remap(build_remap(camera, 24), picture(np.nan_to_num(darkened)))
    np.testing.assert_allclose(environment.radiance[environment.valid], 4.0, rtol=1e-5)


def test_a_picture_of_another_size_is_refused() -> None:
    image = picture(np.ones((96, 95)))
    with pytest.raises(InputError, match="95×96"):
        apply_remap(build_remap_once(), image)
    with pytest.raises(InputError, match="95×96"):
        remap_image(CAMERAS["fisheye tilted"], image, 24)


def test_the_same_picture_gives_the_same_map_bit_for_bit() -> None:
    image = picture(np.random.default_rng(4).random((96, 96, 3)))
    camera = CAMERAS["mirror ball"]
    maps = [apply_remap(build_remap(camera, 24), image).radiance for _ in range(2)]
    np.testing.assert_array_equal(*maps)


@pytest.mark.parametrize("name", ["fisheye tilted", "equirectangular", "mirror ball"])
def test_a_large_picture_in_bands_gives_the_same_light(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = replace(CAMERAS[name], vignetting=(-0.05,))
    width, rows = camera.image_size_px
    directions = np.nan_to_num(pixel_directions(camera))
    radiance = 2 + np.stack(
        [directions[..., 0], np.sin(5 * directions[..., 1]), directions[..., 2]], -1
    )
    radiance[rows // 2 + 5, width // 2 + 9] = 1e4
    clipped = radiance[..., 0] > 1e3
    valid = np.random.default_rng(3).random((rows, width)) > 0.02
    image = picture(np.where(valid[..., None], radiance, 0), valid=valid, clipped=clipped & valid)
    whole = remap_image(camera, image, 16)
    monkeypatch.setattr(lighting.maps.remap_image, "_OPERATOR_PX", 0)
    monkeypatch.setattr(lighting.maps.remap_image, "_BAND_PX", 1000)
    banded = remap_image(camera, image, 16)
    np.testing.assert_array_equal(banded.clipped, whole.clipped)
    assert (banded.valid != whole.valid).mean() < 0.01
    np.testing.assert_allclose(banded.integral(), whole.integral(), rtol=5e-3)
    both = banded.valid & whole.valid
    np.testing.assert_allclose(banded.radiance[both], whole.radiance[both], rtol=0.1)
    assert np.median(np.abs(banded.radiance[both] / whole.radiance[both] - 1)) < 0.01
