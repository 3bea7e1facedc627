"""Objects set into plates."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

from capture.errors import InputError
from capture.exr import read_exr, write_exr
from capture.pictures import read_picture, write_jpeg, write_png
from capture.sensor import srgb_decode
from lighting.light_files import write_lights
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import write_environment
from render.composite_cli import composite_command
from render.lights.all_lights import all_lights, level_irradiance
from render.plates.composite import composite
from render.plates.matching import gain_of_ground, ground_seen, match_albedo, match_gain
from render.plates.placing import placed
from render.plates.plate import Plate, read_plate, write_composite
from render.plates.plate_camera import ground_point, plate_camera, zenith_of_pitch
from render.rays.floor_light import add_floor_light, floor_shade
from render.rays.surface_rows import empty_surfaces
from render.rays.traced_scene import TracedScene
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.render.boxes import box
from tests.render.light_sets import one_light, uniform_fill

SIZE_PX = (64, 48)
CAMERA = plate_camera(SIZE_PX, 60.0, zenith_of_pitch(math.radians(-30)), 0.0, 2.0)
POINT = ground_point(CAMERA, (31.5, 23.5))
BALL = sphere((POINT[0], 0.4, POINT[2]), 0.4, Material((0.6, 0.4, 0.2), specular=0.0), rings=16)
BLACK = Material((0.0, 0.0, 0.0), specular=0.0)
SUN_AND_SKY = LightSet(
    np.array([[0.6, 0.8, 0.0]]),
    np.array([[3.0, 2.5, 2.0]]),
    np.array([0.005]),
    fill=uniform_fill(0.5),
)


def box_at(low, high, material=BLACK):
    """Return a box whose corners are told from POINT."""
    return box(POINT + np.array(low), POINT + np.array(high), material)


def grey_plate(value=0.3):
    radiance = np.full((SIZE_PX[1], SIZE_PX[0], 3), value, np.float32)
    return Plate(radiance, None, None)


def noisy_plate(seed=3):
    codes = np.random.default_rng(seed).integers(0, 256, (SIZE_PX[1], SIZE_PX[0], 3), np.uint8)
    return Plate(srgb_decode(codes / 255).astype(np.float32), codes, None)


def on_ground(*meshes, reflectance=(0.3, 0.3, 0.3)):
    return Scene(meshes, Ground(0.0, reflectance, 1000.0))


def test_pixels_that_objects_do_not_change_are_the_plates_own(tmp_path):
    plate = noisy_plate()
    sun = one_light((0.6, 0.8, 0.0), (3.0, 2.5, 2.0), 0.005)
    result = composite(plate, CAMERA, on_ground(BALL), sun, np.ones(3))
    assert 0.05 < result.changed.mean() < 0.5
    same = ~result.changed
    assert_array_equal(result.picture[same], plate.radiance[same])
    write_composite(tmp_path / "c.png", plate, result.picture, force=False)
    written = read_picture(tmp_path / "c.png")
    assert_array_equal(written[same], plate.codes[same])
    assert np.any(written[result.changed] != plate.codes[result.changed])
    write_composite(tmp_path / "c.exr", plate, result.picture, force=False)
    green = read_exr(tmp_path / "c.exr").channels["G"]
    assert_array_equal(green[same], plate.radiance[same, 1])


def test_ground_keeps_the_share_of_light_that_reaches_it_whatever_its_albedo():
    """In the umbra of a wide roof only the sky is left; its share of the light is known."""
    roof = box_at((0.4, 1.0, -0.5), (1.6, 1.02, 0.5))
    sun = one_light((0.6, 0.8, 0.0), (3.0, 2.0, 1.0), 0.005)
    lamp = one_light((-0.6, 0.8, 0.0), (1.0, 1.0, 1.0), 0.005)
    both = LightSet(
        np.concatenate([sun.directions, lamp.directions]),
        np.concatenate([sun.irradiance, lamp.irradiance]),
        np.full(2, 0.005),
    )
    # The roof's shadow falls 0.75 to the left of the sun, over POINT; the lamp's far from there.
    for reflectance in ((0.1, 0.5, 0.9), (0.7, 0.2, 0.3)):
        scene = on_ground(roof, reflectance=reflectance)
        result = composite(grey_plate(), CAMERA, scene, both, np.ones(3))
        at = result.picture[23:25, 31:33].mean(axis=(0, 1))
        assert_allclose(at, 0.3 * np.array([1 / 4, 1 / 3, 1 / 2]), rtol=1e-3)


def test_a_sheet_of_the_grounds_albedo_on_the_ground_is_not_seen():
    """Match and composite together: P = gain ρ E / π is what the sheet shows."""
    plate = grey_plate(0.3)
    received = level_irradiance(*all_lights(SUN_AND_SKY, on_ground(BALL)))
    match = match_albedo(ground_seen(plate, CAMERA, POINT, 0.5), received, 0.4)
    # Its edges of 1 mm cast next to no shadow.
    material = Material(tuple(match.reflectance), specular=0.0)
    sheet = box_at((-0.5, 0, -0.5), (0.5, 0.001, 0.5), material)
    scene = on_ground(sheet, reflectance=tuple(match.reflectance))
    result = composite(plate, CAMERA, scene, SUN_AND_SKY, match.gain)
    assert result.changed.any()
    assert_allclose(result.picture[20:28, 28:36], 0.3, rtol=0.005)
    assert_allclose(result.picture, 0.3, rtol=0.03)


def test_a_map_is_for_mirrors_and_brings_matt_objects_no_more_light():
    seen = np.ones((16, 32), bool)
    bright = EnvironmentMap(np.full((16, 32, 3), 9.0, np.float32), seen, ~seen)
    plain, before_map = (
        composite(grey_plate(), CAMERA, on_ground(BALL), SUN_AND_SKY, np.ones(3), behind).picture
        for behind in (None, bright)
    )
    assert_allclose(before_map, plain, rtol=1e-4)
    metal = replace(BALL, material=Material((0.9, 0.9, 0.9), roughness=0.2, metalness=1.0))
    mirror = composite(grey_plate(), CAMERA, on_ground(metal), SUN_AND_SKY, np.ones(3), bright)
    assert mirror.picture[23, 31].min() > 5


def test_edges_are_mixed_in_linear_light():
    """Without light an object is black: what is left of the plate is what it does not cover."""
    wall = box_at((-0.501, 0, 0), (0.5, 9, 0.01))
    dark = LightSet(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    left = composite(grey_plate(1.0), CAMERA, on_ground(wall), dark, np.ones(3)).picture[..., 0]
    assert set(np.unique(left)) <= {0.0, 0.25, 0.5, 0.75, 1.0}
    assert {0.5, 1.0, 0.0} <= set(np.unique(left))


def test_of_gain_and_albedo_one_gives_the_other():
    seen, received = np.array([0.2, 0.3, 0.4]), np.array([2.0, 3.0, 5.0])
    for match in (match_gain(seen, received, np.full(3, 1.5)), match_albedo(seen, received, 0.25)):
        assert_allclose(match.gain * match.reflectance * received / np.pi, seen)
        assert np.ptp(match.gain) == 0
    assert match_albedo(np.ones(3), np.ones(3), 0.25).reflectance == pytest.approx(0.25)
    assert_array_equal(match_gain(seen, received, np.full(3, 0.01)).reflectance, 1)
    with pytest.raises(InputError, match="albedo"):
        match_albedo(seen, received, 1.2)
    with pytest.raises(InputError, match="dark"):
        match_albedo(seen, np.zeros(3), 0.2)


def test_ground_that_map_and_plate_both_show_tells_gain_and_white_balance():
    radiance = np.full((32, 64, 3), 30.0, np.float32)
    radiance[16:] = (0.4, 0.5, 0.6)
    radiance[16:, 20:40] = 9.0  # a third of the ground is something else
    seen = np.ones((32, 64), bool)
    shown = np.array([0.4, 0.5, 0.6]) * [0.5, 0.25, 1.0]
    found = gain_of_ground(shown, EnvironmentMap(radiance, seen, ~seen))
    assert_allclose(found, [0.5, 0.25, 1.0], rtol=1e-6)
    unseen = seen.copy()
    unseen[16:] = False
    assert gain_of_ground(shown, EnvironmentMap(radiance, unseen, ~seen)) is None


def test_the_ground_is_read_where_the_objects_stand():
    plate = grey_plate(0.9)
    radiance = plate.radiance.copy()
    radiance[18:30, 24:40] = (0.1, 0.2, 0.3)
    radiance[23, 31] = 50.0  # a glint
    seen = ground_seen(Plate(radiance, None, None), CAMERA, POINT, 0.2)
    assert_allclose(seen, [0.1, 0.2, 0.3], rtol=1e-6)
    with pytest.raises(InputError, match="black"):
        ground_seen(grey_plate(0.0), CAMERA, POINT, 0.2)
    with pytest.raises(InputError, match="does not show"):
        ground_seen(plate, CAMERA, POINT - [0, 0, 50], 0.2)


def sheet_from_below(height_m, shade_of_lights=True):
    """Return what a sheet of reflectance 1 under the sun shows from below, and the shade."""
    sheet = box((-1, height_m, -1), (1, height_m + 0.1, 1), Material((1.0,) * 3, specular=0.0))
    return floor_light_from_below((sheet,), height_m / 2, shade_of_lights)


def floor_light_from_below(meshes, eye_m, shade_of_lights=False):
    """Return the floor's shade, and what one sees looking up of its light, (3,)."""
    scene = Scene(meshes, Ground(0.0, radius_m=1000.0))
    eye = np.array([0.0, eye_m, 0.0])
    camera = Camera(eye, 2 * eye, 0.1, (8, 8), np.array([0.0, 0.0, 1.0]))
    sun = all_lights(one_light((0, 1, 0)), scene)
    traced = TracedScene(scene)
    surfaces, picture = empty_surfaces((8, 8)), np.zeros((8, 8, 4), np.float32)
    traced.find_surfaces(camera, (8, 8), surfaces)
    share, place = floor_shade(traced, *sun)
    if not shade_of_lights:
        share = np.ones_like(share)
    add_floor_light(traced, surfaces, np.array([1.0, 2.0, 3.0]), (share, place), picture)
    traced.release()
    return share, picture[..., :3].mean(axis=(0, 1))


def test_a_floor_lights_what_faces_it_with_all_its_radiance():
    # Radiance L over the half space gives πL, of which a white surface shows L.
    assert_allclose(sheet_from_below(1.0, shade_of_lights=False)[1], [1, 2, 3], rtol=1e-5)


def test_what_stands_between_hides_the_floor():
    above = box((-1, 1, -1), (1, 1.1, 1), Material((1.0,) * 3, specular=0.0))
    hiding = box((-50, 0.1, -50), (50, 0.2, 50), BLACK)
    assert floor_light_from_below((above, hiding), 0.5)[1].max() < 1e-3


def test_the_floor_below_an_object_is_in_its_shadow():
    share, shown = sheet_from_below(0.05)
    assert share[64, 64, 0] == 0
    assert share[2, 2, 0] == 1
    assert shown.max() < 0.01
    # From h = 1 m the shadow, a square of 2 × 2 m, has 55 % of the cosine-weighted view: the view
    # factor to a coaxial square of the same size, by the closed form for a point at its centre.
    a = 1 / math.sqrt(2)
    square = 4 / math.pi * a * math.atan(a)
    assert_allclose(sheet_from_below(1.0)[1], np.array([1, 2, 3]) * (1 - square), rtol=0.02)


def test_objects_are_set_down_turned_and_scaled():
    tall = box((1, 2, 3), (2, 6, 5))
    [mesh] = placed([tall], POINT, math.pi / 2, 1.0)
    assert_allclose(mesh.positions.min(axis=0) - POINT, (-0.25, 0, -0.125), atol=1e-6)
    assert_allclose(mesh.positions.max(axis=0) - POINT, (0.25, 1, 0.125), atol=1e-6)
    front = tall.normals[:, 2] == 1
    assert_allclose(mesh.normals[front], [[1, 0, 0]] * front.sum(), atol=1e-6)
    assert_allclose(mesh.positions[front, 0] - POINT[0], 0.25, atol=1e-6)
    flat = replace(tall, positions=tall.positions * np.float32([1, 0, 1]))
    with pytest.raises(InputError, match="high"):
        placed([flat], POINT, 0.0, 1.0)


@pytest.fixture
def files(tmp_path):
    write_lights(tmp_path / "lights.json", SUN_AND_SKY)
    write_jpeg(tmp_path / "plate.jpg", np.full((48, 64, 3), 150, np.uint8))
    return {
        "lights": tmp_path / "lights.json",
        "output": tmp_path / "out.png",
        "at": "31,30",
        "camera_height_m": 2.0,
        "fov_deg": 56.0,
        "pitch_deg": -30.0,
    }


def test_the_command_tells_gain_and_albedo_and_how_they_are_known(files, tmp_path, capsys):
    sky = np.full((8, 16, 3), 1.0, np.float32)
    seen = np.ones((8, 16), bool)
    write_environment(tmp_path / "map.exr", EnvironmentMap(sky, seen, ~seen))
    composite_command(tmp_path / "plate.jpg", environment=tmp_path / "map.exr", **files)
    # Code 150 is 0.305, and the map is 1 everywhere.
    assert "gain -1.71 EV (red, green, blue ×1.00 1.00 1.00)" in (out := capsys.readouterr().out)
    assert "by the ground in the map" in out
    assert read_picture(files["output"]).shape == (48, 64, 3)
    composite_command(tmp_path / "plate.jpg", force=True, height_m=0.3, **files)
    assert "unknown, middle grey supposed" in capsys.readouterr().out
    composite_command(tmp_path / "plate.jpg", force=True, gain_ev=-2.0, **files)
    assert "gain -2.00 EV (red, green, blue ×1.00 1.00 1.00)" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"at": "31"}, "--at"),
        ({"at": "31,30 5,30"}, "one pixel"),
        ({"at": "31,9", "pitch_deg": 0.0}, "above the horizon"),
        ({"pitch_deg": None}, "one of --pitch-deg"),
        ({"horizon": "1,2 3,4"}, "one of --pitch-deg"),
        ({"fov_deg": None}, "FocalLengthIn35mmFilm"),
        ({"gain_ev": 0.0, "albedo": 0.3}, "give one"),
        ({"output": "out.jpg"}, r"\.png or \.exr"),
    ],
)
def test_what_does_not_make_a_picture_is_one_line(files, tmp_path, changes, message):
    changes = {k: tmp_path / v if k == "output" else v for k, v in changes.items()}
    with pytest.raises(InputError, match=message):
        composite_command(tmp_path / "plate.jpg", **(files | changes))


def test_what_changes_is_coded_as_the_plate_is(tmp_path):
    plate = noisy_plate()
    half = plate.radiance / 2
    half[0, 0] = 7.0
    write_composite(tmp_path / "c.png", plate, half, force=False)
    written = read_picture(tmp_path / "c.png")
    assert_array_equal(written[0, 0], 255)
    linear = srgb_decode(written[1:] / 255)
    assert_allclose(linear, half[1:], atol=0.005)


def test_a_plate_is_upright_and_its_lens_that_of_the_films_diagonal(tmp_path):
    exif = Image.Exif()
    exif[274] = 6  # the stored picture's left column is the top
    exif.get_ifd(34665)[41989] = 28
    stored = np.zeros((48, 64, 3), np.uint8)
    stored[:, :16] = 255
    Image.fromarray(stored).save(tmp_path / "p.png", exif=exif)
    plate = read_plate(tmp_path / "p.png")
    assert plate.size_px == (48, 64)
    assert plate.radiance[:16].min() == 1
    assert plate.radiance[16:].max() == 0
    # 28 mm sees 75.4° along the diagonal of 43.27 mm, here 80 pixels.
    assert plate.focal_px == pytest.approx(40 / math.tan(math.radians(75.38 / 2)), rel=1e-3)


def test_plates_of_other_kinds(tmp_path):
    write_exr(tmp_path / "p.exr", dict.fromkeys("RGB", np.full((4, 6), 9.5)), {})
    plate = read_plate(tmp_path / "p.exr")
    assert plate.size_px == (6, 4)
    assert plate.codes is None
    assert_array_equal(plate.radiance, 9.5)
    write_png(tmp_path / "p.png", np.zeros((4, 6, 3), np.uint16))
    with pytest.raises(InputError, match="16 bits"):
        read_plate(tmp_path / "p.png")
    with pytest.raises(InputError, match="a plate is a picture"):
        read_plate(tmp_path / "p.txt")
