"""The report's files: a page, or a folder with the page and its diagrams."""

from collections.abc import Mapping
from pathlib import Path

from calibration.report.evidence import Evidence
from calibration.report.figures import diagrams
from calibration.report.page import page
from calibration.report.theme import png
from capture.errors import InputError
from capture.output import check_place, refuse_existing, replacing, write_text

_PAGE_SUFFIXES = (".html", ".htm")

_PAGE_NAME = "report.html"


def refuse_report(output: Path, *, force: bool) -> None:
    """Raise InputError if a report is there already and `force` is not set, or cannot be made."""
    if output.suffix.lower() not in _PAGE_SUFFIXES:
        if output.exists() and not output.is_dir():
            raise InputError(f"{output} is not a folder; name a folder or a page, {_PAGE_NAME}")
        if not output.resolve().parent.is_dir():
            raise InputError(f"{output.parent} is not a folder; {output.name} cannot be made there")
        refuse_existing(output / _PAGE_NAME, force=force)
    else:
        check_place(output, force=force)


def write_report(
    output: Path,
    title: str,
    evidence: Evidence,
    pictures: Mapping[str, Path],
    *,
    force: bool = False,
) -> list[str]:
    """Write a page named .html, or a folder with the page and its diagrams as PNG.

    Returns
    -------
    list of str
        A line for each kind of file written.
    """
    refuse_report(output, force=force)
    drawn = diagrams(evidence)
    names = [view.name for view in evidence.record.views]
    found = sum(name in pictures and pictures[name].is_file() for name in names)
    text = page(title, evidence, drawn, pictures)
    told = f"{found} of {len(names)} views with their pictures"
    if output.suffix.lower() in _PAGE_SUFFIXES:
        write_text(output, text, force=force)
        return [f"{output}: {told}"]
    try:
        output.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(f"{output}: cannot be made ({error.strerror or error})") from None
    for diagram in drawn:
        with replacing(output / f"{diagram.name}.png", force=True) as partial:
            partial.write_bytes(png(diagram.figure))
    write_text(output / _PAGE_NAME, text, force=force)
    return [
        f"{output / _PAGE_NAME}: {told}",
        f"{output}: {', '.join(f'{each.name}.png' for each in drawn)}",
    ]
