"""The zenith from gravity, vertical edges and the horizon."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calibration.camera import LEVEL, UP, Calibration
from calibration.files import read_calibration, read_object, write_calibration
from calibration.models.equidistant import Equidistant
from calibration.pose.up import (
    LOOKS,
    with_zenith,
    zenith_of_edges,
    zenith_of_gravity,
    zenith_of_horizon,
)
from calibration.up_cli import calibrate_up
from capture.errors import InputError

SIGMA_RAD = np.deg2rad(0.1)
POSE = Rotation.from_euler("yxz", [40.0, 12.0, -7.0], degrees=True).as_matrix() @ LEVEL
ZENITH = POSE.T @ [0.0, 1.0, 0.0]
LENS = Equidistant((499.5, 499.5), 300.0)


def edge(azimuth_deg: float, *, lean_deg: float = 0.0, count: int = 5) -> NDArray[np.float64]:
    """Return directions along an edge from 20° below to 40° above the horizon, in POSE's camera."""
    altitude = np.radians(np.linspace(-20.0, 40.0, count))
    azimuth = np.radians(azimuth_deg + lean_deg * np.linspace(-0.5, 0.5, count))
    world = [
        np.cos(altitude) * np.sin(azimuth),
        np.sin(altitude),
        np.cos(altitude) * np.cos(azimuth),
    ]
    return np.stack(world, axis=-1) @ POSE


def angle_deg(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(first, second)), first @ second)))


rotations = st.integers(0, 2**31).map(lambda seed: Rotation.random(rng=seed).as_matrix())


@given(rotations, rotations)
@settings(max_examples=30, deadline=None)
def test_the_zenith_becomes_up_by_the_smallest_turn(
    start: NDArray[np.float64], other: NDArray[np.float64]
) -> None:
    zenith = other[1]
    posed = with_zenith(start, zenith)
    np.testing.assert_allclose(posed @ zenith, [0, 1, 0], atol=1e-9)
    np.testing.assert_allclose(posed @ posed.T, np.eye(3), atol=1e-9)
    turned = Rotation.from_matrix(posed @ start.T).magnitude()
    assert turned == pytest.approx(np.radians(angle_deg(start @ zenith, np.array([0, 1, 0]))))


def test_a_level_camera_that_looks_up_is_the_convention_up() -> None:
    np.testing.assert_array_equal(with_zenith(LEVEL, np.array(LOOKS["up"])), UP)
    np.testing.assert_array_equal(with_zenith(LEVEL, np.array(LOOKS["level"])), LEVEL)
    upside_down = with_zenith(LEVEL, np.array([0.0, 1.0, 0.0]))
    np.testing.assert_array_equal(upside_down @ [0, 1, 0], [0, 1, 0])
    assert np.linalg.det(upside_down) == pytest.approx(1.0)


def test_up_is_opposite_to_gravity_of_any_length() -> None:
    np.testing.assert_allclose(zenith_of_gravity([0.0, 3.0, 4.0]), [0.0, -0.6, -0.8])
    np.testing.assert_allclose(zenith_of_gravity([0.0, 1e-300, 0.0]), [0.0, -1.0, 0.0])
    for wrong in ([0.0, 0.0, 0.0], [np.nan, 0.0, 1.0], [np.inf, 0.0, 1.0]):
        with pytest.raises(InputError, match="gravity"):
            zenith_of_gravity(wrong)


def test_two_edges_meet_in_the_zenith() -> None:
    found = zenith_of_edges([edge(0.0), edge(90.0)], SIGMA_RAD)
    assert angle_deg(found.direction, ZENITH) < 1e-6


def test_the_uncertainty_covers_what_noisy_marks_do() -> None:
    random = np.random.default_rng(4)
    errors, sigmas = [], []
    for _ in range(60):
        edges = [edge(azimuth) for azimuth in (0.0, 50.0, 130.0, 200.0, 290.0)]
        noisy = [each + SIGMA_RAD * random.standard_normal(each.shape) for each in edges]
        noisy = [each / np.linalg.norm(each, axis=-1, keepdims=True) for each in noisy]
        found = zenith_of_edges(noisy, SIGMA_RAD)
        errors.append(np.radians(angle_deg(found.direction, ZENITH)))
        sigmas.append(found.sigma_rad)
    # Two coordinates of at most sigma each: the rms length is below √2 sigma, and not far below.
    assert 0.7 < np.sqrt(np.mean(np.square(errors))) / np.mean(sigmas) < 1.5


def test_an_edge_that_leans_is_left_out_and_told() -> None:
    edges = [edge(azimuth) for azimuth in (0.0, 50.0, 130.0, 200.0)]
    found = zenith_of_edges([*edges, edge(290.0, lean_deg=15.0)], SIGMA_RAD)
    np.testing.assert_array_equal(found.kept, [True, True, True, True, False])
    assert angle_deg(found.direction, ZENITH) < 1e-3
    assert np.degrees(abs(found.residual_rad[4])) > 3.0


def test_edges_that_do_not_tell_are_refused() -> None:
    with pytest.raises(InputError, match="mark two or more"):
        zenith_of_edges([edge(0.0)], SIGMA_RAD)
    with pytest.raises(InputError, match="further apart"):
        zenith_of_edges([edge(0.0), edge(180.0)], SIGMA_RAD)  # one plane
    with pytest.raises(InputError, match="foot to its head"):
        zenith_of_edges([edge(0.0), edge(60.0), edge(120.0)[::-1]], SIGMA_RAD)
    with pytest.raises(InputError, match="ends at least"):
        zenith_of_edges([edge(0.0), edge(60.0)[:1]], SIGMA_RAD)


def test_the_horizon_lies_a_right_angle_from_the_zenith() -> None:
    azimuth = np.radians([0.0, 40.0, 100.0, 150.0, 170.0])
    points = np.stack([np.sin(azimuth), 0 * azimuth, np.cos(azimuth)], axis=-1) @ POSE
    points[4] = edge(170.0)[-1]  # a roof, 40° above it
    found = zenith_of_horizon(points, LEVEL[1], SIGMA_RAD)
    assert angle_deg(found.direction, ZENITH) < 1e-6
    np.testing.assert_array_equal(found.kept, [True, True, True, True, False])
    with pytest.raises(InputError, match="alike"):
        zenith_of_horizon(points, POSE[0], SIGMA_RAD)
    with pytest.raises(InputError, match="round more of it"):
        zenith_of_horizon(points[[0, 0]], LEVEL[1], SIGMA_RAD)


def marks(directions: NDArray[np.float64]) -> str:
    pixels, _ = LENS.project(directions)
    return " ".join(f"{x:.6f},{y:.6f}" for x, y in pixels)


def test_the_command_sets_the_tilt_and_keeps_the_rest(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    start, out = tmp_path / "start.json", tmp_path / "cal.json"
    camera = Calibration(LENS, (1000, 1000), 1.5, vignetting=(-0.1,))
    write_calibration(start, camera)
    ahead = [marks(edge(azimuth)) for azimuth in (20.0, 40.0, 65.0)]
    calibrate_up(start, output=out, vertical=ahead)
    assert "up is set to ±" in capsys.readouterr().out
    np.testing.assert_allclose(read_calibration(out).R_world_camera @ ZENITH, [0, 1, 0], atol=1e-6)
    was, now = read_object(start), read_object(out)
    del was["R_world_camera"], now["R_world_camera"]
    assert now == was
    calibrate_up(out, output=out, gravity=",".join(map(str, -ZENITH)), force=True)
    np.testing.assert_allclose(read_calibration(out).R_world_camera @ ZENITH, [0, 1, 0], atol=1e-6)
    with pytest.raises(InputError, match="--force"):
        calibrate_up(start, output=out, looks="up")


def test_the_command_refuses_what_it_cannot_use(tmp_path: Path) -> None:
    start, out = tmp_path / "start.json", tmp_path / "cal.json"
    write_calibration(start, Calibration(LENS, (1000, 1000), 1.5))
    with pytest.raises(InputError, match="0 were given"):
        calibrate_up(start, output=out)
    with pytest.raises(InputError, match="2 were given"):
        calibrate_up(start, output=out, looks="up", horizon="1,2 3,4")
    with pytest.raises(InputError, match="wanted x,y,z"):
        calibrate_up(start, output=out, gravity="0,1")
    with pytest.raises(InputError, match="sees nothing at 0,0"):
        calibrate_up(start, output=out, horizon="0,0 500,500")
    with pytest.raises(InputError, match="--vertical: wanted pixels"):
        calibrate_up(start, output=out, vertical=["500,500 500,400", ""])
    assert not out.exists()
