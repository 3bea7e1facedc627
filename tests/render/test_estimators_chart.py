"""`fishlight chart estimators`: measurements, claims and the gallery, and what later runs keep."""

import math
import re

import cv2
import numpy as np
import pytest

from capture.errors import InputError
from lighting.maps.environment_files import write_environment
from render import estimators_chart_cli
from render.claims import occlusion, registry
from render.claims.contract import Claim, Finding
from render.comparison import convergence
from render.comparison.convergence import ALL, REFERENCE, Convergence, points_of, time_in
from render.comparison.equal_time import Shown, pictures, truest
from render.comparison.gallery import error_picture
from render.estimators_chart_cli import chart_estimators
from render.measures import truths
from tests.environments import environment, outdoors

PICTURES = {f"estimators-{theme}{end}" for theme in ("light", "dark") for end in (".svg", ".png")}
FILES = {"estimators.csv", "claims.csv", "claims.txt", "gallery.html", "measurements.json"}


@pytest.fixture
def map_path(tmp_path):
    write_environment(tmp_path / "sky.exr", outdoors(16))
    return tmp_path / "sky.exr"


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Two systems, two numbers of samples, tiny pictures, two claims of which one fails."""
    monkeypatch.setattr(convergence, "systems", lambda: ["brdf", "cosine"])
    monkeypatch.setattr(convergence, "SAMPLES", (1,))
    monkeypatch.setattr(estimators_chart_cli, "SIZE_PX", (24, 18))
    monkeypatch.setattr(estimators_chart_cli, "SECONDS", 0.05)
    monkeypatch.setattr(convergence, "_PASSES", 1)
    monkeypatch.setattr(truths, "MOST_SECONDS", 0.0)
    strip = np.full((8, 32, 4), 0.5, np.float32)
    monkeypatch.setattr(estimators_chart_cli, "under", lambda _environment: strip)
    monkeypatch.setattr(estimators_chart_cli, "under_point_light", lambda: strip)
    monkeypatch.setattr(occlusion, "SIZE_PX", (12, 9))
    claims = tuple(
        Claim(name, "so they <say>", "somebody, 1999", "a test", lambda _, held=held: [
            Finding("here", {"a figure": 0.25}, held)
        ], "a figure")
        for name, held in (("what holds", True), ("what does not", False))
    )  # fmt: skip
    monkeypatch.setattr(registry, "CLAIMS", claims)


def row(estimator="brdf", scene="diffuse", map_name="m", samples=1, ms=1.0, rmse=0.1):
    return Convergence(scene, map_name, estimator, samples, ms, 0.0, 1, rmse)


@pytest.mark.slow
def test_writes_charts_tables_and_a_page_that_needs_nothing_else(map_path, tmp_path, capsys):
    output = tmp_path / "charts"
    chart_estimators(map_path, output=output)
    assert {path.name for path in output.iterdir()} == {
        *PICTURES, *FILES, "findings.json", "references",
    }  # fmt: skip
    printed = capsys.readouterr().out
    assert "6 measurements of 2 estimators" in printed
    assert re.search(r"truest at equal time, of 3 cases: (brdf|cosine) in [23]", printed)
    assert "what holds: confirmed\n" in printed
    assert "what does not: not confirmed\n" in printed
    assert len((output / "estimators.csv").read_text().splitlines()) == 1 + 3 * 2
    assert (output / "claims.csv").read_text().splitlines()[1:] == [
        'what holds,"somebody, 1999",confirmed,here,true,a figure,0.25',
        'what does not,"somebody, 1999",not confirmed,here,false,a figure,0.25',
    ]
    told = (output / "claims.txt").read_text()
    assert "what does not: NOT CONFIRMED" in told
    assert "Found: a figure 0.25 to 0.25, median 0.25" in told

    page = (output / "gallery.html").read_text()
    assert "so they &lt;say&gt;" in page
    assert page.count('<tr class="held">') == 1
    # Truth, two estimators with errors, for three scenes; two strips of spheres; nine occlusions.
    assert page.count("data:image/webp") == 3 * (1 + 2 * 2) + 2 + 9
    assert not re.findall(r'(?:src|href|srcset)="(?!data:)', page)
    assert page.count("data:image/svg+xml") == 2
    for theme, is_bright in (("light", True), ("dark", False)):
        picture = cv2.imread(str(output / f"estimators-{theme}.png"))
        assert (picture[0, 0].mean() > 128) == is_bright

    with pytest.raises(InputError, match="--force"):
        chart_estimators(map_path, output=output)


def test_the_reference_is_measured_too(tmp_path):
    scenes = {"diffuse": estimators_chart_cli.comparison_scenes((24, 18))["diffuse"]}
    [case] = estimators_chart_cli.cases_of(scenes, {"m": outdoors(16)}, tmp_path)
    [by_brdf, by_reference] = convergence.measure([case], ["brdf", REFERENCE], (1,), {})
    assert (by_reference.estimator, by_reference.scene, by_reference.samples) == (
        REFERENCE,
        "diffuse",
        1,
    )
    assert 0 < by_reference.rmse < 0.2 * by_brdf.rmse
    assert by_reference.rays > by_brdf.rays > 0
    [shown] = pictures(case, [REFERENCE], 0.0)
    assert not np.array_equal(shown.radiance[..., :3], case.truth().radiance)


@pytest.mark.parametrize(("long_s", "passes"), [(-1.0, 1), (math.inf, 2)])
def test_only_short_passes_are_drawn_twice(tmp_path, monkeypatch, long_s, passes):
    monkeypatch.setattr(convergence, "_PASSES", 2)
    monkeypatch.setattr(convergence, "_LONG_S", long_s)
    scenes = {"diffuse": estimators_chart_cli.comparison_scenes((24, 18))["diffuse"]}
    [case] = estimators_chart_cli.cases_of(scenes, {"m": outdoors(16)}, tmp_path)
    drawn = []

    def draw(number):
        drawn.append(number)
        return case.truth().radiance, 1

    convergence._measured(case, "brdf", 1, 0.0, draw)
    assert drawn == list(range(passes))


def test_what_is_known_is_not_measured_again(map_path, tmp_path, monkeypatch):
    calls = []

    def one(case, name, samples):
        calls.append(name)
        return row(name, case.scene_name, case.map_name, samples)

    monkeypatch.setattr(convergence, "_estimator", one)
    monkeypatch.setattr(convergence, "_reference", lambda case, samples: one(case, "r", samples))
    cases = estimators_chart_cli.cases_of(
        estimators_chart_cli.comparison_scenes((8, 6)), {"m": outdoors(8)}, tmp_path
    )
    known = {}
    rows = list(convergence.measure(cases, ["brdf", REFERENCE], (1, 4), known))
    assert len(calls) == len(rows) == len(known) == 12
    assert list(convergence.measure(cases, ["brdf", REFERENCE], (1, 4), known)) == rows
    assert len(calls) == 12


def test_points_are_geometric_means_over_maps_and_scenes():
    rows = [
        row(rmse=0.1, ms=1.0),
        row(rmse=0.4, ms=4.0, map_name="n"),
        row(rmse=0.1, ms=8.0, scene="mixed"),
        row(rmse=0.1, ms=8.0, scene="mixed", map_name="n"),
        row(samples=4),  # not in every case
    ]
    [point] = points_of(rows)
    assert (point.system, point.count) == ("brdf", 4)
    assert point.errors["diffuse"] == pytest.approx(0.2)
    assert point.errors[time_in("diffuse")] == pytest.approx(2.0)
    assert point.errors[ALL] == pytest.approx(math.sqrt(0.02))
    assert point.ms == point.errors[time_in(ALL)] == pytest.approx(4.0)


def test_the_truest_is_one_whose_error_falls_with_time():
    def shown(name, rmse):
        return Shown(name, np.zeros((1, 1, 4), np.float32), rmse, 0.0, 4, 0)

    all_shown = [shown("lights-cells", 0.1), shown("brdf", 0.3), shown(REFERENCE, 0.2)]
    assert truest(all_shown).estimator == REFERENCE
    assert truest([*all_shown, shown("brdf", 0.15)]).estimator == "brdf"


def test_errors_are_black_where_there_are_none():
    truth = np.ones((4, 6, 3), np.float32)
    picture = truth.copy()
    picture[0, 0] += 1
    colours = error_picture(picture, truth).astype(int)
    assert colours[0, 0].sum() > 400
    assert colours[1:].max() < 10


def test_a_map_without_light_is_refused(tmp_path):
    write_environment(tmp_path / "dark.exr", environment(0 * outdoors(8).radiance))
    with pytest.raises(InputError, match="no light"):
        chart_estimators(tmp_path / "dark.exr", output=tmp_path / "charts")
