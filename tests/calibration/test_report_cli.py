"""`fishlight report` on calibration files that were never near a camera."""

from pathlib import Path

import cv2
import pytest

from calibration.files import write_calibration
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
    cv2.imwrite(str(calibration_file.parent / "outside.png"), cv2.UMat(240, 320, cv2.CV_8U).get())
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
