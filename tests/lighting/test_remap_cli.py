"""`fishlight remap`: files in, a map and one line out."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.camera import UP, Calibration
from calibration.files import write_calibration
from calibration.models.equidistant import Equidistant
from capture.errors import InputError
from capture.exr import write_exr
from capture.radiance import RadianceImage
from capture.radiance_files import write_radiance
from lighting.blocks.fill import Fill
from lighting.maps.environment_files import read_environment
from lighting.remap_cli import remap

CAMERA = Calibration(Equidistant((31.5, 31.5), 64 / np.pi), (64, 64), np.pi / 2, UP)


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path, Path]:
    """A picture with one clipped pixel, its calibration, and the map to be made."""
    write_calibration(tmp_path / "cal.json", CAMERA)
    clipped = np.zeros((64, 64), bool)
    clipped[30, 30] = True
    radiance = np.where(clipped[..., None], 900.0, 2.0) * np.ones(3)
    image = RadianceImage(radiance, np.zeros_like(radiance), np.ones((64, 64), bool), clipped)
    write_radiance(tmp_path / "radiance.exr", image)
    return tmp_path / "radiance.exr", tmp_path / "cal.json", tmp_path / "map.exr"


def test_a_map_is_made_and_told_of(
    files: tuple[Path, Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    radiance, calibration, output = files
    remap(radiance, calibration=calibration, output=output, height=32, fill="mean")
    environment, _ = read_environment(output)
    assert environment.height == 32
    assert environment.clipped.any()
    assert environment.seen_share == pytest.approx(0.5, abs=0.03)
    assert environment.radiance[~environment.valid].min() > 2
    told = capsys.readouterr().out
    assert "64×32" in told
    assert "50.0% of all directions seen" in told
    assert f"{environment.clipped.sum()} cells are clipped" in told


def test_what_was_cleaned_is_told(
    files: tuple[Path, Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    _, calibration, output = files
    plane = np.ones((64, 64), np.float32)
    bad = plane.copy()
    bad[32, 32], bad[33, 33] = np.nan, -1
    picture = output.with_name("foreign.exr")
    write_exr(picture, {"R": bad, "G": plane, "B": plane}, {})
    remap(picture, calibration=calibration, output=output, height=16)
    assert "1 NaN, 1 negative" in capsys.readouterr().out
    output.unlink()
    with pytest.raises(InputError, match=r"foreign.exr holds 1 NaN, 1 negative values"):
        remap(picture, calibration=calibration, output=output, height=16, strict=True)
    assert not output.exists()
    write_exr(picture, {"R": plane, "G": plane, "B": plane}, {}, force=True)
    remap(picture, calibration=calibration, output=output, height=16, strict=True)


@pytest.mark.parametrize("height", [1, 0, -5, 5000])
def test_a_height_out_of_range_is_refused(files: tuple[Path, Path, Path], height: int) -> None:
    radiance, calibration, output = files
    with pytest.raises(InputError, match="--height must be 2 to 2048"):
        remap(radiance, calibration=calibration, output=output, height=height)
    assert not output.exists()


def test_a_picture_of_another_size_names_the_file(files: tuple[Path, Path, Path]) -> None:
    _, calibration, output = files
    plane = np.ones((48, 64), np.float32)
    picture = output.with_name("other.exr")
    write_exr(picture, dict.fromkeys("RGB", plane), {})
    with pytest.raises(InputError, match=r"other\.exr is 64×48 px"):
        remap(picture, calibration=calibration, output=output)


@pytest.mark.parametrize("fill", ["black", "mean"])
def test_a_picture_without_a_valid_pixel_leaves_no_map(
    files: tuple[Path, Path, Path], fill: Fill
) -> None:
    _, calibration, output = files
    picture = output.with_name("blind.exr")
    write_exr(picture, dict.fromkeys("RGB", np.full((64, 64), np.nan, np.float32)), {})
    with pytest.raises(InputError, match=r"blind\.exr.*no cell.*cal\.json"):
        remap(picture, calibration=calibration, output=output, height=16, fill=fill)
    assert not output.exists()


def test_an_existing_map_needs_force(files: tuple[Path, Path, Path]) -> None:
    radiance, calibration, output = files
    output.write_text("mine")
    with pytest.raises(InputError, match="--force"):
        remap(radiance, calibration=calibration, output=output, height=16)
    assert output.read_text() == "mine"
    remap(radiance, calibration=calibration, output=output, height=16, force=True)
    assert read_environment(output)[0].height == 16


def test_tells_what_was_done_to_the_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_calibration(tmp_path / "cal.json", CAMERA)
    grey = np.ones((64, 64), np.float32)
    grey[16, 16] = -1
    write_exr(tmp_path / "r.exr", {"Y": grey}, {})
    output = tmp_path / "map.exr"
    remap(tmp_path / "r.exr", calibration=tmp_path / "cal.json", output=output, height=16)
    printed = capsys.readouterr().out
    assert "  luminance repeated to grey\n  set to 0 in the file: 3 negative values\n" in printed


def test_how_well_vignetting_is_known_is_told(
    files: tuple[Path, Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    radiance, calibration, output = files
    fit = {
        **{"source": "flat", "pictures": [], "sample_count": 9, "seen_rad": [0, 1.5]},
        **{"held_out": 0.01, "trials": [], "angle_rad": [0, 0.5, 1.5], "sigma": [0, 0.04, 0.01]},
    }
    dark = replace(CAMERA, vignetting=(-0.4,))
    write_calibration(calibration, dark, vignetting_fit=fit)
    remap(radiance, calibration=calibration, output=output, height=8)
    # At 0.5 V is 0.9, and 0.04 of it 4.4 %; at 1.5 it is 0.1, and 0.01 of it 10 %.
    assert "taken out to ±10.00% at 86°" in capsys.readouterr().out
    write_calibration(calibration, dark, vignetting_fit={**fit, "sigma": "none"})
    with pytest.raises(InputError, match=r"cal\.json: vignetting_fit: Expected"):
        remap(radiance, calibration=calibration, output=output, height=8, force=True)
