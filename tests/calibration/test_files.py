"""Calibration files: what is read, and how a wrong one is named."""

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.camera import LEVEL, UP, Calibration, ImageCircle
from calibration.files import read_calibration, write_calibration
from calibration.models.double_sphere import DoubleSphere
from calibration.models.equidistant import Equidistant
from calibration.models.equirectangular import full_sphere
from calibration.models.equisolid import Equisolid
from calibration.models.extended_unified import ExtendedUnified
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.mirror_ball import MirrorBall
from calibration.models.ocam import OCam
from calibration.models.orthographic import Orthographic
from calibration.models.splined_radial import SplinedRadial
from calibration.models.stereographic import Stereographic
from calibration.models.unified import Unified
from capture.errors import InputError

CENTRE = (319.7, 241.1)
DATA_SHEET = {
    "model": "equisolid",
    "image_size_px": [5616, 3744],
    "centre_px": [2807.5, 1871.5],
    "focal_px": 1248.0,
    "valid_angle_rad": 1.6232,
}


def written(folder: Path, content: object) -> Path:
    path = folder / "cal.json"
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize(
    "model",
    [
        Equidistant(CENTRE, 150.0),
        Equisolid(CENTRE, (150.5, 149.0)),
        Stereographic(CENTRE, 0.1 + 0.2),
        Orthographic(CENTRE, 1 / 3),
        KannalaBrandt(CENTRE, (150.0, 151.0), 0.03, -0.01, 0.004, -0.0006),
        OCam(CENTRE, 209.3, (-0.46, 0.224, -0.197), 0.99887, -0.000169, 0.00011),
        Unified(CENTRE, (310.0, 311.0), 1.4, -0.03, 0.002, 0.0001, -0.0003),
        ExtendedUnified(CENTRE, 150.0, 0.586, 1.139),
        DoubleSphere(CENTRE, 130.0, -0.244, 0.566),
        SplinedRadial(CENTRE, 150.0, 1.9, (0.01, 0.02, -0.1)),
        MirrorBall(CENTRE, 200.1, 7.3),
        full_sphere((640, 480)),
    ],
    ids=lambda model: model.name,
)
def test_every_model_is_read_back_exactly(tmp_path: Path, model) -> None:
    path = tmp_path / "cal.json"
    plain = Calibration(model, (640, 480), 1.5)
    full = replace(
        plain,
        R_world_camera=UP,
        image_circle=ImageCircle((320.0, 240.5), 235.0),
        vignetting=(-0.1, 0.02),
        uneven_vignetting=(0.01, -0.02),
        inner_angle_rad=0.4,
    )
    for calibration in (plain, full):
        write_calibration(path, calibration)
        returned = read_calibration(path)
        np.testing.assert_array_equal(returned.R_world_camera, calibration.R_world_camera)
        same_pose = replace(returned, R_world_camera=LEVEL)
        assert repr(same_pose) == repr(replace(calibration, R_world_camera=LEVEL))


def test_a_file_written_by_hand_needs_five_lines(tmp_path: Path) -> None:
    calibration = read_calibration(written(tmp_path, DATA_SHEET))
    assert calibration.model == Equisolid((2807.5, 1871.5), 1248.0)
    assert calibration.image_size_px == (5616, 3744)
    np.testing.assert_array_equal(calibration.R_world_camera, LEVEL)


def test_an_equirectangular_camera_may_leave_out_what_its_size_tells(tmp_path: Path) -> None:
    content = {"model": "equirectangular", "image_size_px": [640, 320], "valid_angle_rad": 3.14159}
    assert read_calibration(written(tmp_path, content)).model == full_sphere((640, 320))
    partial = {**content, "centre_px": [319.5, 160.5]}
    with pytest.raises(InputError, match="focal_px"):
        read_calibration(written(tmp_path, partial))


WITHOUT = object()


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("model", WITHOUT, "mirror_ball"),
        ("model", "fisheye", "equidistant"),
        ("model", ["equisolid"], "model"),
        ("focal_px", WITHOUT, "focal_px"),
        ("focal_px", "1248", r"str.*focal_px"),
        ("focal_px", [1, 2, 3], "focal_px"),
        ("focal_px", -1, "positive"),
        ("valid_angle_rad", WITHOUT, "valid_angle_rad"),
        ("valid_angle_rad", 93, r"degrees.*1\.6232"),
        ("valid_angle_rad", 3.1416, r"3\.14159 at most"),
        ("image_size_px", [5616.5, 3744], "image_size_px"),
        ("image_size_px", [5616, 0], "image_size_px"),
        ("centre_px", [1], "centre_px"),
        ("k1", 0.1, 'unknown key "k1"'),
        ("R_world_camera", np.diag([1, 1, -1]).tolist(), "rotation"),
        ("R_world_camera", [[1, 0], [0, 1]], "R_world_camera"),
        ("image_circle", {"centre_px": [1, 2], "radius_px": 0}, "radius_px"),
        ("image_circle", {"centre_px": [1, 2]}, r"radius_px.*image_circle"),
        ("image_circle", {"centre_px": [1, 2], "radius_px": 3, "r": 1}, r"`r`.*image_circle"),
        ("vignetting", [-2.0], "vignetting"),
        ("vignetting", [1e308, 1e308], "vignetting"),
        ("focal_px", 1e13, "beyond 1e\\+12"),
    ],
)
def test_a_wrong_key_is_named_in_one_line(tmp_path: Path, key, value, told) -> None:
    content = {**DATA_SHEET, key: value}
    if value is WITHOUT:
        del content[key]
    path = written(tmp_path, content)
    with pytest.raises(InputError, match=told) as caught:
        read_calibration(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "lens",
    [
        {"model": "kannala_brandt", "focal_px": 100, "k4": 1e308},
        {"model": "ocam", "focal_px": 100, "coefficients": [1e308, 1e308]},
        {"model": "unified", "focal_px": 100, "xi": 1e200},
        {"model": "mirror_ball", "radius_px": 100, "distance_ratio": 1e200},
        {
            "model": "mirror_ball_off_axis",
            "principal_px": [1, 2],
            "focal_px": 100,
            "distance_ratio": 1e200,
        },
    ],
    ids=lambda lens: lens["model"],
)
def test_numbers_whose_powers_overflow_are_refused(tmp_path: Path, lens: dict[str, Any]) -> None:
    shared = {"image_size_px": [40, 30], "centre_px": [20, 15], "valid_angle_rad": 1.0}
    with pytest.raises(InputError, match=r"cal\.json"):
        read_calibration(written(tmp_path, {**shared, **lens}))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"[1]",
        b"\xff\xd8\xff",
        b'{"focal_px": NaN}',
        b" " * (2 << 20),
        b'{"": ' + b"[" * 9999,
    ],
)
def test_what_is_no_calibration_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "cal.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"cal\.json") as caught:
        read_calibration(path)
    assert "\n" not in str(caught.value)


def test_a_missing_file_or_a_folder_is_named(tmp_path: Path) -> None:
    for path in (tmp_path / "none.json", tmp_path):
        with pytest.raises(InputError, match=str(path)):
            read_calibration(path)


def test_numbers_that_numpy_computed_are_written(tmp_path: Path) -> None:
    path = tmp_path / "cal.json"
    model = Equidistant((np.float64(1.5), np.float32(2.5)), np.float64(150.0))
    write_calibration(path, Calibration(model, (4, 6), np.radians(90.0)))
    assert read_calibration(path).model == Equidistant((1.5, 2.5), 150.0)


def test_an_existing_file_is_kept_unless_forced(tmp_path: Path) -> None:
    path = written(tmp_path, DATA_SHEET)
    calibration = read_calibration(path)
    with pytest.raises(InputError, match="--force"):
        write_calibration(path, calibration, force=False)
    assert json.loads(path.read_text()) == DATA_SHEET


def test_a_giant_is_refused_unread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "giant.json"
    path.touch()
    os.truncate(path, 2**24 + 1)  # takes no place on the disk
    monkeypatch.setattr(Path, "read_bytes", None)
    with pytest.raises(InputError, match=r"giant\.json: .* more than"):
        read_calibration(path)
