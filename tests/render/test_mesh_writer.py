"""Meshes written for other programs."""

import numpy as np
import pytest

from capture.errors import InputError
from render.scenes.default_scene import sphere
from render.scenes.mesh import load_meshes
from render.scenes.mesh_writer import write_ply
from render.scenes.scene import Material

BALLS = (
    sphere((0.0, 1.0, 0.0), 0.5, Material(), 4),
    sphere((3.0, 0.3, 0.1), 0.2, Material((0.9, 0.1, 0.1)), 5),
)
COUNT = sum(len(ball.positions) for ball in BALLS)


def test_a_ply_is_read_as_it_was_written(tmp_path):
    colours = np.random.default_rng(0).uniform(size=(COUNT, 3))
    write_ply(tmp_path / "m.ply", BALLS, colours)
    (mesh,) = load_meshes(tmp_path / "m.ply").meshes
    first, second = BALLS
    np.testing.assert_array_equal(mesh.positions, [*first.positions, *second.positions])
    np.testing.assert_allclose(mesh.normals, [*first.normals, *second.normals], atol=1e-6)
    np.testing.assert_array_equal(
        mesh.faces, [*first.faces, *(second.faces + len(first.positions))]
    )
    np.testing.assert_allclose(mesh.vertex_colour, colours, atol=0.005)


def test_a_file_that_exists_is_kept(tmp_path):
    (tmp_path / "m.ply").write_text("mine")
    with pytest.raises(InputError, match="--force"):
        write_ply(tmp_path / "m.ply", BALLS, np.ones((COUNT, 3)), force=False)
    assert (tmp_path / "m.ply").read_text() == "mine"
