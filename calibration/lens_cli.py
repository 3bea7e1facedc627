"""`fishlight calibrate lens`: a camera's lens, from its pictures of a board."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from capture.arguments import Output
from capture.output import check_place
from capture.printable import printable


def calibrate_lens(
    images: list[Path],
    *,
    board: str,
    square_mm: float,
    output: Output,
    report: Path | None = None,
    force: Annotated[bool, Parameter(negative=())] = False,
) -> None:
    """Calibrate a lens from pictures of a flat board.

    Take twenty pictures or more with the lens and picture size that will be used: the board tilted
    by 30° either way, near enough to fill a third of the picture, and in every part of it out to
    the rim. Pictures and corners that do not fit with the others are left out and told. Of ten
    kinds of lens the simplest is taken that predicts left-out pictures as well as any does. Rays
    beyond the outermost corners, or uncertain by more than 0.2°, are refused by what reads the
    file.

    Parameters
    ----------
    images
        JPEG, PNG or TIFF files of one size.
    board
        Inner corners of a checkerboard, such as 9x6, or charuco:8x5:5X5_100:0.75, or
        apriltag:6x6:0.3 (Kalibr's grid of tags).
    square_mm
        Side of a square, or of a tag. Only the boards' distances depend on it.
    output
        The calibration file; it keeps the corners and how good the calibration is.
    report
        Also write what `fishlight report` shows: a page, report.html, or a folder for it and its
        diagrams in PNG.
    force
        Replace the output and the report if they exist.
    """
    # Here, so that no other command waits for scipy.
    from calibration.board import parse_board
    from calibration.detection_files import detect_views
    from calibration.files import write_calibration
    from calibration.lens.fit import fit_lens
    from calibration.lens.record import record_of, summary
    from calibration.observations import Rejected, View
    from calibration.report.coverage import advice
    from calibration.report.evidence import evidence_of
    from calibration.report.write import refuse_report, write_report

    check_place(output, force=force)
    if report is not None:
        refuse_report(report, force=force)
    wanted = parse_board(board, square_mm * 1e-3)
    found = detect_views(images, wanted)
    views = [each for each in found if isinstance(each, View)]
    fit = fit_lens(wanted, views, [each for each in found if isinstance(each, Rejected)])
    record = record_of(fit)
    write_calibration(output, fit.calibration, lens_fit=record, force=force)
    evidence = evidence_of(record, fit.calibration)
    for line in summary(record, fit.calibration):
        print(printable(line))
    for line in advice(evidence):
        print(f"next: {line}")
    if report is not None:
        # Views have the names of their files; of two files of one name neither is shown.
        names = [path.name for path in images]
        pictures = {path.name: path for path in images if names.count(path.name) == 1}
        for line in write_report(report, output.name, evidence, pictures, force=force):
            print(line)
    print(f"{output}: {fit.calibration.model.name} lens, {len(fit.views)} views")
