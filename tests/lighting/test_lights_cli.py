"""`fishlight lights` from file to file."""

import numpy as np
import pytest

from capture.errors import InputError
from lighting.environment import EnvironmentMap
from lighting.environment_files import read_environment, write_environment
from lighting.light_files import read_lights
from lighting.lights_cli import lights
from lighting.reduce import reduce_to_lights
from tests.environments import environment, outdoors


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
    assert "map.exr: 10 lights by inverse-cdf" in printed


def test_tells_of_a_clipped_sun(tmp_path, capsys):
    radiance = np.ones((8, 16, 3), np.float32)
    clipped = np.zeros((8, 16), bool)
    clipped[3] = True
    path = tmp_path / "map.exr"
    write_environment(path, EnvironmentMap(radiance, np.ones_like(clipped), clipped))
    lights(path, output=tmp_path / "lights.json")
    # Row 3 of 8 spans cos 67.5° = 0.3827 of the 2 of the sphere.
    assert "19.1% of the light comes from clipped cells" in capsys.readouterr().out


def test_tells_of_an_empty_map(tmp_path, capsys):
    path = tmp_path / "map.exr"
    write_environment(path, environment(np.zeros((8, 16))))
    lights(path, output=tmp_path / "lights.json")
    assert "0 lights" in capsys.readouterr().out
    assert len(read_lights(tmp_path / "lights.json")) == 0


def test_an_existing_output_is_kept_unless_forced(map_path, tmp_path):
    output = tmp_path / "lights.json"
    output.write_text("mine")
    with pytest.raises(InputError, match="--force"):
        lights(map_path, output=output)
    assert output.read_text() == "mine"
    lights(map_path, output=output, force=True)
    assert len(read_lights(output)) == 64


def test_a_wrong_count_leaves_no_file(map_path, tmp_path):
    with pytest.raises(InputError, match="1 to 65536"):
        lights(map_path, output=tmp_path / "lights.json", count=0)
    assert not (tmp_path / "lights.json").exists()
