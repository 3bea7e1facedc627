"""The gallery: scene × estimator at equal time, and what the literature says, as one page of HTML.

Input  : pictures of estimators, claims with findings, charts.
Output : HTML that needs nothing beside it, follows the reader's choice of light or dark, and has
         every picture inside it.
Cost   : 20 kB for each picture.
"""

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files

import cv2
import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from calibration.report.elements import document, row, section, table
from render.claims.contract import CONFIRMED, found, verdict
from render.claims.occlusion import CONES_DEG, DISTANCES_M, occlusion_grid
from render.claims.registry import Checked
from render.comparison.equal_time import Shown, truest
from render.output.view import auto_exposure_ev, to_display

FULL_ERROR = 0.3
"""Error of a pixel, over the mean of the true picture, that is the brightest colour."""

_CAPTION = (
    "Truest first. Errors are relative, away from outlines; what a picture says of itself is of "
    f"all pixels. Colours show where it errs, the brightest by {100 * FULL_ERROR:g} % of the mean."
)
_QUALITY = 88

Bytes = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Section:
    """All pictures of one scene under one map.

    Attributes
    ----------
    truth : (H, W, 3) float32
    """

    scene: str
    map_name: str
    truth: NDArray[np.float32]
    shown: Sequence[Shown]


def gallery(
    sections: Sequence[Section],
    checked: Sequence[Checked],
    charts: Mapping[str, str],
    strips: Mapping[str, Bytes],
    about: str,
) -> str:
    """Return the page.

    Parameters
    ----------
    sections : sequence of Section
        Those of a map together.
    checked : sequence of Checked
    charts : mapping of str to str
        The chart as SVG, "light" and "dark".
    strips : mapping of str to (H, W, 3) uint8
        Spheres under each light, by its name.
    about : str
        What was measured, one line.
    """
    own = files("render.comparison").joinpath("gallery.css").read_text(encoding="utf-8")
    maps = list(dict.fromkeys(each.map_name for each in sections))
    parts = [
        "<header><h1>Direct light by every estimator</h1>\n"
        f'<p class="muted">{escape(about)}</p></header>\n',
        _chart(charts),
        _truest(sections),
        *(_map(name, [each for each in sections if each.map_name == name]) for name in maps),
        _claims(checked),
        _strips(strips),
        _occlusion(),
    ]
    return document("Estimators of direct light", parts, own)


def error_picture(picture: NDArray[np.float32], truth: NDArray[np.float32]) -> Bytes:
    """Return the error of each pixel over the truth's mean in colours, black for none."""
    off = np.abs(picture[..., :3] - truth).mean(axis=-1) / truth.mean()
    colours = mpl.colormaps["inferno"](np.clip(off / FULL_ERROR, 0, 1))
    return np.rint(255 * colours[..., :3]).astype(np.uint8)


def _chart(charts: Mapping[str, str]) -> str:
    light, dark = (_data("image/svg+xml", charts[theme].encode()) for theme in ("light", "dark"))
    drawn = (
        f'<picture><source srcset="{dark}" media="(prefers-color-scheme: dark)">'
        f'<img src="{light}" alt="Error against time of each estimator"></picture>'
    )
    return section("chart", "Error against time", drawn)


def _truest(sections: Sequence[Section]) -> str:
    """Return which estimator wins where; biased ones win early and never get better."""
    rows = []
    for each in sections:
        best, first = truest(each.shown), min(each.shown, key=lambda shown: shown.rmse)
        told = [f"{shown.estimator}, {100 * shown.rmse:.2g} %" for shown in (best, first)]
        rows.append(row([each.map_name, each.scene, *told]))
    heads = ["Map", "Scene", "Truest that converges", "Truest of all"]
    return section("equal-time", "At equal time", table("", heads, rows))


def _map(name: str, sections: Sequence[Section]) -> str:
    """Return all estimators under one map: a row for each, a column for each scene."""
    headings = "".join(f'<th scope="col" colspan="2">{escape(e.scene)}</th>' for e in sections)
    exposures = [auto_exposure_ev(_opaque(each.truth)) for each in sections]
    truths = "".join(
        f'<td colspan="2">{_image(to_display(each.truth, ev), f"{each.scene}, the truth")}</td>'
        for each, ev in zip(sections, exposures, strict=True)
    )
    rows = [f'<tr><th scope="row">truth</th>{truths}</tr>\n']
    by_name = {
        shown.estimator: [
            next(s for s in each.shown if s.estimator == shown.estimator) for each in sections
        ]
        for shown in sections[0].shown
    }
    in_order = sorted(by_name.items(), key=lambda item: math.prod(shown.rmse for shown in item[1]))
    for estimator, of_scenes in in_order:
        cells = "".join(
            _cell(each, shown, ev)
            for each, shown, ev in zip(sections, of_scenes, exposures, strict=True)
        )
        rows.append(f'<tr><th scope="row">{escape(estimator)}</th>{cells}</tr>\n')
    body = (
        f'<p class="muted">{_CAPTION}</p>'
        '<div class="wide"><table class="gallery"><thead><tr><td></td>'
        f"{headings}</tr></thead><tbody>\n{''.join(rows)}</tbody></table></div>"
    )
    return section(f"map-{_slug(name)}", f"Under the map “{escape(name)}”", body)


def _cell(each: Section, shown: Shown, exposure_ev: float) -> str:
    what = f"{each.scene} by {shown.estimator}"
    return (
        f"<td>{_image(to_display(shown.radiance, exposure_ev), what)}"
        f"<small>error {_percent(shown.rmse)}, says {_percent(shown.told)}</small></td>"
        f"<td>{_image(error_picture(shown.radiance, each.truth), f'error of {what}')}"
        f"<small>{shown.rays / 1e6:.2g} M rays, {shown.passes} passes</small></td>"
    )


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 1 else f"{100 * share:.2g} %"


def _claims(checked: Sequence[Checked]) -> str:
    overview = [
        row([claim.name, claim.says, claim.source, found(claim, findings), verdict(findings)], kind)
        for claim, findings in checked
        for kind in ["held" if verdict(findings) == CONFIRMED else ""]
    ]
    parts = [table("", ["Claim", "In words", "Source", "What decides", "Found here"], overview)]
    for claim, findings in checked:
        figures = list(dict.fromkeys(name for finding in findings for name in finding.figures))
        rows = [
            row(
                [
                    finding.setting,
                    *(
                        f"{finding.figures[name]:.3g}" if name in finding.figures else ""
                        for name in figures
                    ),
                    {True: "yes", False: "no", None: ""}[finding.holds],
                ]
            )
            for finding in findings
        ]
        told = table(escape(claim.test), ["Setting", *map(escape, figures), "Holds"], rows)
        parts.append(
            f"<details><summary><strong>{escape(claim.name)}</strong>: "
            f"{verdict(findings)}</summary>{told}</details>\n"
        )
    return section("claims", "What the literature says, measured again", "".join(parts))


def _strips(strips: Mapping[str, Bytes]) -> str:
    drawn = "".join(
        f"<figure>{_image(picture, f'spheres under {name}')}"
        f"<figcaption>{escape(name)}</figcaption></figure>\n"
        for name, picture in strips.items()
    )
    heading = "The same spheres under a point light and under maps"
    return section("spheres", heading, f'<div class="strips">{drawn}</div>')


def _occlusion() -> str:
    grid = occlusion_grid()
    reaches = [f"up to {each:g} m" if np.isfinite(each) else "any distance" for each in DISTANCES_M]
    head = "".join(f'<th scope="col">{reach}</th>' for reach in reaches)
    rows = "".join(
        f'<tr><th scope="row">{cone:g}°</th>'
        + "".join(
            f"<td>{_image(_openness(grid[cone, distance]), f'cone {cone:g}°, {reach}')}</td>"
            for distance, reach in zip(DISTANCES_M, reaches, strict=True)
        )
        + "</tr>\n"
        for cone in CONES_DEG
    )
    body = (
        f'<div class="wide"><table class="gallery"><thead><tr><td></td>{head}</tr></thead>'
        f"<tbody>\n{rows}</tbody></table></div>"
    )
    return section("occlusion", "Ambient occlusion over cone and distance", body)


def _openness(seen: NDArray[np.float32]) -> Bytes:
    grey = seen[..., 0] * seen[..., 1] + (1 - seen[..., 1])
    return np.repeat(np.rint(255 * grey ** (1 / 2.2)).astype(np.uint8)[..., None], 3, axis=-1)


def _image(picture: Bytes, description: str) -> str:
    height, width = picture.shape[:2]
    coded = cv2.imencode(
        ".webp", np.ascontiguousarray(picture[..., ::-1]), [cv2.IMWRITE_WEBP_QUALITY, _QUALITY]
    )[1]
    source = _data("image/webp", coded.tobytes())
    return (
        f'<img src="{source}" width="{width}" height="{height}" loading="lazy" '
        f'alt="{escape(description)}">'
    )


def _data(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def _opaque(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.concatenate([radiance, np.ones_like(radiance[..., :1])], axis=-1)


def _slug(name: str) -> str:
    return "".join(letter if letter.isalnum() else "-" for letter in name.lower())
