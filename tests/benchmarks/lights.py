"""Light reduction, every method and its peers, as `fishlight chart lights` measures them.

Errors are medians over maps: one made here, and captured ones where they are at hand. Times are of
the made one, 1024×512.
"""

from pathlib import Path
from typing import Any

from lighting.maps.environment_files import read_environment
from lighting.measures import chart, flicker
from lighting.reduce import METHODS
from lighting.simulation.outdoors import outdoors
from lighting.simulation.sequences import SEQUENCES

OURS = "cells"
"""The method that peers' times are compared with."""
MADE = "made, outdoors"
DATA = Path(__file__).resolve().parents[2].parent / "shared/data"
CAPTURED = (
    "env-blender-world/city.exr",
    "env-blender-world/interior.exr",
    "env-polyhaven-drei/empty_warehouse_01_1k.hdr",
    "env-polyhaven-drei/venice_sunset_1k.hdr",
    "env-pmndrs/esplanade.exr",
    "env-pmndrs/hall.exr",
)
FIGURES = {
    "open, points": "irradiance error %, as points",
    "open, discs": "irradiance error %, with extent",
    "occluded, points": "occluded %, as points",
    "occluded, discs": "occluded %, with extent",
    "sphere, points": "behind a sphere %, as points",
    "sphere, discs": "behind a sphere %, with extent",
    chart.FLICKER: "flicker %",
}
"""Figures of the chart and the columns that hold them, in per cent."""


def run(repeats: int) -> list[dict[str, Any]]:
    """Return a row per light count and system; the chart repeats as often as it needs to."""
    del repeats
    maps = {MADE: outdoors(512)}
    maps |= {name: read_environment(DATA / name)[0] for name in CAPTURED if (DATA / name).exists()}
    compared, _ = chart.systems()
    on_maps = [row for row in chart.measure(maps, compared, chart.COUNTS, {}) if row]
    measured = flicker.measure(SEQUENCES, compared, flicker.COUNTS, {})
    on_sequences = [row for row in measured if row]
    ms = {(row.system, row.count): row.ms for row in on_maps if row.map_name == MADE}
    return [
        {
            "stage": "lights",
            "case": f"{point.count} lights",
            "system": point.system,
            "ms": ms[point.system, point.count],
            "ratio": None if point.system in METHODS else _ratio(ms, point),
            "accuracy": {
                column: 100 * point.errors[figure]
                for figure, column in FIGURES.items()
                if figure in point.errors
            }
            | {"maps": len(maps)},
        }
        for point in sorted(chart.points_of(on_maps, on_sequences), key=lambda point: point.count)
    ]


def _ratio(ms: dict[tuple[str, int], float], point: chart.Point) -> float:
    return ms[point.system, point.count] / ms[OURS, point.count]
