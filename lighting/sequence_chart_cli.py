"""`fishlight chart sequence`: lights over time, from the table that a batch leaves."""

from pathlib import Path
from typing import Literal

from capture.arguments import Output
from capture.errors import InputError
from capture.output import check_place

_SUFFIXES = (".svg", ".png")


def chart_sequence(
    table: Path, *, output: Output, theme: Literal["light", "dark"] = "light", force: bool = False
) -> None:
    """Draw irradiance, sun, number of lights and predicted error over time, day over day.

    Parameters
    ----------
    table
        What `fishlight batch` leaves: index.sqlite.
    output
        The chart, .svg or .png.
    theme
        For a light or a dark page.
    force
        Replace the chart if it exists.
    """
    # Here, so that no other command waits a second for matplotlib.
    from lighting.measures.sequence_chart import days_of, draw_sequence
    from lighting.measures.sequence_table import read_sequence_table

    if output.suffix.lower() not in _SUFFIXES:
        raise InputError(f"{output}: a chart is written as {' or '.join(_SUFFIXES)}")
    check_place(output, force=force)
    rows = read_sequence_table(table)
    draw_sequence(rows, output, theme)
    days = len(days_of(rows))
    print(f"{output}: {len(rows)} frames, {days} {'day' if days == 1 else 'days'}")
