"""Scene types: what they refuse, and where the camera sees what."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from capture.errors import InputError
from render.scenes.default_scene import default_scene, frame_meshes, sphere
from render.scenes.scene import Camera, Ground, Material, Mesh, Scene

TRIANGLE = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
NORMALS = np.tile(np.float32([0, 0, 1]), (3, 1))
POINTS = st.tuples(*[st.floats(-10, 10)] * 3)


def project(camera, point, near_m=0.1, far_m=100.0):
    """Column and row of a world point in the picture, (0, 0) the centre of the first pixel."""
    clip = camera.world_to_clip(near_m, far_m) @ [*point, 1.0]
    x, y, z = clip[:3] / clip[3]
    width, height = camera.size_px
    return np.array([(x + 1) / 2 * width - 0.5, (1 - y) / 2 * height - 0.5]), z


@settings(deadline=None, max_examples=50)
@given(POINTS, POINTS)
def test_the_target_is_in_the_centre(eye, target):
    view = np.subtract(target, eye)
    if np.hypot(view[0], view[2]) < 1e-2:
        return
    camera = Camera(np.array(eye), np.array(target), size_px=(101, 51))
    pixel, _ = project(camera, target)
    assert_allclose(pixel, [50, 25], atol=1e-6)


def test_right_is_right_and_up_is_up():
    # From +Z the world's +X is to the right. At 2 m and 90° the picture is 4 m high.
    camera = Camera(np.array([0, 0, 2.0]), np.zeros(3), math.pi / 2, (40, 40))
    assert_allclose(project(camera, (1, 0, 0))[0], [29.5, 19.5])
    assert_allclose(project(camera, (0, 1, 0))[0], [19.5, 9.5])


def test_near_and_far_plane_are_the_ends_of_depth():
    camera = Camera(np.array([0, 0, 2.0]), np.zeros(3))
    assert_allclose(project(camera, (0, 0, 1.0), near_m=1, far_m=4)[1], -1)
    assert_allclose(project(camera, (0, 0, -2.0), near_m=1, far_m=4)[1], 1)


@pytest.mark.parametrize("size_px", [(640, 480), (200, 800), (640, 64)])
def test_a_framed_mesh_stands_on_the_ground_inside_the_picture(size_px):
    scene, camera = frame_meshes((sphere((5.0, -3.0, 100.0), 20.0, Material()),), size_px)
    assert_allclose(scene.ground.y_m, -23.0)
    pixels = np.array([project(camera, p)[0] for p in scene.meshes[0].positions[::7]])
    assert np.all(pixels > 0)
    assert np.all(pixels < size_px)


def test_the_ground_ends_at_the_horizon():
    scene, camera = default_scene()
    drop_rad = math.atan((camera.eye[1] - scene.ground.y_m) / scene.ground.radius_m)
    assert drop_rad / camera.vertical_fov_rad * 480 < 1.5  # rows of the picture


def test_the_objects_of_the_default_scene_stand_on_its_ground_and_apart():
    scene, _ = default_scene()
    lowest = [mesh.positions[:, 1].min() for mesh in scene.meshes]
    assert_allclose(lowest, scene.ground.y_m, atol=1e-6)
    for i, mesh in enumerate(scene.meshes):
        for other in scene.meshes[i + 1 :]:
            gaps = np.linalg.norm(mesh.positions[::9, None] - other.positions[None, ::9], axis=2)
            assert gaps.min() > 0.05


@pytest.mark.parametrize(
    ("positions", "faces", "message"),
    [
        (TRIANGLE * np.nan, [[0, 1, 2]], "NaN"),
        (TRIANGLE, [[0, 1, 3]], "outside 0 … 2"),
        (TRIANGLE, np.zeros((0, 3)), "at least one triangle"),
    ],
)
def test_a_broken_mesh_is_refused(positions, faces, message):
    with pytest.raises(InputError, match=message):
        Mesh(positions, NORMALS, faces)


def test_arrays_of_a_mesh_cannot_be_changed():
    mesh = Mesh(TRIANGLE, NORMALS, [[0, 1, 2]])
    with pytest.raises(ValueError, match="read-only"):
        mesh.positions[0] = 1


@pytest.mark.parametrize(
    "make",
    [
        lambda: Material((0.5, 0.5, 1.5)),
        lambda: Material((0.5, 0.5)),
        lambda: Material(roughness=float("nan")),
        lambda: Ground(radius_m=0.0),
        lambda: Camera(np.zeros(3), np.zeros(3)),
        lambda: Camera(np.array([0, 1.0, 0]), np.zeros(3)),
        lambda: Camera(np.array([0, np.nan, 1.0]), np.zeros(3)),
        lambda: Camera(np.ones(3), np.zeros(3), vertical_fov_rad=math.pi),
        lambda: Camera(np.ones(3), np.zeros(3), size_px=(0, 5)),
        lambda: Scene((), None),
    ],
)
def test_nonsense_is_refused(make):
    with pytest.raises(InputError):
        make()
