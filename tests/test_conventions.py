"""CONVENTIONS.md, sentence by sentence.

The heart is a map with one colour on each of the six axes, made by a camera that does not use the
lat-long code: a yaw error and a mirror image must both be found out.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from calibration.camera import LEVEL, UP, Calibration
from calibration.models.equidistant import Equidistant
from calibration.models.equirectangular import full_sphere
from capture.radiance import RELATIVE, RadianceImage
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap, luminance
from lighting.maps.remap import apply_remap, build_remap
from lighting.sphere.latlong import (
    cell_directions,
    direction_to_grid,
    grid_to_direction,
    solid_angles,
)

HEIGHT = 32
AXES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64)
COLOURS = np.array([[1, 0, 0], [0, 1, 1], [0, 1, 0], [1, 0, 1], [0, 0, 1], [1, 1, 0]], np.float64)


def seen_by(camera: Calibration) -> EnvironmentMap:
    """The map of a picture that shows a spot of each axis's colour, placed by the lens alone."""
    width, height = camera.image_size_px
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    directions, _ = camera.unproject(np.stack([x, y], axis=-1).astype(np.float64))
    nearness = np.nan_to_num(directions @ AXES.T)
    radiance = ((nearness > np.cos(0.35)) @ COLOURS).astype(np.float32)
    plane = np.ones((height, width), bool)
    image = RadianceImage(radiance, np.zeros_like(radiance), plane, ~plane)
    return apply_remap(build_remap(camera, HEIGHT), image)


def shows_the_axes(radiance: NDArray[np.floating], valid: NDArray[np.bool_]) -> bool:
    """Whether each axis that was seen has its own colour, where section 3 puts it."""
    # (row, column) of +X, −X, +Y, −Y, +Z, −Z, by the drawing in CONVENTIONS.md, not by the code.
    middle = HEIGHT // 2
    places = [
        (middle, HEIGHT // 2),
        (middle, 3 * HEIGHT // 2),
        (0, 5),
        (HEIGHT - 1, 5),
        (middle, HEIGHT),
        (middle, 0),
    ]
    return all(
        np.allclose(radiance[place], colour, atol=0.02)
        for place, colour in zip(places, COLOURS, strict=True)
        if valid[place]
    )


CAMERAS = {
    "360°": Calibration(full_sphere((256, 128)), (256, 128), np.pi),
    "fisheye level": Calibration(Equidistant((127.5, 127.5), 70.0), (256, 256), 1.8),
    "fisheye up": Calibration(
        Equidistant((127.5, 127.5), 70.0), (256, 256), 1.8, R_world_camera=UP
    ),
}


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())
def test_six_axes_lie_where_they_should(camera: Calibration) -> None:
    environment = seen_by(camera)
    assert environment.valid.mean() > 0.4
    assert shows_the_axes(environment.radiance, environment.valid)


def test_a_yaw_error_and_a_mirror_are_found_out() -> None:
    environment = seen_by(CAMERAS["360°"])
    radiance, valid = environment.radiance, environment.valid
    assert valid.all()
    for quarter in (1, 2, 3):
        assert not shows_the_axes(np.roll(radiance, quarter * HEIGHT // 2, axis=1), valid)
    assert not shows_the_axes(radiance[:, ::-1], valid)
    assert not shows_the_axes(radiance[::-1], valid)
    turned = replace(CAMERAS["360°"], R_world_camera=UP)
    assert shows_the_axes(seen_by(turned).radiance, valid)  # the pose is undone, so nothing moves


def test_the_world_and_the_camera_are_right_handed() -> None:
    for rotation in (LEVEL, UP):
        assert np.linalg.det(rotation) == pytest.approx(1)
    x, y, z = np.eye(3)
    np.testing.assert_array_equal(np.cross(x, y), z)


def test_transforms_read_from_camera_to_world() -> None:
    camera = CAMERAS["fisheye up"]
    forward, _ = camera.unproject(np.array([127.5, 127.5]))
    np.testing.assert_allclose(forward, [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(camera.R_world_camera @ [0, 0, 1], forward, atol=1e-12)


def test_level_has_plus_x_on_the_left_and_the_sky_above() -> None:
    left, above = np.array([90.0, 127.5]), np.array([127.5, 90.0])
    directions, _ = CAMERAS["fisheye level"].unproject(np.stack([left, above]))
    assert directions[0, 0] > 0.4
    assert directions[1, 1] > 0.4


def test_up_has_minus_z_at_its_top_and_minus_x_at_its_right() -> None:
    top, right = np.array([127.5, 90.0]), np.array([165.0, 127.5])
    directions, _ = CAMERAS["fisheye up"].unproject(np.stack([top, right]))
    assert directions[0, 2] < -0.4
    assert directions[1, 0] < -0.4


def test_a_picture_spans_half_a_pixel_beyond_its_outer_centres() -> None:
    camera = CAMERAS["360°"]
    edges = np.array([[-0.5, 64.0], [255.5, 64.0], [-0.51, 64.0], [255.51, 64.0]])
    _, valid = camera.unproject(edges)
    assert valid.tolist() == [True, True, False, False]


def test_a_resized_picture_keeps_its_edges() -> None:
    half = CAMERAS["360°"].scaled_to((128, 64))
    x = np.array([[-0.5, 31.5], [10.0, 20.0]])
    there, _ = half.unproject((x + 0.5) * 0.5 - 0.5)
    here, _ = CAMERAS["360°"].unproject(x)
    np.testing.assert_allclose(there, here, atol=1e-12)


def test_cell_centres_follow_the_formula() -> None:
    r, c = 7, 41
    theta, phi = np.pi * (r + 0.5) / HEIGHT, np.pi - 2 * np.pi * (c + 0.5) / (2 * HEIGHT)
    expected = [np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)]
    np.testing.assert_allclose(cell_directions(HEIGHT)[r, c], expected, atol=1e-15)


@pytest.mark.parametrize(
    ("u", "v", "direction"),
    [
        (0.5, 0.5, [0, 0, 1]),
        (0.25, 0.5, [1, 0, 0]),
        (0.75, 0.5, [-1, 0, 0]),
        (0.0, 0.5, [0, 0, -1]),
        (1.0, 0.5, [0, 0, -1]),
        (0.3, 0.0, [0, 1, 0]),
        (0.3, 1.0, [0, -1, 0]),
    ],
)
def test_edges_of_the_map_lie_on_the_seam_and_the_poles(
    u: float, v: float, direction: list[float]
) -> None:
    """Positions (u, v) from edge to edge; grid coordinates have integers at cell centres."""
    grid = np.array([2 * HEIGHT * u - 0.5, HEIGHT * v - 0.5])
    np.testing.assert_allclose(grid_to_direction(grid, HEIGHT), direction, atol=1e-12)


def test_solid_angles_are_exact() -> None:
    edges = np.pi * np.arange(HEIGHT + 1) / HEIGHT
    expected = np.pi / HEIGHT * (np.cos(edges[:-1]) - np.cos(edges[1:]))
    np.testing.assert_allclose(solid_angles(HEIGHT), expected, rtol=1e-14)
    assert 2 * HEIGHT * solid_angles(HEIGHT).sum() == pytest.approx(4 * np.pi, rel=1e-14)


def test_light_is_linear_float32_rec709_and_relative_unless_said() -> None:
    environment = seen_by(CAMERAS["360°"])
    assert environment.radiance.dtype == np.float32
    assert environment.scale == RELATIVE == "relative"
    np.testing.assert_allclose(luminance(np.eye(3)), [0.2126, 0.7152, 0.0722])
    with np.errstate(over="ignore"):
        assert np.isinf(np.float16(1e6))


def test_lights_are_unit_vectors_with_irradiance_and_extent() -> None:
    with pytest.raises(ValueError, match="unit"):
        LightSet(np.array([[0, 2.0, 0]]), np.ones((1, 3)), np.zeros(1))


class TestOtherPrograms:
    """Section 6: each program's own formula for u, from its direction, against ours."""

    directions = np.random.default_rng(0).normal(size=(200, 3))

    def ours(self, directions: NDArray[np.float64]) -> NDArray[np.float64]:
        return (direction_to_grid(directions, HEIGHT)[:, 0] + 0.5) / (2 * HEIGHT)

    def assert_same(self, a: NDArray[np.float64], b: NDArray[np.float64]) -> None:
        np.testing.assert_allclose(np.exp(2j * np.pi * a), np.exp(2j * np.pi * b), atol=1e-12)

    def test_mitsuba(self) -> None:
        # d = (sin φ sin θ, cos θ, −cos φ sin θ), φ = 2πu
        u = np.arctan2(self.directions[:, 0], -self.directions[:, 2]) / (2 * np.pi)
        self.assert_same(self.ours(self.directions), u)

    def test_three_js(self) -> None:
        u = np.arctan2(self.directions[:, 2], self.directions[:, 0]) / (2 * np.pi) + 0.5
        self.assert_same(self.ours(self.directions), u - 0.25)

    def test_blender(self) -> None:
        x, y, z = self.directions.T
        in_blender = np.stack([x, -z, y], axis=-1)
        assert np.linalg.det(np.stack([[1, 0, 0], [0, 0, -1], [0, 1, 0]])) == pytest.approx(1)
        u = 0.5 - np.arctan2(in_blender[:, 1], in_blender[:, 0]) / (2 * np.pi)
        self.assert_same(self.ours(self.directions), u - 0.25)

    def test_playcanvas(self) -> None:
        x, _, z = (self.directions * (-1, 1, 1)).T  # its shaders turn x round, then look up
        self.assert_same(self.ours(self.directions), np.arctan2(x, z) / (2 * np.pi) + 0.5)
