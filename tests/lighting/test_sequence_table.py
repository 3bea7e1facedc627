"""The table of lights over time, and its chart."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest

from capture.errors import InputError
from lighting.light_set import LightSet
from lighting.measures.sequence_chart import days_of, draw_sequence
from lighting.measures.sequence_table import (
    FrameRow,
    SequenceTable,
    light_columns,
    read_sequence_table,
)
from lighting.sequence_chart_cli import chart_sequence
from lighting.sphere import harmonics


def row(bracket: int, time_s: float, recording: str = "sky", **columns) -> FrameRow:
    return FrameRow(
        recording=recording,
        bracket=bracket,
        time_s=time_s,
        exposure_count=3,
        shortest_s=1e-3,
        longest_s=0.1,
        **columns,
    )


def lit(bracket: int, time_s: float, **columns) -> FrameRow:
    sun = {"sun_x": 0.0, "sun_y": 0.6, "sun_z": 0.8, "sun_power": 2.0}
    return row(
        bracket,
        time_s,
        **{"total_irradiance": 3.0, "light_count": 8, "predicted_error": 0.01} | sun | columns,
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "index.sqlite"


def test_rows_come_back_as_they_were_in_order_of_time(path):
    rows = [
        lit(1, 0.1 + 0.2, clipped_share=1e-7, lights_file="sky/lights/1.json"),
        row(0, 0.25, failure="damaged"),
    ]
    with SequenceTable(path) as table:
        table.put(rows)
    assert read_sequence_table(path) == rows[::-1]


def test_a_frame_has_one_row_the_last_that_was_written(path):
    with SequenceTable(path) as table:
        table.put([row(0, 0.0, failure="damaged"), row(0, 0.0, recording="other")])
    with SequenceTable(path) as table:
        table.put([lit(0, 0.0)])
    assert read_sequence_table(path) == [row(0, 0.0, recording="other"), lit(0, 0.0)]


def test_rows_are_written_all_or_none(path):
    with SequenceTable(path) as table:
        table.put([row(0, 0.0)])

        def failing():
            yield row(1, 1.0)
            raise RuntimeError

        with pytest.raises(RuntimeError):
            table.put(failing())
        table.put([row(2, 2.0)])
    assert [found.bracket for found in read_sequence_table(path)] == [0, 2]


def test_what_is_no_table_of_lights_is_refused_and_left_alone(path):
    path.write_text("no database, and too long to be the beginning of one" * 10)
    for use in (SequenceTable, read_sequence_table):
        with pytest.raises(InputError, match="not a database"):
            use(path)
    path.unlink()
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE frames (their TEXT)")
    connection.close()
    for use in (SequenceTable, read_sequence_table):
        with pytest.raises(InputError, match="table of lights of version 1, found 0"):
            use(path)
    with pytest.raises(InputError, match="no such table"):
        read_sequence_table(path.with_name("none.sqlite"))


def test_columns_tell_of_the_light_and_of_its_strongest_key():
    fill = np.zeros((harmonics.COUNT, 3))
    fill[0] = 0.5 * np.sqrt(4 * np.pi)  # 0.5 from everywhere
    directions = np.array([[0.0, 1.0, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    power = np.array([1.0, 3.0, 5.0, 0.0])
    lights = LightSet(
        directions,
        np.repeat(power[:, None], 3, axis=1),
        np.zeros(4),
        is_key=np.array([True, True, False, False]),
        fill=fill,
        predicted_error=0.02,
    )
    columns = light_columns(lights)
    assert columns["total_irradiance"] == pytest.approx(9 + 0.5 * 4 * np.pi)
    assert (columns["sun_x"], columns["sun_y"], columns["sun_z"]) == (0.6, 0.8, 0.0)
    assert columns["sun_power"] == pytest.approx(3.0)
    assert columns["light_count"] == 3  # a place without light is none
    assert columns["predicted_error"] == 0.02


def test_without_a_key_light_there_is_no_sun():
    lights = LightSet(np.array([[0.0, 1.0, 0.0]]), np.ones((1, 3)), np.zeros(1))
    assert "sun_x" not in light_columns(lights)


def test_days_begin_at_midnight_of_each_recording():
    rows = [lit(0, 86_399.0), lit(1, 86_400.0), row(0, 10.0, recording="b")]
    days = days_of(rows)
    assert [(day.recording, day.number, list(day.times_s)) for day in days] == [
        ("sky", 0, [86_399.0]),
        ("sky", 1, [0.0]),
        ("b", 0, [10.0]),
    ]


@pytest.mark.parametrize("day_count", [1, 7])
def test_the_chart_shows_every_panel_and_what_failed(path, tmp_path, capsys, day_count):
    times_s = [86_400.0 * day + 600.0 * step for day in range(day_count) for step in range(9)]
    rows = [lit(i, time_s, clipped_share=0.01) for i, time_s in enumerate(times_s)]
    rows[4] = row(4, times_s[4], failure="damaged")
    with SequenceTable(path) as table:
        table.put(rows)
    chart = tmp_path / "chart.svg"
    chart_sequence(path, output=chart)
    drawn = chart.read_text()
    for text in ("All light", "Elevation", "Number of lights", "Predicted error", "1 failed"):
        assert text in drawn
    assert f"{9 * day_count} frames, {day_count} day" in capsys.readouterr().out
    draw_sequence(rows, tmp_path / "again.svg")
    assert (tmp_path / "again.svg").read_bytes() == chart.read_bytes()


def test_a_chart_without_lights_or_of_another_kind_is_refused(path, tmp_path):
    with SequenceTable(path) as table:
        table.put([row(0, 0.0)])
    with pytest.raises(InputError, match="no lights in the table"):
        chart_sequence(path, output=tmp_path / "chart.svg")
    with pytest.raises(InputError, match=r"written as \.svg or \.png"):
        chart_sequence(path, output=tmp_path / "chart.pdf")
