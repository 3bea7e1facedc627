"""`fishlight lights` from file to file."""

from pathlib import Path

import numpy as np
import pytest

from calibration.camera import UP, Calibration
from calibration.files import write_calibration
from calibration.models.equidistant import Equidistant
from capture.errors import InputError
from capture.exr import write_exr
from lighting.light_arguments import DEFAULT_ERROR
from lighting.light_files import read_lights
from lighting.lights_cli import lights
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import read_environment, write_environment
from lighting.reduce import METHODS, reduce_to_lights
from lighting.remap_cli import remap
from render.main import main
from tests.environments import constant, environment, one_hot, outdoors

DATA = Path(__file__).resolve().parents[2].parent / "shared/data"


@pytest.fixture
def map_path(tmp_path):
    path = tmp_path / "map.exr"
    write_environment(path, outdoors(16))
    return path


def test_writes_the_lights_of_the_map(map_path, tmp_path, capsys):
    output = tmp_path / "lights.json"
    lights(map_path, output=output, count=10)
    written = read_lights(output)
    expected = reduce_to_lights(read_environment(map_path)[0], 10)
    np.testing.assert_array_equal(written.directions, expected.directions)
    np.testing.assert_array_equal(written.irradiance, expected.irradiance)
    printed = capsys.readouterr().out
    assert printed.count("\n") == 1
    assert "map.exr: 10 lights by adaptive" in printed
    assert f"fill of order {expected.fill_order}" in printed
    assert f"predicted error {expected.predicted_error:.2%}; block rows 16;" in printed
    total = " ".join(f"{channel:.4g}" for channel in expected.integral())
    assert f"∫ L dω {total} (relative × sr)" in printed


def test_says_nothing_of_what_a_method_does_not_have(map_path, tmp_path, capsys):
    lights(map_path, output=tmp_path / "lights.json", count=10, method="inverse-cdf")
    printed = capsys.readouterr().out
    assert "map.exr: 10 lights by inverse-cdf; ∫ L dω" in printed


@pytest.mark.parametrize(
    ("view", "method", "why"),
    [
        (one_hot(), "cells", "1 instead of 8: no more are needed to hold all the light\n"),
        (constant(), "adaptive", "0 instead of 8: no more are needed to hold all the light beside"),
        (environment(np.zeros((8, 16))), "adaptive", "0 instead of 8: there is no light"),
    ],
)
def test_says_why_there_are_fewer_lights(view, method, why, tmp_path, capsys):
    path = tmp_path / "map.exr"
    write_environment(path, view)
    lights(path, output=tmp_path / "lights.json", count=8, method=method)
    assert why in capsys.readouterr().out


@pytest.mark.parametrize("error", [None, 0.2, 0.01])
def test_auto_takes_as_few_lights_as_meet_the_error(map_path, tmp_path, error):
    output = tmp_path / "lights.json"
    lights(map_path, output=output, count="auto", error=error)
    expected = reduce_to_lights(
        read_environment(map_path)[0], 512, error=DEFAULT_ERROR if error is None else error
    )
    assert 0 < len(expected) < 400
    np.testing.assert_array_equal(read_lights(output).directions, expected.directions)
    assert read_lights(output).predicted_error == expected.predicted_error


def test_auto_at_the_source(camera_files, tmp_path):
    picture, calibration = camera_files
    output = tmp_path / "lights.json"
    lights(picture, output=output, calibration=calibration, count="auto", fill="mean")
    assert len(read_lights(output)) == 0  # all of one colour
    assert read_lights(output).fill_order == 0


def test_tells_of_an_error_that_cannot_be_met(map_path, tmp_path, capsys):
    lights(map_path, output=tmp_path / "lights.json", count="auto", error=1e-6)
    assert "the error of 1e-06 is not met: no more than 512 lights" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (["--count", "10", "--error", "0.02"], "--count 10; give --count auto"),
        (["--error", "0.02"], "--count 64; give --count auto"),
        (["--count", "auto", "--method", "cells"], "--count auto is for --method adaptive"),
        (["--count", "auto", "--error", "5"], "between 0 and 1, got 5"),
        (["--count", "auto", "--error", "nan"], "between 0 and 1, got nan"),
        (["--count", "auto", "--method", "magic"], "not for magic"),
        (["--count", "many"], "a whole number or auto, got 'many'"),
        (["--count", "2.5"], "a whole number or auto, got '2.5'"),
    ],
)
def test_wrong_wishes_are_one_line(map_path, tmp_path, capsys, wrong, message):
    with pytest.raises(SystemExit, match="2"):
        main(["lights", str(map_path), "-o", str(tmp_path / "lights.json"), *wrong])
    printed = capsys.readouterr().err
    assert message in printed
    assert printed.count("\n") == 1
    assert not (tmp_path / "lights.json").exists()


def test_the_help_names_every_method(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["lights", "--help"])
    words = capsys.readouterr().out.replace("│", " ").split()
    assert METHODS.keys() <= {word.strip(",.") for word in words}


def test_tells_what_was_done_to_the_file(tmp_path, capsys):
    channels = {"Y": np.ones((8, 16), np.float32)}
    channels["Y"][0, 0] = np.nan
    write_exr(tmp_path / "map.exr", channels, {})
    lights(tmp_path / "map.exr", output=tmp_path / "lights.json")
    printed = capsys.readouterr().out
    assert "  luminance repeated to grey\n  set to 0 in the file: 3 NaN values\n" in printed
    with pytest.raises(InputError, match=r"map\.exr holds 3 NaN values"):
        lights(tmp_path / "map.exr", output=tmp_path / "strict.json", strict=True)
    assert not (tmp_path / "strict.json").exists()


@pytest.mark.parametrize("fill", ["black", "mean", "mirror"])
def test_what_the_remap_filled_lights_too(tmp_path, fill):
    # Half of the directions are seen, all of radiance 2; the other half holds the fill.
    lens = Equidistant((31.5, 31.5), 64 / np.pi)
    write_calibration(tmp_path / "cal.json", Calibration(lens, (64, 64), np.pi / 2, UP))
    plane = np.full((64, 64), 2.0, np.float32)
    write_exr(tmp_path / "radiance.exr", dict.fromkeys("RGB", plane), {})
    remap(
        tmp_path / "radiance.exr",
        calibration=tmp_path / "cal.json",
        output=tmp_path / "map.exr",
        height=32,
        fill=fill,
    )
    lights(tmp_path / "map.exr", output=tmp_path / "lights.json")
    filled = read_lights(tmp_path / "lights.json")
    share = 0.5 if fill == "black" else 1.0
    np.testing.assert_allclose(filled.integral(), share * 4 * np.pi * 2, rtol=1e-3)


def test_tells_of_a_clipped_sun(tmp_path, capsys):
    radiance = np.ones((8, 16, 3), np.float32)
    clipped = np.zeros((8, 16), bool)
    clipped[3] = True
    path = tmp_path / "map.exr"
    write_environment(path, EnvironmentMap(radiance, np.ones_like(clipped), clipped))
    lights(path, output=tmp_path / "lights.json")
    # Row 3 of 8 spans cos 67.5° = 0.3827 of the 2 of the sphere.
    assert "19.1% of the light comes from clipped pixels" in capsys.readouterr().out


def test_tells_of_an_empty_map(tmp_path, capsys):
    path = tmp_path / "map.exr"
    write_environment(path, environment(np.zeros((8, 16))))
    lights(path, output=tmp_path / "lights.json")
    assert "0 lights" in capsys.readouterr().out
    assert len(read_lights(tmp_path / "lights.json")) == 0


@pytest.fixture
def camera_files(tmp_path):
    """A picture of 64² px, half of the sphere at radiance 2, and its calibration."""
    lens = Equidistant((31.5, 31.5), 64 / np.pi)
    calibration = tmp_path / "cal.json"
    write_calibration(calibration, Calibration(lens, (64, 64), np.pi / 2, UP))
    picture = tmp_path / "radiance.exr"
    write_exr(picture, dict.fromkeys("RGB", np.full((64, 64), 2.0, np.float32)), {})
    return picture, calibration


@pytest.mark.parametrize(("method", "fill"), [("cells", "mean"), ("inverse-cdf", "black")])
def test_takes_a_camera_picture_with_its_calibration(camera_files, tmp_path, capsys, method, fill):
    picture, calibration = camera_files
    output = tmp_path / "lights.json"
    lights(picture, output=output, calibration=calibration, count=9, method=method, fill=fill)
    share = 0.5 if fill == "black" else 1.0
    written = read_lights(output)
    np.testing.assert_allclose(written.irradiance.sum(axis=0), share * 4 * np.pi * 2, rtol=3e-3)
    assert f"radiance.exr: 9 lights by {method}" in capsys.readouterr().out


def test_a_picture_of_another_size_than_the_calibration_is_refused(camera_files, map_path):
    with pytest.raises(InputError, match=r"map\.exr is 32×16 px.*64×64"):
        lights(map_path, output=map_path.with_suffix(".json"), calibration=camera_files[1])


def test_a_map_is_not_filled(map_path):
    with pytest.raises(InputError, match=r"--calibration.*remap"):
        lights(map_path, output=map_path.with_suffix(".json"), fill="mean")


def test_an_existing_output_is_kept_unless_forced(map_path, tmp_path):
    output = tmp_path / "lights.json"
    output.write_text("mine")
    with pytest.raises(InputError, match="--force"):
        lights(map_path, output=output)
    assert output.read_text() == "mine"
    lights(map_path, output=output, force=True)
    assert len(read_lights(output)) > 0


def test_a_wrong_count_leaves_no_file(map_path, tmp_path):
    with pytest.raises(InputError, match="1 to 65536"):
        lights(map_path, output=tmp_path / "lights.json", count=0)
    assert not (tmp_path / "lights.json").exists()


@pytest.mark.data
@pytest.mark.parametrize(
    "name",
    [
        "env-pmndrs/esplanade.exr",
        "env-pmndrs/sky.exr",
        "env-blender-world/city.exr",
        "env-polyhaven-drei/rooitou_park_1k.hdr",
        "env-grace-colour/Grace_Cathedral.hdr",
    ],
)
def test_captured_maps_keep_their_energy(name, tmp_path):
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{path} is not here: captures are not part of the project")
    output = tmp_path / "lights.json"
    lights(path, output=output)
    total = read_lights(output).integral()
    # What a lights file must add up to, from the file itself and in plain numpy.
    radiance = read_environment(path)[0].radiance.astype(np.float64)
    edges = np.cos(np.linspace(0, np.pi, len(radiance) + 1))
    solid_angle = np.pi / len(radiance) * (edges[:-1] - edges[1:])
    np.testing.assert_allclose(total, solid_angle @ radiance.sum(axis=1), rtol=1e-6)
