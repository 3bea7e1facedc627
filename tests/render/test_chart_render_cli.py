"""`fishlight chart render`: what it writes, goes on with, and refuses."""

from contextlib import contextmanager

import pytest

from capture.errors import InputError
from lighting.maps.environment_files import write_environment
from lighting.measures import line_chart
from lighting.measures.chart import Point
from render import chart_cli
from render.chart_cli import chart_render
from render.measures import chart, growth, truths
from render.measures.chart_drawing import ERROR_CHART, GROWTH_CHART
from render.measures.ways import MAIN_WAYS, RAYS
from tests.environments import constant, environment, outdoors
from tests.render.chart_cases import CAMERA, EVEN, SCENE, Painter, measured


@pytest.fixture
def small(monkeypatch):
    """One scene, rays of two counts and a setting of one; the truth is even."""
    painters = {RAYS: Painter(0.9), "bright": Painter(1.3)}

    @contextmanager
    def both():
        yield painters

    view = {"ball": (SCENE, CAMERA)}
    monkeypatch.setattr(chart_cli, "ways", both)
    monkeypatch.setattr(chart_cli, "chart_scenes", lambda meshes, size_px: view)
    monkeypatch.setattr(truths, "truth_of", lambda *_arguments: EVEN)
    monkeypatch.setattr(
        line_chart,
        "draw",
        lambda points, what, own, about, path, theme: path.write_text(
            f"{what.title} {theme} {own} {about}"
        ),
    )
    monkeypatch.setattr(chart, "COUNTS", (4, 8))
    monkeypatch.setattr(chart, "COUNTS_OF_SETTINGS", (8,))
    monkeypatch.setattr(growth, "COUNTS", {growth.TRIANGLES: (64, 256), growth.PIXELS: (12, 300)})
    return painters


@pytest.fixture
def map_path(tmp_path):
    path = tmp_path / "map.exr"
    write_environment(path, outdoors(8))
    return path


def test_writes_the_charts_and_their_numbers(small, map_path, tmp_path, capsys):
    output = tmp_path / "charts"
    chart_render(map_path, output=output)
    printed = capsys.readouterr().out.splitlines()
    assert printed == [
        "no OpenGL, so not in the chart: shadow maps",
        f"{output}: 7 measurements of 2 ways, 1 scene under 1 map",
    ]
    pictures = {
        f"{name}-{theme}{suffix}"
        for name in ("render", "growth")
        for theme in ("light", "dark")
        for suffix in (".svg", ".png")
    }
    others = {"render.csv", "growth.csv", "measurements.json", "growth.json"}
    assert {path.name for path in output.iterdir()} == pictures | others
    header, *lines = (output / "render.csv").read_text().splitlines()
    assert header == "scene,map_name,way,count,lights,ms,setup_ms,rmse,flip,least_flip"
    assert [line.split(",")[:4] for line in lines] == [
        ["ball", str(map_path), *row] for row in ((RAYS, "4"), (RAYS, "8"), ("bright", "8"))
    ]
    assert lines[0].split(",")[7] == "0.1"
    assert len((output / "growth.csv").read_text().splitlines()) == 1 + 4
    for name, words in (("render", "error against time"), ("growth", "time of a frame grows")):
        text = (output / f"{name}-dark.svg").read_text()
        assert words in text
        assert f"dark {MAIN_WAYS} " in text
    assert "1 scene under 1 map, 640×480. The" in (output / "render-light.svg").read_text()
    # All is known: nothing is drawn.
    drawn = len(small[RAYS].frames)
    chart_render(map_path, output=output, force=True)
    assert len(small[RAYS].frames) == drawn
    chart_render(map_path, output=output, force=True, fresh=True)
    assert len(small[RAYS].frames) == 2 * drawn


@pytest.mark.parametrize("what", [ERROR_CHART, GROWTH_CHART], ids=["render", "growth"])
def test_every_panel_is_drawn(what, tmp_path):
    points = chart.points_of([measured(RAYS, count, rmse=1 / count) for count in (4, 16, 64)])
    points += [Point(RAYS, count, 2.0, {growth.TRIANGLES: 2.0}) for count in (1000, 30_000)]
    points += [Point(RAYS, count, 2.0, {growth.PIXELS: 2.0}) for count in (20_000, 1_200_000)]
    line_chart.draw(points, what, [RAYS], "some scenes", tmp_path / "chart.svg")
    text = (tmp_path / "chart.svg").read_text()
    for panel in what.panels:
        assert f">{panel.title}</text>" in text
    assert (">1.2M</text>" in text) == (what is GROWTH_CHART)


def test_a_run_goes_on_where_an_earlier_one_was_killed(small, map_path, tmp_path, monkeypatch):
    draw = small[RAYS].draw

    def killed(lights, environment_map, frame):
        if len(lights) == 8:
            raise SystemExit
        return draw(lights, environment_map, frame)

    # Whatever ends it: no handler may be needed for what was measured to be kept.
    monkeypatch.setattr(chart_cli, "progress", lambda rows, *_: rows)
    monkeypatch.setattr(small[RAYS], "draw", killed)
    with pytest.raises(SystemExit):
        chart_render(map_path, output=tmp_path / "charts")
    assert [path.name for path in (tmp_path / "charts").iterdir()] == ["measurements.json"]
    assert {count for count, _ in small[RAYS].frames} == {4}
    small[RAYS].frames.clear()
    monkeypatch.setattr(small[RAYS], "draw", draw)
    chart_render(map_path, output=tmp_path / "charts")
    drawn = {count for count, _ in small[RAYS].frames}
    assert 8 in drawn
    assert 4 not in drawn


def test_nothing_is_measured_that_could_not_be_written(small, map_path, tmp_path):
    output = tmp_path / "charts"
    output.mkdir()
    (output / "growth.csv").write_text("mine")
    with pytest.raises(InputError, match="--force"):
        chart_render(map_path, output=output)
    with pytest.raises(InputError, match="is a file"):
        chart_render(map_path, output=map_path)
    assert (output / "growth.csv").read_text() == "mine"
    assert not small[RAYS].opened


@pytest.mark.parametrize("lit_rows", [0, 4])
def test_a_map_without_light_above_the_horizon_is_refused(small, tmp_path, lit_rows):
    radiance = constant(8).radiance.copy()
    radiance[: 8 - lit_rows] = 0
    write_environment(tmp_path / "dark.exr", environment(radiance))
    with pytest.raises(InputError, match=r"dark\.exr: there is no light"):
        chart_render(tmp_path / "dark.exr", output=tmp_path / "charts")
    assert not (tmp_path / "charts").exists()
