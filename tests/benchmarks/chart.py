"""Error against time of every light reduction, drawn from results.json.

The numbers at the points are counts of lights: `python -m tests.benchmarks.chart`.
"""

import json
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

HERE = Path(__file__).parent
PANELS = {
    "irradiance error %, median": "in the open",
    "occluded %, as points": "occluded, lights as points",
    "occluded %, with extent": "occluded, lights as wide as their extent",
}
# Colours that keep apart for colour-blind eyes (Okabe and Ito); peers are dashed.
STYLES = {
    "inverse-cdf": ("#0072B2", "-"),
    "median-cut": ("#E69F00", "-"),
    "variance-minimisation": ("#CC79A7", "-"),
    "cells": ("#009E73", "-"),
    "random points": ("#777777", "--"),
    "median cut (numpy)": ("#D55E00", "--"),
}


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Write an SVG with a panel per kind of error; `rows` are those of lights.run."""
    # Fixed ids, so that the same results give the same file.
    with mpl.rc_context({"svg.hashsalt": "fishlight", "font.size": 9}):
        figure = Figure(figsize=(11, 4.2), layout="constrained")
        axes = figure.subplots(1, len(PANELS), sharex=True, sharey=True)
        for axis, (key, title) in zip(axes, PANELS.items(), strict=True):
            for system, (colour, line) in STYLES.items():
                own = [row for row in rows if row["system"] == system]
                times_ms = [row["ms"] for row in own]
                errors = [row["accuracy"][key] for row in own]
                axis.plot(times_ms, errors, line, color=colour, marker="o", ms=4, label=system)
                for row, time_ms, error in zip(own, times_ms, errors, strict=True):
                    if system in ("inverse-cdf", "cells"):
                        number = row["case"].split()[0]
                        axis.annotate(
                            number, (time_ms, error), (4, 4), textcoords="offset points", fontsize=7
                        )
            axis.set(xscale="log", yscale="log", title=title, xlabel="ms for a 1024×512 map")
            axis.grid(True, which="major", alpha=0.3)
        axes[0].set_ylabel("error of the irradiance, %")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
        figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    results = json.loads((HERE / "results.json").read_text())
    draw([row for row in results["rows"] if row["stage"] == "lights"], HERE / "lights.svg")
