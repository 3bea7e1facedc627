"""Camera files of other programs: conventions by hand, other programs as oracles, no loss."""

from pathlib import Path
from typing import Any, get_args

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from calibration.camera import Calibration, CameraModel
from calibration.formats import FORMATS, read_camera
from calibration.formats.approximation import Nearest, approximate
from calibration.formats.foreign import ForeignCamera, NoCounterpart, as_calibration
from calibration.formats.splined_stereographic import SplinedStereographic
from calibration.formats.yaml_text import parse_yaml
from calibration.formats_cli import FormatName
from calibration.models.double_sphere import DoubleSphere
from calibration.models.equidistant import Equidistant
from calibration.models.equirectangular import Equirectangular
from calibration.models.equisolid import Equisolid
from calibration.models.extended_unified import ExtendedUnified
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.ocam import OCam
from calibration.models.orthographic import Orthographic
from calibration.models.stereographic import Stereographic
from calibration.models.unified import Unified
from capture.errors import InputError
from tests.calibration.format_texts import read_text

_DATA = Path(__file__).resolve().parents[2].parent / "shared/data"

CENTRE = (318.25, 241.75)

LENSES: dict[str, CameraModel] = {
    "kannala_brandt": KannalaBrandt(CENTRE, (190.5, 188.25), 0.003, -0.002, 0.001, -0.0004),
    "unified": Unified(CENTRE, (420.5, 419.0), 1.3, -0.05, 0.01, 0.002, -0.003),
    "double_sphere": DoubleSphere(CENTRE, 150.0, -0.2, 0.57),
    "extended_unified": ExtendedUnified(CENTRE, (220.0, 221.5), 0.6, 1.1),
    "ocam": OCam(CENTRE, (201.0, 199.5), (-0.3, 0.02, -0.05), 1.01, 0.002, -0.001),
    "stereographic": Stereographic(CENTRE, (170.0, 171.0)),
    "equirectangular": Equirectangular(CENTRE, 130.0),
}

COUNTERPARTS = {
    "opencv": ("kannala_brandt", "unified"),
    "kalibr": ("kannala_brandt", "unified", "double_sphere", "extended_unified"),
    "ocamcalib": ("ocam",),
    "mrcal": ("stereographic", "equirectangular"),
    "colmap": ("kannala_brandt",),
    "nerfstudio": ("kannala_brandt",),
}


def _camera(name: str) -> Calibration:
    return Calibration(LENSES[name], (640, 480), 1.2)


@pytest.fixture
def pixels() -> NDArray[np.float64]:
    x, y = np.meshgrid(np.linspace(120, 520, 9), np.linspace(50, 440, 7))
    return np.stack([x, y], axis=-1).reshape(-1, 2)


@pytest.mark.parametrize(
    ("form", "lens"), [(form, lens) for form, lenses in COUNTERPARTS.items() for lens in lenses]
)
def test_a_lens_comes_back_from_a_file_without_loss(
    tmp_path: Path, pixels: NDArray[np.float64], form: str, lens: str
) -> None:
    written = _camera(lens)
    name, read = read_text(tmp_path, FORMATS[form].write(written))
    assert name == form
    assert read.image_size_px == (640, 480)
    before, seen = written.model.unproject(pixels)
    after, seen_after = read.model.unproject(pixels)
    assert seen.all()
    assert seen_after.all()
    assert np.linalg.norm(np.cross(before, after), axis=-1).max() < 1e-9


@pytest.mark.parametrize("form", FORMATS)
def test_a_lens_without_a_counterpart_is_refused(form: str) -> None:
    for lens in sorted(LENSES.keys() - set(COUNTERPARTS[form])):
        with pytest.raises(NoCounterpart, match=f"projects as {lens} does, only"):
            FORMATS[form].write(_camera(lens))


def test_the_commands_choices_are_the_formats() -> None:
    assert set(get_args(FormatName)) == set(FORMATS)


@pytest.mark.parametrize("form", ["colmap", "nerfstudio"])
def test_programs_that_count_from_the_corner_are_half_a_pixel_off(form: str) -> None:
    # The middle of a picture of 512 × 400 is the pixel (255.5, 199.5) here, (256, 200) there.
    lens = Equidistant((255.5, 199.5), 150.0)
    text = FORMATS[form].write(Calibration(lens, (512, 400), 1.5))
    read = FORMATS[form].read(text, "").model
    assert isinstance(read, KannalaBrandt)
    assert read.centre_px == (255.5, 199.5)
    if form == "colmap":
        assert text.splitlines()[-1].split() == [
            *["1", "OPENCV_FISHEYE", "512", "400", "150.0", "150.0", "256.0", "200.0"],
            *["0.0"] * 4,
        ]
    else:
        assert '"cx": 256.0' in text
        assert '"cy": 200.0' in text


def test_colmaps_short_fisheyes_have_one_focal_length(tmp_path: Path) -> None:
    _, two = read_text(tmp_path, "# list\n3 RADIAL_FISHEYE 640 480 300 320 240 0.1 0.02\n")
    assert two.model == KannalaBrandt((319.5, 239.5), 300.0, 0.1, 0.02)
    _, one = read_text(tmp_path, "3 SIMPLE_RADIAL_FISHEYE 640 480 300 320 240 0.1\n")
    assert one.model == KannalaBrandt((319.5, 239.5), 300.0, 0.1)


_K = (5, 6, 7, 8)


@pytest.mark.parametrize(
    ("kind", "intrinsics", "distortion", "coefficients", "model"),
    [
        ("pinhole", [3, 4, 1, 2], "equidistant", [5, 6, 7, 8], KannalaBrandt((1, 2), (3, 4), *_K)),
        ("omni", [0.5, 3, 4, 1, 2], "radtan", [5, 6, 7, 8], Unified((1, 2), (3, 4), 0.5, *_K)),
        ("omni", [0.5, 3, 4, 1, 2], "none", [], Unified((1, 2), (3, 4), 0.5)),
        ("ds", [0.5, 0.25, 3, 4, 1, 2], "none", [], DoubleSphere((1, 2), (3, 4), 0.5, 0.25)),
        ("eucm", [0.5, 1.5, 3, 3, 1, 2], "none", [], ExtendedUnified((1, 2), 3, 0.5, 1.5)),
    ],
)  # fmt: skip
def test_kalibrs_numbers_have_their_order(
    tmp_path: Path,
    kind: str,
    intrinsics: list[float],
    distortion: str,
    coefficients: list[float],
    model: CameraModel,
) -> None:
    text = (
        f"cam0:\n  camera_model: {kind}\n  distortion_model: {distortion}\n"
        f"  distortion_coeffs: {coefficients}\n  intrinsics: {intrinsics}\n"
        "  resolution: [640, 480]\n  T_cam_imu:\n  - [1.0, 0.0,\n    0.0, 0.0]\n  - [0, 1, 0, 0]\n"
    )
    assert read_text(tmp_path, text) == ("kalibr", ForeignCamera(model, (640, 480)))


def _cam2world(text: str, row: float, column: float) -> NDArray[np.float64]:
    """Return the ray of the toolbox's function of that name: row, column, backward."""
    rows = [line.split() for line in text.splitlines() if line and line[0] != "#"]
    polynomial, _, (row_0, column_0), (c, d, e), _ = ([float(w) for w in each] for each in rows)
    x, y = np.linalg.solve([[c, d], [e, 1.0]], [row - row_0, column - column_0])
    z = np.polynomial.polynomial.polyval(np.hypot(x, y), polynomial[1:])
    ray = np.array([x, y, z])
    return ray / np.linalg.norm(ray)


def _world2cam(text: str, ray: NDArray[np.float64]) -> tuple[float, float]:
    """Return the row and column of the toolbox's function of that name."""
    rows = [line.split() for line in text.splitlines() if line and line[0] != "#"]
    _, inverse, (row_0, column_0), (c, d, e), _ = ([float(w) for w in each] for each in rows)
    across = np.hypot(ray[0], ray[1])
    radius = np.polynomial.polynomial.polyval(np.arctan(ray[2] / across), inverse[1:])
    x, y = ray[:2] / across * radius
    return x * c + y * d + row_0, x * e + y + column_0


def test_ocamcalib_counts_rows_before_columns() -> None:
    camera = _camera("ocam")
    text = FORMATS["ocamcalib"].write(camera)
    for x, y in ((400.0, 241.75), (318.25, 300.0), (150.0, 80.0)):
        direction = camera.model.unproject(np.array([x, y]))[0]
        row, column, backward = _cam2world(text, y, x)
        np.testing.assert_allclose(direction, [column, row, -backward], atol=1e-12)
        at_row, at_column = _world2cam(text, np.array([row, column, backward]))
        assert np.hypot(at_column - x, at_row - y) < 0.02


def test_opencv_reads_its_files_and_projects_as_they_say(tmp_path: Path) -> None:
    angle, azimuth = np.meshgrid(np.linspace(0.05, 1.4, 8), np.linspace(0, 6, 7))
    points = np.stack(
        [np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), np.cos(angle)], axis=-1
    ).reshape(1, -1, 3)
    for name in ("kannala_brandt", "unified"):
        path = tmp_path / f"{name}.yaml"
        path.write_text(FORMATS["opencv"].write(_camera(name)))
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
        matrix = storage.getNode("camera_matrix").mat()
        distortion = storage.getNode("distortion_coefficients").mat()
        still = np.zeros((3, 1)), np.zeros((3, 1))
        if name == "unified":
            xi = float(storage.getNode("xi").mat()[0, 0])
            theirs, _ = cv2.omnidir.projectPoints(points, *still, matrix, xi, distortion)
        else:
            theirs, _ = cv2.fisheye.projectPoints(points, *still, matrix, distortion)
        ours = LENSES[name].project(points)[0]
        assert np.abs(theirs.reshape(-1, 2) - ours[0]).max() < 1e-6


def test_a_file_that_opencv_wrote_is_read(tmp_path: Path) -> None:
    path = tmp_path / "theirs.yml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("K", np.array([[300.0, 0, 320], [0, 301, 240], [0, 0, 1]]))
    storage.write("D", np.array([[0.1], [0.02], [-0.003], [1e-05]]))
    storage.write("model", "fisheye")
    storage.release()
    name, read = read_camera(path)
    assert name == "opencv"
    assert read.model == KannalaBrandt((320.0, 240.0), (300.0, 301.0), 0.1, 0.02, -0.003, 1e-05)


def test_ros_camera_info_of_a_fisheye_is_read(tmp_path: Path) -> None:
    text = (
        "image_width: 640\nimage_height: 480\ncamera_name: front\ncamera_matrix:\n  rows: 3\n"
        "  cols: 3\n  data: [300.0, 0.0, 320.0,\n         0.0, 301.0, 240.0,\n"
        "         0.0, 0.0, 1.0]\ndistortion_model: equidistant\ndistortion_coefficients:\n"
        "  rows: 1\n  cols: 4\n  data: [0.1, 0.02, -0.003, 0.0]\n"
    )
    model = KannalaBrandt((320.0, 240.0), (300.0, 301.0), 0.1, 0.02, -0.003)
    assert read_text(tmp_path, text) == ("opencv", ForeignCamera(model, (640, 480)))


_MATRIX = "K: [300, 0, 320, 0, 300, 240, 0, 0, 1]\nimage_size: [640, 480]\n"

_KALIBR = "intrinsics: [300, 300, 320, 240]\nresolution: [640, 480]\n"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("hello", "wanted a camera file of mrcal, ocamcalib"),
        (_MATRIX + "D: [0.1, 0, 0, 0]\n", 'add a line "model: fisheye"'),
        (_MATRIX + "D: [0.1, 0, 0, 0, 0]\n", "of a perspective lens"),
        (_MATRIX + "D: [0.1, 0, 0]\nmodel: fisheye\n", "wanted 4 numbers"),
        (_MATRIX.replace("[300, 0", "[300, 2") + "D: [0, 0, 0, 0]\n", "skew of 2.0"),
        (_MATRIX + "model: fisheye\n", "wanted a key distortion_coefficients"),
        (f"camera_model: pinhole\ndistortion_model: radtan\n{_KALIBR}", "no exact counterpart"),
        (f"camera_model: pinhole\ndistortion_model: equidistant\n{_KALIBR}", "distortion_coeffs"),
        ("1 OPENCV 640 480 1 2 3 4 5 6 7 8", "camera 1 is OPENCV; readable are"),
        ("1 OPENCV_FISHEYE 640 480 1 2 3 4 5 6 7", "has 8 parameters, got 7"),
        ("1 OPENCV_FISHEYE 640 0.5 1 1 3 4 5 6 7 8", "whole numbers of pixels"),
        ("{'lensmodel': 'LENSMODEL_OPENCV8'}", "LENSMODEL_OPENCV8 has no exact counterpart"),
        ("{'lensmodel': LENSMODEL_OPENCV8()}", "wanted a dictionary of mrcal's"),
        ('{"fl_x": 1, "fl_y": 1, "cx": 1, "cy": 1, "w": 2, "h": 2}', "camera_model is OPENCV;"),
        ('{"fl_x": 1}', "wanted a key fl_y"),
        ("#polynomial\n5 -1 0 1 1 1\n3 1 2 3\n4 5\n1 0 0\n", "wanted five lines of numbers"),
        ("#polynomial\n5 -1 0 1\n3 1 2 3\n4 5\n1 0 0\n4 5\n", "the polynomial has 3 numbers"),
        ("#polynomial\n4 -1e300 0 1 1\n3 1 2 3\n4 5\n1 0 0\n4 5\n", "polynomial of OCamCalib"),
        ("1 OPENCV_FISHEYE 640 480 1 2 3 4 5 6 7 1e308", "beyond 1e+12"),
        (_MATRIX + "model: fisheye\nD: [[1], 2, 3, 4]\n", "wanted 4 numbers"),
        (
            f"camera_model: ds\ndistortion_model: x\n{_KALIBR}distortion_coeffs: 5\n",
            "no exact counterpart",
        ),
        (_MATRIX.replace("320", "3" * 5000), "numbers up to 1e+12"),
        (_MATRIX.replace("320", "320_"), "wanted 9 numbers"),
        ("{'lensmodel': 'LENSMODEL_LONLAT', 'intrinsics': 5}", "wanted 4 numbers, got 5"),
        (
            f"{{'lensmodel': 'LENSMODEL_LONLAT', 'intrinsics': [1{'0' * 400}, 1, 1, 1]}}",
            "up to 1e+12",
        ),
        ("1" + " " * 2**20, "more than the 1048576"),
    ],
)
def test_what_cannot_be_read_is_refused_with_the_reason(
    tmp_path: Path, text: str, complaint: str
) -> None:
    with pytest.raises(InputError) as refusal:
        read_text(tmp_path, text)
    assert complaint in str(refusal.value)
    assert str(tmp_path / "camera.txt") in str(refusal.value)


def test_of_several_cameras_one_is_named(tmp_path: Path) -> None:
    text = "".join(
        f"{number} SIMPLE_RADIAL_FISHEYE 640 480 {number}00 320 240 0\n" for number in (1, 2)
    )
    with pytest.raises(InputError, match="holds 1, 2: choose one with --camera"):
        read_text(tmp_path, text)
    with pytest.raises(InputError, match="no camera '3'"):
        read_text(tmp_path, text, "3")
    model: Any = read_text(tmp_path, text, "2")[1].model
    assert model.focal_px == 200.0


def test_without_an_angle_all_of_the_picture_is_valid() -> None:
    # The corner of a picture of 201 × 101 is (100.5, 50.5) from its middle.
    lens = Equidistant((100.0, 50.0), 100.0)
    found = as_calibration(ForeignCamera(lens, (201, 101))).valid_angle_rad
    np.testing.assert_allclose(found, np.hypot(1.005, 0.505), rtol=1e-12)
    assert as_calibration(ForeignCamera(lens, (201, 101)), 0.7).valid_angle_rad == 0.7
    # Of a lens that shows its circle within the picture, all that it can represent is.
    inside = ForeignCamera(Orthographic((100.0, 50.0), 40.0), (201, 101))
    np.testing.assert_allclose(as_calibration(inside).valid_angle_rad, np.pi / 2)


@pytest.mark.parametrize("nearest", [KannalaBrandt, OCam, SplinedStereographic])
def test_an_approximation_tells_its_error(nearest: Nearest) -> None:
    camera = Calibration(Equisolid((200.5, 150.0), (140.0, 138.0)), (400, 300), 1.4)
    near = approximate(camera, nearest)
    assert isinstance(near.calibration.model, nearest)
    assert near.max_rad < 2e-4
    angle = np.linspace(0.01, 0.95, 40)
    rays = np.stack([np.sin(angle), 0.3 * np.sin(angle), np.cos(angle)], axis=-1)
    apart = camera.model.project(rays)[0] - near.calibration.model.project(rays)[0]
    assert np.linalg.norm(apart, axis=1).max() / 138.0 < 1.5 * near.max_rad
    assert near.rms_rad < near.max_rad


def test_an_approximation_of_such_a_lens_is_the_lens() -> None:
    camera = _camera("kannala_brandt")
    assert approximate(camera, KannalaBrandt).max_rad < 1e-9


@pytest.mark.data
def test_files_of_real_cameras() -> None:
    if not (_DATA / "calib-tumvi-samples").exists():
        pytest.skip(f"{_DATA} is not here")
    path = _DATA / "calib-tumvi-samples/pinhole-equi-512/camchain-imucam-imucalib.yaml"
    name, tumvi = read_camera(path, "cam0")
    assert (name, tumvi.image_size_px) == ("kalibr", (512, 512))
    # 97.5° from the axis, half the lens's 195°, lies about the edge of its picture.
    edge = tumvi.model.project(np.array([np.sin(1.7017), 0.0, np.cos(1.7017)]))[0]
    assert 500 < edge[0] < 620
    path = _DATA / "calib-ocam-vmr-sample/calib_results_fisheye.txt"
    name, vmr = read_camera(path)
    assert (name, vmr.image_size_px) == ("ocamcalib", (1024, 768))
    # The toolbox's own inverse is good to a pixel in the picture, and says where rows are.
    text = path.read_text()
    for x, y in ((100.0, 381.0), (505.0, 700.0), (900.0, 100.0)):
        ray = vmr.model.unproject(np.array([x, y]))[0]
        row, column = _world2cam(text, np.array([ray[1], ray[0], -ray[2]]))
        assert np.hypot(column - x, row - y) < 0.5


@pytest.mark.data
def test_kalibrs_models_of_one_camera_agree() -> None:
    folder = _DATA / "calib-adapter-samples/kalibr"
    if not folder.exists():
        pytest.skip(f"{folder} is not here")
    kinds = {
        "DS": ("ds", "none", ("xi", "alpha", "fx", "fy", "cx", "cy"), ()),
        "EUCM": ("eucm", "none", ("alpha", "beta", "fx", "fy", "cx", "cy"), ()),
        "KB": ("pinhole", "equidistant", ("fx", "fy", "cx", "cy"), ("k1", "k2", "k3", "k4")),
    }
    x, y = np.meshgrid(np.linspace(40, 712, 15), np.linspace(40, 440, 9))
    rays = []
    for name, (kind, distortion, intrinsics, coefficients) in kinds.items():
        values = parse_yaml((folder / f"{name}.yml").read_text())["parameter"]
        text = (
            f"cam0:\n  camera_model: {kind}\n  distortion_model: {distortion}\n"
            f"  intrinsics: {[values[key] for key in intrinsics]}\n"
            f"  distortion_coeffs: {[values[key] for key in coefficients]}\n"
            "  resolution: [752, 480]\n"
        )
        model = FORMATS["kalibr"].read(text, "").model
        rays.append(model.unproject(np.stack([x, y], axis=-1))[0])
    for other in rays[1:]:  # three calibrations of one camera, which differ by 0.11° at most
        apart = np.arcsin(np.linalg.norm(np.cross(rays[0], other), axis=-1))
        assert np.rad2deg(apart).max() < 0.15
