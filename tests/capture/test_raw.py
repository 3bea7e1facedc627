"""RAW files: linear, alike for every frame of a bracket, and harmless when hostile."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from capture import decoding
from capture.errors import InputError, UnreadableFrame
from capture.exr import read_exr
from capture.frame import Bracket, Exposure, Frame
from capture.importing import import_sources, read_photo_bracket
from capture.merge import merge_bracket
from capture.merge_cli import merge
from capture.primaries import PRIMARIES
from capture.radiance_files import read_radiance
from capture.raw import BLACK_DN, WHITE_DN, raw_sensor, read_raw
from capture.recording import open_recording
from capture.sensor import Sensor
from tests.capture.dng_files import BLACK, RGGB, WHITE, colour_matrix, dng
from tests.capture.photo_files import DATA

SHAPE = (48, 64)
PATCH = 8

# A made-up camera: its channels overlap, and green is the most sensitive.
CAMERA = np.array([[0.30, 0.12, 0.03], [0.20, 0.70, 0.10], [0.02, 0.16, 0.40]])
WHITE_LIGHT = CAMERA.sum(axis=1)


def mosaic(linear: np.ndarray, black: tuple[int, ...], white: tuple[int, ...]) -> np.ndarray:
    """Counts of an RGGB sensor that sees camera RGB (H, W, 3), 0 at black and 1 at white."""
    counts = np.empty(linear.shape[:2], np.int64)
    for place, channel in enumerate(RGGB):
        at = (slice(place // 2, None, 2), slice(place % 2, None, 2))
        low, high = black[place % len(black)], white[0]
        level = low + linear[(*at, channel)] * (high - low)
        counts[at] = np.clip(np.rint(level), 0, high)
    return counts


def patches(values: np.ndarray) -> np.ndarray:
    """Values (rows, columns, 3) as patches of PATCH × PATCH pixels."""
    return values.repeat(PATCH, axis=0).repeat(PATCH, axis=1)


def middles(picture: np.ndarray) -> np.ndarray:
    """One pixel of each patch, whose neighbours lie in the same one."""
    return picture[PATCH // 2 :: PATCH, PATCH // 2 :: PATCH]


def linear_counts(path: Path) -> np.ndarray:
    return (read_raw(path)[0].astype(float) - BLACK_DN) / (WHITE_DN - BLACK_DN)


def write(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


LINEAR = np.random.default_rng(1).uniform(0.02, 0.95, (6, 8, 3))


@pytest.mark.parametrize(
    ("bits", "black", "white"),
    [
        (16, (BLACK,), (WHITE,)),
        (14, (2056, 2048, 2040, 2060), (15_000,)),
        (12, (120, 128, 136, 130), (4095,)),
        (8, (0,), (255,)),
    ],
    ids=lambda value: str(value),
)
def test_a_mosaic_gives_the_light_between_each_channels_black_and_white(
    tmp_path: Path, bits: int, black: tuple[int, ...], white: tuple[int, ...]
) -> None:
    counts = mosaic(patches(LINEAR), black, white)
    path = write(tmp_path / "a.dng", dng(counts, bits=bits, black=black, white=white))
    found = linear_counts(path)
    assert found.shape == (*SHAPE, 3)
    half_a_step = 0.5 / (white[0] - max(black))
    np.testing.assert_allclose(middles(found), LINEAR, atol=half_a_step + 1 / 60_000)


@pytest.mark.parametrize("bits", [12, 16])
def test_a_linear_dng_gives_the_light_between_each_channels_black_and_white(
    tmp_path: Path, bits: int
) -> None:
    black, white = np.array([100, 200, 300]), np.array([4000, 3900, 3800])
    counts = np.rint(black + patches(LINEAR) * (white - black)).astype(int)
    path = write(tmp_path / "a.dng", dng(counts, bits=bits, black=black, white=white))
    np.testing.assert_allclose(linear_counts(path), patches(LINEAR), atol=0.6 / 3500)


def test_a_sensor_without_colours_gives_grey(tmp_path: Path) -> None:
    counts = np.rint(BLACK + patches(LINEAR)[..., 0] * (WHITE - BLACK)).astype(int)
    path = write(tmp_path / "a.dng", dng(counts, monochrome=True))
    found, facts = read_raw(path)
    assert np.ptp(found, axis=2).max() == 0
    np.testing.assert_allclose(linear_counts(path)[..., 0], patches(LINEAR)[..., 0], atol=1e-4)
    assert raw_sensor(facts).colour_matrix is None


def test_bilinear_means_of_the_neighbours_on_a_ramp(tmp_path: Path) -> None:
    # Of a plane the mean of neighbours on both sides is the plane itself, in every channel.
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    plane = 1000 + 40 * rows + 60 * columns
    found = linear_counts(write(tmp_path / "a.dng", dng(plane)))[1:-1, 1:-1]
    expected = ((plane - BLACK) / (WHITE - BLACK))[1:-1, 1:-1, None]
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-4)


def test_noise_below_black_stays(tmp_path: Path) -> None:
    # Cut off at black, noise of mean 0 and deviation σ would have the mean σ/√(2π) = 0.4 σ.
    noise = np.random.default_rng(3).normal(0, 40, SHAPE)
    path = write(tmp_path / "a.dng", dng(np.rint(BLACK + noise).astype(int)))
    found = linear_counts(path) * (WHITE - BLACK)
    assert abs(found.mean()) < 2
    assert found.min() < -60


def test_a_full_site_marks_itself_and_what_is_interpolated_from_it(tmp_path: Path) -> None:
    counts = np.full(SHAPE, 6000)
    counts[20, 30] = WHITE  # a red site: even row and column
    full = read_raw(write(tmp_path / "a.dng", dng(counts)))[0] == WHITE_DN
    expected = np.zeros((*SHAPE, 3), bool)
    expected[19:22, 29:32, 0] = True  # red is missing at all eight around it
    np.testing.assert_array_equal(full, expected)
    counts[20, 30], counts[20, 31] = 6000, WHITE  # a green one: two blue and two red neighbours
    full = read_raw(write(tmp_path / "a.dng", dng(counts)))[0] == WHITE_DN
    expected[:] = False
    expected[[19, 20, 20, 20, 21], [31, 30, 31, 32, 31], 1] = True
    np.testing.assert_array_equal(full, expected)


def test_strips_join_without_a_seam(tmp_path: Path) -> None:
    counts = np.random.default_rng(4).integers(BLACK, WHITE + 1, (600, 32))
    whole = read_raw(write(tmp_path / "a.dng", dng(counts)))[0]
    part = read_raw(write(tmp_path / "b.dng", dng(counts[200:400])))[0]
    np.testing.assert_array_equal(whole[201:399], part[1:-1])  # 256 lies between


def test_scale_does_not_depend_on_the_picture_nor_on_as_shot_balance(tmp_path: Path) -> None:
    # LibRaw by itself moves white to the brightest pixel if that lies above 3/4 of it.
    plain = np.full(SHAPE, 5000)
    spot = plain.copy()
    spot[40:44, 40:44] = 15_000
    reference, facts = read_raw(write(tmp_path / "a.dng", dng(plain)))
    found = read_raw(write(tmp_path / "b.dng", dng(spot)))[0]
    np.testing.assert_array_equal(found[:32, :32], reference[:32, :32])
    found, warm = read_raw(write(tmp_path / "c.dng", dng(plain, as_shot=(200, 100, 60))))
    np.testing.assert_array_equal(found, reference)
    assert warm == facts


def test_pixels_lie_as_the_sensor_has_them(tmp_path: Path) -> None:
    counts = np.full(SHAPE, 2000)
    counts[:8, :16] = 9000
    upright = read_raw(write(tmp_path / "a.dng", dng(counts)))[0]
    turned = read_raw(write(tmp_path / "b.dng", dng(counts, orientation=6)))[0]
    np.testing.assert_array_equal(turned, upright)
    assert upright[4, 8, 1] > 2 * upright[40, 8, 1]


@pytest.fixture
def bracket(tmp_path: Path) -> Any:
    """Radiance, (6, 8, 3) Rec.709, and three DNG files of it, 1/1000 s to 1/10 s."""
    rng = np.random.default_rng(7)
    radiance = rng.uniform(0.3, 1, (6, 8, 3)) * np.geomspace(0.1, 500, 48).reshape(6, 8, 1)
    radiance[0, 0] = 1e6  # a sun, full in all exposures
    for name, time_s in (("a", 0.1), ("b", 0.01), ("c", 0.001)):
        light = patches(radiance @ (CAMERA / WHITE_LIGHT.max()).T) * time_s
        content = dng(
            mosaic(light, (510, 512, 514, 516), (WHITE,)),
            bits=14,
            black=(510, 512, 514, 516),
            matrices=[(21, colour_matrix(CAMERA))],
            time_s=(round(time_s * 1000), 1000),
        )
        write(tmp_path / f"{name}.dng", content)
    return radiance, sorted(tmp_path.glob("*.dng"))


def assert_within_steps(found: np.ndarray, radiance: np.ndarray, sensor: Sensor) -> None:
    """Half a count of each channel, through the matrix.

    In the longest exposure it is worth 0.5/15867/0.1 s; of a shorter one, used where a channel of
    the next is above 0.98, at most 0.5/15867/0.098 of the channel's value. Weights are in
    proportion to light, at most, so each of the three exposures adds no more than that.
    """
    half_a_step = 0.5 / (WHITE - 516)
    channels = radiance @ np.linalg.inv(sensor.colour_matrix).T
    steps = half_a_step * np.maximum(1 / 0.1, channels / 0.098)
    assert np.all(np.abs(found - radiance) < 3 * steps @ np.abs(sensor.colour_matrix).T)


def test_a_bracket_merges_to_its_radiance(bracket: Any) -> None:
    radiance, paths = bracket
    frames, sensor, _ = read_photo_bracket(paths)
    image = merge_bracket(frames, sensor)
    found, clipped = middles(image.radiance), middles(image.clipped)
    assert np.argwhere(clipped).tolist() == [[0, 0]]
    assert_within_steps(found[~clipped], radiance[~clipped], sensor)
    # A full sun is white, at what fills the most sensitive channel of the shortest exposure.
    np.testing.assert_allclose(found[0, 0], 1000, rtol=1e-3)


def test_variance_follows_the_colours(bracket: Any) -> None:
    # Independent noise of the channels: Σ_k M²_jk Var_k, here of a patch of many noisy pixels.
    sensor = raw_sensor(read_raw(bracket[1][0])[1])
    linear = CAMERA @ np.array([0.3, 0.2, 0.4]) / WHITE_LIGHT.max()
    electrons = np.random.default_rng(8).poisson(linear * sensor.full_well_e, (200, 200, 3))
    noise_e = np.random.default_rng(9).normal(0, sensor.read_noise_e, electrons.shape)
    values = (electrons + noise_e) / sensor.full_well_e
    counts = np.rint(BLACK_DN + values * (WHITE_DN - BLACK_DN)).astype(np.uint16)
    image = merge_bracket(Bracket((Frame(counts, Exposure(1.0)),)), sensor)
    measured = image.radiance.var(axis=(0, 1))
    np.testing.assert_allclose(image.variance.mean(axis=(0, 1)), measured, rtol=0.05)
    np.testing.assert_allclose(image.radiance.mean(axis=(0, 1)), [0.3, 0.2, 0.4], rtol=0.005)


def test_a_recording_of_raw_files_keeps_their_sensor(bracket: Any, tmp_path: Path) -> None:
    radiance, paths = bracket
    import_sources(paths, tmp_path / "recording")
    recording = open_recording(tmp_path / "recording")
    image = merge_bracket(recording.read_bracket(0), recording.sensor)
    assert_within_steps(middles(image.radiance)[1:], radiance[1:], recording.sensor)
    assert "D65" in recording.sensor.source


def test_the_command_names_sensor_and_primaries_and_is_read_back(
    bracket: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    radiance, paths = bracket
    output = tmp_path / "a.exr"
    merge(*paths, output=output, primaries="acescg")
    told = capsys.readouterr().err
    assert "black 510/512/516/514, white 16383" in told  # R, G, B, second G
    assert "colour matrix of the file for D65, daylight white" in told
    attributes = read_exr(output).attributes
    assert attributes["chromaticities"] == pytest.approx(PRIMARIES["acescg"].ravel())
    assert "daylight white" in attributes["comments"]
    found = middles(read_radiance(output)[0].radiance)[1:]
    sensor = raw_sensor(read_raw(paths[0])[1])
    assert_within_steps(found, radiance[1:], sensor)


def test_a_recording_with_levels_of_old_is_refused(bracket: Any, tmp_path: Path) -> None:
    import_sources(bracket[1], tmp_path / "recording")
    manifest = tmp_path / "recording/manifest.json"
    manifest.write_text(manifest.read_text().replace('"black_dn": 4096.0', '"black_dn": 0.0'))
    with pytest.raises(InputError, match="import them again"):
        open_recording(tmp_path / "recording")


def test_the_sensor_says_what_the_file_did(tmp_path: Path) -> None:
    counts = np.full(SHAPE, 3000)
    facts = read_raw(write(tmp_path / "a.dng", dng(counts, black=(500, 510, 510, 520))))[1]
    sensor = raw_sensor(facts)
    assert "black 500/510/520, white 16383" in sensor.source
    # Steps of a 12-bit file add 30000/3583/√12 electrons.
    facts = read_raw(write(tmp_path / "b.dng", dng(counts, white=(4095,))))[1]
    assert raw_sensor(facts).read_noise_e == pytest.approx(np.hypot(4, 2.417), rel=1e-3)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (dng(np.full(SHAPE, 3000))[:-3000], "cannot be developed"),
        (dng(np.full(SHAPE, 3000), width=60_000)[:700], "cannot be developed"),
        (dng(np.full((2400, 2), 3000), width=60_000), "60000×2400 px"),
        (dng(np.full(SHAPE, 3000), black=(20_000,)), "above white"),
        (b"A letter, not a photograph.\n" * 100, "cannot be developed"),
        (b"", "empty"),
    ],
    ids=["truncated", "forged size", "picture bomb", "black above white", "text", "empty"],
)
def test_hostile_file_is_an_unreadable_frame(tmp_path: Path, content: bytes, reason: str) -> None:
    path = write(tmp_path / "bad.dng", content)
    with pytest.raises(UnreadableFrame, match=reason) as caught:
        read_raw(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nothing\.dng: no such file"):
        read_raw(tmp_path / "nothing.dng")


def test_decoder_stays_within_its_memory(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    path = write(tmp_path / "large.dng", dng(np.full((4000, 6000), 3000, np.uint16)))
    monkeypatch.setattr(decoding, "_idle", [])
    monkeypatch.setattr(decoding, "_MAX_BYTES", 400 * 2**20)  # its libraries alone map 350 MiB
    with pytest.raises(UnreadableFrame, match=r"mempool|memory"):
        read_raw(path)
    decoding._idle.pop().end()


@pytest.mark.data
def test_real_dng_develops_to_a_colour_chart() -> None:
    path = DATA / "raw-tinydng/colorchart.dng"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    bracket, sensor, _ = read_photo_bracket([path], [0.01])
    assert "black 2056, white 15000" in sensor.source
    image = merge_bracket(bracket, sensor)
    assert image.size_px == (1734, 1156)
    # Rows and columns of patches on the chart: orange is redder than blue, and the grey ones of
    # one row keep their colour however bright they are.
    red, green, blue = (image.radiance[860, 925, i] for i in range(3))
    assert red > 2 * green > 2 * blue
    greys = image.radiance[[930, 930, 930], [700, 810, 920]]
    chroma = greys / greys.sum(axis=1, keepdims=True)
    assert np.ptp(chroma, axis=0).max() < 0.02
