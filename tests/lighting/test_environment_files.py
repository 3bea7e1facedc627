"""Environment maps on disk, ours and those of other programs."""

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

import capture.exr
from capture.decoding import decode
from capture.errors import InputError
from capture.exr import read_exr, write_exr
from capture.radiance_files import write_hdr
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import read_environment, write_environment
from lighting.sphere.latlong import cell_directions, solid_angles

DATA = Path(__file__).resolve().parents[2].parent / "shared/data"


def sample_map() -> EnvironmentMap:
    rng = np.random.default_rng(3)
    radiance = rng.random((8, 16, 3), np.float32) * 1e6
    valid = rng.random((8, 16)) > 0.3
    radiance[~valid] = 0.25  # what it was filled with
    return EnvironmentMap(radiance, valid, rng.random((8, 16)) > 0.8, "cd/m²")


def test_a_map_comes_back_with_its_marks(tmp_path: Path) -> None:
    environment = sample_map()
    write_environment(tmp_path / "map.exr", environment)
    back, cleaned = read_environment(tmp_path / "map.exr")
    for name in ("radiance", "valid", "clipped"):
        np.testing.assert_array_equal(getattr(back, name), getattr(environment, name))
    assert back.scale == "cd/m²"
    assert not str(cleaned)


def test_a_radiance_picture_loses_the_marks_and_keeps_the_light(tmp_path: Path) -> None:
    environment = sample_map()
    write_environment(tmp_path / "map.hdr", environment)
    back, _ = read_environment(tmp_path / "map.hdr")
    brightest = environment.radiance.max(axis=2, keepdims=True)
    # RGBE keeps 8 bits of the brightest channel.
    assert np.all(np.abs(back.radiance - environment.radiance) <= brightest / 128)
    assert back.valid.all()


def test_an_existing_map_is_replaced_only_by_force(tmp_path: Path) -> None:
    write_environment(tmp_path / "map.exr", sample_map())
    with pytest.raises(InputError, match="--force"):
        write_environment(tmp_path / "map.exr", sample_map(), force=False)


@pytest.mark.parametrize("size", [(8, 8), (8, 17), (8, 15), (1, 2), (32, 24)])
def test_a_picture_that_is_no_lat_long_map_is_refused(
    tmp_path: Path, size: tuple[int, int]
) -> None:
    path = tmp_path / "picture.exr"
    write_hdr(path, np.ones((*size, 3), np.float32))
    with pytest.raises(InputError, match=rf"picture\.exr.*twice as wide.*{size[1]}×{size[0]}"):
        read_environment(path)


def test_a_map_without_a_finite_pixel_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "map.exr"
    write_hdr(path, np.full((4, 8, 3), np.nan, np.float32))
    with pytest.raises(InputError, match=r"map\.exr: not one of its pixels"):
        read_environment(path)


def test_a_file_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_environment(tmp_path / "map.exr", sample_map())
    read = []

    def noted(kind: str, path: Path) -> object:
        read.append(path)
        return decode(kind, path)

    monkeypatch.setattr(capture.exr, "decode", noted)
    read_environment(tmp_path / "map.exr")
    assert read == [tmp_path / "map.exr"]


def test_an_odd_number_of_rows_is_a_map(tmp_path: Path) -> None:
    write_hdr(tmp_path / "map.exr", np.ones((5, 10, 3), np.float32))
    assert read_environment(tmp_path / "map.exr")[0].height == 5


def test_what_is_no_radiance_is_cleaned_counted_and_marked(tmp_path: Path) -> None:
    rgb = np.ones((4, 8, 3), np.float32)
    rgb[0, 0, 1], rgb[1, 1, 0], rgb[2, 2] = np.nan, np.inf, -3894
    write_hdr(tmp_path / "map.exr", rgb)
    environment, cleaned = read_environment(tmp_path / "map.exr")
    assert (cleaned.nan_count, cleaned.infinite_count, cleaned.negative_count) == (1, 1, 3)
    assert not environment.valid[0, 0]
    assert not environment.valid[1, 1]
    assert environment.valid.sum() == 30
    assert environment.radiance[0, 0].max() == 0
    assert environment.radiance[2, 2].max() == 0


def write_with_seam_centres(path: Path, rgb: np.ndarray) -> None:
    channels = dict(zip("RGB", np.moveaxis(rgb, -1, 0), strict=True))
    write_exr(path, channels, {"envmap": OpenEXR.ENVMAP_LATLONG})


def test_pixel_centres_on_the_seam_and_poles_become_cells(tmp_path: Path) -> None:
    height = 64
    # OpenEXR's rule: latitude π/2 … −π/2 and longitude π … −π at the first and last *centres*.
    theta = np.linspace(0, np.pi, height)[:, None]
    phi = np.linspace(np.pi, -np.pi, 2 * height)[None]
    y = np.broadcast_to(np.cos(theta), (height, 2 * height))
    directions = np.stack([np.sin(theta) * np.sin(phi), y, np.sin(theta) * np.cos(phi)], axis=-1)
    write_with_seam_centres(tmp_path / "map.exr", (directions + 1).astype(np.float32))
    environment, _ = read_environment(tmp_path / "map.exr")
    # Linear interpolation of a unit wave over a step h errs by h²/8; taking the picture as cells
    # would err by half a cell, h/2 = 0.025.
    np.testing.assert_allclose(environment.radiance - 1, cell_directions(height), atol=8e-4)


def test_a_one_pixel_light_keeps_its_flux_when_centres_become_cells(tmp_path: Path) -> None:
    height = 64
    for row, column in ((20, 30), (32, 0), (40, 127)):
        rgb = np.zeros((height, 2 * height, 3), np.float32)
        rgb[row, column] = 1e4
        write_with_seam_centres(tmp_path / "map.exr", rgb)
        environment, _ = read_environment(tmp_path / "map.exr")
        # A pixel between pixels of step h = π/(N − 1) stands for h² sin θ, or half of it on the
        # seam, whose two columns are one.
        step = np.pi / (height - 1)
        share = 0.5 if column in (0, 127) else 1.0
        expected = 1e4 * share * step**2 * np.sin(step * row)
        np.testing.assert_allclose(environment.integral(), expected, rtol=0.03)


@pytest.mark.data
def test_openexr_itself_puts_centres_on_the_seam() -> None:
    path = DATA / "env-openexr-images/OrientationLatLong.exr"
    if not path.exists():
        pytest.skip(f"{path} is absent")
    green = read_exr(path).channels["G"]
    np.testing.assert_allclose(green[:, 0], green[:, -1], atol=2e-3)  # half floats
    assert np.abs(green[:, 0] - green[:, 1]).max() > 0.1
    assert np.ptp(green[0]) == 0


@pytest.mark.data
def test_openexrs_map_shows_what_its_cube_shows_on_every_axis() -> None:
    folder = DATA / "env-openexr-images"
    if not folder.exists():
        pytest.skip(f"{folder} is absent")
    cube = read_exr(folder / "KernerEnvCube.exr").channels
    environment, _ = read_environment(folder / "KernerEnvLatLong.exr")
    directions = cell_directions(environment.height)
    solid_angle = np.repeat(solid_angles(environment.height)[:, None], directions.shape[1], axis=1)
    side = cube["G"].shape[1]
    across = np.linspace(-1, 1, side)
    face_weight = (1 + across[:, None] ** 2 + across**2) ** -1.5  # solid angle of a face's pixels

    def means(directions: np.ndarray) -> np.ndarray:
        """Mean colour of the cells that each face of the cube holds, +X −X +Y −Y +Z −Z."""
        largest = np.abs(directions).argmax(axis=-1)
        sign = np.take_along_axis(directions, largest[..., None], axis=-1)[..., 0] > 0
        return np.array(
            [
                np.average(environment.radiance[on], axis=0, weights=solid_angle[on])
                for axis in range(3)
                for on in ((largest == axis) & sign, (largest == axis) & ~sign)
            ]
        )

    faces = np.array(
        [
            [
                np.average(cube[name][face * side : (face + 1) * side], weights=face_weight)
                for name in "RGB"
            ]
            for face in range(6)
        ]
    )
    np.testing.assert_allclose(means(directions), faces, rtol=0.006)
    for wrong in ([-1, 1, 1], [1, 1, -1], [1, -1, 1]):  # a mirror, whichever axis, is found out
        assert not np.allclose(means(directions * wrong), faces, rtol=0.02)
