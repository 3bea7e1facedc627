"""The map behind pictures against `background.look_up`, which keeps the places of a still view."""

import numpy as np
import pytest

from render.moving.surroundings import show_map
from render.rays.background import look_up, map_coordinates, picture_rays
from render.rays.surface_rows import GROUND, KIND, empty_surfaces, in_picture
from render.rays.traced_scene import TracedScene
from render.scenes.scene import Camera, Ground, Scene

SIZE_PX = (45, 30)  # the last tiles reach over the picture's edges
EYE = np.array([0.3, 0.5, 0.2])
MAP = np.random.default_rng(3).random((16, 32, 3), np.float32)
OFF = 2e-4  # 16 cells, of which neighbours differ by 1, times what map_places.py is off


@pytest.mark.parametrize(
    "toward",
    [(0.01, 1, 0.02), (-0.02, -1, 0.01), (0.1, 0.2, -1), (0.01, 1.2, -1)],
    ids=["zenith", "nadir", "seam", "both"],
)
def test_no_seam_and_no_pole_is_seen(toward):
    picture, expected, _ = shown(Ground(-1e6, radius_m=1e-3), toward, None)
    np.testing.assert_allclose(picture[..., :3], expected, atol=OFF)
    assert (picture[..., 3] == 0.25).all(), "alpha is not the map's"


def test_through_the_ground_it_is_in_the_ground_s_shadow():
    """Where that is black without shadow, there is nothing to tell shadow by."""
    ground, toward = Ground(0.0, radius_m=2.0), (0.1, -0.6, -1)
    picture, expected, on_ground = shown(ground, toward, np.array([0.5, 1.0, 0.0], np.float32))
    assert 0.1 < on_ground.mean() < 0.9
    shade = np.where(on_ground[..., None], [0.5, 0.25, 1.0], 1.0)
    np.testing.assert_allclose(picture[..., :3], shade * expected, atol=OFF)
    opaque, _, _ = shown(ground, toward, None)
    assert (opaque[on_ground] == 0.25).all()
    np.testing.assert_allclose(opaque[~on_ground, :3], expected[~on_ground], atol=OFF)


def shown(ground, toward, unshaded):
    """Return a picture that was 0.25, what the map shows everywhere, and where the ground is."""
    camera = Camera(EYE, EYE + np.array(toward), 1.7, SIZE_PX)
    surfaces = empty_surfaces(SIZE_PX)
    traced = TracedScene(Scene((), ground))
    traced.find_surfaces(camera, SIZE_PX, surfaces)
    traced.release()
    picture = np.full((*SIZE_PX[::-1], 4), 0.25, np.float32)
    show_map(surfaces, EYE, MAP, unshaded, picture)
    expected = np.zeros((picture[..., 0].size, 3), np.float32)
    places = map_coordinates(picture_rays(camera, SIZE_PX).reshape(-1, 3))
    look_up(MAP, places, np.arange(len(places)), expected)
    is_ground = in_picture(surfaces, SIZE_PX)[..., KIND] == GROUND
    return picture, expected.reshape(*picture.shape[:2], 3), is_ground
