"""The report as one page of HTML that needs nothing beside it: no script, no other file.

Input  : Evidence, its diagrams, and the pictures of the views that are still there.
Output : HTML that follows the reader's choice of light or dark, and prints in light.
Cost   : 0.1 s a picture of one megapixel; some 50 kB a view.
"""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import numpy as np

from calibration.lens.record import TrialRecord
from calibration.report.coverage import advice
from calibration.report.elements import document, row, section, table
from calibration.report.evidence import Evidence
from calibration.report.figures import Diagram, mrad
from calibration.report.theme import inline_svg
from calibration.report.view_sections import preview, rejected, views


def page(
    title: str,
    evidence: Evidence,
    diagrams: Sequence[Diagram],
    pictures: Mapping[str, Path],
) -> str:
    """Return the report in HTML.

    Parameters
    ----------
    title : str
        Of the page: which calibration it is of.
    evidence : Evidence
    diagrams : sequence of Diagram
        Of the evidence.
    pictures : mapping of str to Path
        The pictures by the names of their views. Those that are not there, cannot be read or have
        another size are done without.
    """
    parts = [
        _heading(title, evidence),
        _next(evidence),
        _diagrams(diagrams),
        _sureness(evidence),
        _models(evidence),
        preview(evidence, pictures),
        views(evidence, pictures),
        rejected(evidence, pictures),
    ]
    return document(f"Lens calibration {title}", parts)


def _heading(title: str, evidence: Evidence) -> str:
    record, calibration = evidence.record, evidence.calibration
    taken = _taken(evidence)
    count, rejected = len(record.views), len(record.rejected)
    wrong = int(np.sum(~evidence.kept))
    inner, outer = record.seen_rad
    sigma, at_rim = (
        _mrad_at(angle, record.angle_rad, record.sigma_rad)
        for angle in ((inner + outer) / 2, calibration.valid_angle_rad)
    )
    width, height = calibration.image_size_px
    tiles = [
        ("Lens", escape(taken.model), f"{taken.parameter_count} numbers fitted"),
        (
            "Error where not fitted",
            f"{taken.held_out_px:.3f} px",
            f"{record.rms_px:.3f} px where fitted",
        ),
        (
            f"Uncertain at {np.rad2deg(inner + outer) / 2:.0f}° by",
            f"{sigma} mrad",
            f"{at_rim} mrad at the valid angle",
        ),
        (
            "Valid to",
            f"{np.rad2deg(calibration.valid_angle_rad):.1f}°",
            f"off the axis; corners to {np.rad2deg(outer):.1f}°",
        ),
        (
            "Pictures used",
            f"{count} of {count + rejected}",
            f"{len(evidence.kept)} corners, {wrong} left out as wrong",
        ),
    ]
    listed = "".join(
        f"<div><dt>{name}</dt><dd>{value}<small>{remark}</small></dd></div>\n"
        for name, value, remark in tiles
    )
    return (
        f'<header><h1>Lens calibration</h1>\n<p class="muted">{escape(title)} · '
        f"{width}×{height} px</p></header>\n"
        f'<dl class="tiles">\n{listed}</dl>\n'
    )


def _next(evidence: Evidence) -> str:
    sentences = advice(evidence)
    if not sentences:
        return section(
            "next", "What to photograph next", "<p>Nothing: corners lie all over the picture.</p>"
        )
    items = "".join(f"<li>{escape(sentence)}</li>\n" for sentence in sentences)
    return section("next", "What to photograph next", f"<ul>\n{items}</ul>")


def _diagrams(diagrams: Sequence[Diagram]) -> str:
    drawn = "".join(
        f'<figure id="{each.name}">'
        f"{inline_svg(each.figure, each.name, f'{each.title}. {each.caption}')}"
        f"<figcaption><strong>{each.title}</strong>{each.caption}</figcaption></figure>\n"
        for each in diagrams
    )
    return section(
        "diagrams", "Coverage, residuals, uncertainty", f'<div class="figures">\n{drawn}</div>'
    )


def _sureness(evidence: Evidence) -> str:
    record = evidence.record
    inner, outer = record.seen_rad
    steps = [angle for angle in np.deg2rad(np.arange(15, 180, 15)) if inner < angle < outer]
    rows = []
    for angle in [*steps, outer]:
        values = [
            _mrad_at(angle, record.angle_rad, each) for each in (record.sigma_rad, record.split_rad)
        ]
        rows.append(row([f"{np.rad2deg(angle):.1f}°", *values]))
    listed = table(
        "Of directions, in mrad, by the angle from the axis, as far as corners were seen.",
        ["Angle", "Uncertainty", "Odd less even views"],
        rows,
    )
    ratio = mrad(record.split_rad) / mrad(record.sigma_rad)
    angle = np.array(record.angle_rad)
    ratio = ratio[np.isfinite(ratio) & (angle >= inner) & (angle <= outer)]
    told = (
        f"{np.median(ratio):.1f} times as much in the median" if len(ratio) else "unknown amounts"
    )
    return section(
        "sureness",
        "How sure directions are",
        "<p>The uncertainty holds the noise of the corners and what the choice of the lens leaves "
        "open. Lenses fitted to the odd and to the even views alone differ by "
        f"{told}. Up to three is expected, as each has half of "
        "the views, both err, and in two directions; much more tells of views that contradict "
        f"each other, or of too few.</p>{listed}",
    )


def _mrad_at(angle_rad: float, angles_rad: list[float], values_rad: list[float | None]) -> str:
    """Return a value in mrad at an angle, in figures; a dash where there is none."""
    value = np.interp(angle_rad, angles_rad, mrad(values_rad))
    return f"{value:.2f}" if np.isfinite(value) else "–"


def _models(evidence: Evidence) -> str:
    record, taken = evidence.record, _taken(evidence)
    best = min(record.trials, key=lambda trial: trial.held_out_px)
    rows = [
        row(
            [
                trial.model,
                _verdict(trial, taken),
                f"{trial.parameter_count}",
                f"{trial.held_out_px:.3f}",
                f"{trial.excess_px:.4f}\u00a0±\u00a0{trial.excess_error_px:.4f}",
            ],
            "chosen" if trial is taken else "",
        )
        for trial in record.trials
    ]
    listed = table(
        "Errors in px at corners of pictures that the lens was not fitted to. More than the best: "
        "in the mean over the pictures, with its standard error.",
        ["Lens", "Verdict", "Numbers", "Error, rms", "More than the best"],
        rows,
    )
    why = (
        f"{taken.model} predicts left-out pictures best; every simpler lens is worse by more "
        "than the standard error"
        if taken is best
        else f"{taken.model} is the simplest lens that predicts left-out pictures no worse than "
        f"{best.model} does, as far as these pictures tell"
    )
    return section("lenses", "Why this lens", f"<p>{escape(why)}.</p>{listed}")


def _verdict(trial: TrialRecord, taken: TrialRecord) -> str:
    if trial is taken:
        return "chosen"
    if trial.excess_px <= trial.excess_error_px:
        return "as good"
    return "worse"


def _taken(evidence: Evidence) -> TrialRecord:
    record = evidence.record
    return next(trial for trial in record.trials if trial.model == record.chosen)
