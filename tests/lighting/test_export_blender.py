"""The script for Blender: run by Blender where it is installed, and before a stand-in for it."""

import runpy
import sys
from dataclasses import replace
from types import ModuleType, SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lighting.export.discs import facing_irradiance
from lighting.export.files import write_scene
from lighting.export.orientation import z_up
from lighting.export.rig import light_rig
from tests.lighting.room import assert_lit_by_the_room, lamps, room


@pytest.fixture
def script(tmp_path):
    path = tmp_path / "scene.py"
    write_scene(path, light_rig(lamps(), room()))
    return path


def run_before_a_stand_in(script, monkeypatch):
    """Return the lamps that the script puts into the scene, and its pictures by their paths."""
    placed, pictures = [], {}

    def load(path):
        return pictures.setdefault(path, MagicMock())

    bpy = MagicMock(spec=ModuleType)
    bpy.context, bpy.data = MagicMock(), MagicMock()
    bpy.data.lights.new = lambda name, kind: SimpleNamespace(name=name, kind=kind)
    bpy.data.objects.new = lambda name, data: SimpleNamespace(name=name, data=data)
    collection = bpy.data.collections.new.return_value
    collection.objects.link = placed.append
    bpy.data.images.load = load
    monkeypatch.setitem(sys.modules, "bpy", bpy)
    runpy.run_path(str(script))
    bpy.context.scene.collection.children.link.assert_called_once_with(collection)
    bpy.context.scene.world.node_tree.nodes.clear.assert_called_once()
    return placed, pictures


def test_suns_stand_where_the_lamps_do_and_are_as_strong(script, monkeypatch):
    placed, pictures = run_before_a_stand_in(script, monkeypatch)
    lights = light_rig(lamps(), room()).lights
    assert [lamp.name for lamp in placed] == ["key_0", "key_1"]
    for index, lamp in enumerate(placed):
        assert lamp.data.kind == "SUN"
        assert lamp.rotation_mode == "QUATERNION"
        shines = Rotation.from_quat(lamp.rotation_quaternion, scalar_first=True).apply([0, 0, -1])
        np.testing.assert_allclose(-shines, z_up(lights.directions)[index], atol=1e-12)
        np.testing.assert_allclose(
            np.array(lamp.data.color) * lamp.data.energy, facing_irradiance(lights)[index]
        )
        assert lamp.data.angle == pytest.approx(2 * lights.angular_radius_rad[index])
    (path,) = pictures
    assert path == str(script.with_name("scene.py.dome.exr"))
    assert pictures[path].colorspace_settings.name == "Linear Rec.709"


def test_without_a_dome_no_picture_is_loaded(tmp_path, monkeypatch):
    write_scene(tmp_path / "scene.py", light_rig(lamps()))
    placed, pictures = run_before_a_stand_in(tmp_path / "scene.py", monkeypatch)
    assert len(placed) == 3
    assert not pictures


def test_text_of_others_cannot_break_the_script(tmp_path, monkeypatch):
    odd = replace(lamps(), scale="a\nraise ValueError", source='\0 """\nraise ValueError \\')
    write_scene(tmp_path / "odd.py", light_rig(odd))
    placed, _ = run_before_a_stand_in(tmp_path / "odd.py", monkeypatch)
    assert len(placed) == 3


def test_cycles_lights_a_sphere_with_it_as_the_room_does(script, tmp_path):
    bpy = pytest.importorskip("bpy", reason="Blender is not installed as a module (bpy)")
    towards, irradiance = irradiance_by_cycles(bpy, script, str(tmp_path / "seen.exr"))
    assert_lit_by_the_room(towards, irradiance, 0.02)


def irradiance_by_cycles(bpy, script, picture_path):
    """Return normals, in our frame, and irradiance of a white sphere seen from two sides."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    runpy.run_path(str(script))
    scene = bpy.context.scene
    size = 24
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.max_bounces = 256, 0
    scene.cycles.use_denoising, scene.cycles.filter_width = False, 0.01
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = picture_path
    bpy.ops.mesh.primitive_uv_sphere_add(segments=256, ring_count=128)
    bpy.ops.object.shade_smooth()
    white = bpy.data.materials.new("white")
    white.use_nodes = True
    nodes, links = white.node_tree.nodes, white.node_tree.links
    nodes.clear()
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Color"].default_value = (1, 1, 1, 1)
    links.new(diffuse.outputs["BSDF"], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    bpy.context.object.data.materials.append(white)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale, camera.rotation_mode = "ORTHO", 2, "QUATERNION"
    scene.collection.objects.link(camera)
    scene.camera = camera

    side = (np.arange(size) + 0.5) / size * 2 - 1
    right, above = np.meshgrid(side, side)  # Blender's pixels begin at the lower left
    inside = right**2 + above**2 < 0.8
    local = np.stack([right, above, np.sqrt(np.maximum(1 - right**2 - above**2, 0))], -1)[inside]
    normals, irradiance = [], []
    for turn in (Rotation.from_euler("x", 0.5), Rotation.from_euler("x", 0.5 + np.pi)):
        camera.rotation_quaternion = turn.as_quat(scalar_first=True)
        camera.location = turn.apply([0, 0, 5])
        bpy.ops.render.render(write_still=True)
        picture = bpy.data.images.load(picture_path)
        pixels = np.array(picture.pixels[:]).reshape(size, size, 4)[..., :3]
        bpy.data.images.remove(picture)
        x, y, z = turn.apply(local).T
        normals.append(np.stack([x, z, -y], axis=-1))
        irradiance.append(np.pi * pixels[inside])
    return np.concatenate(normals), np.concatenate(irradiance)
