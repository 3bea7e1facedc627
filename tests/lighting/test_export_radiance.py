"""Radiance scenes, lit by Radiance."""

import os
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lighting.export.files import write_scene
from lighting.export.orientation import z_up
from lighting.export.rig import LightRig, light_rig
from lighting.light_set import LightSet
from lighting.sphere.latlong import cell_directions
from tests.environments import environment, normals
from tests.lighting.room import assert_lit_by_the_room, lamps, room


@pytest.fixture(scope="module")
def environment_variables():
    """Where Radiance's programs and library are: installed, or in the wheel `pyradiance`."""
    variables = dict(os.environ)
    if shutil.which("rtrace") is None:
        reason = "Radiance is not installed (rtrace), nor is its wheel pyradiance"
        wheel = Path(pytest.importorskip("pyradiance", reason=reason).__file__).parent
        variables["PATH"] = f"{wheel / 'bin'}{os.pathsep}{variables['PATH']}"
        variables["RAYPATH"] = f".{os.pathsep}{wheel / 'lib'}"
    return variables


IRRADIANCE = "-I -ab 1 -ad 4096 -aa 0 -lw 1e-6 -dt 0 -dc 1"


def measured_by_radiance(scene, towards, variables, options=IRRADIANCE):
    """Return what rtrace finds at the origin, (n, 3), on normals or along rays in our frame."""

    def run(command, text):
        done = subprocess.run(
            command.split(), input=text, capture_output=True, cwd=scene.parent, env=variables
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    (scene.parent / "scene.oct").write_bytes(run(f"oconv {scene.name}", b""))
    rays = "\n".join("0 0 0 " + " ".join(map(str, ray)) for ray in z_up(towards))
    lines = run(f"rtrace -h {options} scene.oct", rays.encode()).split(b"\n")
    return np.array([line.split() for line in lines if line], np.float64)


def test_it_lights_every_side_as_the_room_does(tmp_path, environment_variables):
    write_scene(tmp_path / "a scene.rad", light_rig(lamps(), room()))
    (tmp_path / "a scene.rad").rename(tmp_path / "scene.rad")  # the dome's name keeps its blank
    towards = normals(96)
    measured = measured_by_radiance(tmp_path / "scene.rad", towards, environment_variables)
    assert_lit_by_the_room(towards, measured, 0.03)


def test_a_ray_finds_each_cell_of_the_dome_where_it_was(tmp_path, environment_variables):
    # Centres of cells, at the seam and the poles too; the picture's colours have 8 bits.
    radiance = np.random.default_rng(0).uniform(0.5, 1, (8, 16, 3))
    dark = LightSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    write_scene(tmp_path / "scene.rad", LightRig(dark, environment(radiance), np.zeros(3)))
    rays = cell_directions(8).reshape(-1, 3)
    found = measured_by_radiance(tmp_path / "scene.rad", rays, environment_variables, "")
    np.testing.assert_allclose(found.reshape(8, 16, 3), radiance, rtol=0.015)


def test_text_of_others_is_no_line_of_the_scene(tmp_path, environment_variables):
    # Radiance runs what stands behind an exclamation mark.
    odd = replace(lamps(), scale="relative\n!touch made\n", source="a\n!touch made\n")
    write_scene(tmp_path / "scene.rad", light_rig(odd))
    measured_by_radiance(tmp_path / "scene.rad", normals(1), environment_variables)
    assert not (tmp_path / "made").exists()


def test_a_point_gives_its_irradiance(tmp_path, environment_variables):
    # At 30° and 60° from the normal of a surface that looks along our +Y, and one below it.
    directions = np.array([[0.5, np.sqrt(0.75), 0], [0, 0.5, np.sqrt(0.75)], [0, -1.0, 0]])
    point = LightSet(directions, np.diag([2.0, 4.0, 8.0]), np.zeros(3))
    write_scene(tmp_path / "points.rad", light_rig(point))
    measured = measured_by_radiance(
        tmp_path / "points.rad", np.array([[0, 1.0, 0]]), environment_variables
    )
    np.testing.assert_allclose(measured, [[2 * np.sqrt(0.75), 2.0, 0.0]], rtol=1e-3)
