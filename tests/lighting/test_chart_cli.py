"""`fishlight chart lights`, from maps to the folder of charts."""

import subprocess
import sys

import cv2
import pytest

from capture.errors import InputError
from lighting import chart_cli
from lighting.chart_cli import chart_lights
from lighting.maps.environment_files import write_environment
from lighting.measures import chart, chart_drawing, flicker
from lighting.simulation.sequences import SEQUENCES
from render.main import main
from tests.environments import constant, environment, outdoors

PICTURES = ("lights-light.svg", "lights-light.png", "lights-dark.svg", "lights-dark.png")


@pytest.fixture
def map_path(tmp_path):
    path = tmp_path / "map.exr"
    write_environment(path, outdoors(8))
    return path


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Two systems, two counts (one of flicker), one sequence of three frames."""
    both = chart.systems()[0]
    chosen = {name: both[name] for name in ("inverse-cdf", "random points")}
    monkeypatch.setattr(chart, "systems", lambda: (chosen, ["Some Program"]))
    monkeypatch.setattr(chart, "COUNTS", (4, 8))
    monkeypatch.setattr(chart, "_REPEATS", 1)
    monkeypatch.setattr(flicker, "COUNTS", (4,))
    monkeypatch.setattr(flicker, "FRAMES", 3)
    monkeypatch.setattr(flicker, "ROWS", 8)
    monkeypatch.setattr(chart_cli, "SEQUENCES", {"two suns": SEQUENCES["two suns"]})


@pytest.fixture
def undrawn(monkeypatch):
    monkeypatch.setattr(chart_drawing, "draw", lambda *_arguments: None)


@pytest.fixture
def never_measured(monkeypatch):
    def fail(*_arguments):
        raise AssertionError("measured")

    monkeypatch.setattr(chart, "measure", fail)


def test_writes_the_charts_and_their_numbers(map_path, tmp_path, capsys):
    output = tmp_path / "charts"
    chart_lights(map_path, output=output)
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "not installed, so not in the chart: Some Program"
    assert printed[1] == f"{output}: 6 measurements of 2 systems on 1 map and 1 sequences"
    assert len(printed) == 2
    assert {path.name for path in output.iterdir()} == {
        *PICTURES,
        "lights.csv",
        "measurements.json",
    }
    lines = (output / "lights.csv").read_text().splitlines()
    assert len(lines) == 1 + 2 * 2 + 2
    assert sum("two suns" in line for line in lines) == 2
    for theme, is_bright in (("light", True), ("dark", False)):
        picture = cv2.imread(str(output / f"lights-{theme}.png"))
        assert (picture[0, 0].mean() > 128) == is_bright
        assert picture.std() > 5
        assert "inverse-cdf" in (output / f"lights-{theme}.svg").read_text()


@pytest.mark.usefixtures("undrawn")
def test_a_second_run_takes_the_results_of_the_first(map_path, tmp_path, monkeypatch):
    output = tmp_path / "charts"
    chart_lights(map_path, output=output)
    first = (output / "lights.csv").read_text()
    timed = []

    def untimed(system, environment_map, count):
        timed.append(count)
        return system(environment_map, count, None)[0], 1.0

    monkeypatch.setattr(chart, "_timed", untimed)
    chart_lights(map_path, output=output, force=True)
    assert not timed
    assert (output / "lights.csv").read_text() == first
    write_environment(map_path, outdoors(8, seed=1))
    chart_lights(map_path, output=output, force=True)
    assert len(timed) == 4
    chart_lights(map_path, output=output, force=True, fresh=True)
    assert len(timed) == 8


def test_an_interrupted_run_keeps_what_it_measured(map_path, tmp_path, monkeypatch):
    output = tmp_path / "charts"

    def interrupted(*_arguments):
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr(flicker, "measure", interrupted)
    with pytest.raises(KeyboardInterrupt):
        chart_lights(map_path, output=output)
    assert [path.name for path in output.iterdir()] == ["measurements.json"]
    assert len(chart.read_known(output / "measurements.json")) == 4


@pytest.mark.usefixtures("undrawn")
def test_without_maps_the_made_one_is_charted(tmp_path, monkeypatch):
    monkeypatch.setattr(chart_cli, "_MADE_ROWS", 8)
    chart_lights(output=tmp_path / "charts")
    assert "made, outdoors" in (tmp_path / "charts/lights.csv").read_text()


@pytest.mark.usefixtures("never_measured")
@pytest.mark.parametrize(
    ("content", "message"), [(None, "none.exr"), (b"no picture", "none.exr")], ids=["no", "damaged"]
)
def test_a_map_that_cannot_be_read_stops_it_before_anything_is_measured(
    map_path, tmp_path, capsys, content, message
):
    bad = tmp_path / "none.exr"
    if content:
        bad.write_bytes(content)
    output = tmp_path / "charts"
    with pytest.raises(SystemExit) as stop:
        main(["chart", "lights", str(map_path), str(bad), "-o", str(output)])
    assert stop.value.code == 2
    assert message in capsys.readouterr().err
    assert not output.exists()


@pytest.mark.usefixtures("never_measured")
def test_existing_charts_are_kept_unless_forced(map_path, tmp_path):
    output = tmp_path / "charts"
    output.mkdir()
    (output / "lights.csv").write_text("mine")
    with pytest.raises(InputError, match="--force"):
        chart_lights(map_path, output=output)
    assert (output / "lights.csv").read_text() == "mine"


@pytest.mark.usefixtures("never_measured")
def test_a_map_without_light_is_refused(tmp_path):
    write_environment(tmp_path / "dark.exr", environment(constant(8).radiance * 0))
    with pytest.raises(InputError, match=r"dark\.exr: there is no light"):
        chart_lights(tmp_path / "dark.exr", output=tmp_path / "charts")


def test_other_commands_do_not_wait_for_what_the_chart_needs():
    slow = "{'matplotlib', 'scipy.optimize'}"
    code = f"import sys, lighting.cli; sys.exit(bool({slow} & {{*sys.modules}}))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
