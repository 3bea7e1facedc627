"""Light reduction beyond the chart: scenes held out of tuning, and 3000 samples.

64 lights: medians of the chart's errors over 18 captured scenes, and over the nine that are held
out (tests/captured_maps.py), each map in its own size. 3000 lights: of a made map, 1024×512. Times
are the chart's, the least of several.
"""

from typing import Any

from lighting.maps.environment import EnvironmentMap
from lighting.measures import chart
from lighting.simulation.outdoors import outdoors
from tests.benchmarks.lights import FIGURES
from tests.captured_maps import captured_maps, held_out

MANY = ("inverse-cdf", "penrose", "structured")


def run(repeats: int) -> list[dict[str, Any]]:
    """Return a row for each set of scenes and system; the chart repeats as often as it needs to."""
    del repeats
    captured = captured_maps()
    apart = held_out(list(captured))
    compared = {name: find for name, find in chart.systems()[0].items() if name != chart.STEADY}
    rows = []
    for about, names in (
        ("tuned on", [name for name in captured if name not in apart]),
        ("held out", apart),
    ):
        if names:
            scenes = {name: captured[name] for name in names}
            rows += _rows(f"64 lights, {len(names)} scenes {about}", scenes, compared, 64)
    many = {name: compared[name] for name in MANY}
    return rows + _rows("3000 lights, made map", {"made": outdoors(512)}, many, 3000)


def _rows(
    case: str, maps: dict[str, EnvironmentMap], compared: dict[str, chart.System], count: int
) -> list[dict[str, Any]]:
    measured = [row for row in chart.measure(maps, compared, [count], {}) if row]
    return [
        {
            "stage": "light_figures",
            "case": case,
            "system": point.system,
            "ms": point.ms,
            "ratio": None,
            "accuracy": {
                column: 100 * point.errors[figure]
                for figure, column in FIGURES.items()
                if figure in point.errors
            },
        }
        for point in chart.points_of(measured)
    ]
