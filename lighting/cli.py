"""The lighting stage's commands: simulate, remap, lights, export and chart."""

from collections.abc import Callable
from typing import Any

from lighting.chart_cli import chart_app
from lighting.export_cli import export
from lighting.lights_cli import lights
from lighting.remap_cli import remap
from lighting.simulate_cli import simulate

COMMANDS: tuple[tuple[Callable[..., Any], str], ...] = (
    (simulate, "simulate"),
    (remap, "remap"),
    (lights, "lights"),
    (export, "export"),
    (chart_app, "chart"),
)
