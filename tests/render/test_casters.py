"""Casters: closed meshes are told from open ones."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from render.scenes.casters import gather_casters, is_closed, signed_volume
from render.scenes.default_scene import sphere, torus
from render.scenes.scene import Material, Mesh

BALL = sphere((1.0, 2.0, 3.0), 0.5, Material(), rings=32)
RING = torus((0.0, 1.0, 0.0), 1.0, 0.2, Material(), segments=48)


@pytest.mark.parametrize(("mesh", "volume"), [(BALL, 4 / 3 * np.pi / 8), (RING, 2 * np.pi**2 / 25)])
def test_spheres_and_rings_are_closed_and_wound_outward(mesh, volume):
    casters = gather_casters([mesh])
    assert len(casters.open_faces) == 0
    assert_allclose(signed_volume(casters.positions, casters.closed_faces), volume, rtol=0.04)


def test_a_closed_mesh_wound_inward_is_turned():
    inward = Mesh(BALL.positions, BALL.normals, BALL.faces[:, ::-1])
    casters = gather_casters([inward])
    assert signed_volume(casters.positions, casters.closed_faces) > 0


def test_a_mesh_with_a_hole_is_open_and_leaves_the_others_closed():
    holed = Mesh(RING.positions, RING.normals, RING.faces[1:])
    casters = gather_casters([BALL, holed])
    assert len(casters.closed_faces) == len(gather_casters([BALL]).closed_faces)
    assert len(casters.open_faces) == len(RING.faces) - 1
    corners = casters.positions[casters.open_faces]
    assert_array_equal(np.sort(corners, axis=1), np.sort(holed.positions[holed.faces], axis=1))


def test_a_triangle_turned_over_opens_a_mesh():
    casters = gather_casters([BALL])
    faces = casters.closed_faces.copy()
    assert is_closed(faces, len(casters.positions))
    faces[7] = faces[7, ::-1]
    assert not is_closed(faces, len(casters.positions))


def test_the_bounding_sphere_holds_everything():
    casters = gather_casters([BALL, RING])
    for mesh in (BALL, RING):
        distance = np.linalg.norm(mesh.positions - casters.centre, axis=1)
        assert distance.max() <= casters.radius_m * (1 + 1e-6)


def test_nothing_casts_without_meshes():
    casters = gather_casters([])
    assert len(casters.positions) == len(casters.open_faces) == casters.radius_m == 0
