"""`fishlight inspect`: what a recording holds."""

import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from capture.errors import InputError
from capture.inspecting import contact_sheet, describe, examine
from capture.output import check_place
from capture.pictures import write_png
from capture.recording import open_recording


def inspect(recording: Path, *, thumbnails: Path | None = None, force: bool = False) -> None:
    """Show what a recording holds, and whether every frame of it can be read.

    Parameters
    ----------
    recording
        A folder with a manifest.json.
    thumbnails
        Also write a sheet of thumbnails, a PNG: a row for each of up to 12 brackets.
    force
        Replace the sheet if it exists.
    """
    if thumbnails is not None:
        if thumbnails.suffix.lower() != ".png":
            raise InputError(f"{thumbnails}: wanted a file named .png")
        check_place(thumbnails, force=force)
    opened = open_recording(recording)
    examination = examine(opened)
    _print_facts(describe(opened, examination))
    if thumbnails is not None:
        write_png(thumbnails, contact_sheet(opened), force=force)
    if examination.failures:
        count = len(examination.failures)
        raise InputError(f"{count} of {len(opened)} brackets: {examination.failures[0]}")


def _print_facts(facts: Sequence[tuple[str, str]]) -> None:
    if not sys.stdout.isatty():
        for name, value in facts:
            print(f"{name}: {value}")
        return
    table = Table.grid(padding=(0, 2))
    for name, value in facts:
        table.add_row(Text(name, style="bold"), Text(value))
    Console().print(table)
