"""Radiance .hdr: every encoding, orientation and header variable; OpenCV is the second reader."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from capture.errors import InputError, UnreadableFrame
from capture.primaries import REC709, rgb_to_xyz
from capture.radiance_hdr import decode_scanlines, read_radiance_hdr, write_radiance_hdr

DATA = Path(__file__).resolve().parents[2].parent / "shared/data"
RNG = np.random.default_rng(5)

# Mantissas 128 at exponent 129 mean 128 · 2^(129 − 136) = 1; a step of the mantissa is 2^-7.
STEP = 2.0**-7


def rgbe_of(height: int, width: int) -> np.ndarray:
    """Return random pixels whose values are mantissa × STEP."""
    rgbe = RNG.integers(0, 256, (height, width, 4)).astype(np.uint8)
    rgbe[..., 0] |= 128
    rgbe[..., 3] = 129
    return rgbe


def hdr(
    pixels: bytes, resolution: str, lines: str = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n"
) -> bytes:
    return f"{lines}\n{resolution}\n".encode() + pixels


def read(folder: Path, content: bytes) -> np.ndarray:
    path = folder / "a.hdr"
    path.write_bytes(content)
    return read_radiance_hdr(path)[0]


def runs_by_channel(line: np.ndarray) -> bytes:
    """Encode a scan line, (W, 4), as Radiance does: greedy runs of 3 and more, else literals."""
    width = len(line)
    out = bytearray((2, 2, width >> 8, width & 255))
    for channel in line.T:
        literals: list[int] = []
        column = 0
        while column < width:
            run = 1
            while run < 127 and column + run < width and channel[column + run] == channel[column]:
                run += 1
            if run >= 3:
                out += bytes([len(literals), *literals]) if literals else b""
                literals = []
                out += bytes([128 + run, channel[column]])
                column += run
                continue
            literals.append(int(channel[column]))
            column += 1
            if len(literals) == 128:
                out += bytes([128, *literals])
                literals = []
        out += bytes([len(literals), *literals]) if literals else b""
    return bytes(out)


def repeats(line: np.ndarray) -> bytes:
    """Encode a scan line in the old way: a pixel, then 1 1 1 n for n more of it."""
    out = bytearray()
    column = 0
    while column < len(line):
        run = 1
        while column + run < len(line) and np.array_equal(line[column + run], line[column]):
            run += 1
        out += bytes(line[column])
        more = run - 1
        while more:
            out += bytes([1, 1, 1, more & 255])
            more >>= 8
        column += run
    return bytes(out)


@pytest.mark.parametrize("encode", [runs_by_channel, repeats, np.ndarray.tobytes])
def test_every_encoding_gives_the_same_pixels(tmp_path: Path, encode: object) -> None:
    rgbe = rgbe_of(5, 700)
    rgbe[1] = rgbe[1, 0]  # 699 repeats: two digits in the old encoding, six runs in the new
    rgbe[2, 100:400, 1] = 7
    rgbe[3, ::2, 3] = 0  # black, whatever the mantissas
    content = hdr(b"".join(map(encode, rgbe)), "-Y 5 +X 700")  # type: ignore[arg-type]
    expected = rgbe[..., :3] * np.float32(STEP) * (rgbe[..., 3:] > 0)
    np.testing.assert_array_equal(read(tmp_path, content), expected)


def test_encodings_may_change_from_line_to_line(tmp_path: Path) -> None:
    rgbe = rgbe_of(3, 20)
    content = hdr(
        runs_by_channel(rgbe[0]) + repeats(rgbe[1]) + runs_by_channel(rgbe[2]), "-Y 3 +X 20"
    )
    np.testing.assert_array_equal(read(tmp_path, content), rgbe[..., :3] * np.float32(STEP))


def test_decoder_agrees_with_plain_python() -> None:
    rgbe = rgbe_of(4, 50)
    rgbe[:, 10:30, 2] = 9
    data = np.frombuffer(b"".join(map(runs_by_channel, rgbe)), np.uint8)
    for decode in (decode_scanlines, decode_scanlines.py_func):
        decoded = np.zeros_like(rgbe)
        assert decode(data, 0, decoded) == 4
        np.testing.assert_array_equal(decoded, rgbe)
        assert decode(data[:-1], 0, decoded) == 3


# The picture, rows from the top: 1 2 3 / 4 5 6. Each string names the order its values come in.
@pytest.mark.parametrize(
    ("resolution", "stored"),
    [
        ("-Y 2 +X 3", "123456"),
        ("-Y 2 -X 3", "321654"),
        ("+Y 2 +X 3", "456123"),
        ("+Y 2 -X 3", "654321"),
        ("+X 3 -Y 2", "142536"),
        ("-X 3 -Y 2", "362514"),
        ("+X 3 +Y 2", "415263"),
        ("-X 3 +Y 2", "635241"),
    ],
)
def test_orientation_is_undone(tmp_path: Path, resolution: str, stored: str) -> None:
    pixels = b"".join(bytes([128 + int(value), 0, 0, 129]) for value in stored)
    red = read(tmp_path, hdr(pixels, resolution))[..., 0] / STEP - 128
    np.testing.assert_array_equal(red, [[1, 2, 3], [4, 5, 6]])


ONE = bytes([128, 128, 128, 129])  # RGB (1, 1, 1)


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("#?RADIANCE\n", (1, 1, 1)),
        ("#?RGBE\nFORMAT=32-bit_rle_rgbe\n", (1, 1, 1)),
        ("VIEW= -vtv -vh 90\n#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n", (1, 1, 1)),
        ("#?RADIANCE\r\nFORMAT=32-bit_rle_rgbe\r\n", (1, 1, 1)),
        ("#?RADIANCE\nEXPOSURE=4\n", (0.25, 0.25, 0.25)),
        ("#?RADIANCE\nEXPOSURE= 4\npfilt -e 2\nEXPOSURE=0.5\n", (0.5, 0.5, 0.5)),
        ("#?RADIANCE\nCOLORCORR=2 1 0.5\nEXPOSURE=2\n", (0.25, 0.5, 1)),
        ("#?RADIANCE\n# EXPOSURE=9\n", (1, 1, 1)),
    ],
)
def test_header_is_honoured(tmp_path: Path, lines: str, expected: tuple[float, ...]) -> None:
    np.testing.assert_allclose(read(tmp_path, hdr(ONE, "-Y 1 +X 1", lines))[0, 0], expected)


def test_xyz_becomes_rec709(tmp_path: Path) -> None:
    # X = Y = Z = 1 is the equal-energy white, whose Rec.709 values follow from the primaries.
    content = hdr(ONE, "-Y 1 +X 1", "#?RADIANCE\nFORMAT=32-bit_rle_xyze\n")
    expected = np.linalg.solve(rgb_to_xyz(REC709), np.ones(3))
    np.testing.assert_allclose(read(tmp_path, content)[0, 0], expected, rtol=1e-6)


def test_variables_are_returned(tmp_path: Path) -> None:
    path = tmp_path / "a.hdr"
    path.write_bytes(hdr(ONE, "-Y 1 +X 1", "#?RADIANCE\nVIEW= -vta -vh 180\nOWNER=x=y\n"))
    header = read_radiance_hdr(path)[1]
    assert header == {"VIEW": "-vta -vh 180", "OWNER": "x=y", "FORMAT": "32-bit_rle_rgbe"}


radiances = hnp.array_shapes(min_dims=2, max_dims=2, max_side=20).flatmap(
    lambda shape: hnp.arrays(np.float32, (*shape, 3), elements=st.floats(0, 2.0**100, width=32))
)


@settings(max_examples=60, deadline=None)
@given(rgb=radiances)
def test_written_value_returns_within_half_a_step(
    tmp_path_factory: pytest.TempPathFactory, rgb: np.ndarray
) -> None:
    path = tmp_path_factory.getbasetemp() / "round.hdr"
    write_radiance_hdr(path, rgb)
    back = read_radiance_hdr(path)[0]
    # The largest channel lies in [128, 256) steps, so half a step is at most 1/256 of it; below
    # 2^-128 the format has no exponent left.
    largest = rgb.max(axis=-1, keepdims=True).astype(np.float64)
    assert np.all(np.abs(back - rgb.astype(np.float64)) <= np.maximum(largest / 256, 2.0**-127))
    write_radiance_hdr(path, back)
    np.testing.assert_array_equal(read_radiance_hdr(path)[0], back)


def test_rounding_is_unbiased_and_opencv_reads_the_same(tmp_path: Path) -> None:
    path = tmp_path / "a.hdr"
    rgb = RNG.uniform(0.5, 1, (64, 128, 3)).astype(np.float32)
    write_radiance_hdr(path, rgb)
    back = read_radiance_hdr(path)[0]
    # The error is uniform within ±2^-9: its mean over 24576 values has σ = 2^-8/√(12·24576).
    sigma = 2.0**-8 / np.sqrt(12 * rgb.size)
    assert abs((back - rgb).mean(dtype=np.float64)) < 5 * sigma
    np.testing.assert_array_equal(cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1], back)


@pytest.mark.parametrize("value", [-1e-9, np.nan, np.inf, 2.0**127])
def test_writer_refuses_what_the_format_cannot_hold(tmp_path: Path, value: float) -> None:
    rgb = np.ones((2, 2, 3), np.float32)
    rgb[1, 0, 2] = value
    with pytest.raises(InputError, match=r"a\.hdr: .* finite numbers from 0 to 2\^126.*\.exr"):
        write_radiance_hdr(tmp_path / "a.hdr", rgb)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("encode", [runs_by_channel, repeats])
def test_no_part_of_a_file_is_a_picture(tmp_path: Path, encode: object) -> None:
    rgbe = rgbe_of(3, 12)
    rgbe[1] = rgbe[1, 0]
    content = hdr(b"".join(map(encode, rgbe)), "-Y 3 +X 12")  # type: ignore[arg-type]
    read(tmp_path, content)
    for length in range(len(content)):
        with pytest.raises(UnreadableFrame, match=r"truncated|not a Radiance|empty"):
            read(tmp_path, content[:length])


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"A text.\n\nOf two paragraphs.\n", "not a Radiance picture"),
        (hdr(ONE, "-Y 1 +X 1", "#?RADIANCE\nFORMAT=ascii\n"), "FORMAT 'ascii'"),
        (hdr(ONE, "-Y 1 +X 1", "#?RADIANCE\nEXPOSURE=0\n"), "EXPOSURE '0'"),
        (hdr(ONE, "-Y 1 +X 1", "#?RADIANCE\nEXPOSURE=nan\n"), "EXPOSURE 'nan'"),
        (hdr(ONE, "-Y 1 +X 1", "#?RADIANCE\nEXPOSURE=1e300\n"), "EXPOSURE '1e300'"),
        (hdr(ONE, "-Y 1 +X 1", "#?RADIANCE\n" + 2 * "EXPOSURE=1e-20\n"), "together come to"),
        (hdr(ONE, "-Y 1 +X 1", "#?RADIANCE\nCOLORCORR=1 2\n"), "COLORCORR '1 2'"),
        (hdr(ONE, "-Y 0 +X 1"), "1×0 px"),
        (hdr(ONE, "-Y 1 +Y 1"), "no line like"),
        (hdr(ONE, "-Y 100000 +X 200000"), "200000×100000 px"),
        (hdr(ONE, "-Y 8192 +X 16384"), "fewer bytes than scan lines"),
        (hdr(bytes([1, 1, 1, 5]), "-Y 1 +X 5"), "0 of 1 scan lines"),  # repeats nothing
        (hdr(ONE + bytes([1, 1, 1, 5]), "-Y 1 +X 5"), "0 of 1 scan lines"),  # one too many
        (hdr(bytes([2, 2, 0, 9]) + bytes(60), "-Y 1 +X 8"), "0 of 1 scan lines"),  # other width
        (hdr(bytes([2, 2, 0, 8]) + bytes(60), "-Y 1 +X 8"), "0 of 1 scan lines"),  # nothing
        (hdr(bytes([2, 2, 0, 8, 137, 1] * 9), "-Y 1 +X 8"), "0 of 1 scan lines"),  # run of 9
        (hdr(ONE, "-Y 9 +X 9").replace(b"\n", b"\r\n"), "line ends were converted"),
    ],
)
def test_damaged_file_is_refused_with_the_reason(
    tmp_path: Path, content: bytes, reason: str
) -> None:
    with pytest.raises(UnreadableFrame, match=reason) as caught:
        read(tmp_path, content)
    assert str(tmp_path / "a.hdr") in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_radiance_hdr(tmp_path / "a.hdr")


@pytest.mark.data
def test_opencv_reads_the_same_from_real_files() -> None:
    paths = sorted(DATA.glob("env-*/*.hdr"))
    if not paths:
        pytest.skip(f"no .hdr files in {DATA}")
    for path in paths:  # none has an EXPOSURE, which OpenCV passes over
        expected = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1]
        np.testing.assert_array_equal(read_radiance_hdr(path)[0], expected)
