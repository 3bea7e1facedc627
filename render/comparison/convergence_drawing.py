"""The chart of estimators: error against time, for each scene.

Input  : points of convergence.py.    Output : SVG and PNG files.
"""

from lighting.measures.chart import Point
from lighting.measures.line_chart import Chart, Cost, Panel
from render.comparison.convergence import ALL, REFERENCE, time_in


def _time_in(scene: str) -> Cost:
    def cost(point: Point) -> float:
        return point.errors[time_in(scene)]

    return cost


CONVERGENCE_CHART = Chart(
    "Direct light by every estimator: error against time",
    "Band: nothing else is both cheaper and truer; beside it, samples per pixel. Time is CPU "
    "time of a pass, error relative RMSE; geometric means.",
    (
        Panel("Diffuse", "diffuse", _time_in("diffuse")),
        Panel("Glossy", "glossy", _time_in("glossy")),
        Panel("Mixed", "mixed", _time_in("mixed")),
        Panel("All three", ALL, _time_in(ALL)),
    ),
    REFERENCE,
)
