"""The parts of the report's page that show pictures: straightened, used, and not used.

Fails  : a picture that is not there, cannot be read or has another size is done without.
"""

from collections.abc import Mapping
from html import escape
from pathlib import Path

import numpy as np

from calibration.report.elements import row, section, table
from calibration.report.evidence import Evidence
from calibration.report.view_drawings import (
    preview_uris,
    read_of_size,
    thumbnail_uri,
    view_svg,
)
from capture.progress import progress


def _key(kind: str, shape: str) -> str:
    return (
        '<svg class="key" viewBox="0 0 16 16" aria-hidden="true">'
        f'<g class="{kind}">{shape}</g></svg>'
    )


_FOUND = _key("found", '<circle cx="8" cy="8" r="4.5"/>')
_PROJECTED = _key("projected", '<path d="M3 8h10M8 3v10"/>')
_WRONG = _key("wrong", '<circle cx="8" cy="8" r="6"/>')
_KEY = (
    f"<p>{_FOUND} corners as found, {_PROJECTED} as the lens projects them, {_WRONG} left out as "
    "wrong. The worst picture is first.</p>"
)


def preview(evidence: Evidence, pictures: Mapping[str, Path]) -> str:
    """Return the first view whose picture is there, without the lens's bending."""
    size_px = evidence.calibration.image_size_px
    grey = None
    for view in evidence.record.views:
        path = pictures.get(view.name)
        grey = None if path is None else read_of_size(path, size_px)
        if grey is not None:
            break
    if grey is None:
        text = "<p>None of the pictures was found: give --pictures the folder that they are in.</p>"
        return section("preview", "Without the lens's bending", text)
    uris = preview_uris(grey, evidence.calibration)
    shown = "".join(
        f'<figure><img src="{uri}" alt="{escape(view.name)} as a lens without distortion shows it, '
        f'{name}"><figcaption>{name}</figcaption></figure>\n'
        for name, uri in uris.items()
    )
    return section(
        "preview",
        "Without the lens's bending",
        f"<p>{escape(view.name)} as a lens without distortion would show it: edges that are "
        "straight in the world must look straight. Even grey: not seen, or beyond the valid "
        f'angle.</p><div class="previews">\n{shown}</div>',
    )


def views(evidence: Evidence, pictures: Mapping[str, Path]) -> str:
    """Return every view with its board redrawn, the worst first."""
    record = evidence.record
    rms = [evidence.rms_px(view) for view in range(len(record.views))]
    worst_first = sorted(range(len(rms)), key=lambda view: -np.nan_to_num(rms[view], nan=np.inf))
    cards = []
    for view in progress(worst_first, "drawing the views"):
        path = pictures.get(record.views[view].name)
        grey = None if path is None else read_of_size(path, evidence.calibration.image_size_px)
        cards.append(
            f"<figure>{view_svg(evidence, view, grey)}<figcaption><strong>"
            f"{escape(record.views[view].name)}</strong>{_view_numbers(evidence, view)}"
            "</figcaption></figure>\n"
        )
    return section("views", "Views", f'{_KEY}<div class="views">\n{"".join(cards)}</div>')


def _view_numbers(evidence: Evidence, view: int) -> str:
    part = evidence.corners.of_view(view)
    wrong = int(np.sum(~evidence.kept[part]))
    angles = np.rad2deg(evidence.angle_rad[part])
    distance_m = float(np.linalg.norm(evidence.record.views[view].t_camera_board_m))
    return (
        f"{evidence.rms_px(view):.3f} px rms · {len(angles)} corners"
        f"{f', {wrong} wrong' if wrong else ''} · {angles.min():.0f}° to {angles.max():.0f}° off "
        f"the axis · board tilted {np.rad2deg(evidence.tilt_rad(view)):.0f}°, {distance_m:.2f} m "
        "away"
    )


def rejected(evidence: Evidence, pictures: Mapping[str, Path]) -> str:
    """Return the pictures that were not used, and why."""
    if not evidence.record.rejected:
        return section("rejected", "Pictures not used", "<p>None: all were used.</p>")
    rows = [row([each.name, each.reason]) for each in evidence.record.rejected]
    listed = table("", ["Picture", "Why it was not used"], rows)
    found = []
    for each in evidence.record.rejected:
        path = pictures.get(each.name)
        grey = None if path is None else read_of_size(path, evidence.calibration.image_size_px)
        if grey is not None:
            found.append(
                f'<figure><img src="{thumbnail_uri(grey)}" alt="{escape(each.name)}, not used">'
                f"<figcaption>{escape(each.name)}</figcaption></figure>\n"
            )
    shown = f'<div class="views">\n{"".join(found)}</div>' if found else ""
    return section("rejected", "Pictures not used", listed + shown)
