"""The charts of renderers: error against time, and how time grows.

Input  : points of chart.py and growth.py.    Output : SVG and PNG files.
"""

from lighting.measures.chart import Point
from lighting.measures.line_chart import Chart, Panel
from render.measures.chart import (
    COUNTS,
    FLIP,
    MS,
    RMSE,
    SETTINGS_FLIP,
    SETTINGS_RMSE,
    WORST,
)
from render.measures.growth import PIXELS, TRIANGLES
from render.measures.ways import RAYS


def _count(point: Point) -> float:
    return point.count


_BAND = "Band: nothing else is both cheaper and truer; beside it, the number of lights."

ERROR_CHART = Chart(
    "Pictures under an environment map: error against time",
    f"{_BAND} Grey: other settings. Lights and camera move; transport: lights only; rays: objects "
    "too.",
    (
        Panel("Relative RMSE, median", RMSE),
        Panel("FLIP, median: how different it looks", FLIP),
        Panel("Relative RMSE, worst scene and map", WORST),
        Panel("Relative RMSE, by the number of lights", RMSE, _count, "%", "", COUNTS),
        Panel("Relative RMSE, median, of settings", SETTINGS_RMSE),
        Panel("FLIP, median, of settings", SETTINGS_FLIP),
    ),
    RAYS,
)

GROWTH_CHART = Chart(
    "Pictures under an environment map: how the time of a frame grows",
    "What is made before the first frame is not counted: for transport, that takes seconds.",
    (
        Panel("With lights", MS, _count, "ms", "", COUNTS, has_front=False),
        Panel("With triangles", TRIANGLES, _count, "ms", "", (1e3, 1e4, 1e5, 1e6), has_front=False),
        Panel("With pixels", PIXELS, _count, "ms", "", (2e4, 1e5, 3e5, 1.2e6), has_front=False),
    ),
    RAYS,
)
