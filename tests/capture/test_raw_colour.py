"""From a camera's channels to Rec.709: where the matrix comes from, and what is white."""

from pathlib import Path

import numpy as np
import pytest

from capture.exr import read_exr
from capture.frame import Bracket, Exposure, Frame
from capture.merge import merge_bracket
from capture.primaries import PRIMARIES, REC709, adaptation, rgb_to_xyz
from capture.radiance import RadianceImage
from capture.radiance_files import read_radiance, write_radiance
from capture.raw import raw_sensor, read_raw
from capture.raw_colour import DngMatrix, camera_to_rec709
from capture.sensor import Sensor, in_primaries
from tests.capture.dng_files import colour_matrix, dng

# A made-up camera under daylight, and how the same one was measured under lamp light.
CAMERA = np.array([[0.30, 0.12, 0.03], [0.20, 0.70, 0.10], [0.02, 0.16, 0.40]])
LAMP_CAMERA = CAMERA * [[1.2], [1.0], [0.7]]
NO_TABLE = np.zeros((3, 3))


def dng_matrix(camera: np.ndarray, illuminant: int = 21, **rest: object) -> DngMatrix:
    return DngMatrix(tuple(colour_matrix(camera).ravel()), illuminant, **rest)


def expected(camera: np.ndarray) -> np.ndarray:
    """The inverse of what the camera sees, scaled so that white just fills one channel."""
    return np.linalg.inv(camera / camera.sum(axis=1).max())


def test_the_matrix_undoes_the_camera_and_white_fills_the_most_sensitive_channel() -> None:
    matrix, origin = camera_to_rec709([dng_matrix(CAMERA)], None, NO_TABLE)
    np.testing.assert_allclose(matrix, expected(CAMERA), rtol=1e-9)
    np.testing.assert_allclose(np.linalg.solve(matrix, np.ones(3)).max(), 1, rtol=1e-9)
    assert origin == "colour matrix of the file for D65, daylight white"


@pytest.mark.parametrize("lamp_first", [True, False])
def test_of_two_illuminants_the_one_nearest_to_daylight_counts(lamp_first: bool) -> None:
    both = [dng_matrix(LAMP_CAMERA, 17), dng_matrix(CAMERA, 21)]
    matrix, _ = camera_to_rec709(both if lamp_first else both[::-1], None, NO_TABLE)
    np.testing.assert_allclose(matrix, expected(CAMERA), rtol=1e-9)
    lamp, origin = camera_to_rec709(both[:1], None, NO_TABLE)
    np.testing.assert_allclose(lamp, expected(LAMP_CAMERA), rtol=1e-9)
    assert "standard light A" in origin


def test_a_cameras_own_gains_come_before_the_matrix_of_its_kind() -> None:
    # The model's matrix, this camera's calibration and its analogue gains are multiplied.
    calibration = np.diag([1.02, 1.0, 0.97])
    matrix, _ = camera_to_rec709(
        [dng_matrix(CAMERA, calibration=tuple(calibration.ravel()))], (1.5, 1.0, 2.0), NO_TABLE
    )
    camera = np.diag([1.5, 1.0, 2.0]) @ calibration @ CAMERA
    np.testing.assert_allclose(matrix, expected(camera), rtol=1e-9)


def test_a_forward_matrix_takes_over_the_colours_and_leaves_white_white() -> None:
    # One made of the same camera: white-balanced channels to XYZ under D50.
    balanced = CAMERA / CAMERA.sum(axis=1, keepdims=True)
    forward = adaptation(REC709[3], (0.3457, 0.3585)) @ rgb_to_xyz(REC709) @ np.linalg.inv(balanced)
    mixing = np.array([[1.1, 0.05, 0.0], [0.02, 1.0, 0.03], [0.0, 0.1, 0.9]])
    for calibration in (None, tuple(mixing.ravel())):
        camera = np.diag([1.5, 1.0, 2.0]) @ (np.eye(3) if calibration is None else mixing) @ CAMERA
        matrix, origin = camera_to_rec709(
            [dng_matrix(CAMERA, camera_to_d50=tuple(forward.ravel()), calibration=calibration)],
            (1.5, 1.0, 2.0),
            NO_TABLE,
        )
        np.testing.assert_allclose(matrix, expected(camera), rtol=1e-9)
    assert origin.startswith("forward and colour matrix")
    # Another one changes the colours, not the white.
    other = forward @ np.linalg.inv(forward) @ np.diag(forward.sum(axis=1))
    matrix, _ = camera_to_rec709(
        [dng_matrix(CAMERA, camera_to_d50=tuple(other.ravel()))], None, NO_TABLE
    )
    white = CAMERA.sum(axis=1) / CAMERA.sum(axis=1).max()
    np.testing.assert_allclose(matrix @ white, 1, rtol=1e-9)
    assert np.abs(matrix - expected(CAMERA)).max() > 0.1


def test_a_file_that_is_no_dng_takes_the_matrix_of_the_table() -> None:
    # Canon EOS 5D Mark II, as LibRaw's table has it (dcraw's adobe_coeff).
    table = np.array([[4716, 603, -830], [-7798, 15474, 2480], [-1496, 1937, 6651]]) / 10_000
    matrix, origin = camera_to_rec709([], None, table)
    assert "LibRaw's table" in origin
    neutral = table @ rgb_to_xyz(REC709) @ np.ones(3)
    np.testing.assert_allclose(matrix @ neutral / neutral.max(), 1, rtol=1e-9)
    # Red and blue need more than green, as in every camera with such a mosaic.
    assert neutral.argmax() == 1


@pytest.mark.parametrize(
    "matrices",
    [
        [],
        [DngMatrix((0.0,) * 9)],
        [DngMatrix((1.0,) * 9)],
        [dng_matrix(-CAMERA)],
        [dng_matrix(CAMERA, camera_to_d50=(0.0,) * 9)],
        [dng_matrix(CAMERA, camera_to_d50=(1.0,) * 9)],
        [dng_matrix(CAMERA, camera_to_d50=(1e9, 0.1, 0.1, 0.1, 1.0, 0.1, 0.1, 0.1, 1.0))],
    ],
    ids=[
        "none",
        "zeros",
        "singular",
        "negative",
        "forward of zeros",
        "forward singular",
        "forward huge",
    ],
)
def test_without_a_usable_matrix_that_is_said(matrices: list[DngMatrix]) -> None:
    matrix, origin = camera_to_rec709(matrices, None, NO_TABLE)
    assert matrix is None
    assert "no colour matrix" in origin


def test_the_tags_of_a_dng_file_arrive(tmp_path: Path) -> None:
    path = tmp_path / "a.dng"
    counts = np.full((24, 32), 3000)
    matrices = [(17, colour_matrix(LAMP_CAMERA)), (21, colour_matrix(CAMERA))]
    path.write_bytes(dng(counts, matrices=matrices))
    facts = read_raw(path)[1]
    assert [each.illuminant for each in facts.matrices] == [17, 21]
    # Five digits in the file.
    np.testing.assert_allclose(raw_sensor(facts).colour_matrix, expected(CAMERA), atol=2e-4)
    path.write_bytes(dng(counts, matrices=matrices, forward=np.diag([0.9642, 1, 0.8249])))
    facts = read_raw(path)[1]
    assert facts.matrices[0].camera_to_d50 is None
    assert facts.matrices[1].camera_to_d50 == pytest.approx((0.9642, 0, 0, 0, 1, 0, 0, 0, 0.8249))
    path.write_bytes(dng(counts, matrices=[]))
    assert "no colour matrix" in raw_sensor(read_raw(path)[1]).source


COUNTS = np.random.default_rng(2).integers(4096, 60_000, (16, 24, 3)).astype(np.uint16)


def merged(sensor: Sensor) -> RadianceImage:
    return merge_bracket(Bracket((Frame(COUNTS, Exposure(0.01)),)), sensor)


@pytest.mark.parametrize("name", ["rec2020", "acescg"])
@pytest.mark.parametrize("suffix", [".exr", ".hdr"])
def test_other_primaries_are_named_and_read_back_as_rec709(
    tmp_path: Path, name: str, suffix: str
) -> None:
    matrix = camera_to_rec709([dng_matrix(np.eye(3) + 0.1)], None, NO_TABLE)[0]
    sensor = Sensor(4096, 65535, colour_matrix=matrix)
    wide = merged(in_primaries(sensor, name))
    assert wide.primaries == name
    path = tmp_path / f"a{suffix}"
    write_radiance(path, wide, comments="made of counts")
    if suffix == ".exr":
        attributes = read_exr(path).attributes
        assert attributes["chromaticities"] == pytest.approx(PRIMARIES[name].ravel())
        assert attributes["comments"] == "made of counts"
    back = read_radiance(path)[0].radiance
    reference = merged(sensor).radiance
    # What Rec.709 cuts off was never in the reference; .hdr has eight bits.
    inside = (wide.radiance > 0).all(axis=2) & (reference > 0).all(axis=2)
    assert inside.mean() > 0.3
    largest = reference.max(axis=2, keepdims=True)
    tolerance = 1e-5 if suffix == ".exr" else 0.02
    assert (np.abs(back - reference) / largest)[inside].max() < tolerance


def test_wide_primaries_hold_what_rec709_cuts_off() -> None:
    # A saturated green of ACEScg has negative red and blue in Rec.709.
    green = np.broadcast_to(np.array([4096, 60_000, 4096], np.uint16), (4, 4, 3))
    matrix = np.linalg.inv(in_primaries(Sensor(4096, 65535), "acescg").colour_matrix)
    bracket = Bracket((Frame(green, Exposure(1.0)),))
    sensor = Sensor(4096, 65535, colour_matrix=matrix)  # of a camera that sees ACEScg
    narrow = merge_bracket(bracket, sensor).radiance[0, 0]
    wide = merge_bracket(bracket, in_primaries(sensor, "acescg")).radiance[0, 0]
    assert narrow[0] == narrow[2] == 0
    np.testing.assert_allclose(wide, [0, (60_000 - 4096) / (65535 - 4096), 0], atol=1e-6)


def test_a_clipped_pixel_is_white_or_below_what_its_channels_say() -> None:
    # White light of radiance 100 just fills green; red is then at 0.45 of its range, blue at 0.58.
    counts = np.full((2, 2, 3), 65535, np.uint16)
    counts[0, 0] = 65535, 40_000, 30_000
    matrix, _ = camera_to_rec709([dng_matrix(CAMERA)], None, NO_TABLE)
    image = merge_bracket(
        Bracket((Frame(counts, Exposure(0.01)),)), Sensor(4096, 65535, colour_matrix=matrix)
    )
    assert image.clipped.all()
    np.testing.assert_allclose(image.radiance[1], 100, rtol=1e-6)
    camera = np.linalg.solve(matrix, image.radiance[0, 0])
    measured = 100 * (counts[0, 0] - 4096.0) / (65535 - 4096)
    np.testing.assert_allclose(camera, np.minimum(measured, [45, 100, 58]), rtol=1e-5)


@pytest.mark.parametrize("scale", [0.8, 1.25])
def test_clipped_light_is_white_by_a_matrix_of_any_scale(scale: float) -> None:
    # That of `calibrate colour` keeps the luminance of grey, whatever fills a channel.
    matrix, _ = camera_to_rec709([dng_matrix(CAMERA)], None, NO_TABLE)
    full = Bracket((Frame(np.full((1, 1, 3), 65535, np.uint16), Exposure(0.01)),))
    image = merge_bracket(full, Sensor(4096, 65535, colour_matrix=scale * np.array(matrix)))
    np.testing.assert_allclose(image.radiance, 100 * scale, rtol=1e-6)


def test_the_variance_of_a_colour_is_that_of_a_sum() -> None:
    matrix = np.array([[1.5, -0.3, -0.2], [-0.2, 1.4, -0.2], [0.0, -0.5, 1.5]])
    counts = np.array([[[20_000, 30_000, 40_000]]], np.uint16)
    bracket = Bracket((Frame(counts, Exposure(0.01)),))
    own = merge_bracket(bracket, Sensor(4096, 65535)).variance[0, 0]
    colours = merge_bracket(bracket, Sensor(4096, 65535, colour_matrix=matrix)).variance[0, 0]
    np.testing.assert_allclose(colours, matrix**2 @ own, rtol=1e-5)
