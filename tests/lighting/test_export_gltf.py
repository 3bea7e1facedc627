"""glTF scenes, read by pygltflib."""

import numpy as np
import pytest
from pygltflib import GLTF2
from scipy.spatial.transform import Rotation

from lighting.export.files import write_scene
from lighting.export.rig import light_rig
from lighting.light_set import LightSet
from lighting.maps.environment_files import read_environment
from tests.environments import normals
from tests.lighting.room import assert_lit_by_the_room, lamps, room

KHR = "KHR_lights_punctual"


def directional_lights(gltf):
    """Return the direction toward each light and its illuminance, as the extension has them."""
    directions, illuminance = [], []
    for node in (gltf.nodes[index] for index in gltf.scenes[gltf.scene].nodes or []):
        light = gltf.extensions[KHR]["lights"][node.extensions[KHR]["light"]]
        assert light["type"] == "directional"
        directions.append(-Rotation.from_quat(node.rotation).apply([0, 0, -1]))
        illuminance.append(np.array(light["color"]) * light["intensity"])
    return np.array(directions).reshape(-1, 3), np.array(illuminance).reshape(-1, 3)


@pytest.mark.parametrize("suffix", [".gltf", ".glb"])
def test_it_lights_every_side_as_the_room_does(tmp_path, suffix):
    path = tmp_path / f"scene{suffix}"
    write_scene(path, light_rig(lamps(), room()))
    gltf = GLTF2().load(path)
    assert gltf.asset.version == "2.0"
    assert gltf.extensionsUsed == [KHR]
    directions, illuminance = directional_lights(gltf)
    np.testing.assert_allclose(directions, lamps().directions[:2], atol=1e-12)
    radii = [light["extras"]["angularRadius"] for light in gltf.extensions[KHR]["lights"]]
    np.testing.assert_allclose(radii, lamps().angular_radius_rad[:2])

    extras = gltf.scenes[0].extras
    assert extras["environmentMapConvention"] == "three"
    assert extras["scale"] == "relative"
    dome, _ = read_environment(tmp_path / extras["environmentMap"])
    towards = normals()
    clamped = np.clip(towards @ directions.T, 0, None)
    assert_lit_by_the_room(towards, clamped @ illuminance + under_three_js(towards, dome), 0.005)


def under_three_js(towards, dome):
    """The irradiance from a map that is looked up as three.js does: u = atan2(z, x)/2π + ½."""
    height = dome.height
    u, v = np.meshgrid(
        (np.arange(2 * height) + 0.5) / (2 * height), (np.arange(height) + 0.5) / height
    )
    longitude, theta = 2 * np.pi * (u - 0.5), np.pi * v
    directions = np.stack(
        [np.sin(theta) * np.cos(longitude), np.cos(theta), np.sin(theta) * np.sin(longitude)],
        axis=-1,
    )
    light = dome.radiance * (np.sin(theta) * (np.pi / height) ** 2)[..., None]
    return np.clip(towards @ directions.reshape(-1, 3).T, 0, None) @ light.reshape(-1, 3)


def test_colours_are_within_the_specification(tmp_path):
    write_scene(tmp_path / "all.gltf", light_rig(lamps()))
    for light in GLTF2().load(tmp_path / "all.gltf").extensions[KHR]["lights"]:
        assert max(light["color"]) == 1
        assert light["intensity"] > 0


def test_a_scene_without_lights_has_no_empty_lists(tmp_path):
    dark = LightSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    write_scene(tmp_path / "dark.gltf", light_rig(dark))
    gltf = GLTF2().load(tmp_path / "dark.gltf")
    assert not gltf.nodes
    assert not gltf.extensionsUsed
    assert "[]" not in (tmp_path / "dark.gltf").read_text()


def test_a_binary_file_is_aligned(tmp_path):
    for name in ("a", "ab", "abc", "abcd"):
        lights = LightSet(np.eye(3)[:1], np.ones((1, 3)), np.zeros(1), source=name)
        write_scene(tmp_path / "aligned.glb", light_rig(lights), force=True)
        content = (tmp_path / "aligned.glb").read_bytes()
        assert len(content) % 4 == 0
        assert int.from_bytes(content[8:12], "little") == len(content)
        assert GLTF2().load(tmp_path / "aligned.glb").scenes[0].extras["source"] == name
