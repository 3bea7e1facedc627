"""What is seen through each pixel, against closed forms in float64."""

from dataclasses import replace

import numpy as np

from render.rays.background import picture_rays
from render.rays.surface_rows import (
    ALPHA2,
    DULL,
    F0,
    F90,
    FACE_NORMAL,
    FIELDS,
    GLOSSY,
    GROUND,
    KIND,
    MATT,
    NORMAL,
    NOTHING,
    POSITION,
    TRIANGLE,
    U,
    V,
    empty_surfaces,
    in_picture,
)
from render.rays.traced_scene import TracedScene
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.render.boxes import box

METAL = Material((0.9, 0.6, 0.3), roughness=0.4, metalness=1.0)
COATED = Material((0.2, 0.4, 0.6), roughness=0.6, metalness=0.25)
MATT_GREY = Material((0.6, 0.5, 0.4), specular=0.0)
BOX = box((-0.9, 0.0, -0.9), (-0.4, 0.8, -0.2), MATT_GREY)
MESHES = (
    sphere((0.0, 0.5, 0.0), 0.5, METAL, 24),
    sphere((0.9, 0.3, 0.2), 0.3, COATED, 24),
    replace(BOX, faces=BOX.faces[:, ::-1]),  # which the camera sees from behind
)
SCENE = Scene(MESHES, Ground(0.0, (0.5, 0.4, 0.3), 4.0))
CAMERA = Camera(np.array([0.4, 1.2, 3.0]), np.array([0.0, 0.5, 0.0]), 0.9, (90, 60))


def test_every_surface_is_that_of_its_triangle():
    seen, geometry = found(CAMERA)
    seen = seen[seen[..., KIND] >= DULL]
    at = geometry.faces[np.ascontiguousarray(seen[:, TRIANGLE]).view(np.int32)]
    u, v = seen[:, U].astype(float), seen[:, V].astype(float)
    shares = np.stack([1 - u - v, u, v])
    corners = geometry.positions[at].astype(float)
    position = np.einsum("kn,nkc->nc", shares, corners)
    near(seen, POSITION, position)
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    away = position - CAMERA.eye
    facing *= np.where(np.einsum("nc,nc->n", facing, away) > 0, -1, 1)[:, None]
    facing = unit(facing)
    near(seen, FACE_NORMAL, facing)
    normal = unit(np.einsum("kn,nkc->nc", shares, geometry.attributes[at, :3]))
    normal *= np.where(np.einsum("nc,nc->n", normal, facing) < 0, -1, 1)[:, None]
    near(seen, NORMAL, normal)


def test_surfaces_reflect_as_their_materials():
    """Metals by their colour alone, dielectrics by 4 % and evenly, others as much as they are."""
    seen, geometry = found(CAMERA)
    seen = seen[seen[..., KIND] >= DULL]
    mesh = geometry.mesh_of_face[np.ascontiguousarray(seen[:, TRIANGLE]).view(np.int32)]
    assert set(mesh) == {0, 1, 2}
    for number, material in enumerate([METAL, COATED, MATT_GREY]):
        base, metal = np.asarray(material.base_colour), material.metalness
        shown = seen[mesh == number]
        near(shown, MATT, np.tile((1 - metal) / np.pi * base, (len(shown), 1)))
        f0 = (1 - metal) * 0.04 * material.specular + metal * base
        near(shown, F0, np.tile(f0, (len(shown), 1)))
        np.testing.assert_allclose(shown[:, F90], (1 - metal) * material.specular + metal)
        np.testing.assert_allclose(shown[:, ALPHA2], material.roughness**4, rtol=1e-6)
        assert (shown[:, KIND] == (GLOSSY if material.specular else DULL)).all()


def test_elsewhere_there_is_the_ground_or_the_ray():
    seen, _ = found(CAMERA)
    rays = picture_rays(CAMERA, CAMERA.size_px)
    place = CAMERA.eye - rays * (CAMERA.eye[1] / rays[..., 1:2])
    is_ground = seen[..., KIND] == GROUND
    assert is_ground.mean() > 0.1
    np.testing.assert_allclose(seen[is_ground, :3], place[is_ground], atol=2e-5)
    assert (np.hypot(place[is_ground, 0], place[is_ground, 2]) < 4.001).all()
    assert (seen[is_ground, NORMAL:MATT] == [0, 1, 0, 0, 1, 0]).all()
    np.testing.assert_allclose(
        seen[is_ground, MATT:F0], np.tile(SCENE.ground.reflectance, (is_ground.sum(), 1)) / np.pi
    )
    is_empty = seen[..., KIND] == NOTHING
    assert is_empty.mean() > 0.1
    np.testing.assert_allclose(seen[is_empty, :3], rays[is_empty], atol=1e-6)
    assert (seen[is_empty, NORMAL:KIND] == 0).all()
    assert (seen[is_ground, F0:KIND] == 0).all()


def test_nothing_stays_of_the_picture_before():
    """Not even in fields that are zero and are not written again."""
    surfaces = empty_surfaces(CAMERA.size_px, FIELDS + 3)
    for target in ((0.0, 0.5, 0.0), (0.0, 3.0, 0.0), (2.0, 0.0, 1.0)):
        camera = replace(CAMERA, target=np.array(target))
        again, _ = found(camera, surfaces)
        anew, _ = found(camera)
        np.testing.assert_array_equal(again.view(np.int32), anew.view(np.int32))


def found(camera, surfaces=None):
    """Return what a camera sees, (H, W, FIELDS + 3), and the triangles."""
    surfaces = empty_surfaces(camera.size_px, FIELDS + 3) if surfaces is None else surfaces
    with_triangles = TracedScene(SCENE)
    with_triangles.find_surfaces(camera, camera.size_px, surfaces)
    with_triangles.release()
    return in_picture(surfaces, camera.size_px).copy(), with_triangles.geometry


def near(seen, field, expected):
    np.testing.assert_allclose(seen[:, field : field + 3], expected, atol=2e-6)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
