"""What inspect tells, against what was counted by hand on a recording made for it."""

import math

import numpy as np
import pytest
from PIL import ImageFont

from capture.frame import Exposure, Frame
from capture.inspecting import (
    MAX_ROWS,
    _caption,
    black_share,
    clipped_share,
    contact_sheet,
    describe,
    examine,
    exposure_text,
)
from capture.manifest import DeviceRecord
from capture.recording import open_recording
from capture.recording_writer import create_recording
from capture.sensor import Sensor, assumed_sensor

SRGB = assumed_sensor(np.uint8)
TIMES_S = (0.01, 0.16)


def make(folder, bracket_count=4, times_s=TIMES_S, sensor=SRGB, dtype=np.uint8, timestamps_s=None):
    """Frames half dark, half bright; frame number 3 never reached the disk."""
    full = np.iinfo(dtype).max
    with create_recording(folder, "test", sensor, source="made", licence="CC0") as writer:
        for position in range(bracket_count * len(times_s)):
            picture = np.zeros((20, 30, 3), dtype)
            picture[:, 15:] = full
            picture[:5, :15] = full // 2  # a quarter of the dark half is not black
            bracket = position // len(times_s)
            writer.write_frame(
                picture,
                Exposure(times_s[position % len(times_s)]),
                bracket / 10 if timestamps_s is None else timestamps_s[bracket],
                bracket,
                index=position if position < 3 else position + 1,
            )
    return open_recording(folder)


def facts(recording):
    return dict(describe(recording, examine(recording)))


def test_the_facts_are_those_of_the_recording(tmp_path):
    told = facts(make(tmp_path / "r"))
    assert told["camera"] == "test"
    assert told["sensor"] == "black 0, white 255; assumed sRGB"
    assert (told["source"], told["licence"], told["calibration"]) == ("made", "CC0", "none")
    assert told["size"] == "30×20 px"
    assert told["brackets"] == "4 of 2 frames"
    assert told["exposures"] == "1/100 s, 1/6.25 s (4.0 EV)"
    assert told["duration"] == "0.300 s, 10 brackets a second"
    assert told["gaps"].startswith("1 frames lost before they were written, 0 long intervals")
    assert told["frames"] == "8, all read, digests right"
    assert told["clipped"].startswith("50.000%")
    assert told["black"].startswith("37.500%")


def test_a_live_camera_is_told_with_its_controls(tmp_path):
    camera = DeviceRecord("/dev/video2", "MJPG", 1 / 30, "uvcvideo", {"Gain": 4, "Sharpness": 0})
    with create_recording(tmp_path / "r", "Webcam", SRGB, device=camera) as writer:
        writer.write_frame(np.zeros((4, 4, 3), np.uint8), Exposure(0.01), 0.0, 0)
    told = facts(open_recording(tmp_path / "r"))
    assert told["device"] == "/dev/video2, driver uvcvideo, MJPG, 30 frames a second"
    assert told["controls"] == "Gain 4; Sharpness 0"


def test_a_device_of_an_older_recording_has_no_driver_and_other_sources_no_device(tmp_path):
    camera = DeviceRecord("0", "YUYV", 0.04)
    with create_recording(tmp_path / "r", "Webcam", SRGB, device=camera) as writer:
        writer.write_frame(np.zeros((4, 4, 3), np.uint8), Exposure(0.01), 0.0, 0)
    told = facts(open_recording(tmp_path / "r"))
    assert (told["device"], told["controls"]) == ("0, YUYV, 25 frames a second", "not told")
    assert "device" not in facts(make(tmp_path / "made"))


def test_gaps_in_time_are_counted(tmp_path):
    # The bracket of two frames at 0.5 s is raised to 0.6 s, which makes it a repetition.
    told = facts(make(tmp_path / "r", 6, timestamps_s=(0.0, 0.1, 0.2, 0.6, 0.5, 0.7)))
    assert "1 long intervals, 1 repeated and 2 falling" in told["gaps"]


def test_shares_are_of_the_shortest_and_the_longest_exposure_in_any_order(tmp_path):
    grey = np.full((4, 4, 3), 100, np.uint8)
    harsh = np.where(np.arange(4)[:, None, None] < 2, 0, np.full_like(grey, 255))
    with create_recording(tmp_path / "r", "", SRGB) as writer:
        for time_s, picture in ((0.04, harsh), (0.01, grey), (0.16, grey), (0.05, harsh)):
            writer.write_frame(picture, Exposure(time_s), 0.0, 0)
    examination = examine(open_recording(tmp_path / "r"))
    assert (examination.clipped_share, examination.black_share) == (0.0, 0.0)


def test_unreadable_brackets_are_counted_and_named(tmp_path):
    make(tmp_path / "r")
    (tmp_path / "r" / "frames" / "000000.png").write_bytes(b"")
    recording = open_recording(tmp_path / "r")
    examination = examine(recording)
    assert len(examination.failures) == 1
    assert "000000.png" in examination.failures[0]
    assert dict(describe(recording, examination))["frames"] == "8; brackets that cannot be read: 1"


def test_shares_are_unknown_where_nothing_can_be_read(tmp_path):
    make(tmp_path / "r", 1)
    (tmp_path / "r" / "frames" / "000000.png").unlink()
    recording = open_recording(tmp_path / "r")
    examination = examine(recording)
    assert math.isnan(examination.clipped_share)
    assert math.isnan(examination.black_share)
    facts = dict(describe(recording, examination))
    assert facts["clipped"] == "an unknown share of the shortest exposures' pixels"


def test_clipping_begins_at_the_saturation_and_black_at_the_black_level():
    sensor = Sensor(100.0, 1000.0, saturation=0.5)  # full from 550 on
    counts = np.zeros((1, 4, 3), np.uint16)
    counts[0, :, 1] = (100, 101, 549, 550)
    assert clipped_share(Frame(counts, Exposure(1.0)), sensor) == 0.25
    assert black_share(counts, sensor) == 0.25


def test_of_float_counts_those_are_clipped_that_the_file_marks():
    counts = np.full((1, 4, 3), 7, np.float32)
    marks = np.array([[True, False, False, False]])
    assert clipped_share(Frame(counts, Exposure(1.0), clipped=marks), SRGB) == 0.25
    assert clipped_share(Frame(counts, Exposure(1.0)), SRGB) == 0.0


@pytest.mark.parametrize(
    ("exposure", "text"),
    [
        (Exposure(1 / 8000, 1.0, 5.6), "1/8000 s f/5.6"),
        (Exposure(0.3125, 1.0), "0.3125 s"),
        (Exposure(7.1479e-6), "1/139900 s"),
        (Exposure(13.0, 4.0), "13 s gain 4"),
        (Exposure(1 / 4000, 4.0, 1.4), "1/4000 s f/1.4 gain 4"),
    ],
)
def test_exposures_are_written_as_photographers_do(exposure, text):
    assert exposure_text(exposure) == text


def test_captions_have_no_letter_that_the_font_lacks_and_no_half_parts(tmp_path):
    font = ImageFont.load_default(15)
    text = exposure_text(Exposure(1 / 4000, 4.0, 1.4))
    absent = bytes(font.getmask("\uffff"))
    assert all(bytes(font.getmask(letter)) != absent for letter in text)
    shortened = {_caption(Exposure(1 / 4000, 4.0, 1.4), px, font) for px in range(200)}
    assert shortened == {"", "1/4000 s", "1/4000 s f/1.4", text}


def test_many_exposures_are_told_by_their_ends(tmp_path):
    told = facts(make(tmp_path / "r", 1, times_s=tuple(2.0**-i for i in range(10))))
    assert told["exposures"] == "10 from 1/512 s to 1 s (9.0 EV)"


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_the_sheet_shows_each_exposure_of_a_bracket_in_a_row(tmp_path, dtype):
    recording = make(tmp_path / "r", 1, sensor=assumed_sensor(dtype), dtype=dtype)
    sheet = contact_sheet(recording)
    assert sheet.dtype == np.uint8
    # Each of the two thumbnails is half white; labels add a little.
    white = (sheet == 255).all(axis=2)
    rows = np.flatnonzero(white.sum(axis=1) > white.shape[1] / 4)
    assert len(rows) > 100
    middle = white[rows[len(rows) // 2]]
    assert np.count_nonzero(np.diff(middle.astype(int)) == 1) == 2


def test_a_sheet_has_a_limited_number_of_rows_and_fits_on_a_page(tmp_path):
    few = contact_sheet(make(tmp_path / "few", MAX_ROWS))
    many = contact_sheet(make(tmp_path / "many", 3 * MAX_ROWS))
    assert few.shape == many.shape
    wide = contact_sheet(make(tmp_path / "wide", 1, times_s=tuple(2.0**-i for i in range(20))))
    assert wide.shape[1] <= 1600 + 16
    assert many.shape[0] <= 2800


def test_a_sheet_goes_on_past_an_unreadable_bracket(tmp_path):
    whole = contact_sheet(make(tmp_path / "r"))
    (tmp_path / "r" / "frames" / "000002.png").unlink()
    damaged = contact_sheet(open_recording(tmp_path / "r"))
    assert damaged.shape == whole.shape
    assert (damaged == 255).sum() < 0.8 * (whole == 255).sum()
