"""USD scenes, read by Pixar's library and rendered by Mitsuba."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdLux

from lighting.export.files import write_scene
from lighting.export.rig import light_rig
from lighting.light_set import LightSet
from lighting.maps.environment_files import read_environment
from tests.lighting.room import assert_lit_by_the_room, lamps, room


@pytest.fixture(scope="module")
def stage(tmp_path_factory):
    path = tmp_path_factory.mktemp("usd") / "scene.usda"
    write_scene(path, light_rig(lamps(), room()))
    return Usd.Stage.Open(str(path))


def distant_lights(stage):
    return [UsdLux.DistantLight(p) for p in stage.Traverse() if p.IsA(UsdLux.DistantLight)]


def toward(light):
    """The direction from which it shines: against −Z of its frame."""
    to_world = UsdGeom.XformCache().GetLocalToWorldTransform(light.GetPrim())
    return -np.array(to_world.TransformDir(Gf.Vec3d(0, 0, -1)))


def radiance_and_radius(light):
    """As the documentation of UsdLux's `inputs:normalize` has it."""
    radius = np.radians(light.GetAngleAttr().Get()) / 2
    rgb = np.array(light.GetColorAttr().Get()) * light.GetIntensityAttr().Get()
    rgb *= 2 ** light.GetExposureAttr().Get()
    assert light.GetNormalizeAttr().Get()
    return rgb / (np.sin(radius) ** 2 * np.pi if radius > 0 else 1.0), radius


def dome_file(stage):
    (dome,) = [UsdLux.DomeLight(p) for p in stage.Traverse() if p.IsA(UsdLux.DomeLight)]
    assert dome.GetTextureFormatAttr().Get() == "latlong"
    assert dome.GetIntensityAttr().Get() == 1
    return dome.GetTextureFileAttr().Get().resolvedPath


def test_the_stage_has_our_frame(stage):
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    assert stage.GetDefaultPrim().GetPath() == "/lights"


def test_each_lamp_is_a_disc_of_its_own_radiance(stage):
    lights = lamps()
    assert len(distant_lights(stage)) == 2
    for index, light in enumerate(distant_lights(stage)):
        np.testing.assert_allclose(toward(light), lights.directions[index], atol=1e-12)
        radiance, radius = radiance_and_radius(light)
        assert radius == pytest.approx(lights.angular_radius_rad[index], rel=1e-6)
        solid_angle = 2 * np.pi * (1 - np.cos(radius))
        np.testing.assert_allclose(radiance * solid_angle, lights.irradiance[index], rtol=1e-6)


def test_the_dome_is_the_map_without_the_lamps(stage):
    dome, _ = read_environment(Path(dome_file(stage)))
    np.testing.assert_array_equal(dome.radiance, light_rig(lamps(), room()).dome.radiance)


def test_mitsuba_lights_a_sphere_with_it_as_the_room_does(stage):
    towards, irradiance = irradiance_by_mitsuba(distant_lights(stage), dome_file(stage))
    assert_lit_by_the_room(towards, irradiance, 0.02)


def test_lights_alone_have_no_dome_and_a_point_gives_its_irradiance(tmp_path):
    point = LightSet(np.array([[0, 0, -1.0]]), np.array([[3.0, 6.0, 0.0]]), np.zeros(1))
    write_scene(tmp_path / "point.usda", light_rig(point))
    stage = Usd.Stage.Open(str(tmp_path / "point.usda"))
    (light,) = distant_lights(stage)
    np.testing.assert_allclose(toward(light), [0, 0, -1], atol=1e-12)
    radiance, radius = radiance_and_radius(light)
    np.testing.assert_allclose(radiance, [3, 6, 0])
    assert radius == 0
    assert not [p for p in stage.Traverse() if p.IsA(UsdLux.DomeLight)]


def test_text_of_others_cannot_break_the_file(tmp_path):
    odd = LightSet(np.eye(3)[:1], np.ones((1, 3)), np.zeros(1), source='a "quoted" \\ Ł\n\0name')
    write_scene(tmp_path / "odd.usda", light_rig(odd))
    stage = Usd.Stage.Open(str(tmp_path / "odd.usda"))
    assert stage.GetRootLayer().documentation.endswith('a "quoted" \\ Ł name')


def irradiance_by_mitsuba(lights, dome_path):
    """Return normals and irradiance of a white sphere, seen from two sides, (n, 3) each."""
    import mitsuba  # takes a third of a second

    mitsuba.set_variant("scalar_rgb")
    scene = {
        "type": "scene",
        "integrator": {"type": "direct"},
        "dome": {"type": "envmap", "filename": dome_path},
        "sphere": {
            "type": "sphere",
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 1.0}},
        },
    }
    for index, light in enumerate(lights):
        radiance, radius = radiance_and_radius(light)
        scene[f"light_{index}"] = {
            "type": "directional",
            "direction": list(-toward(light)),
            "irradiance": {"type": "rgb", "value": list(radiance * np.pi * np.sin(radius) ** 2)},
        }
    loaded = mitsuba.load_dict(scene)
    normals, irradiance = [], []
    for eye in ([0.0, 0.0, 5.0], [0.0, 0.0, -5.0]):
        size = 16
        to_world = mitsuba.ScalarTransform4f().look_at(origin=eye, target=[0, 0, 0], up=[0, 1, 0])
        sensor = mitsuba.load_dict(
            {
                "type": "orthographic",
                "to_world": to_world,
                "film": {
                    "type": "hdrfilm",
                    "width": size,
                    "height": size,
                    "rfilter": {"type": "box"},
                },
                "sampler": {"type": "multijitter", "sample_count": 256},
            }
        )
        picture = np.array(mitsuba.render(loaded, sensor=sensor))[..., :3]
        # Mitsuba's cameras have +x on the left, as ours: the picture's right is x toward −x.
        side = 1 - 2 * (np.arange(size) + 0.5) / size
        left, above = np.meshgrid(side, side)
        inside = left**2 + above**2 < 0.8
        local = np.stack([left, above, -np.sqrt(np.maximum(1 - left**2 - above**2, 0))], axis=-1)
        rotation = np.array(to_world.matrix)[:3, :3]
        normals.append(local[inside] @ rotation.T)
        irradiance.append(np.pi * picture[inside])
    return np.concatenate(normals), np.concatenate(irradiance)
