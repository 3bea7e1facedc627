"""`fishlight calibrate lens` on pictures of a real fisheye."""

from pathlib import Path

import pytest

from calibration.files import read_calibration
from calibration.lens.record import read_lens_record
from calibration.lens_cli import calibrate_lens
from capture.errors import InputError

DATA = Path(__file__).resolve().parents[2].parent / "shared/data/calib-urban-fisheye"


@pytest.mark.slow
@pytest.mark.data
@pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data is not here")
def test_a_real_fisheye_is_calibrated_to_a_tenth_of_a_pixel(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "cal.json"
    pictures = [DATA / f"Fisheye2_{number}.jpg" for number in range(1, 9)]
    calibrate_lens(pictures, board="8x6", square_mm=117.0, output=out)
    record, calibration = read_lens_record(out), read_calibration(out)
    assert len(record.views) == 8
    assert record.rms_px < 0.12
    assert calibration.image_size_px == (748, 480)
    assert calibration.valid_angle_rad > 1.1
    said = capsys.readouterr().out
    assert "8 of 8 pictures used" in said
    assert "8 views are few" in said
    assert said.rstrip().endswith("8 views")


def test_an_output_that_exists_is_refused_before_any_work(tmp_path: Path) -> None:
    out = tmp_path / "cal.json"
    out.write_text("mine")
    with pytest.raises(InputError, match="--force"):
        calibrate_lens([tmp_path / "none.jpg"], board="9x6", square_mm=30.0, output=out)
    assert out.read_text() == "mine"
