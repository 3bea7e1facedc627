"""The chart's data: what is measured, remembered, summarised and drawn."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from capture.errors import InputError
from lighting.measures import chart, flicker
from lighting.measures.chart import FLICKER, Measurement, Point, as_csv, pareto_front, points_of
from lighting.measures.chart_drawing import draw
from lighting.measures.error_measures import (
    errors,
    received,
    received_from_map,
    standard_receivers,
    truth,
)
from lighting.measures.known import code_digest, write_known
from lighting.measures.themes import THEMES
from lighting.reduce import ADAPTIVE, METHODS, reduce_to_lights
from lighting.simulation.sequences import SEQUENCES, frames
from tests.environments import constant, outdoors


class Counted:
    """A system that counts its calls."""

    def __init__(self):
        self.calls = 0

    def __call__(self, environment, count, memory):
        self.calls += 1
        return reduce_to_lights(environment, count, "cells"), memory


def measured(system="a", count=4, ms=1.0, map_name="m", **figures):
    return Measurement(map_name, system, count, count, ms, figures or {"open, points": 0.1})


def test_every_method_and_peer_is_a_system():
    compared, missing = chart.systems()
    assert set(METHODS) <= set(compared)
    assert {"random points", "Hammersley points", "median cut (numpy)"} <= set(compared)
    assert {"Mitsuba 3 (scalar)", "colour-hdri"} <= set(compared) | set(missing)
    assert not set(compared) & set(missing)


def test_a_measurement_is_what_the_error_measures_say():
    environment_map = outdoors(16)
    [row] = chart.measure({"m": environment_map}, {"cells": Counted()}, [8], {})
    lights = reduce_to_lights(environment_map, 8, "cells")
    true = truth(environment_map)
    for shape, as_points in (("points", True), ("discs", False)):
        by_kind = errors(lights, true, as_points=as_points)
        for kind, error in by_kind.items():
            assert row.errors[f"{kind}, {shape}"] == error
        occluded = [by_kind[kind] for kind in ("wall", "sphere", "comb")]
        expected = np.sqrt(np.mean(np.square(occluded)))
        assert row.errors[f"occluded, {shape}"] == pytest.approx(expected, rel=1e-12)
    assert (row.map_name, row.system, row.count, row.lights) == ("m", "cells", 8, 8)
    assert row.ms > 0


def test_the_time_is_that_of_a_frame_in_a_stream():
    remembered = []

    def counting(environment_map, count, memory):
        remembered.append(memory)
        return reduce_to_lights(environment_map, count, "cells"), len(remembered)

    list(chart.measure({"m": outdoors(8)}, {"counting": counting}, [4], {}))
    assert remembered[:3] == [None, 1, 2]


def test_the_temporal_stage_is_timed_on_maps_and_judged_on_sequences(monkeypatch):
    monkeypatch.setattr(flicker, "ROWS", 16)
    compared = {name: chart.systems()[0][name] for name in ("adaptive", chart.STEADY)}
    on_maps = list(chart.measure({"m": outdoors(16)}, compared, [16], {}))
    assert [bool(row.errors) for row in on_maps] == [True, False]
    name = "still, 1 % noise"
    on_sequences = list(flicker.measure({name: SEQUENCES[name]}, compared, [16], {}))
    plain, steadied = points_of(on_maps, on_sequences)
    assert steadied.errors[FLICKER] < 0.8 * plain.errors[FLICKER]
    assert steadied.ms > 0


def test_what_is_known_is_not_measured_again(tmp_path):
    system, known = Counted(), {}
    maps = {"m": outdoors(8)}
    first = list(chart.measure(maps, {"cells": system}, [4, 8], known))
    calls = system.calls
    assert calls > 2  # each is repeated
    write_known(tmp_path / "known.json", known)
    known = chart.read_known(tmp_path / "known.json")
    assert list(chart.measure(maps, {"cells": system}, [4, 8], known)) == first
    assert system.calls == calls
    # By another name it is still the same map; another map, count or system is not.
    renamed = list(chart.measure({"n": outdoors(8)}, {"cells": system}, [4], known))
    assert system.calls == calls
    assert renamed[0].map_name == "n"
    for environment_map, name, count in (
        (outdoors(8, seed=1), "cells", 4),
        (outdoors(8), "cells", 5),
        (outdoors(8), "other", 4),
    ):
        calls = system.calls
        list(chart.measure({"m": environment_map}, {name: system}, [count], known))
        assert system.calls > calls


def test_changed_code_is_measured_again_and_replaces_what_was(monkeypatch, tmp_path):
    system, known, maps = Counted(), {}, {"m": outdoors(8)}
    list(chart.measure(maps, {"cells": system}, [4], known))
    calls = system.calls
    write_known(tmp_path / "known.json", known)
    monkeypatch.setattr(chart, "lighting_digest", lambda: "newer")
    list(chart.measure(maps, {"cells": system}, [4], known))
    assert system.calls > calls
    assert chart.read_known(tmp_path / "known.json") == {}


def test_all_of_lighting_is_code_that_results_depend_on(monkeypatch):
    read = set()
    monkeypatch.setattr(Path, "read_bytes", lambda path: read.add(path.name) or b"")
    code_digest.__wrapped__(Path(chart.__file__).parents[1])
    assert {"reduce.py", "cell_tree.py", "penrose.py", "chart.py"} <= read


def test_a_slow_system_is_spared_larger_counts(monkeypatch):
    # A clock on which every call takes 3 s.
    clock = iter(range(0, 1000, 3))
    monkeypatch.setattr(chart, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    system = Counted()
    rows = list(chart.measure({"m": outdoors(8)}, {"slow": system}, [4, 8, 16], {}))
    assert rows[0].ms == 3000
    assert rows[1:] == [None, None]
    assert system.calls == 2


def test_a_damaged_file_of_results_is_an_error(tmp_path):
    path = tmp_path / "measurements.json"
    assert chart.read_known(path) == {}
    path.write_text('{"measurements": 3}')
    with pytest.raises(InputError, match="remove it"):
        chart.read_known(path)


def test_points_are_medians_over_maps_and_means_over_sequences():
    on_maps = [measured(ms=ms, **{"open, points": ms / 10}) for ms in (1.0, 2.0, 9.0)]
    on_sequences = [measured(ms=50.0, flicker=value) for value in (0.1, 0.2, 0.9)]
    [point] = points_of(on_maps, on_sequences)
    assert point.ms == 2.0
    assert point.errors == pytest.approx({"open, points": 0.2, FLICKER: 0.4}, rel=1e-12)


def test_a_count_not_reached_on_every_map_is_left_out():
    rows = [measured(count=4), measured(count=8), measured(count=4, map_name="n")]
    assert [point.count for point in points_of(rows)] == [4]
    [point] = points_of(rows, [measured(count=8, flicker=0.1)])
    assert FLICKER not in point.errors


def test_the_front_is_what_nothing_beats():
    points = [
        Point("a", 4, 1.0, {"e": 0.5}),
        Point("a", 8, 2.0, {"e": 0.1}),
        Point("b", 4, 1.5, {"e": 0.6}),
        Point("b", 8, 3.0, {"e": 0.1}),
        Point("c", 8, 4.0, {"e": 0.05}),
        Point("d", 8, 0.1, {}),
    ]
    assert pareto_front(points, "e") == [points[0], points[1], points[4]]


def test_the_table_has_a_line_for_each_measurement():
    lines = as_csv([measured(), measured(system="b, c", flicker=0.25)]).splitlines()
    assert lines[0] == 'map,system,count,lights,ms,"open, points",flicker'
    assert lines[1] == "m,a,4,4,1,0.1,"
    assert lines[2] == 'm,"b, c",4,4,1,,0.25'


def test_flicker_is_what_lights_change_more_than_the_map(monkeypatch):
    monkeypatch.setattr(flicker, "ROWS", 16)
    monkeypatch.setattr(flicker, "FRAMES", 4)
    name = "small lamp, 3 % noise"
    sequence = {name: SEQUENCES[name]}
    sphere = standard_receivers()["sphere"]

    def of(system):
        [row] = flicker.measure(sequence, {"system": system}, [16], {})
        return row.errors[FLICKER]

    maps = [timed.environment for timed in frames(SEQUENCES[name], flicker.ROWS, flicker.FRAMES)]
    first = reduce_to_lights(maps[0], 16, "cells")
    assert of(lambda *_arguments: (first, None)) == 0
    # Lights that swing by a tenth change by a fifth from frame to frame.
    swing = iter([0.9, 1.1] * (flicker.FRAMES // 2))

    def swinging(*_arguments):
        return replace(first, irradiance=next(swing) * first.irradiance), None

    true = np.array([received_from_map(sphere, environment_map) for environment_map in maps])
    mean = np.sqrt(np.mean(true**2))
    light = np.sqrt(np.mean(received(sphere, first, as_points=True) ** 2))
    moved = np.sqrt(np.mean(np.diff(true, axis=0) ** 2, axis=(1, 2)))
    expected = np.sqrt(np.mean((0.2 * light - moved) ** 2)) / mean
    assert of(swinging) == pytest.approx(expected, rel=1e-6)


def test_a_system_gets_what_it_remembered_of_the_frame_before(monkeypatch):
    monkeypatch.setattr(flicker, "ROWS", 8)
    name, remembered = "two suns", []

    def counting(environment_map, count, memory):
        remembered.append(memory)
        return reduce_to_lights(environment_map, count, "cells"), len(remembered)

    list(flicker.measure({name: SEQUENCES[name]}, {"counting": counting}, [4], {}))
    assert remembered == [None, *range(1, flicker.FRAMES)]


def test_lights_that_stand_still_do_not_flicker(monkeypatch):
    monkeypatch.setattr(flicker, "ROWS", 8)
    name = "still, 1 % noise"
    [row] = flicker.measure(
        {name: SEQUENCES[name]},
        {"same": lambda _environment, count, _memory: (reduce_to_lights(constant(8), count), None)},
        [4],
        {},
    )
    assert row.errors[FLICKER] == 0
    assert row.map_name == name


@pytest.fixture(scope="module")
def some_points():
    return [
        Point(system, count, ms * count, {"open, points": 1 / count, FLICKER: 0.1 / count})
        for system, ms in (("cells", 0.1), ("random points", 0.3))
        for count in (4, 16, 64)
    ]


@pytest.mark.parametrize("theme", THEMES)
def test_draws_vectors_with_every_name_and_the_colours_of_the_page(some_points, theme, tmp_path):
    path = tmp_path / "chart.svg"
    draw(some_points, ["cells"], "what it is", path, theme)
    text = path.read_text()
    for words in ("cells", "random points", "what it is", "In the open, lights as points"):
        assert f">{words}</text>" in text
    other = "dark" if theme == "light" else "light"
    assert THEMES[theme].page in text
    assert THEMES[other].ink not in text
    draw(some_points, ["cells"], "what it is", tmp_path / "again.svg", theme)
    assert (tmp_path / "again.svg").read_text() == text


def test_names_of_ours_are_the_default_and_what_is_most_on_fronts(tmp_path):
    # Ten of ours, each as often on the front as its number says, and the default, which never is.
    front = [name for number in range(10) for name in [f"method {number}"] * number]
    points = [
        Point(name, count, 1.0 + count, {"open, points": 1 / (1 + count)})
        for count, name in enumerate(front)
    ]
    points += [Point("method 0", 1, 99.0, {"open, points": 1.0})]
    points += [Point(ADAPTIVE, 1, 99.0, {"open, points": 1.0})]
    own = list(dict.fromkeys(point.system for point in points))
    draw(points, own, "", tmp_path / "chart.svg")
    named = re.findall(r">(method \d|adaptive)</text>", (tmp_path / "chart.svg").read_text())
    assert set(named) == {ADAPTIVE, *(f"method {number}" for number in (9, 8, 7, 6))}


def test_a_front_may_be_by_the_number_of_lights():
    points = [
        Point("a", 4, 9.0, {"e": 0.5}),
        Point("b", 4, 1.0, {"e": 0.6}),
        Point("b", 8, 2.0, {"e": 0.4}),
    ]
    assert pareto_front(points, "e", lambda point: point.count) == [points[0], points[2]]


def test_no_name_lies_on_another(tmp_path):
    # Twelve systems that end in the same point: their names are spread above and below it.
    crowd = [Point(f"system {number}", 4, 1.0, {"open, points": 0.1}) for number in range(12)]
    draw(crowd, [], "", tmp_path / "chart.svg")
    text = (tmp_path / "chart.svg").read_text()
    heights = [float(y) for y in re.findall(r'y="([0-9.]+)"[^>]*>system ', text)]
    assert len(heights) == 12
    assert np.diff(np.sort(heights)).min() > 10  # points; letters are 9 high
