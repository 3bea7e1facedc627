"""The README's chart of light reduction, from results.json: `python -m tests.benchmarks.chart`."""

import json
from pathlib import Path
from typing import Any

from lighting.measures.chart import STEADY, Point
from lighting.measures.chart_drawing import draw
from lighting.reduce import METHODS
from tests.benchmarks.lights import FIGURES

HERE = Path(__file__).parent


def draw_rows(rows: list[dict[str, Any]], folder: Path) -> None:
    """Write lights.svg and lights-dark.svg; `rows` are those of lights.run."""
    points = [
        Point(
            row["system"],
            int(row["case"].split()[0]),
            row["ms"],
            {
                figure: row["accuracy"][column] / 100
                for figure, column in FIGURES.items()
                if column in row["accuracy"]
            },
        )
        for row in rows
    ]
    about = (
        f"4, 8, 16 … 1024 lights. Errors are medians over {rows[0]['accuracy']['maps']} maps, "
        "times are for 1024×512."
    )
    for theme, name in (("light", "lights.svg"), ("dark", "lights-dark.svg")):
        draw(points, [*METHODS, STEADY], about, folder / name, theme)


if __name__ == "__main__":
    results = json.loads((HERE / "results.json").read_text())
    draw_rows([row for row in results["rows"] if row["stage"] == "lights"], HERE)
