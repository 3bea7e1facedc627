"""Pixel formats against closed forms, against OpenCV, and against themselves in other packings."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from capture.errors import UnreadableFrame
from capture.sensor import Sensor
from capture.v4l2.formats import PictureFormat
from capture.v4l2.pixel_formats import (
    PIXEL_FORMATS,
    brightest_sample,
    decode,
    exposure_samples,
    pixel_sensor,
)

WIDTH, HEIGHT = 48, 32
RANDOM = np.random.default_rng(7)
FULL, LIMITED = 1, 2
REC709, JPEG, SRGB, RAW = 3, 7, 8, 11

BYTES_PER_PIXEL = {"YUYV": 2, "UYVY": 2, "NV12": 1, "RGB3": 3, "BGR3": 3, "GREY": 1}
PACKED_10 = {"pBAA": "BG10", "pGAA": "GB10", "pgAA": "BA10", "pRAA": "RG10"}
PACKED_12 = {"pBCC": "BG12", "pGCC": "GB12", "pgCC": "BA12", "pRCC": "RG12"}
ORDERS = {"RG12": "RGGB", "BA12": "GRBG", "GB12": "GBRG", "BG12": "BGGR"}


def picture(fourcc: str, bytes_per_pixel: float = 2, padding: int = 0, **colour: int):
    return PictureFormat(fourcc, (WIDTH, HEIGHT), int(WIDTH * bytes_per_pixel) + padding, **colour)


def counts_of(data: bytes, of: PictureFormat) -> NDArray[np.generic]:
    return decode(data, of, pixel_sensor(of, brightest_sample(data, of)))


def video_bytes(count: int) -> bytes:
    """Return bytes of 16 and more: darker luma than black OpenCV takes for black."""
    return RANDOM.integers(16, 256, count, np.uint8).tobytes()


def one_colour(fourcc: str, yuv: tuple[int, int, int]) -> bytes:
    y, u, v = yuv
    if fourcc == "NV12":
        return bytes([y]) * (WIDTH * HEIGHT) + bytes([u, v]) * (WIDTH * HEIGHT // 4)
    pair = {"YUYV": [y, u, y, v], "UYVY": [u, y, v, y]}[fourcc]
    return bytes(pair) * (WIDTH * HEIGHT // 2)


@pytest.mark.parametrize("fourcc", ["YUYV", "UYVY", "NV12"])
@pytest.mark.parametrize(
    ("colour", "yuv", "rgb"),
    [
        # BT.601, 16 … 235: white, black, and full red: Y = 16 + 219 × 0.299 = 81.5,
        # Cb = 128 − 112 × 0.299 / 0.886 = 90.2, Cr = 128 + 112
        ({"colorspace": SRGB}, (235, 128, 128), (255, 255, 255)),
        ({"colorspace": SRGB}, (16, 128, 128), (0, 0, 0)),
        ({"colorspace": SRGB}, (81, 90, 240), (254, 0, 0)),
        # BT.709: red has Y = 16 + 219 × 0.2126 = 62.6, Cb = 128 − 112 × 0.2126 / 0.9278 = 102.3
        ({"colorspace": REC709}, (63, 102, 240), (255, 0, 0)),
        ({"ycbcr_enc": 2}, (63, 102, 240), (255, 0, 0)),
        # Full range: grey stays as it is; the JPEG colour space implies it
        ({"quantization": FULL}, (235, 128, 128), (235, 235, 235)),
        ({"colorspace": JPEG}, (16, 128, 128), (16, 16, 16)),
        ({"colorspace": JPEG, "quantization": LIMITED}, (16, 128, 128), (0, 0, 0)),
    ],
)
def test_yuv_is_read_by_the_matrix_and_range_that_the_driver_names(
    fourcc: str, colour: dict[str, int], yuv: tuple[int, int, int], rgb: tuple[int, int, int]
) -> None:
    of = picture(fourcc, BYTES_PER_PIXEL[fourcc], **colour)
    counts = counts_of(one_colour(fourcc, yuv), of)
    assert counts.shape == (HEIGHT, WIDTH, 3)
    np.testing.assert_allclose(counts.astype(int), np.broadcast_to(rgb, counts.shape), atol=1)


def test_yuyv_agrees_with_opencv_where_it_reads_the_same_matrix() -> None:
    of = picture("YUYV", colorspace=SRGB)
    data = video_bytes(2 * WIDTH * HEIGHT)
    pairs = np.frombuffer(data, np.uint8).reshape(HEIGHT, WIDTH, 2)
    expected = cv2.cvtColor(pairs, cv2.COLOR_YUV2RGB_YUY2).astype(int)
    np.testing.assert_allclose(counts_of(data, of).astype(int), expected, atol=2)


def test_nv12_agrees_with_opencv() -> None:
    data = video_bytes(WIDTH * HEIGHT * 3 // 2)
    planes = np.frombuffer(data, np.uint8).reshape(HEIGHT * 3 // 2, WIDTH)
    expected = cv2.cvtColor(planes, cv2.COLOR_YUV2RGB_NV12).astype(int)
    counts = counts_of(data, picture("NV12", 1, colorspace=SRGB))
    np.testing.assert_allclose(counts.astype(int), expected, atol=2)


def test_bgr_is_rgb_with_its_bytes_turned() -> None:
    pixels = RANDOM.integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
    assert np.array_equal(counts_of(pixels.tobytes(), picture("RGB3", 3)), pixels)
    assert np.array_equal(counts_of(pixels[..., ::-1].tobytes(), picture("BGR3", 3)), pixels)


@pytest.mark.parametrize(("fourcc", "bits"), [("Y10", 10), ("Y12", 12), ("Y16", 16)])
def test_grey_of_more_bits_is_linear_and_white_at_its_last_count(fourcc: str, bits: int) -> None:
    of = picture(fourcc)
    samples = RANDOM.integers(0, 2**bits, (HEIGHT, WIDTH), np.uint16)
    samples[0, 0] = 2**bits - 1
    counts = counts_of(samples.astype("<u2").tobytes(), of)
    assert np.array_equal(counts, np.repeat(samples[..., None], 3, axis=2))
    sensor = pixel_sensor(of, 2**bits - 1)
    assert (sensor.white_dn, sensor.response) == (2**bits - 1, None)


def test_16_bits_that_are_not_filled_are_white_where_the_brightest_sample_says() -> None:
    samples = np.full((HEIGHT, WIDTH), 900, np.uint16)
    samples[3, 5] = 4095
    data = samples.tobytes()
    of = picture("RG16")
    assert pixel_sensor(of, brightest_sample(data, of)).white_dn == 4095
    with pytest.raises(UnreadableFrame, match="above white, 1023"):
        decode(data, of, pixel_sensor(of, 900))


def test_grey_of_8_bits_is_linear_only_if_the_driver_says_so() -> None:
    assert pixel_sensor(picture("GREY", 1), 0).source == "assumed sRGB"
    assert pixel_sensor(picture("GREY", 1, colorspace=RAW), 0).response is None
    assert pixel_sensor(picture("GREY", 1, xfer_func=5), 0).response is None


@pytest.mark.parametrize("fourcc", ORDERS)
def test_a_mosaic_of_a_plane_of_light_gives_back_the_plane(fourcc: str) -> None:
    """Means of neighbours are exact where light changes evenly; at the border pixels repeat."""
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    colours = {"R": 500 + 8 * columns, "G": 900 + 16 * rows, "B": 1500 - 8 * columns - 8 * rows}
    mosaic = np.empty((HEIGHT, WIDTH), np.uint16)
    for index, name in enumerate(ORDERS[fourcc]):
        phase = np.s_[index // 2 :: 2, index % 2 :: 2]
        mosaic[phase] = colours[name][phase]
    counts = counts_of(mosaic.tobytes(), picture(fourcc))
    expected = np.stack([colours["R"], colours["G"], colours["B"]], axis=-1)
    assert np.array_equal(counts[1:-1, 1:-1], expected[1:-1, 1:-1])


def test_a_count_that_a_full_sample_has_a_share_in_is_white() -> None:
    """The red sample in row 4, column 6 gives its share to the eight pixels around it."""
    mosaic = np.full((HEIGHT, WIDTH), 1000, np.uint16)
    mosaic[4, 6] = 4095
    counts = counts_of(mosaic.tobytes(), picture("RG12"))
    is_white = counts == 4095
    expected = np.zeros_like(is_white)
    expected[3:6, 5:8, 0] = True
    assert np.array_equal(is_white, expected)
    assert np.all(counts[~is_white] == 1000)


@pytest.mark.parametrize("packed", PACKED_10)
def test_ten_bits_packed_are_ten_bits(packed: str) -> None:
    samples = RANDOM.integers(0, 1024, (HEIGHT, WIDTH), np.uint16)
    groups = samples.reshape(HEIGHT, -1, 4)
    low = sum((groups[..., i] & 3) << 2 * i for i in range(4))
    data = np.concatenate([groups >> 2, low[..., None]], axis=2).astype(np.uint8).tobytes()
    assert np.array_equal(
        counts_of(data, picture(packed, 1.25)),
        counts_of(samples.tobytes(), picture(PACKED_10[packed])),
    )


@pytest.mark.parametrize("packed", PACKED_12)
def test_twelve_bits_packed_are_twelve_bits(packed: str) -> None:
    samples = RANDOM.integers(0, 4096, (HEIGHT, WIDTH), np.uint16)
    groups = samples.reshape(HEIGHT, -1, 2)
    low = (groups[..., 0] & 15) | (groups[..., 1] & 15) << 4
    data = np.concatenate([groups >> 4, low[..., None]], axis=2).astype(np.uint8).tobytes()
    assert np.array_equal(
        counts_of(data, picture(packed, 1.5)),
        counts_of(samples.tobytes(), picture(PACKED_12[packed])),
    )


@pytest.mark.parametrize("fourcc", sorted(PIXEL_FORMATS - {"MJPG", "JPEG"}))
def test_padding_is_no_picture_and_a_frame_that_breaks_off_is_unreadable(fourcc: str) -> None:
    size = {**BYTES_PER_PIXEL, **dict.fromkeys(PACKED_10, 1.25), **dict.fromkeys(PACKED_12, 1.5)}
    size |= dict.fromkeys(["BA81", "GBRG", "GRBG", "RGGB"], 1)
    row_bytes = int(WIDTH * size.get(fourcc, 2))
    rows = HEIGHT * 3 // 2 if fourcc == "NV12" else HEIGHT
    # Small bytes: samples of 10 and 12 bits in two must not lie above white.
    plain = RANDOM.integers(0, 3, (rows, row_bytes), np.uint8)
    padded = np.full((rows, row_bytes + 24), 255, np.uint8)
    padded[:, :row_bytes] = plain
    of = PictureFormat(fourcc, (WIDTH, HEIGHT), row_bytes)
    of_padded = PictureFormat(fourcc, (WIDTH, HEIGHT), row_bytes + 24)
    sensor = pixel_sensor(of, 1000)
    expected = decode(plain.tobytes(), of, sensor)
    data = padded.tobytes()[:-24]  # drivers may leave out the last row's padding
    assert np.array_equal(decode(data, of_padded, sensor), expected)
    assert np.array_equal(exposure_samples(data, of_padded), exposure_samples(plain.tobytes(), of))
    with pytest.raises(UnreadableFrame, match="breaks off"):
        decode(data[:-1], of_padded, sensor)


def jpeg(width: int = WIDTH) -> tuple[bytes, NDArray[np.uint8]]:
    smooth = cv2.GaussianBlur(RANDOM.integers(0, 256, (HEIGHT, width, 3), np.uint8), (0, 0), 4)
    encoded = cv2.imencode(".jpg", smooth[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 98])[1]
    return encoded.tobytes(), smooth


def test_mjpg_without_huffman_tables_is_the_same_picture() -> None:
    """Cameras leave out the tables that all of them use (section DHT, marker C4)."""
    data, smooth = jpeg()
    counts = counts_of(data, picture("MJPG", 0))
    np.testing.assert_allclose(counts.astype(int), smooth, atol=12)
    start = data.index(b"\xff\xc4")
    bare = data
    while (start := bare.find(b"\xff\xc4")) >= 0:
        length = int.from_bytes(bare[start + 2 : start + 4], "big")
        bare = bare[:start] + bare[start + 2 + length :]
    assert len(bare) < len(data)
    assert np.array_equal(counts_of(bare, picture("MJPG", 0)), counts)


@pytest.mark.parametrize("read", [counts_of, exposure_samples])
def test_mjpg_that_breaks_off_or_has_another_size_is_unreadable(read) -> None:
    data, _ = jpeg()
    with pytest.raises(UnreadableFrame, match="truncated"):
        read(data[: len(data) // 2], picture("MJPG", 0))
    with pytest.raises(UnreadableFrame, match="64×32, not 48×32"):
        read(jpeg(64)[0], picture("MJPG", 0))
    with pytest.raises(UnreadableFrame, match="not a JPEG"):
        read(b"\0" * 100, picture("MJPG", 0))


@pytest.mark.parametrize("fourcc", ["YUYV", "NV12", "RGB3", "GREY", "RG12", "MJPG"])
def test_samples_are_few_and_follow_the_brightness(fourcc: str) -> None:
    size = (1024, 512)
    of = PictureFormat(fourcc, size, int(1024 * BYTES_PER_PIXEL.get(fourcc, 2)))
    means = []
    for value in (40, 160):
        if fourcc == "MJPG":
            grey = np.full((512, 1024), value, np.uint8)
            data = cv2.imencode(".jpg", grey)[1].tobytes()
        elif fourcc == "YUYV":
            data = bytes([value, 128]) * (1024 * 512)
        elif fourcc == "RG12":
            data = np.full((512, 1024), value, np.uint16).tobytes()
        else:
            data = bytes([value]) * (1024 * 512 * 3)
        samples = exposure_samples(data, of)
        assert 2000 < samples.size < 10000
        assert np.ptp(samples) == 0
        means.append(float(samples[0]))
    # Video luma of 16 … 235 is spread over 0 … 255.
    spread = 255 / 219 if fourcc in ("YUYV", "NV12") else 1.0
    assert means[1] - means[0] == pytest.approx(120 * spread, abs=1)


def test_saturation_of_a_mosaic_follows_the_sensor() -> None:
    of = picture("RG12")
    sensor = Sensor(64.0, 4000.0, saturation=0.9)  # full from 64 + 0.9 × 3936 = 3606.4 on
    for value, white in ((3606, 3606), (3607, 4000)):
        mosaic = np.full((HEIGHT, WIDTH), value, np.uint16)
        assert np.all(decode(mosaic.tobytes(), of, sensor) == white)
