"""The chart of lights: error against time and against the number of lights, and flicker.

Three panels show a kind of error against time, the fourth against the number of lights.

Input  : points of chart.py.    Output : SVG and PNG files.
"""

from collections.abc import Sequence
from pathlib import Path

from lighting.measures import line_chart
from lighting.measures.chart import COUNTS, FLICKER, Point
from lighting.measures.line_chart import Chart, Panel
from lighting.reduce import ADAPTIVE


def _lights(point: Point) -> float:
    return point.count


LIGHTS_CHART = Chart(
    "Lights from an environment map: error of the irradiance",
    "Band: nothing else is both cheaper and truer; beside it, the number of lights. "
    "Thin: fishlight's other methods. Grey: not fishlight's.",
    (
        Panel("In the open, lights as points", "open, points"),
        Panel("Behind occluders, lights with their extent", "occluded, discs"),
        Panel("Flicker behind an occluder, frame to frame", FLICKER),
        Panel(
            "Behind occluders, by the number of lights",
            "occluded, discs",
            _lights,
            cost_unit="",
            cost_ticks=COUNTS[::2],
        ),
    ),
    ADAPTIVE,
)


def draw(
    points: Sequence[Point], own: Sequence[str], about: str, path: Path, theme: str = "light"
) -> None:
    """Write the chart as `line_chart.draw` does; `own` are fishlight's systems."""
    line_chart.draw(points, LIGHTS_CHART, own, about, path, theme)
