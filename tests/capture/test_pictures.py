"""Camera pictures: whole and as stored, or not at all. Pillow is the independent codec."""

import io
import struct
import time
import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from capture.errors import InputError, UnreadableFrame
from capture.pictures import picture_size, read_picture, write_jpeg, write_png

RNG = np.random.default_rng(7)
COLOURS = RNG.integers(0, 256, (20, 30, 3), dtype=np.uint8)
COLOURS_16 = RNG.integers(0, 65536, (20, 30, 3), dtype=np.uint16)


def smooth(height: int = 64, width: int = 96) -> np.ndarray:
    """Return a picture that JPEG keeps well."""
    y, x = np.mgrid[0:height, 0:width]
    return np.stack([2 * x, 3 * y, 255 - x - y], axis=-1).astype(np.uint8)


def encoded(picture: np.ndarray, file_format: str, mode: str = "RGB", **options: Any) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(picture).convert(mode).save(buffer, file_format, **options)
    return buffer.getvalue()


def read_bytes_as(path: Path, content: bytes) -> np.ndarray:
    path.write_bytes(content)
    return read_picture(path)


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "P", "1", "LA"])
def test_png_of_any_kind_holds_what_pillow_reads(tmp_path: Path, mode: str) -> None:
    content = encoded(COLOURS, "PNG", mode)
    expected = np.asarray(Image.open(io.BytesIO(content)).convert("RGB"))
    np.testing.assert_array_equal(read_bytes_as(tmp_path / "a.png", content), expected)


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA"])
@pytest.mark.parametrize("compression", [None, "tiff_lzw", "tiff_adobe_deflate"])
def test_tiff_of_any_kind_holds_what_pillow_reads(
    tmp_path: Path, mode: str, compression: str | None
) -> None:
    content = encoded(COLOURS, "TIFF", mode, compression=compression)
    expected = np.asarray(Image.open(io.BytesIO(content)).convert("RGB"))
    np.testing.assert_array_equal(read_bytes_as(tmp_path / "a.tif", content), expected)


@pytest.mark.parametrize("options", [{}, {"progressive": True}, {"restart_marker_blocks": 2}])
@pytest.mark.parametrize("mode", ["L", "RGB"])
def test_jpeg_holds_what_pillow_reads(tmp_path: Path, mode: str, options: dict[str, Any]) -> None:
    content = encoded(smooth(), "JPEG", mode, **options)
    expected = np.asarray(Image.open(io.BytesIO(content)).convert("RGB"))
    read = read_bytes_as(tmp_path / "a.jpg", content)
    # Two builds of one decoder; they may round the colour transform differently.
    assert np.abs(read.astype(int) - expected).max() <= 1


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_sixteen_bits_are_kept_in_rgb_order(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(cv2.imencode(suffix, COLOURS_16[..., ::-1].copy())[1].tobytes())
    read = read_picture(path)
    assert read.dtype == np.uint16
    np.testing.assert_array_equal(read, COLOURS_16)


def test_grey_of_sixteen_bits_is_repeated(tmp_path: Path) -> None:
    grey = COLOURS_16[..., 0].copy()
    for file_format, suffix in (("PNG", ".png"), ("TIFF", ".tif")):
        path = tmp_path / f"a{suffix}"
        Image.fromarray(grey).save(path, file_format)
        np.testing.assert_array_equal(read_picture(path), np.repeat(grey[..., None], 3, axis=2))


pictures = st.sampled_from([np.uint8, np.uint16]).flatmap(
    lambda dtype: hnp.arrays(dtype, hnp.array_shapes(min_dims=2, max_dims=2, max_side=9).map(
        lambda shape: (*shape, 3)
    ))
)  # fmt: skip


@settings(max_examples=40, deadline=None)
@given(picture=pictures)
def test_png_written_is_read_unchanged(
    tmp_path_factory: pytest.TempPathFactory, picture: np.ndarray
) -> None:
    path = tmp_path_factory.getbasetemp() / "round.png"
    write_png(path, picture)
    read = read_picture(path)
    assert read.dtype == picture.dtype
    np.testing.assert_array_equal(read, picture)
    assert picture_size(path) == picture.shape[1::-1]


def test_png_with_alpha_is_what_pillow_reads(tmp_path: Path) -> None:
    picture = RNG.integers(0, 256, (5, 7, 4), dtype=np.uint8)
    write_png(tmp_path / "a.png", picture)
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "a.png")), picture)


def test_jpeg_keeps_colour_at_full_resolution(tmp_path: Path) -> None:
    # Columns of red and blue, one pixel wide: halved colour resolution would mix them to purple.
    picture = np.zeros((16, 16, 3), np.uint8)
    picture[:, ::2, 0] = 200
    picture[:, 1::2, 2] = 200
    write_jpeg(tmp_path / "a.jpg", picture, 95)
    assert np.abs(read_picture(tmp_path / "a.jpg").astype(int) - picture).max() < 40


def test_writers_replace_only_when_told(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    write_png(path, COLOURS)
    with pytest.raises(InputError, match="--force"):
        write_png(path, COLOURS, force=False)
    with pytest.raises(InputError, match="--force"):
        write_jpeg(path, COLOURS, 90, force=False)
    np.testing.assert_array_equal(read_picture(path), COLOURS)


@pytest.mark.parametrize("picture", [COLOURS[..., 0], COLOURS.astype(np.float32), COLOURS[..., :2]])
def test_writers_refuse_what_is_not_a_picture(tmp_path: Path, picture: np.ndarray) -> None:
    for write in (write_png, write_jpeg):
        with pytest.raises(ValueError, match=r"\(H, W, 3\)|uint8"):
            write(tmp_path / "a.png", picture)
    assert not list(tmp_path.iterdir())


# ---- pixels as stored ----


@pytest.mark.parametrize("orientation", range(1, 9))
def test_orientation_is_not_applied(tmp_path: Path, orientation: int) -> None:
    exif = Image.Exif()
    exif[274] = orientation
    upright = read_bytes_as(tmp_path / "a.jpg", encoded(smooth(), "JPEG"))
    tagged = read_bytes_as(tmp_path / "b.jpg", encoded(smooth(), "JPEG", exif=exif))
    np.testing.assert_array_equal(tagged, upright)
    png = read_bytes_as(tmp_path / "b.png", encoded(COLOURS, "PNG", exif=exif))
    np.testing.assert_array_equal(png, COLOURS)


def test_turned_tiff_is_refused_because_its_decoder_turns_it(tmp_path: Path) -> None:
    with pytest.raises(UnreadableFrame, match="orientation tag"):
        read_bytes_as(tmp_path / "a.tif", encoded(COLOURS, "TIFF", tiffinfo={274: 3}))


def test_transparent_picture_is_refused_and_an_opaque_one_read(tmp_path: Path) -> None:
    picture = np.dstack([COLOURS, np.full(COLOURS.shape[:2], 255, np.uint8)])
    write_png(tmp_path / "a.png", picture)
    np.testing.assert_array_equal(read_picture(tmp_path / "a.png"), COLOURS)
    picture[3, 4, 3] = 254
    write_png(tmp_path / "a.png", picture)
    with pytest.raises(InputError, match="transparent"):
        read_picture(tmp_path / "a.png")


def test_colour_that_means_transparent_is_refused_where_it_occurs(tmp_path: Path) -> None:
    red, green, blue = COLOURS[3, 4].tolist()
    with pytest.raises(InputError, match="transparent"):
        read_bytes_as(tmp_path / "a.png", encoded(COLOURS, "PNG", transparency=(red, green, blue)))


# ---- whole or not at all ----

FORMATS = {
    "jpeg": encoded(smooth(), "JPEG"),
    "progressive jpeg": encoded(smooth(), "JPEG", progressive=True),
    "png": encoded(COLOURS, "PNG"),
    "tiff": encoded(COLOURS, "TIFF"),
    "lzw tiff": encoded(COLOURS, "TIFF", compression="tiff_lzw"),
    "tiff of opencv": cv2.imencode(".tif", COLOURS_16)[1].tobytes(),
}


@pytest.mark.parametrize("name", FORMATS)
def test_no_part_of_a_file_is_a_picture(tmp_path: Path, name: str) -> None:
    content = FORMATS[name]
    path = tmp_path / "part"
    read_bytes_as(path, content)
    for length in [*range(min(len(content), 300)), *range(300, len(content), 37), len(content) - 1]:
        path.write_bytes(content[:length])
        for read in (read_picture, picture_size):
            with pytest.raises(UnreadableFrame, match=r"truncated|empty|not a JPEG|damaged"):
                read(path)


def test_end_marker_of_a_preview_does_not_complete_a_cut_picture(tmp_path: Path) -> None:
    preview = encoded(smooth(8, 8), "JPEG")
    whole = encoded(smooth(), "JPEG")
    segment = b"\xff\xe2" + struct.pack(">H", len(preview) + 2) + preview
    content = whole[:2] + segment + whole[2:]
    assert picture_size_of(tmp_path, content) == (96, 64)
    with pytest.raises(UnreadableFrame, match="truncated"):
        picture_size_of(tmp_path, content[:-100])


def test_bytes_after_the_picture_are_legal(tmp_path: Path) -> None:
    # Multi-picture files of phones and cameras carry more pictures behind the first.
    whole = encoded(smooth(), "JPEG")
    read = read_bytes_as(tmp_path / "a.jpg", whole + encoded(smooth(8, 8), "JPEG") + b"vendor")
    np.testing.assert_array_equal(read, read_bytes_as(tmp_path / "b.jpg", whole))


def picture_size_of(folder: Path, content: bytes) -> tuple[int, int]:
    path = folder / "some.picture"
    path.write_bytes(content)
    return picture_size(path)


def forged_png(width: int, height: int) -> bytes:
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(bytes(1000))), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )


def forged_jpeg(width: int, height: int) -> bytes:
    content = encoded(smooth(), "JPEG")
    at = content.index(b"\xff\xc0") + 5
    return content[:at] + struct.pack(">HH", height, width) + content[at + 4 :]


def forged_tiff(width: int, height: int) -> bytes:
    content = cv2.imencode(".tif", np.zeros((20, 30, 3), np.uint8))[1].tobytes()
    for tag, old, new in ((256, 30, width), (257, 20, height)):
        for kind, letter in ((3, "H"), (4, "I")):
            entry = struct.pack("<HHI" + letter, tag, kind, 1, old)
            if entry in content:
                start = content.index(entry)
                entry = struct.pack("<HHII", tag, 4, 1, new)
                content = content[:start] + entry + content[start + 12 :]
    return content


@pytest.mark.parametrize("forge", [forged_png, forged_jpeg, forged_tiff])
def test_picture_bomb_is_refused_before_it_is_decoded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forge: Any
) -> None:
    assert picture_size_of(tmp_path, forge(16384, 8192)) == (16384, 8192)  # 2^27, the limit
    path = tmp_path / "bomb"
    path.write_bytes(forge(16384, 8193))
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("the pixels were decoded"))
    for read in (read_picture, picture_size):
        with pytest.raises(UnreadableFrame, match="16384×8193 px"):
            read(path)


PNG_CHUNK = struct.pack(">I4sI", 0, b"teSt", 0)
JPEG_SCAN = b"\xff\xda\x00\x02"
TIFF_TAGS = b"".join(struct.pack("<HHII", tag, 3, 2**21, 8) for tag in (258, 273))


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"\xff\xd8\xff" + b"\xff" * 2**21 + b"\xd9", "parts"),
        (b"\xff\xd8" + JPEG_SCAN * 101 + b"\xff\xd9", "100 scans"),
        (b"\x89PNG\r\n\x1a\n" + PNG_CHUNK * (2**20 + 1), "parts"),
        (struct.pack("<2sHIH", b"II", 42, 8, 2) + TIFF_TAGS + bytes(2**22), "parts"),
    ],
    ids=["fill bytes", "scans", "chunks", "strips"],
)
def test_a_file_of_more_parts_than_a_picture_has_is_refused_soon(
    tmp_path: Path, content: bytes, told: str
) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(content)
    start_s = time.thread_time()
    with pytest.raises(UnreadableFrame, match=rf"more than .*{told}"):
        read_picture(path)
    assert time.thread_time() - start_s < 1


def test_decoder_that_disagrees_with_the_header_is_not_believed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cv2, "imdecode", lambda *_: COLOURS[:, :-1])
    with pytest.raises(UnreadableFrame, match="cannot be decoded"):
        read_bytes_as(tmp_path / "a.png", FORMATS["png"])


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "empty"),
        (b"Not a picture, but a text.\n", "not a JPEG, PNG or TIFF"),
        (encoded(COLOURS, "GIF"), "not a JPEG, PNG or TIFF"),
        (encoded(COLOURS, "JPEG", "CMYK"), "4 components"),
        (encoded(COLOURS, "TIFF", "CMYK"), "photometric type 5"),
        (encoded(COLOURS, "TIFF", "P"), "photometric type 3"),
        (encoded(COLOURS, "TIFF", "F"), "32"),
        (forged_png(0, 5), "0×5 px"),
        (forged_png(40, 40), "damaged PNG"),  # fewer pixels in it than it says
    ],
)
def test_what_is_no_camera_picture_is_refused_with_the_reason(
    tmp_path: Path, content: bytes, reason: str
) -> None:
    path = tmp_path / "a.png"
    with pytest.raises(UnreadableFrame, match=reason) as caught:
        read_bytes_as(path, content)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_file_and_folder_are_named(tmp_path: Path) -> None:
    for read in (read_picture, picture_size):
        with pytest.raises(InputError, match=r"nothing\.png: no such file"):
            read(tmp_path / "nothing.png")
        with pytest.raises(InputError, match="not a file"):
            read(tmp_path)
