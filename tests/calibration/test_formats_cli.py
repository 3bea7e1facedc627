"""`fishlight calibrate import` and `export`, as a shell calls them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.camera import LEVEL, UP, Calibration
from calibration.files import read_calibration, write_calibration
from calibration.models.equisolid import Equisolid
from calibration.models.kannala_brandt import KannalaBrandt
from capture.errors import InputError
from tests.capture import command_line

CAMERA = "1 OPENCV_FISHEYE 640 480 300.0 301.0 320.0 240.0 0.01 0.0 0.0 0.0\n"


def run(*tokens: Any) -> None:
    command_line.run("calibrate", *tokens)


@pytest.fixture
def cameras(tmp_path: Path) -> Path:
    path = tmp_path / "cameras.txt"
    path.write_text(CAMERA)
    return path


def test_what_is_imported_is_exported_again(
    cameras: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ours, theirs = tmp_path / "cal.json", tmp_path / "again.txt"
    run("import", cameras, "-o", ours, "--valid-angle-deg", 60)
    assert "kannala_brandt for 640×480 px from colmap, valid to 60.0°\n" in capsys.readouterr().out
    calibration = read_calibration(ours)
    assert calibration.model == KannalaBrandt((319.5, 239.5), (300.0, 301.0), 0.01)
    np.testing.assert_allclose(calibration.valid_angle_rad, np.pi / 3)
    np.testing.assert_array_equal(calibration.R_world_camera, LEVEL)
    run("export", ours, "-o", theirs, "--format", "colmap")
    assert theirs.read_text().splitlines()[-1] + "\n" == CAMERA
    assert "left out, for want of a place: valid angle (60.0°)\n" in capsys.readouterr().out
    write_calibration(ours, replace(calibration, inner_angle_rad=0.5))
    run("export", ours, "-o", theirs, "--format", "colmap", "--force")
    assert "valid angle (60.0°), inner angle (28.6°)\n" in capsys.readouterr().out


def test_a_valid_angle_that_was_guessed_is_told(
    cameras: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run("import", cameras, "-o", tmp_path / "cal.json")
    assert "as far as picture and model reach" in capsys.readouterr().out


@pytest.mark.slow
def test_an_approximation_is_made_on_demand_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ours, theirs = tmp_path / "cal.json", tmp_path / "camchain.yaml"
    lens = Equisolid((200.0, 150.0), 140.0)
    camera = Calibration(lens, (400, 300), 1.4, R_world_camera=UP, vignetting=(-0.1,))
    write_calibration(ours, camera)
    with pytest.raises(InputError, match=r"cal\.json: no model .* as equisolid .*--approximate"):
        run("export", ours, "-o", theirs, "--format", "kalibr")
    assert not theirs.exists()
    run("export", ours, "-o", theirs, "--format", "kalibr", "--approximate")
    told = capsys.readouterr().out
    assert "an approximation of equisolid: off by" in told
    assert "vignetting, R_world_camera" in told
    mrcals, back = tmp_path / "m.cameramodel", tmp_path / "back.json"
    run("export", ours, "-o", mrcals, "--format", "mrcal", "--approximate")
    assert "splined_stereographic for mrcal" in capsys.readouterr().out
    with pytest.raises(InputError, match=r"m\.cameramodel: no lens here .*--approximate"):
        run("import", mrcals, "-o", back)
    with pytest.raises(InputError, match="give --valid-angle-deg with --approximate"):
        run("import", mrcals, "-o", back, "--approximate")
    run("import", mrcals, "-o", back, "--approximate", "--valid-angle-deg", 80)
    assert "from mrcal, an approximation of splined_stereographic" in capsys.readouterr().out
    pixels = np.array([[80.0, 60.0], [200.0, 150.0], [310.0, 220.0]])
    found, _ = read_calibration(back).model.unproject(pixels)
    np.testing.assert_allclose(found, lens.unproject(pixels)[0], atol=2e-4)


def test_a_file_that_exists_is_kept(cameras: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="give --force"):
        run("import", cameras, "-o", cameras)
    run("import", cameras, "-o", tmp_path / "cal.json")
    with pytest.raises(InputError, match="give --force"):
        run("export", tmp_path / "cal.json", "-o", cameras, "--format", "colmap")
    assert cameras.read_text() == CAMERA


@pytest.mark.parametrize("angle", [0, 181])
def test_an_angle_out_of_range_is_refused(cameras: Path, tmp_path: Path, angle: float) -> None:
    with pytest.raises(InputError, match="--valid-angle-deg must be in"):
        run("import", cameras, "-o", tmp_path / "cal.json", "--valid-angle-deg", angle)
