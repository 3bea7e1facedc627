"""`fishlight calibrate sun` on recordings and pictures of a simulated day."""

import csv
import hashlib
import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

from calibration.camera import UP
from calibration.files import read_calibration, read_object, write_calibration
from calibration.models.equidistant import Equidistant
from calibration.pose.sky_pictures import parse_moment, parse_utc_offset, sky_pictures
from calibration.pose.sun_position import sun_directions
from calibration.sun_cli import calibrate_sun
from capture.errors import InputError
from tests.calibration.sun_skies import LENS, SIZE_PX, add_cloud, camera, sky

PLACE: Any = {"latitude_deg": 48.2, "longitude_deg": 16.4}
POSE = Rotation.from_euler("yxz", [25.0, 4.0, -3.0], degrees=True).as_matrix() @ UP
START = datetime(2026, 6, 21, 7, 0, tzinfo=UTC)
TIMES_S = 1200.0 * np.arange(19)


@pytest.fixture(scope="module")
def skies() -> list[NDArray[np.uint8]]:
    moments = START.timestamp() + TIMES_S
    sun = sun_directions(moments, *np.radians([PLACE["latitude_deg"], PLACE["longitude_deg"]]))
    pictures = [sky(camera(POSE), each) for each in sun]
    x, y = camera(POSE).project(sun[7])[0]
    pictures[7] = add_cloud(pictures[7], (x, y), (40.0, 6.0))
    return pictures


def record(folder: Path, pictures: list[NDArray[np.uint8]], first_s: float) -> Path:
    """Write a recording by hand, each bracket a picture and a longer, white exposure."""
    folder.mkdir()
    frames = []
    for number, picture in enumerate(pictures):
        for step, (time_s, counts) in enumerate(
            ((0.01, np.full_like(picture, 255)), (0.001, picture))
        ):
            name = f"{number:03}-{step}.png"
            cv2.imwrite(str(folder / name), counts[..., ::-1])
            frames.append(
                {
                    "file": name,
                    "time_s": time_s,
                    "sha256": hashlib.sha256((folder / name).read_bytes()).hexdigest(),
                    "size_px": SIZE_PX,
                    "index": 2 * number + step,
                    "bracket": number,
                    "timestamp_s": first_s + TIMES_S[number],
                }
            )
    sensor = {
        "black_dn": 0,
        "white_dn": 255,
        "response": "srgb",
        "saturation": 0.98,
        "full_well_e": 30000,
        "read_noise_e": 4,
    }
    manifest = {
        "schema": "fishlight-recording/1",
        "camera": "simulated",
        "sensor": sensor,
        "source": "",
        "licence": "",
        "frames": frames,
    }
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder


def turn_deg(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    return float(np.degrees(Rotation.from_matrix(first @ second.T).magnitude()))


def test_a_day_of_sun_tells_the_pose(
    tmp_path: Path, skies: list[NDArray[np.uint8]], capsys: pytest.CaptureFixture[str]
) -> None:
    start, out, table = tmp_path / "start.json", tmp_path / "cal.json", tmp_path / "sun.csv"
    write_calibration(start, camera(POSE))
    recording = record(tmp_path / "sky", skies, 12.5)
    local = "2026-06-21T09:00:00+02:00"
    calibrate_sun([recording], calibration=start, output=out, start=local, residuals=table, **PLACE)
    assert turn_deg(read_calibration(out).R_world_camera, POSE) < 0.1
    said = capsys.readouterr()
    assert "by 18 of 19 pictures" in said.out
    assert "1 left out: what is brightest is not round" in said.err
    assert "where the calibration had it" not in said.err
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert rows[7]["x_px"] == ""
    assert "not round" in rows[7]["left_out"]
    assert rows[3]["utc"] == "2026-06-21T08:00:00.000+00:00"
    assert float(rows[3]["residual_rad"]) < np.radians(0.1)
    was, now = read_object(start), read_object(out)
    del was["R_world_camera"], now["R_world_camera"]
    assert now == was


def test_a_day_of_sun_tells_the_lens_too(
    tmp_path: Path, skies: list[NDArray[np.uint8]], capsys: pytest.CaptureFixture[str]
) -> None:
    start, out = tmp_path / "start.json", tmp_path / "cal.json"
    sheet = replace(LENS, focal_px=98.0, centre_px=(157.0, 153.0))
    write_calibration(start, replace(camera(POSE), model=sheet), lens_fit={"kept": 1})
    recording = record(tmp_path / "sky", skies, 12.5)
    day: Any = {"calibration": start, "output": out, "start": "2026-06-21T09:00:00+02:00"}
    calibrate_sun([recording], refine_lens=True, **day, **PLACE)
    found = read_calibration(out)
    assert isinstance(found.model, Equidistant)
    assert found.model.focal_px == pytest.approx(LENS.focal_px, rel=2e-3)
    assert np.hypot(*np.subtract(found.model.centre_px, LENS.centre_px)) < 1.0
    assert turn_deg(found.R_world_camera, POSE) < 1.0
    assert "lens_fit" not in read_object(out)
    said = capsys.readouterr().out
    assert "focal length 95" in said
    assert "by 18 of 19 pictures" in said


def test_a_clock_that_kept_winter_time_is_told_where_up_is_known(
    tmp_path: Path, skies: list[NDArray[np.uint8]], capsys: pytest.CaptureFixture[str]
) -> None:
    start, out = tmp_path / "start.json", tmp_path / "cal.json"
    write_calibration(start, camera(POSE))
    recording = record(tmp_path / "sky", skies, (START + timedelta(hours=2)).timestamp())
    with pytest.raises(InputError, match="give --time-zone"):
        calibrate_sun([recording], calibration=start, output=out, **PLACE)
    assert not out.exists()
    calibrate_sun([recording], calibration=start, output=out, time_zone="+01:00", **PLACE)
    said = capsys.readouterr()
    assert "the clock is 60 min fast" in said.err
    assert turn_deg(read_calibration(out).R_world_camera, POSE) == pytest.approx(15.0, abs=0.2)
    calibrate_sun(
        [recording], calibration=start, output=out, time_zone="+0200", force=True, **PLACE
    )
    assert turn_deg(read_calibration(out).R_world_camera, POSE) < 0.1


def test_recordings_whose_moments_are_not_known_are_refused(
    tmp_path: Path, skies: list[NDArray[np.uint8]]
) -> None:
    live = record(tmp_path / "live", skies[:2], 12.5)
    with pytest.raises(InputError, match="with --start"):
        sky_pictures([live], timedelta(0), None)
    with pytest.raises(InputError, match="leave --time-zone out"):
        sky_pictures([live], timedelta(0), START)
    manifest = json.loads((live / "manifest.json").read_text())
    manifest["frames"][2]["timestamp_s"] = 0.0
    (live / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(InputError, match="clock was set"):
        sky_pictures([live], None, START)


def test_a_night_is_refused_with_what_the_pictures_show(
    tmp_path: Path, skies: list[NDArray[np.uint8]]
) -> None:
    start = tmp_path / "start.json"
    write_calibration(start, camera(POSE))
    recording = record(tmp_path / "sky", skies[:4], 0.0)
    with pytest.raises(InputError, match="most often: the sun stood below 5°"):
        calibrate_sun(
            [recording],
            calibration=start,
            output=tmp_path / "cal.json",
            start="2026-06-21T23:00:00Z",
            **PLACE,
        )


def photograph(path: Path, zone: str, original: str = "2026:06:21 09:00:00") -> Path:
    picture = Image.new("RGB", (8, 8))
    exif = picture.getexif()
    exif[0x132] = "2026:06:21 09:00:00"  # DateTime
    tags = exif.get_ifd(0x8769)
    tags[0x9003] = original  # DateTimeOriginal
    if zone:
        tags[0x9011] = zone  # OffsetTimeOriginal
    picture.save(path, exif=exif)
    return path


def test_photographs_need_a_zone_from_file_or_flag(tmp_path: Path) -> None:
    bare, zoned = photograph(tmp_path / "a.jpg", ""), photograph(tmp_path / "b.jpg", "+02:00")
    two_hours = timedelta(hours=2)
    for path, clock in ((bare, two_hours), (zoned, None), (zoned, two_hours)):
        assert sky_pictures([path], clock, None)[0].timestamp_s == START.timestamp()
    # The zone of a moment that is not told says nothing of the one that is.
    blank = photograph(tmp_path / "d.jpg", "+02:00", original="0000:00:00 00:00:00")
    for path in (bare, blank):
        with pytest.raises(InputError, match="zone of its clock"):
            sky_pictures([path], None, None)
    with pytest.raises(InputError, match="leave it out"):
        sky_pictures([zoned], timedelta(0), None)
    undated = tmp_path / "c.png"
    Image.new("RGB", (8, 8)).save(undated)
    with pytest.raises(InputError, match="when it was taken"):
        sky_pictures([undated], two_hours, None)


def test_only_offsets_and_moments_with_a_zone_are_taken() -> None:
    assert parse_utc_offset("UTC") == parse_utc_offset("Z") == timedelta(0)
    assert parse_utc_offset("-07:30") == -timedelta(hours=7, minutes=30)
    for wrong in ("Europe/Vienna", "CEST", "2", ""):
        with pytest.raises(InputError, match="--time-zone"):
            parse_utc_offset(wrong)
    assert parse_moment("2026-06-21T09:00:00+02:00") == START
    for wrong in ("2026-06-21T09:00:00", "noon"):
        with pytest.raises(InputError, match="with its zone"):
            parse_moment(wrong)
