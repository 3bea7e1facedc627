"""`fishlight report` on calibration files that were never near a camera."""

from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from calibration.files import read_calibration, write_calibration
from calibration.lens.record import read_lens_record
from calibration.lens_cli import calibrate_lens
from calibration.observations import Rejected
from calibration.report_cli import report
from capture.errors import InputError
from tests.calibration.lens_records import known_record


@pytest.fixture
def calibration_file(tmp_path: Path) -> Path:
    rejected = [Rejected("../outside.png", "too dark")]
    record, calibration, _ = known_record(
        [(0, 0), (40, 200)], names=["a.png", "b.png"], rejected=rejected
    )
    path = tmp_path / "cal.json"
    write_calibration(path, calibration, lens_fit=record)
    return path


def test_the_short_form_is_printed(
    calibration_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report(calibration_file)
    said = capsys.readouterr().out
    assert said.startswith("2 of 3 pictures used, 40 corners, 1 of them left out")
    assert "not used: ../outside.png: too dark" in said
    assert "next: Take 8 more pictures" in said
    assert list(calibration_file.parent.iterdir()) == [calibration_file]


def test_names_in_a_file_do_not_steer_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record, calibration, _ = known_record(
        [(0, 0), (40, 200)], names=["a.png", "b.png"], rejected=[Rejected("c", "\x1b]0;dark\x07")]
    )
    path = tmp_path / "cal.json"
    ball = {
        "picture": "\x1b[2Jball.exr", "centre_px": [1, 2], "half_angle_rad": 0.1, "covariance": [],
        "residual_px": 0.1, "support": 0.5, "angle_rad": [1.0], "sigma_rad": [0.1],
    }  # fmt: skip
    for lens in (record, None):
        write_calibration(path, calibration, lens_fit=lens, ball_fit=ball)
        report(path)
        said = capsys.readouterr().out
        assert "ball.exr" in said
        assert all(letter.isprintable() or letter == "\n" for letter in said)


def test_a_page_is_written_once_and_replaced_with_force(
    calibration_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = calibration_file.with_name("report.html")
    out.write_text("mine")
    with pytest.raises(InputError, match="--force"):
        report(calibration_file, output=out)
    assert out.read_text() == "mine"
    report(calibration_file, output=out, force=True)
    assert out.read_text().startswith("<!DOCTYPE html>")
    assert capsys.readouterr().out.endswith(f"{out}: 0 of 2 views with their pictures\n")


def test_a_folder_gets_the_page_and_the_diagrams(calibration_file: Path) -> None:
    folder = calibration_file.with_name("report")
    report(calibration_file, output=folder)
    written = sorted(path.name for path in folder.iterdir())
    assert written == [
        "coverage.png",
        "report.html",
        "residual-by-angle.png",
        "residuals.png",
        "uncertainty.png",
    ]
    width = cv2.imread(str(folder / "uncertainty.png")).shape[1]
    assert width >= 1000
    with pytest.raises(InputError, match="--force"):
        report(calibration_file, output=folder)


def test_a_picture_outside_of_the_folder_is_not_read(calibration_file: Path) -> None:
    inside = calibration_file.parent / "pictures"
    inside.mkdir()
    cv2.imwrite(str(calibration_file.parent / "outside.png"), np.zeros((240, 320), np.uint8))
    out = calibration_file.with_name("report.html")
    report(calibration_file, output=out, pictures=inside)
    assert "<img" not in out.read_text()


def test_a_file_in_the_folders_place_is_refused(calibration_file: Path) -> None:
    with pytest.raises(InputError, match=r"not a folder; name a folder or a page, report\.html"):
        report(calibration_file, output=calibration_file, force=True)


def test_a_calibration_without_views_is_refused_in_a_line(calibration_file: Path) -> None:
    _, calibration, _ = known_record([(0, 0)])
    write_calibration(calibration_file, calibration)
    with pytest.raises(InputError, match=r"cal\.json keeps no views"):
        report(calibration_file)


def test_an_altered_record_is_refused_with_its_file(calibration_file: Path) -> None:
    text = calibration_file.read_text()
    calibration_file.write_text(text.replace('"chosen":"equidistant"', '"chosen":"ocam"'))
    with pytest.raises(InputError, match=r"cal\.json: lens_fit: 'ocam' is chosen"):
        report(calibration_file)


def test_calibrating_writes_the_report_from_the_pictures_it_was_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ["a.png", "b.png", "c.png"]
    record, calibration, _ = known_record([(0, 0), (40, 200), (50, 90)], names=names)
    monkeypatch.setattr("calibration.detection_files.detect_views", lambda *_: [])
    monkeypatch.setattr(
        "calibration.lens.fit.fit_lens",
        lambda *_: SimpleNamespace(calibration=calibration, views=()),
    )
    monkeypatch.setattr("calibration.lens.record.record_of", lambda _: record)
    (tmp_path / "other").mkdir()
    # Two files are named b.png: which of them the view is of, nothing tells.
    pictures = [tmp_path / name for name in ("a.png", "b.png", "other/b.png", "c.png")]
    for picture in pictures:
        cv2.imwrite(str(picture), np.zeros((240, 320), np.uint8))
    out, page = tmp_path / "cal.json", tmp_path / "report.html"
    calibrate_lens(pictures, board="5x4", square_mm=50.0, output=out, report=page)
    assert read_calibration(out).model == calibration.model
    assert [view.name for view in read_lens_record(out).views] == names
    assert page.read_text().count("<image ") == 2


def test_a_report_that_exists_is_refused_before_any_work(tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    page.write_text("mine")
    with pytest.raises(InputError, match=r"report\.html exists; give --force"):
        calibrate_lens(
            [tmp_path / "none.jpg"],
            board="9x6",
            square_mm=30.0,
            output=tmp_path / "cal.json",
            report=page,
        )
    assert page.read_text() == "mine"
