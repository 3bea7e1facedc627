"""RAW files: linear, alike for every frame of a bracket, and harmless when hostile.

The files are DNGs made here: one uncompressed plane of 16-bit counts behind an RGGB mosaic, of a
camera whose own primaries are Rec.709, so that development is the identity but for the levels.
"""

import struct
from pathlib import Path

import numpy as np
import pytest

from capture import raw
from capture.errors import InputError, UnreadableFrame
from capture.primaries import REC709, rgb_to_xyz
from capture.raw import read_raw

BLACK, WHITE = 512, 16383
SHAPE = (48, 64)
DATA = Path(__file__).resolve().parents[2].parent / "shared/data"


def dng(
    counts: np.ndarray,
    *,
    as_shot: tuple[int, int, int] = (100, 100, 100),
    orientation: int = 1,
    width: int | None = None,
    monochrome: bool = False,
) -> bytes:
    """Return a DNG file of counts, (H, W), behind a mosaic or without one."""
    height = counts.shape[0]
    width = width or counts.shape[1]
    matrix = np.rint(np.linalg.inv(rgb_to_xyz(REC709)) * 10_000).astype(int).ravel()
    tags = [
        (254, "I", [0]),  # NewSubFileType: the main picture
        (256, "I", [width]),
        (257, "I", [height]),
        (258, "H", [16]),
        (259, "H", [1]),  # no compression
        (262, "H", [34892 if monochrome else 32803]),  # linear, or a colour filter array
        (271, "s", b"Test\0"),
        (272, "s", b"Plane\0"),
        (273, "I", [0]),  # StripOffsets, set below
        (274, "H", [orientation]),
        (277, "H", [1]),
        (278, "I", [height]),
        (279, "I", [2 * counts.size]),
        (33421, "H", [2, 2]),
        (33422, "B", [0, 1, 1, 2]),  # red, green, green, blue
        (50706, "B", [1, 4, 0, 0]),  # DNGVersion
        (50708, "s", b"Test Plane\0"),
        (50714, "H", [BLACK]),
        (50717, "H", [WHITE]),
        (50721, "r", [number for value in matrix for number in (value, 10_000)]),
        (50728, "R", [number for value in as_shot for number in (value, 100)]),
        (50778, "H", [21]),  # CalibrationIlluminant1: D65
    ]
    if monochrome:
        tags = [tag for tag in tags if tag[0] not in (33421, 33422, 50721, 50728, 50778)]
    kinds = {"B": (1, 1), "s": (2, 1), "H": (3, 2), "I": (4, 4), "R": (5, 8), "r": (10, 8)}
    values_at = 8 + 2 + 12 * len(tags) + 4
    entries, values = b"", b""
    pixels_at = values_at + 1024
    for tag, kind, value in tags:
        if tag == 273:
            value = [pixels_at]
        code, size = kinds[kind]
        letter = {"R": "I", "r": "i"}.get(kind, kind)
        data = value if kind == "s" else struct.pack(f"<{len(value)}{letter}", *value)
        count = len(data) // size
        if len(data) <= 4:
            place = data.ljust(4, b"\0")
        else:
            place = struct.pack("<I", values_at + len(values))
            values += data + b"\0" * (len(data) % 2)
        entries += struct.pack("<HHI", tag, code, count) + place
    header = struct.pack("<2sHIH", b"II", 42, 8, len(tags)) + entries + bytes(4)
    return (header + values).ljust(pixels_at, b"\0") + counts.astype("<u2").tobytes()


def level(linear: float) -> int:
    return round(BLACK + linear * (WHITE - BLACK))


def developed(tmp_path: Path, counts: np.ndarray, **options: object) -> np.ndarray:
    path = tmp_path / "frame.dng"
    path.write_bytes(dng(counts, **options))
    return read_raw(path)[0]


def test_counts_are_the_light_between_black_and_white(tmp_path: Path) -> None:
    # Columns of rising light, two mosaic cells wide each so that interpolation has flat ground;
    # grey through Rec.709 primaries in daylight is itself: (count − black)/(white − black).
    light = np.repeat(np.linspace(0.05, 0.95, SHAPE[1] // 8), 8)
    counts = np.broadcast_to([level(value) for value in light], SHAPE)
    result = developed(tmp_path, counts)
    assert result.shape == (*SHAPE, 3)
    assert result.dtype == np.uint16
    middle = result[:, 4::8].astype(float) / 65535  # away from the steps
    expected = light[4::8]
    assert np.abs(middle - expected[:, None]).max() < 0.002


def test_sensor_of_developed_counts_is_linear_from_0_to_65535(tmp_path: Path) -> None:
    path = tmp_path / "frame.dng"
    path.write_bytes(dng(np.full(SHAPE, level(0.5))))
    sensor = read_raw(path)[1]
    assert (sensor.black_dn, sensor.white_dn, sensor.response) == (0, 65535, None)
    assert str(BLACK) in sensor.source
    assert str(WHITE) in sensor.source


def test_scale_does_not_depend_on_the_brightest_pixel_nor_on_as_shot_balance(
    tmp_path: Path,
) -> None:
    # LibRaw by itself moves white to the brightest pixel if that lies above 3/4 of it.
    plain = np.full(SHAPE, level(0.3))
    spot = plain.copy()
    spot[40:44, 40:44] = level(0.9)
    reference = developed(tmp_path, plain)
    np.testing.assert_array_equal(developed(tmp_path, spot)[:32, :32], reference[:32, :32])
    warm = developed(tmp_path, plain, as_shot=(200, 100, 60))
    np.testing.assert_array_equal(warm, reference)


def test_full_pixel_is_full_in_all_channels(tmp_path: Path) -> None:
    result = developed(tmp_path, np.full(SHAPE, WHITE))
    assert result.min() >= 65534  # the matrices round once


def test_sensor_without_colours_gives_grey(tmp_path: Path) -> None:
    result = developed(tmp_path, np.full(SHAPE, level(0.5)), monochrome=True)
    assert result.shape == (*SHAPE, 3)
    assert np.abs(result / 65535 - 0.5).max() < 0.002


def test_pixels_lie_as_the_sensor_has_them(tmp_path: Path) -> None:
    counts = np.full(SHAPE, level(0.1))
    counts[:8, :16] = level(0.6)
    upright = developed(tmp_path, counts)
    turned = developed(tmp_path, counts, orientation=6)
    np.testing.assert_array_equal(turned, upright)
    assert upright[4, 8, 1] > 3 * upright[40, 8, 1]


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (dng(np.full(SHAPE, level(0.5)))[:-3000], "cannot be developed"),
        (dng(np.full(SHAPE, level(0.5)), width=60_000)[:700], "cannot be developed"),
        (b"A letter, not a photograph.\n" * 100, "cannot be developed"),
        (b"", "empty"),
    ],
    ids=["truncated", "forged size", "text", "empty"],
)
def test_hostile_file_is_an_unreadable_frame(tmp_path: Path, content: bytes, reason: str) -> None:
    path = tmp_path / "bad.dng"
    path.write_bytes(content)
    with pytest.raises(UnreadableFrame, match=reason) as caught:
        read_raw(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_picture_bomb_is_refused_before_its_pixels_are_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "bomb.dng"
    path.write_bytes(dng(np.full((2400, 2), level(0.5)), width=60_000))
    with pytest.raises(UnreadableFrame, match="60000×2400 px"):
        read_raw(path)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nothing\.dng: no such file"):
        read_raw(tmp_path / "nothing.dng")


@pytest.fixture
def frame(tmp_path: Path) -> Path:
    path = tmp_path / "frame.dng"
    path.write_bytes(dng(np.full(SHAPE, level(0.5))))
    return path


def replace_worker(monkeypatch: pytest.MonkeyPatch, path: Path, program: str) -> None:
    path.write_text(program)
    monkeypatch.setattr(raw, "_WORKER", path)


def test_crash_of_the_decoder_is_an_unreadable_frame(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, frame: Path
) -> None:
    program = "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"
    replace_worker(monkeypatch, tmp_path / "crash.py", program)
    with pytest.raises(UnreadableFrame, match="crashed on it \\(SIGSEGV\\)"):
        read_raw(frame)


def test_decoder_that_hangs_is_stopped(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, frame: Path
) -> None:
    replace_worker(monkeypatch, tmp_path / "hang.py", "import time; time.sleep(60)")
    monkeypatch.setattr(raw, "_TIMEOUT_S", 0.2)
    with pytest.raises(UnreadableFrame, match="not developed within"):
        read_raw(frame)


def test_decoder_stays_within_its_memory(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    path = tmp_path / "large.dng"
    path.write_bytes(dng(np.full((4000, 6000), level(0.5), np.uint16)))
    monkeypatch.setattr(raw, "_MAX_BYTES", 2**28)  # less than the 24 megapixels need
    with pytest.raises(UnreadableFrame, match=r"mempool|memory"):
        read_raw(path)


@pytest.mark.data
def test_real_dng_develops_to_a_colour_chart() -> None:
    path = DATA / "raw-tinydng/colorchart.dng"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    counts, sensor = read_raw(path)
    assert counts.shape == (1156, 1734, 3)
    assert "black 2056, white 15000" in sensor.source
    assert 1000 < counts.mean() < 20_000
