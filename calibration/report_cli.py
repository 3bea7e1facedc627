"""`fishlight report`: how good a calibration is, in the terminal or as a page."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from capture.printable import printable


def report(
    calibration: Path,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    pictures: Path | None = None,
    force: Annotated[bool, Parameter(negative=())] = False,
) -> None:
    """Tell how good a calibration is, and for a lens what to photograph to better it.

    With --output a lens also as a page: where corners lie, how far the lens is off, how sure its
    directions are, why this lens, and every view with its board redrawn.

    Parameters
    ----------
    calibration
        A calibration file that `fishlight calibrate` wrote, of a lens, a mirror ball or a
        vignetting.
    output
        A page, report.html, that needs no other file; or a folder for it and its diagrams in PNG.
    pictures
        The folder of the pictures; without it, that of the calibration file. Pictures that are not
        there are done without.
    force
        Replace the output if it exists.
    """
    # Here, so that no other command waits for scipy.
    from calibration.ball_record import ball_summary, read_ball_record
    from calibration.files import read_calibration, read_records
    from calibration.lens.record import read_lens_record, summary
    from calibration.report.coverage import advice
    from calibration.report.evidence import evidence_of
    from calibration.report.write import refuse_report, write_report
    from calibration.vignetting_record import read_vignetting_record, vignetting_summary

    if output is not None:
        refuse_report(output, force=force)
    camera = read_calibration(calibration)
    ball, vignetting = read_ball_record(calibration), read_vignetting_record(calibration)
    others = [] if ball is None else ball_summary(ball)
    others += [] if vignetting is None else vignetting_summary(vignetting, camera)
    if others and output is None and "lens_fit" not in read_records(calibration):
        for line in others:
            print(printable(line))
        return
    record = read_lens_record(calibration)
    evidence = evidence_of(record, camera)
    for line in [*summary(record, camera), *others]:
        print(printable(line))
    for line in advice(evidence):
        print(f"next: {line}")
    if output is None:
        return
    folder = calibration.parent if pictures is None else pictures
    names = [view.name for view in record.views] + [each.name for each in record.rejected]
    # A name is that of a file in the folder, whatever path a calibration file may hold.
    paths = {name: folder / Path(name).name for name in names}
    for written in write_report(output, calibration.name, evidence, paths, force=force):
        print(written)
