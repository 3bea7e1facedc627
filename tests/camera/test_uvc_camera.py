"""The emulated camera without a kernel: what it says of itself, its answers, its pictures."""

import json
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from capture.sensor import srgb_decode
from tests.camera.scene_pictures import UNIT_S, PictureSet, encoded, noisy, patches, write_pictures
from tests.camera.uvc_controls import (
    APERTURE_PRIORITY,
    GET_CUR,
    GET_DEF,
    GET_INFO,
    GET_LEN,
    GET_MAX,
    GET_MIN,
    MANUAL,
    SET_CUR,
    Controls,
)
from tests.camera.uvc_descriptors import (
    CAMERA_TERMINAL,
    PROCESSING_UNIT,
    StreamShape,
    configuration_descriptor,
    string_descriptor,
)
from tests.camera.uvc_pictures import PictureBook, PictureKey
from tests.camera.uvc_stamp import Stamp, stamp_of_counts, stamp_of_data, stamped

MODE, EXPOSURE = (CAMERA_TERMINAL, 2), (CAMERA_TERMINAL, 4)
GAIN = (PROCESSING_UNIT, 4)
WRONG_STATE, OUT_OF_RANGE, NO_SUCH_CONTROL = 2, 4, 6


def descriptors(data: bytes) -> list[bytes]:
    parts, start = [], 0
    while start < len(data):
        parts.append(data[start : start + data[start]])
        start += data[start]
    return parts


def test_lengths_in_the_descriptors_agree() -> None:
    shape = StreamShape(("YUYV", "MJPG", "RG16", "GREY"), (160, 120), (333_333, 666_667))
    data = configuration_descriptor(shape)
    parts = descriptors(data)
    assert b"".join(parts) == data
    assert struct.unpack_from("<H", data, 2) == (len(data),)
    headers = [part for part in parts if part[1] == 0x24 and part[2] == 1]
    control, streaming = headers
    # From the header to the end of the units: the header, camera, processing unit, output.
    units = [part for part in parts if part[1] == 0x24][:4]
    assert struct.unpack_from("<H", control, 5) == (sum(map(len, units)),)
    formats = [part for part in parts if part[1] == 0x24][5:]
    assert struct.unpack_from("<H", streaming, 4) == (len(streaming) + sum(map(len, formats)),)
    assert [part[2] for part in formats] == [4, 5, 13, 6, 7, 13, 4, 5, 13, 4, 5, 13]
    grey_frame = formats[-2]
    assert struct.unpack_from("<HHIIII", grey_frame, 5) == (
        *(160, 120),
        *(160 * 120 * 8 * 10_000_000 // 666_667, 160 * 120 * 8 * 10_000_000 // 333_333),
        *(160 * 120, 333_333),
    )


def test_strings() -> None:
    assert string_descriptor(0, ["é"]) == b"\4\3\x09\x04"
    assert string_descriptor(1, ["é"]) == b"\4\3\xe9\0"
    assert string_descriptor(2, ["é"]) is None


@pytest.fixture
def controls() -> Controls:
    return Controls((1, 10, 100, 500), 2)


def reason(controls: Controls) -> int:
    answer = controls.answer(GET_CUR, 0, 2, b"")
    assert answer is not None
    return answer[0]


def test_exposure_is_refused_while_automatic(controls: Controls) -> None:
    assert controls.settings().exposure_mode == APERTURE_PRIORITY
    assert controls.answer(SET_CUR, *EXPOSURE, struct.pack("<I", 10)) is None
    assert reason(controls) == WRONG_STATE
    assert controls.answer(SET_CUR, *MODE, bytes([MANUAL])) == b""
    assert controls.answer(SET_CUR, *EXPOSURE, struct.pack("<I", 10)) == b""
    assert reason(controls) == 0


def test_exposure_between_two_is_rounded_and_read_back(controls: Controls) -> None:
    controls.answer(SET_CUR, *MODE, bytes([MANUAL]))
    controls.answer(SET_CUR, *EXPOSURE, struct.pack("<I", 40))
    assert controls.answer(GET_CUR, *EXPOSURE, b"") == struct.pack("<I", 10)
    assert controls.answer(GET_INFO, *EXPOSURE, b"") == bytes([3 | 8])
    assert [(name, value) for _, name, value in controls.changes] == [
        ("exposure_mode", MANUAL),
        ("exposure", 10),
    ]


def test_values_out_of_range_and_unknown_controls_are_refused(controls: Controls) -> None:
    controls.answer(SET_CUR, *MODE, bytes([MANUAL]))
    for value in (0, 501):
        assert controls.answer(SET_CUR, *EXPOSURE, struct.pack("<I", value)) is None
        assert reason(controls) == OUT_OF_RANGE
    assert controls.answer(SET_CUR, *MODE, bytes([2])) is None
    assert controls.answer(GET_CUR, PROCESSING_UNIT, 9, b"") is None
    assert reason(controls) == NO_SUCH_CONTROL


def test_range_default_and_size_of_a_control(controls: Controls) -> None:
    controls.answer(SET_CUR, *GAIN, struct.pack("<H", 1))
    asked = [controls.answer(request, *GAIN, b"") for request in (GET_MIN, GET_MAX, GET_DEF)]
    assert asked == [struct.pack("<H", value) for value in (0, 1, 0)]
    assert controls.answer(GET_LEN, *GAIN, b"") == struct.pack("<H", 2)
    assert controls.answer(GET_LEN, *EXPOSURE, b"") == struct.pack("<H", 4)


def decoded(data: bytes, pixel_format: str) -> np.ndarray:
    """Linear values and, of uncompressed pictures, their counts, by OpenCV."""
    raw = np.frombuffer(data, np.uint8)
    if pixel_format == "MJPG":
        return cv2.imdecode(raw, cv2.IMREAD_COLOR_RGB)
    if pixel_format == "YUYV":
        return cv2.cvtColor(raw.reshape(120, 160, 2), cv2.COLOR_YUV2RGB_YUYV)
    if pixel_format == "GREY":
        return np.repeat(raw.reshape(120, 160, 1), 3, axis=2)
    return cv2.cvtColor(raw.view("<u2").reshape(120, 160), cv2.COLOR_BayerBG2RGB)  # RGGB, to cv2


@pytest.mark.parametrize("pixel_format", ["YUYV", "RG16", "GREY"])
def test_stamp_survives_decoding(pixel_format: str) -> None:
    stamp = Stamp(0xA5F1, 500, 1)
    picture = bytearray(encoded(np.full((120, 160, 3), 0.4), pixel_format))
    data = stamped(picture, pixel_format, 160, stamp)
    counts = decoded(data, pixel_format)
    assert stamp_of_counts(counts) == stamp_of_data(data, pixel_format, 160) == stamp
    plain = decoded(encoded(np.full((120, 160, 3), 0.4), pixel_format), pixel_format)
    assert np.array_equal(counts[:110], plain[:110])


def test_stamp_in_a_jpeg_is_a_comment() -> None:
    plain = encoded(np.full((120, 160, 3), 0.4), "MJPG")
    data = stamped(bytearray(plain), "MJPG", 160, Stamp(70, 10, 0))
    assert stamp_of_data(data, "MJPG", 160) == Stamp(70, 10, 0)
    assert np.array_equal(decoded(data, "MJPG"), decoded(plain, "MJPG"))
    (length,) = struct.unpack_from(">H", data, 4)
    assert data[: 2 + 2] + data[4 + length :] == plain[:2] + b"\xff\xfe" + plain[2:]
    with pytest.raises(ValueError, match="no stamp"):
        stamp_of_data(plain, "MJPG", 160)


@pytest.mark.parametrize("pixel_format", ["YUYV", "MJPG", "RG16"])
def test_pictures_show_radiance_times_time(pixel_format: str) -> None:
    linear = np.clip(patches() * 20 * UNIT_S, 0, 1)
    counts = decoded(encoded(linear, pixel_format), pixel_format)
    found = counts / 65520 if pixel_format == "RG16" else srgb_decode(counts / 255)
    # Centres of the squares. 12 bits round by 1/8190. Of 8 bits, luma and colour difference of
    # YUYV round by half a count of 219 and 1.772/2 of 224 in blue, 1.0 of 255 together and with
    # OpenCV's own rounding 1.5 of 255; JPEG's finest quantisation does not exceed 3. The curve's
    # slope is at most 2.4.
    bound = {"RG16": 1.3e-4, "YUYV": 2.4 * 1.6 / 255, "MJPG": 2.4 * 3 / 255}[pixel_format]
    middle = (slice(8, 112, 16), slice(8, 160, 16))
    assert np.abs(found[middle] - linear[middle]).max() < bound


def test_noise_is_that_of_electrons() -> None:
    # 10,000 electrons make white; at 0.25 there are 2500, of deviation 50, and 5 of reading.
    linear = noisy(np.full((200, 200, 3), 0.25), 2.0, np.random.default_rng(5))
    assert linear.mean() == pytest.approx(0.5, abs=2e-4)
    assert linear.std() == pytest.approx(2 * np.hypot(50, 5) / 10_000, rel=0.02)  # 1/√(2·120,000)


def test_book_holds_the_pictures_of_every_key(tmp_path: Path) -> None:
    wanted = PictureSet(("GREY", "MJPG"), (1, 10, 100), 2, 2)
    write_pictures(tmp_path, patches(), wanted)
    book = PictureBook(tmp_path)
    assert (book.size_px, book.formats, book.exposures) == (
        (160, 120),
        ("GREY", "MJPG"),
        (1, 10, 100),
    )
    assert book.auto_exposure in book.exposures
    levels = [
        np.frombuffer(book.picture(PictureKey("GREY", exposure, gain), 0), np.uint8).mean()
        for exposure, gain in ((1, 0), (1, 1), (10, 0), (10, 1), (100, 1))
    ]
    assert np.all(np.diff(levels) > 0)
    first, second, third = (book.picture(PictureKey("MJPG", 10, 0), n) for n in range(3))
    assert first == third != second
    assert decoded(bytes(first), "MJPG").shape == (120, 160, 3)
    assert json.loads((tmp_path / "pictures.json").read_text())["gain_count"] == 2
