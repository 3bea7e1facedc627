"""The report's page: whole, readable without a script or another file, and true to the record."""

import base64
import re
from functools import cache
from html.parser import HTMLParser
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

from calibration.observations import Rejected
from calibration.report.evidence import Evidence, evidence_of
from calibration.report.figures import Diagram, diagrams, exaggeration
from calibration.report.page import page
from calibration.report.theme import DARK, LIGHT
from calibration.report.view_drawings import preview_uris, read_of_size
from tests.calibration.lens_records import SIZE_PX, known_record

_HOSTILE = "<b>a&\"b'.png"

_REJECTED = (Rejected("dark<i>.png", "no board <was> found"), Rejected("far.png", "too small"))

_EMPTY = {"meta", "img", "br", "link", "input", "hr"}


class _Page(HTMLParser):
    """The elements of a page with their attributes, its text, and what was not closed rightly."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.rows: list[list[str]] = []
        self.text = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in _EMPTY:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not {"style", "svg"} & set(self.open):
            self.text += data
        if {"td", "th"} & set(self.open[-1:]):
            self.rows[-1][-1] += data

    def attributes(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for each, attributes in self.elements if each == tag]


@cache
def _evidence() -> Evidence:
    record, calibration, _ = known_record(
        [(0, 0), (40, 200), (70, 0)],
        names=[_HOSTILE, "second.png", "third.png"],
        rejected=_REJECTED,
    )
    return evidence_of(record, calibration)


@cache
def _diagrams() -> list[Diagram]:
    return diagrams(_evidence())


@cache
def _text() -> str:
    return page('<u>cal&".json', _evidence(), _diagrams(), {})


def test_every_element_is_closed_and_every_id_is_one_elements() -> None:
    parsed = _Page(_text())
    assert parsed.open == []
    ids = [attributes["id"] for _, attributes in parsed.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    inner = re.findall(r'(?:xlink:href="|href="|url\()#([\w-]+)', _text())
    labels = [a["aria-labelledby"] for _, a in parsed.elements if "aria-labelledby" in a]
    assert inner
    assert {*inner, *labels} <= set(ids)


def test_nothing_is_loaded_and_nothing_runs() -> None:
    parsed = _Page(_text())
    assert not {"script", "link", "iframe", "object"} & {tag for tag, _ in parsed.elements}
    for _, attributes in parsed.elements:
        assert not any(name.startswith("on") for name in attributes)
        for name in ("src", "href", "xlink:href"):
            assert (attributes.get(name) or "#").startswith(("#", "data:"))
    assert "@import" not in _text()
    assert not re.search(r"url\((?!#)", _text())


def test_it_can_be_read_out() -> None:
    parsed = _Page(_text())
    assert parsed.attributes("html") == [{"lang": "en"}]
    assert len(parsed.attributes("h1")) == len(parsed.attributes("title")) == 1
    for image in parsed.attributes("svg"):
        assert image.get("aria-hidden") == "true" or (image["role"], bool(image["aria-label"])) == (
            "img",
            True,
        )
    assert all(heading["scope"] in ("col", "row") for heading in parsed.attributes("th"))
    viewport = [meta["content"] for meta in parsed.attributes("meta") if meta.get("name")]
    assert "width=device-width, initial-scale=1" in viewport


def test_light_and_dark_differ_in_every_colour_and_the_diagrams_take_theirs_from_the_page() -> None:
    text = _text()
    assert LIGHT.keys() == DARK.keys()
    assert "prefers-color-scheme: dark" in text
    body = text[text.index("<body>") :]
    for name in LIGHT:
        assert LIGHT[name] != DARK[name]
        assert text.count(f"--{name}: ") == 2
        assert LIGHT[name] not in body
    assert not re.search(r"(fill|stroke): #(?!484f58)", body)


def _contrast(one: str, other: str) -> float:
    """Contrast ratio of the Web Content Accessibility Guidelines 2.1."""

    def luminance(colour: str) -> float:
        channels = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
        linear = np.where(
            channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4
        )
        return float(linear @ [0.2126, 0.7152, 0.0722])

    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_text_and_lines_stand_out_from_the_page(theme: dict[str, str]) -> None:
    for name in ("ink", "muted", "green"):
        assert _contrast(theme[name], theme["page"]) > 4.5
    for name in ("blue", "red", "amber"):
        assert _contrast(theme[name], theme["page"]) > 3.0


def test_its_numbers_are_the_records() -> None:
    record, calibration = _evidence().record, _evidence().calibration
    parsed = _Page(_text())
    assert f"{record.trials[0].held_out_px:.3f} px" in parsed.text
    assert f"{record.rms_px:.3f} px where fitted" in parsed.text
    assert f"{np.rad2deg(calibration.valid_angle_rad):.1f}°" in parsed.text
    assert "3 of 5" in parsed.text
    assert "60 corners, 1 left out as wrong" in parsed.text
    assert f"exaggerated {exaggeration(_evidence())}×" in parsed.text
    # sigma = 1e-3 θ and split = 2e-3 θ: in mrad, θ itself and twice it.
    rows = {row[0]: row[1:] for row in parsed.rows}
    assert rows["30.0°"] == ["0.52", "1.05"]
    assert rows["60.0°"] == ["1.05", "2.09"]
    assert "differ by 2.0 times as much" in parsed.text


def test_where_a_curve_has_no_value_the_page_has_a_dash() -> None:
    record, calibration, _ = known_record([(0, 0), (40, 200), (70, 0)])
    nowhere = msgspec.structs.replace(record, split_rad=[None] * len(record.angle_rad))
    evidence = evidence_of(nowhere, calibration)
    parsed = _Page(page("cal", evidence, diagrams(evidence), {}))
    assert ["30.0°", "0.52", "–"] in parsed.rows
    assert "nan" not in parsed.text.lower()


def test_the_table_of_lenses_tells_which_was_chosen_and_why() -> None:
    parsed = _Page(_text())
    rows = {row[0]: row[1:] for row in parsed.rows if row}
    assert rows["equidistant"] == ["chosen", "3", "0.151", "0.0012\u00a0±\u00a00.0034"]
    assert rows["equisolid"][0] == "worse"
    assert rows["kannala_brandt"][0] == "as good"
    assert "equidistant is the simplest lens" in parsed.text
    assert "no worse than kannala_brandt does" in parsed.text


def test_names_are_shown_as_they_are_and_mean_nothing_in_html() -> None:
    parsed = _Page(_text())
    assert _HOSTILE in parsed.text
    assert parsed.text.count('<u>cal&".json') == 2  # the window's title and the page's
    assert any(row == ["dark<i>.png", "no board <was> found"] for row in parsed.rows)
    assert any(row == ["far.png", "too small"] for row in parsed.rows)
    assert not {"b", "i", "u", "was"} & {tag for tag, _ in parsed.elements}
    labels = [image.get("aria-label") or "" for image in parsed.attributes("svg")]
    assert any(label.startswith(_HOSTILE) for label in labels)


def test_without_its_pictures_every_view_is_drawn_on_an_even_ground() -> None:
    parsed = _Page(_text())
    assert len([a for a in parsed.attributes("svg") if a.get("class") == "view"]) == 3
    assert parsed.attributes("image") == parsed.attributes("img") == []
    assert "None of the pictures was found" in parsed.text


def test_the_worst_view_is_first() -> None:
    evidence = _evidence()
    names = [view.name for view in evidence.record.views]
    places = [_Page(_text()).text.rindex(name) for name in names]
    worst_first = np.argsort([-evidence.rms_px(view) for view in range(3)])
    assert list(np.argsort(places)) == list(worst_first)


def test_a_views_drawing_has_a_circle_for_each_corner_and_a_cross_for_each_projection() -> None:
    found = re.findall(r'<path class="(\w+)" d="([^"]*)"', _text())
    by_kind = {kind: [path for each, path in found if each == kind] for kind, _ in found}
    assert sorted(path.count("M") for path in by_kind["found"]) == [19, 20, 20]
    assert sorted(path.count("M") for path in by_kind["wrong"]) == [0, 0, 1]
    assert [path.count("M") for path in by_kind["projected"]] == [40] * 3  # two strokes each
    assert [path.count("M") for path in by_kind["board"]] == [4 + 5] * 3  # rows and columns
    second = _evidence().record.views[1]
    x, y = second.corners_px[7]
    radius = SIZE_PX[0] / 110
    assert any(f"M{x - radius:.2f} {y:.2f}a" in path for path in by_kind["found"])


def _picture(path: Path, size_px: tuple[int, int]) -> Path:
    cv2.imwrite(str(path), np.full((size_px[1], size_px[0], 3), 90, np.uint8))
    return path


def test_pictures_that_are_there_are_shown(tmp_path: Path) -> None:
    small = _picture(tmp_path / "small.png", (32, 24))
    torn = tmp_path / "torn.png"
    torn.write_bytes(b"\x89PNG\r\n")
    pictures = {
        _HOSTILE: torn,
        "second.png": small,
        "third.png": _picture(tmp_path / "third.png", SIZE_PX),
        "far.png": _picture(tmp_path / "far.png", SIZE_PX),
    }
    parsed = _Page(page("cal", _evidence(), [], pictures))
    assert len(parsed.attributes("image")) == 1
    alts = [image["alt"] or "" for image in parsed.attributes("img")]
    assert "far.png, not used" in alts
    assert "third.png as a lens without distortion shows it, ahead" in alts
    assert read_of_size(small, SIZE_PX) is None
    assert read_of_size(torn, SIZE_PX) is None


def test_a_straight_view_shows_planes_as_a_pinhole_would() -> None:
    # Grey by how steep the ray is: constant along what are straight rows of the view ahead.
    calibration = _evidence().calibration
    y, x = np.mgrid[0 : SIZE_PX[1], 0 : SIZE_PX[0]]
    rays, _ = calibration.model.unproject(np.stack([x, y], axis=-1).astype(np.float64))
    slope = rays[..., 1] / np.maximum(rays[..., 2], 0.2)
    grey = np.clip(128 + 100 * slope, 0, 255).astype(np.uint8)
    uris = preview_uris(grey, calibration)
    assert list(uris) == ["to the left", "ahead", "to the right"]

    data = np.frombuffer(base64.b64decode(uris["ahead"].split(",")[1]), np.uint8)
    ahead = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE).astype(np.float64)
    expected = 128 + 100 * np.tan(np.deg2rad(40)) * np.linspace(-1, 1, len(ahead))
    assert np.abs(ahead - expected[:, None]).max() < 4  # of 168 between top and bottom


def test_diagrams_hold_the_corners_where_they_are() -> None:
    by_name = {diagram.name: diagram.figure.axes[0] for diagram in _diagrams()}
    evidence = _evidence()
    kept = evidence.corners.pixels[evidence.kept]
    drawn = [line.get_xydata() for line in by_name["coverage"].lines]
    assert any(np.array_equal(each, kept) for each in drawn)
    ends = kept + exaggeration(evidence) * evidence.residuals_px[evidence.kept]
    drawn = [line.get_xydata() for line in by_name["residuals"].lines]
    assert any(len(each) == 3 * len(kept) and np.allclose(each[1::3], ends) for each in drawn)
    sigma = next(line for line in by_name["uncertainty"].lines if line.get_label() == "uncertainty")
    known = np.isfinite(sigma.get_ydata())
    assert np.allclose(sigma.get_ydata()[known], np.deg2rad(sigma.get_xdata()[known]))
    assert not known.all()
