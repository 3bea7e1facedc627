"""The `render` command."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from capture.arguments import parse_size
from capture.errors import InputError
from capture.exr import read_exr, write_exr
from capture.pictures import read_picture
from capture.sensor import srgb_encode
from lighting.light_files import write_lights
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import write_environment
from lighting.simulation.outdoors import outdoors
from render.opengl import context
from render.opengl.context import GlUnavailable
from render.render_cli import parse_exposure, render
from render.scenes.mesh import load_meshes
from tests.render.light_sets import random_lights

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture
def lights(tmp_path):
    write_lights(tmp_path / "lights.json", random_lights(4, seed=0))
    return tmp_path / "lights.json"


@pytest.mark.gl
def test_a_picture_of_the_default_scene(tmp_path, lights, capsys):
    output = tmp_path / "p.png"
    render(lights=lights, output=output, size="64x48")
    picture = read_picture(output)
    assert picture.shape == (48, 64, 3)
    # Auto exposure: the log-mean of the scene is middle grey, code 118.
    assert 60 < np.median(picture) < 180
    printed = capsys.readouterr().out
    assert "lights 4" in printed
    assert printed.count("\n") == 1


def test_without_opengl_rays_draw_the_picture(tmp_path, lights, capsys, monkeypatch):
    def refuse():
        raise GlUnavailable("no EGL")

    monkeypatch.setattr(context, "create_context", refuse)
    render(lights=lights, output=tmp_path / "p.png", size="64x48")
    assert 60 < np.median(read_picture(tmp_path / "p.png")) < 180
    assert "no OpenGL: drawn with rays" in capsys.readouterr().out


@pytest.mark.gl
def test_a_mesh_in_front_of_a_map_as_radiance(tmp_path, lights):
    (tmp_path / "m.obj").write_text(OBJ)
    seen = np.ones((8, 16), bool)
    sky = EnvironmentMap(np.full((8, 16, 3), 7.0, np.float32), seen, ~seen)
    write_environment(tmp_path / "map.exr", sky)
    output = tmp_path / "p.exr"
    arguments = {"lights": lights, "mesh": tmp_path / "m.obj", "background": tmp_path / "map.exr"}
    render(output=output, size="40x30", **arguments)
    channels = read_exr(output).channels
    background = channels["A"] == 0
    assert background.any()
    assert_array_equal(channels["R"][background], 7)
    with pytest.raises(InputError, match="--force"):
        render(output=output, **arguments)


def test_a_reference_picture_with_its_error_in_front_of_its_map(tmp_path, capsys):
    seen = np.ones((8, 16), bool)
    sky = EnvironmentMap(np.full((8, 16, 3), 7.0, np.float32), seen, ~seen)
    write_environment(tmp_path / "map.exr", sky)
    (tmp_path / "m.obj").write_text(OBJ)
    output = tmp_path / "p.exr"
    arguments = {"environment": tmp_path / "map.exr", "background": tmp_path / "map.exr"}
    mesh = tmp_path / "m.obj"
    render(reference=True, output=output, size="20x15", mesh=mesh, error=0.05, **arguments)
    file = read_exr(output)
    background = file.channels["A"] == 0
    np.testing.assert_allclose(file.channels["R"][background], 7, rtol=1e-6)
    error = file.channels["standard_error.G"]
    assert not error[background].any()
    assert error.max() > 0
    assert 0 < file.attributes["relative_error"] <= 0.05
    printed = capsys.readouterr()
    assert "map 16×8" in printed.out
    assert printed.err == ""


def test_a_reference_picture_to_look_at_under_lights(tmp_path, lights):
    output = tmp_path / "p.png"
    render(reference=True, lights=lights, output=output, size="16x12", seconds=0.1)
    assert 60 < np.median(read_picture(output)) < 180


def test_a_picture_by_an_estimator_agrees_with_the_reference(tmp_path, capsys):
    write_environment(tmp_path / "map.exr", outdoors(8))
    arguments = {"reference": True, "environment": tmp_path / "map.exr", "size": "16x12"}
    pictures = {}
    for name in (None, "mis-balance", "lights-cells"):
        output = tmp_path / f"{name}.exr"
        render(output=output, estimator=name, error=0.1, **arguments)
        pictures[name] = read_exr(output).channels
        told = "of its noise (what its lights leave out" in capsys.readouterr().out
        assert told == (name == "lights-cells")
    for colour in "RGB":
        means = [pictures[name][colour].mean() for name in (None, "mis-balance")]
        assert means[1] == pytest.approx(means[0], rel=0.05)
        assert (pictures["mis-balance"][colour] != pictures[None][colour]).any()
    with pytest.raises(InputError, match=r"no estimator is called 'best'; there are: cosine, brdf"):
        render(output=tmp_path / "s.exr", estimator="best", **arguments)


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ({}, "give --lights"),
        ({"lights": "l.json", "estimator": "brdf"}, "are for --reference"),
        ({"lights": "l.json", "error": 0.1}, "are for --reference"),
        ({"reference": True}, "either --lights or --map"),
        ({"reference": True, "lights": "l.json", "environment": "m.exr"}, "either"),
    ],
)
def test_light_that_is_missing_or_given_twice(tmp_path, flags, message):
    with pytest.raises(InputError, match=message):
        render(output=tmp_path / "p.png", **flags)


@pytest.mark.parametrize("limit", [{"error": 0.0}, {"seconds": -1.0}, {"error": float("nan")}])
def test_limits_of_a_reference_that_are_none(tmp_path, lights, limit):
    with pytest.raises(InputError, match="above 0"):
        render(reference=True, lights=lights, output=tmp_path / "p.png", size="8x8", **limit)


@pytest.mark.parametrize("text", ["", "640", "640x", "-4x3", "0x10", "10x99999", "4 x 3", "ax3"])
def test_sizes_that_are_none(text):
    with pytest.raises(InputError):
        parse_size(text)


def test_sizes_and_exposures():
    assert parse_size("640x480") == (640, 480)
    assert parse_exposure("auto") is None
    assert parse_exposure("-1.5") == -1.5
    for text in ("bright", "nan", "inf", "1e9"):
        with pytest.raises(InputError, match="exposure"):
            parse_exposure(text)


def test_a_wrong_suffix_is_refused_before_any_work(tmp_path):
    with pytest.raises(InputError, match=r"\.png or \.exr"):
        render(lights=tmp_path / "missing.json", output=tmp_path / "p.jpeg")


def test_ambient_occlusion_alone_needs_no_light(tmp_path, capsys):
    (tmp_path / "m.obj").write_text(OBJ)
    render(output=tmp_path / "ao.exr", mesh=tmp_path / "m.obj", size="40x30", ao=True, cone_deg=90)
    render(output=tmp_path / "ao.png", mesh=tmp_path / "m.obj", size="40x30", ao=True, cone_deg=90)
    channels = read_exr(tmp_path / "ao.exr").channels
    coded = cv2.imread(str(tmp_path / "ao.png"), cv2.IMREAD_UNCHANGED)
    assert 0.3 < channels["G"][channels["A"] == 1].min() < 0.95
    whole = channels["A"] == 1
    np.testing.assert_allclose(
        coded[whole][:, 1], 255 * srgb_encode(channels["G"][whole]), atol=0.51
    )
    assert "ambient occlusion, cone 90°, mean 0." in capsys.readouterr().out


def test_ambient_occlusion_of_vertices(tmp_path, capsys):
    """Of one triangle on its edge, whose normal is level, the ground hides half of the sky."""
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    render(output=tmp_path / "ao.ply", mesh=tmp_path / "m.obj", ao=True)
    (mesh,) = load_meshes(tmp_path / "ao.ply").meshes
    np.testing.assert_allclose(mesh.vertex_colour, 0.5, atol=0.03)
    assert "ambient occlusion of 3 vertices, cone 180°, mean 0." in capsys.readouterr().out
    with pytest.raises(InputError, match="a picture is written as"):
        render(output=tmp_path / "p.ply", lights=tmp_path / "l.json")
    with pytest.raises(InputError, match="ambient occlusion is written as"):
        render(output=tmp_path / "p.jpg", ao=True)


def test_flags_of_ambient_occlusion_without_it(tmp_path, lights):
    with pytest.raises(InputError, match="are for --ao"):
        render(output=tmp_path / "p.png", lights=lights, cone_deg=90)


@pytest.mark.parametrize(
    "flags",
    [
        {"lights": Path("l.json")},
        {"background": Path("m.exr")},
        {"exposure_ev": "2"},
        {"estimator": "brdf"},
        {"error": 0.1},
        {"bounces": 1},
    ],
)
def test_light_with_ambient_occlusion(tmp_path, flags):
    with pytest.raises(InputError, match="drawn without light"):
        render(output=tmp_path / "p.png", ao=True, **flags)


def test_a_reference_under_a_map_without_light_is_black_and_tells_what_was_amiss(tmp_path, capsys):
    radiance = np.zeros((8, 16, 3), np.float32)
    radiance[3, 4] = -1
    write_exr(tmp_path / "map.exr", dict(zip("RGB", radiance.transpose(2, 0, 1), strict=True)), {})
    output = tmp_path / "p.exr"
    render(reference=True, environment=tmp_path / "map.exr", output=output, size="8x6")
    assert not read_exr(output).channels["R"].any()
    assert "map.exr: set to 0 in the file: 3 negative values" in capsys.readouterr().out
