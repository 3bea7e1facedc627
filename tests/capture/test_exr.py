"""OpenEXR: exact, strict, and indifferent to how another program laid the file out."""

import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from capture.errors import InputError, UnreadableFrame
from capture.exr import read_exr, write_exr

DATA = Path(__file__).resolve().parents[2].parent / "shared/data"
RNG = np.random.default_rng(3)
PIXELS = RNG.random((12, 20)).astype(np.float32)


def foreign(path: Path, channels: dict[str, Any], **header: Any) -> Path:
    """Write a file with the library alone."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    with OpenEXR.File(header, dict(channels)) as file:
        file.write(str(path))
    return path


def window(x0: int, y0: int, x1: int, y1: int) -> tuple[np.ndarray, np.ndarray]:
    return np.array([x0, y0], np.int32), np.array([x1, y1], np.int32)


channel_sets = hnp.array_shapes(min_dims=2, max_dims=2, max_side=20).flatmap(
    lambda shape: st.dictionaries(
        st.sampled_from(["R", "G", "B", "Y", "valid", "variance.R", "layer.Z"]),
        hnp.arrays(np.float32, shape, elements=st.floats(width=32)),
        min_size=1,
    )
)


@settings(max_examples=40, deadline=None)
@given(channels=channel_sets)
def test_what_is_written_is_read_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory, channels: dict[str, np.ndarray]
) -> None:
    path = tmp_path_factory.getbasetemp() / "round.exr"
    write_exr(path, channels, {})
    read = read_exr(path).channels
    assert read.keys() == channels.keys()
    for name, pixels in channels.items():
        assert read[name].dtype == np.float32
        np.testing.assert_array_equal(read[name], pixels)  # NaN included


def test_views_are_written_as_they_look_and_stay_as_they_are(tmp_path: Path) -> None:
    # The binding ignores strides and fills the dictionary that it is given with its own objects.
    channels = {"R": PIXELS.T, "G": PIXELS[::-1].T, "B": PIXELS.T.astype(np.float64)}
    write_exr(tmp_path / "a.exr", channels, {})
    read = read_exr(tmp_path / "a.exr").channels
    for name, pixels in channels.items():
        assert isinstance(pixels, np.ndarray)
        np.testing.assert_array_equal(read[name], pixels.astype(np.float32))


def test_attributes_return(tmp_path: Path) -> None:
    chromaticities = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
    attributes = {"owner": "nobody", "gain": 1.5, "chromaticities": chromaticities}
    write_exr(tmp_path / "a.exr", {"R": PIXELS}, attributes)
    read = read_exr(tmp_path / "a.exr").attributes
    assert (read["owner"], read["gain"]) == ("nobody", 1.5)
    assert read["chromaticities"] == pytest.approx(chromaticities)
    assert "channels" not in read


def test_existing_file_is_replaced_only_when_told(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    write_exr(path, {"R": PIXELS}, {})
    with pytest.raises(InputError, match="--force"):
        write_exr(path, {"R": PIXELS}, {}, force=False)
    with pytest.raises(ValueError, match="of one shape"):
        write_exr(path, {"R": PIXELS, "G": PIXELS.T}, {})
    np.testing.assert_array_equal(read_exr(path).channels["R"], PIXELS)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["NO", "RLE", "ZIPS", "ZIP", "PIZ"])
def test_lossless_compressions_of_other_programs_are_read(tmp_path: Path, name: str) -> None:
    compression = getattr(OpenEXR, f"{name}_COMPRESSION")
    path = foreign(tmp_path / "a.exr", {"R": PIXELS}, compression=compression)
    np.testing.assert_array_equal(read_exr(path).channels["R"], PIXELS)


def test_tiles_and_half_and_integer_channels_are_read(tmp_path: Path) -> None:
    half, integer = PIXELS.astype(np.float16), (PIXELS * 100).astype(np.uint32)
    path = foreign(
        tmp_path / "a.exr",
        {"R": half, "id": integer},
        type=OpenEXR.tiledimage,
        tiles=OpenEXR.TileDescription(),
    )
    read = read_exr(path).channels
    np.testing.assert_array_equal(read["R"], half.astype(np.float32))
    np.testing.assert_array_equal(read["id"], integer.astype(np.float32))


def test_overscan_is_cut_off(tmp_path: Path) -> None:
    # Data window (-2, -1)..(17, 10); the picture is (0, 0)..(9, 4): rows 1..5, columns 2..11.
    path = foreign(
        tmp_path / "a.exr",
        {"R": PIXELS},
        dataWindow=window(-2, -1, 17, 10),
        displayWindow=window(0, 0, 9, 4),
    )
    np.testing.assert_array_equal(read_exr(path).channels["R"], PIXELS[1:6, 2:12])


def test_picture_with_missing_pixels_is_refused(tmp_path: Path) -> None:
    path = foreign(
        tmp_path / "a.exr",
        {"R": PIXELS},
        dataWindow=window(5, 5, 24, 16),
        displayWindow=window(0, 0, 39, 23),
    )
    with pytest.raises(InputError, match=r"20×12 px, which do not cover .* 40×24"):
        read_exr(path)


def test_subsampled_channel_is_refused(tmp_path: Path) -> None:
    path = foreign(tmp_path / "a.exr", {"BY": PIXELS, "Y": PIXELS})
    at = path.read_bytes().index(b"BY\0") + 3 + 8  # behind its name, pixel type and flags
    content = path.read_bytes()
    path.write_bytes(content[:at] + struct.pack("<II", 2, 2) + content[at + 8 :])
    with pytest.raises(InputError, match="channel 'BY' is subsampled"):
        read_exr(path)


def test_file_of_several_parts_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    parts = [
        OpenEXR.Part({"type": OpenEXR.scanlineimage}, {"R": PIXELS.copy()}, name)
        for name in ("left", "right")
    ]
    with OpenEXR.File(parts) as file:
        file.write(str(path))
    with pytest.raises(InputError, match="several parts"):
        read_exr(path)


def test_a_tile_larger_than_any_picture_takes_no_memory(tmp_path: Path) -> None:
    """Of 628 bytes, one took the library seconds and gigabytes before it gave up."""
    path = tmp_path / "a.exr"
    header = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    with OpenEXR.File(header, {"Y": np.ones((40, 70), np.float32)}) as file:
        file.write(str(path))
    data = bytearray(path.read_bytes())
    height = data.index(b"tiledesc\0") + len(b"tiledesc\0") + 4 + 4
    data[height : height + 4] = (1 << 24).to_bytes(4, "little")
    path.write_bytes(data)
    with pytest.raises(UnreadableFrame, match="tiles of 32×16777216 px"):
        read_exr(path)


@pytest.mark.parametrize("kind", ["scan lines", "tiles"])
def test_no_part_of_a_file_is_a_picture_and_nothing_else_is_printed(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], kind: str
) -> None:
    header: dict[str, Any] = {}
    if kind == "tiles":
        header = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    path = foreign(tmp_path / "a.exr", {"R": RNG.random((70, 90)).astype(np.float32)}, **header)
    content = path.read_bytes()
    for length in [*range(0, 400, 3), *range(400, len(content), 401), len(content) - 1]:
        path.write_bytes(content[:length])
        with pytest.raises(UnreadableFrame, match=r"truncated|empty|not an OpenEXR"):
            read_exr(path)
    assert capfd.readouterr() == ("", "")


def test_interrupted_file_without_all_its_offsets_is_truncated(tmp_path: Path) -> None:
    # A program that is killed leaves zeros where the offsets of later chunks belong.
    path = foreign(tmp_path / "a.exr", {"R": np.ones((40, 20), np.float32)})
    content = path.read_bytes()
    header_end = content.index(b"type\0string\0\x0d\0\0\0scanlineimage") + 29
    assert content[header_end] == 0
    second = header_end + 1 + 8
    path.write_bytes(content[:second] + bytes(16) + content[second + 16 :])
    with pytest.raises(UnreadableFrame, match="truncated"):
        read_exr(path)


def test_forged_size_is_refused_before_memory_is_taken(tmp_path: Path) -> None:
    path = foreign(tmp_path / "a.exr", {"R": PIXELS})
    content = path.read_bytes()
    for size in (2**27, 200_000):
        corner = np.array([0, 0, size - 1, 1023], "<i4").tobytes()
        forged = content.replace(np.array([0, 0, 19, 11], "<i4").tobytes(), corner)
        path.write_bytes(forged)
        with pytest.raises(UnreadableFrame, match=f"{size}×1024 px"):
            read_exr(path)
    # In a process of its own, whose memory is told apart from everything that ran before it.
    program = (
        "import resource, sys\n"
        "from pathlib import Path\n"
        "from capture.exr import read_exr\n"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "try: read_exr(Path(sys.argv[1]))\n"
        "except ValueError: pass\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)"
    )
    root = Path(__file__).resolve().parents[2]
    ran = subprocess.run(
        [sys.executable, "-c", program, str(path)], capture_output=True, check=True, cwd=root
    )
    assert int(ran.stdout) < 50_000  # KiB


def test_a_table_of_millions_of_offsets_is_refused_soon(tmp_path: Path) -> None:
    path = foreign(tmp_path / "a.exr", {"R": PIXELS})
    content = path.read_bytes()
    table = content.index(b"type\0string\0\x0d\0\0\0scanlineimage") + 30
    count = 2**21
    end = table + 8 * count
    path.write_bytes(content[:table] + struct.pack("<Q", end) * count + struct.pack("<II", 0, 99))
    start_s = time.thread_time()
    with pytest.raises(UnreadableFrame, match="truncated"):
        read_exr(path)
    assert time.thread_time() - start_s < 1


@pytest.mark.parametrize("content", [b"", b"A text.", b"\x76\x2f\x31\x01"])
def test_what_is_no_exr_file_is_named(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.exr"
    path.write_bytes(content)
    with pytest.raises(UnreadableFrame, match=r"a\.exr: "):
        read_exr(path)
    with pytest.raises(InputError, match="no such file"):
        read_exr(tmp_path / "b.exr")


@pytest.mark.data
def test_files_of_other_programs_are_read() -> None:
    paths = sorted(DATA.glob("env-*/*.exr"))
    if not paths:
        pytest.skip(f"no EXR files in {DATA}")
    for path in paths:
        assert set("RGB") <= read_exr(path).channels.keys(), path
