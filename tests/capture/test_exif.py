"""EXIF: what is there, in SI units; None for what is not. Pillow writes the tags."""

import struct
import subprocess
import sys
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from capture.errors import InputError
from capture.exif import Exif, read_exif

DATA = Path(__file__).resolve().parents[2].parent / "shared/data"
EXIF_DIRECTORY = 0x8769
NOON = datetime(2024, 6, 1, 12, 0, 0, tzinfo=UTC).timestamp()


def photograph(folder: Path, *, camera: dict[int, Any] | None = None, **tags: Any) -> Path:
    """Write a JPEG with these tags, named as in `NUMBERS`, and return its path."""
    exif = Image.Exif()
    exif.update(camera or {})
    exif.get_ifd(EXIF_DIRECTORY).update({NUMBERS[name]: value for name, value in tags.items()})
    path = folder / "photograph.jpg"
    Image.new("RGB", (8, 8)).save(path, exif=exif)
    return path


NUMBERS = {
    "exposure": 33434,
    "f_number": 33437,
    "iso": 34855,
    "original": 36867,
    "zone": 36881,
    "fraction": 37521,
    "on_film": 41989,
}


def test_all_fields_are_read_in_their_units(tmp_path: Path) -> None:
    path = photograph(
        tmp_path,
        camera={271: "Canon", 272: "Canon EOS 5D Mark II", 274: 6},
        exposure=IFDRational(1, 8000),
        f_number=IFDRational(28, 5),
        iso=400,
        original="2024:06:01 12:00:00",
        fraction="71",
        on_film=35,
    )
    assert read_exif(path) == Exif(
        time_s=1 / 8000,
        gain=4.0,
        f_number=5.6,
        timestamp_s=pytest.approx(NOON + 0.71, rel=0, abs=1e-3),
        equivalent_focal_length_mm=35,
        camera="Canon EOS 5D Mark II",
        orientation=6,
    )


def test_maker_is_put_before_a_model_that_does_not_name_it(tmp_path: Path) -> None:
    path = photograph(tmp_path, camera={271: "FUJIFILM", 272: "X-H1"})
    assert read_exif(path).camera == "FUJIFILM X-H1"


def test_text_of_a_file_holds_nothing_that_steers_a_terminal(tmp_path: Path) -> None:
    path = photograph(tmp_path, camera={272: " X\x1b[2J\n1\t"})
    assert read_exif(path).camera == "X[2J1"


def test_time_zone_is_taken_off(tmp_path: Path) -> None:
    exif = read_exif(photograph(tmp_path, original="2024:06:01 12:00:00", zone="+02:00"))
    assert (exif.timestamp_s, exif.utc_offset) == (NOON - 7200, timedelta(hours=2))
    # A zone of a moment that is not told is no zone of the one that is.
    other = {306: "2024:06:01 12:00:00"}
    exif = read_exif(
        photograph(tmp_path, camera=other, original="0000:00:00 00:00:00", zone="+02:00")
    )
    assert (exif.timestamp_s, exif.utc_offset) == (NOON, None)


@pytest.mark.parametrize(
    "tags",
    [
        {"exposure": IFDRational(0, 1)},
        {"exposure": IFDRational(0, 0)},
        {"exposure": IFDRational(1, 0)},
        {"f_number": IFDRational(0, 1)},
        {"iso": 0},
        {"original": "0000:00:00 00:00:00"},
        {"original": "yesterday"},
        {"original": ""},
        {},
    ],
)
def test_nonsense_is_none(tmp_path: Path, tags: dict[str, Any]) -> None:
    assert read_exif(photograph(tmp_path, **tags)) == Exif()


@pytest.mark.parametrize("content", [b"A text.", b"\xff\xd8\xff\xe1\0\x10Exif\0\0II*\0"])
def test_file_without_exif_gives_none(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(content)
    assert read_exif(path) == Exif()


def test_parser_prints_nothing(tmp_path: Path) -> None:
    # In a process of its own: pytest catches what goes through logging.
    path = tmp_path / "a.png"
    Image.new("RGB", (8, 8)).save(path)
    program = f"from capture.exif import Path, read_exif; read_exif(Path({str(path)!r}))"
    root = Path(__file__).resolve().parents[2]
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, cwd=root, check=True)
    assert (ran.stdout, ran.stderr) == (b"", b"")


def test_directories_that_name_one_another_end_soon(tmp_path: Path) -> None:
    # Five of 5000 entries each, of which every one leads to the next: 5000⁴ to be read in the last.
    count, entry_size = 5000, 12
    size = 2 + entry_size * count + 4
    directories = [
        struct.pack("<H", count)
        + struct.pack("<HHII", 0x8825, 4, 1, 8 + size * (level + 1)) * count
        + bytes(4)
        for level in range(5)
    ]
    path = tmp_path / "a.tif"
    path.write_bytes(b"II*\0" + struct.pack("<I", 8) + b"".join(directories) + bytes(size))
    start_s = time.thread_time()
    assert read_exif(path) == Exif()
    assert time.thread_time() - start_s < 2


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.jpg: no such file"):
        read_exif(tmp_path / "a.jpg")


@pytest.mark.data
def test_real_bracket_spans_its_stated_exposures() -> None:
    folder = DATA / "brackets-lumilab-fisheye"
    if not folder.exists():
        pytest.skip(f"{folder} is not there")
    exifs = [read_exif(path) for path in sorted(folder.glob("**/*.JPG"))]
    times = [exif.time_s for exif in exifs if exif.time_s]
    assert (len(times), max(times), min(times)) == (10, 13.0, 1 / 8000)
    assert {exif.camera for exif in exifs} == {"Canon EOS 5D Mark II"}
