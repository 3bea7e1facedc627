"""`fishlight export` from file to file."""

import resource
from dataclasses import replace

import numpy as np
import pytest

from capture.errors import InputError
from capture.exr import read_exr
from capture.radiance_files import read_hdr, write_hdr
from lighting.export_cli import export
from lighting.light_files import write_lights
from lighting.maps.environment_files import read_environment, write_environment
from tests.environments import constant
from tests.lighting.room import lamps, room


@pytest.fixture
def folder(tmp_path):
    write_lights(tmp_path / "lights.json", lamps())
    write_environment(tmp_path / "map.exr", room())
    return tmp_path


def files_in(folder):
    return sorted(
        path.name for path in folder.iterdir() if path.name not in ("lights.json", "map.exr")
    )


SCENES = {
    "scene.usda": "scene.usda.dome.exr",
    "scene.gltf": "scene.gltf.dome.exr",
    "scene.glb": "scene.glb.dome.exr",
    "scene.py": "scene.py.dome.exr",
    "scene.rad": "scene.rad.dome.hdr",
    "SCENE.USDA": "SCENE.USDA.dome.exr",
}


@pytest.mark.parametrize(("scene", "dome"), SCENES.items())
def test_the_suffix_names_the_format_and_the_dome_stands_beside(folder, scene, dome):
    export(folder / "lights.json", output=folder / scene, map_path=folder / "map.exr")
    assert files_in(folder) == sorted([scene, dome])
    assert dome.encode() in (folder / scene).read_bytes()


def test_lights_dome_sum_and_map_are_printed(folder, capsys):
    export(folder / "lights.json", output=folder / "a.usda", map_path=folder / "map.exr")
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].endswith("a.usda: lights: 2, and the dome a.usda.dome.exr")
    assert "relative × sr" in lines[1]
    printed = {line.split()[0]: np.array(line.split()[1:], float) for line in lines[2:]}
    assert list(printed) == ["lights", "dome", "sum", "map"]
    np.testing.assert_allclose(printed["lights"], lamps().irradiance[:2].sum(axis=0), rtol=1e-3)
    np.testing.assert_allclose(printed["lights"] + printed["dome"], printed["sum"], rtol=1e-3)
    np.testing.assert_allclose(printed["sum"], room().integral(), rtol=1e-3)
    np.testing.assert_array_equal(printed["sum"], printed["map"])


def test_a_map_that_is_not_the_lights_own_is_told(folder, capsys):
    write_environment(folder / "map.exr", constant())
    export(folder / "lights.json", output=folder / "a.usda", map_path=folder / "map.exr")
    assert "of the lights was not in the map" in capsys.readouterr().out


def test_what_the_exported_map_cannot_tell_is_told(folder, capsys):
    row, column = np.indices((64, 128))
    radiance = room().radiance.copy()
    radiance[40, 0] = np.nan
    clipped = (row < 32) & (column == 7)
    write_hdr(folder / "map.exr", radiance, valid=row < 32, clipped=clipped)
    write_lights(folder / "lights.json", replace(lamps(), clipped_fraction=0.25), force=True)
    export(folder / "lights.json", output=folder / "a.usda", map_path=folder / "map.exr")
    export(output=folder / "b.exr", map_path=folder / "map.exr", convention="usd")
    printed = capsys.readouterr().out
    assert printed.count("50.0% of all directions were not seen") == 2
    assert printed.count("32 cells are clipped") == 2
    assert printed.count("set to 0") == 2
    assert "25.0% of the light comes from clipped cells" in printed


def test_a_map_that_is_not_written_is_told_and_its_marks_are_not(folder, capsys):
    write_environment(folder / "map.exr", replace(room(), valid=np.zeros((64, 128), bool)))
    no_keys = replace(lamps(), is_key=np.zeros(3, bool))
    write_lights(folder / "lights.json", no_keys, force=True)
    export(folder / "lights.json", output=folder / "a.usda", map_path=folder / "map.exr")
    assert files_in(folder) == ["a.usda"]
    printed = capsys.readouterr().out
    assert "no key lights: the lights stand for all of the map, which is not written" in printed
    assert "not seen" not in printed


def test_without_a_map_only_the_scene_is_written(folder, capsys):
    export(folder / "lights.json", output=folder / "a.glb")
    assert files_in(folder) == ["a.glb"]
    assert "lights: 3, and no dome" in capsys.readouterr().out


@pytest.mark.parametrize(("convention", "columns"), [("usd", 0), ("three", 32), ("blender", 32)])
def test_a_map_is_converted_and_holds_colours_only(folder, capsys, convention, columns):
    # Mitsuba refuses an environment map with more channels than three.
    output = folder / "turned.exr"
    export(output=output, map_path=folder / "map.exr", convention=convention)
    assert set(read_exr(output).channels) == set("RGB")
    converted, _ = read_environment(output)
    np.testing.assert_array_equal(converted.radiance, np.roll(room().radiance, columns, axis=1))
    assert convention in capsys.readouterr().out


def test_a_map_may_become_a_radiance_picture(folder):
    export(output=folder / "turned.hdr", map_path=folder / "map.exr", convention="usd")
    np.testing.assert_allclose(
        read_hdr(folder / "turned.hdr").rgb, room().radiance, atol=room().radiance.max() / 128
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"output": "a.fbx"}, r"a\.fbx: wanted a scene named \.usda.*map named \.exr, \.hdr"),
        ({"output": "a.usda", "lights": None}, "wanted lights"),
        ({"output": "a.usda", "convention": "usd"}, "--convention is for maps"),
        ({"output": "a.exr"}, "takes no lights"),
        ({"output": "a.exr", "lights": None}, "--map and --convention"),
        ({"output": "a.exr", "lights": None, "map_path": "map.exr"}, "--convention"),
        ({"output": "a.usda", "map_path": "no.exr"}, r"no\.exr"),
        ({"output": "a.usda", "lights": "no.json"}, r"no\.json: no such file"),
        ({"output": 'a"b.usda', "map_path": "map.exr"}, "without quotes"),
        ({"output": "a@b.usda", "map_path": "map.exr"}, "without quotes, @"),
        ({"output": "a\udcff.usda", "map_path": "map.exr"}, "cannot be printed"),
    ],
)
def test_wrong_input_is_one_line_and_writes_nothing(folder, arguments, message):
    arguments = {"lights": "lights.json"} | arguments
    named = ("output", "lights", "map_path")
    paths = {k: folder / v if k in named and v else v for k, v in arguments.items()}
    with pytest.raises(InputError, match=message) as caught:
        export(**paths)
    assert "\n" not in str(caught.value)
    assert files_in(folder) == []


@pytest.mark.parametrize("taken", ["a.usda", "a.usda.dome.exr"])
def test_what_exists_is_replaced_only_by_force_and_never_by_half(folder, taken):
    (folder / taken).write_text("mine")
    arguments = {"output": folder / "a.usda", "map_path": folder / "map.exr"}
    with pytest.raises(InputError, match=rf"{taken} exists.*--force"):
        export(folder / "lights.json", **arguments)
    assert files_in(folder) == [taken]
    assert (folder / taken).read_text() == "mine"
    export(folder / "lights.json", **arguments, force=True)
    assert files_in(folder) == ["a.usda", "a.usda.dome.exr"]
    assert (folder / "a.usda").read_text().startswith("#usda")


def test_what_exists_is_refused_before_anything_is_read(folder):
    (folder / "a.usda").write_text("mine")
    with pytest.raises(InputError, match=r"a\.usda exists"):
        export(folder / "no.json", output=folder / "a.usda")


def test_a_dome_there_is_no_room_for_is_told_by_its_name_and_leaves_no_scene(folder):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))  # the dome takes 97 kB
    try:
        with pytest.raises(InputError, match=r"/a\.usda\.dome\.exr: cannot be written"):
            export(folder / "lights.json", output=folder / "a.usda", map_path=folder / "map.exr")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert files_in(folder) == []


def test_a_dome_that_cannot_be_made_leaves_no_scene(folder):
    write_environment(folder / "map.exr", room(63))
    with pytest.raises(InputError, match="63 rows"):
        export(folder / "lights.json", output=folder / "a.py", map_path=folder / "map.exr")
    assert files_in(folder) == []
