"""The bundled recordings: what they promise, and that the pipeline finds their truth again."""

from pathlib import Path

import numpy as np
import pytest

from calibration.files import read_calibration
from capture.merge import merge_bracket
from capture.recording import Recording, open_recording
from lighting.maps.environment import luminance
from lighting.maps.remap import apply_remap, build_remap
from lighting.simulation.truth import Truth, read_truth
from lighting.sphere.latlong import cell_directions, solid_angles

FOLDER = Path(__file__).parents[2] / "recordings"
NAMES = ("outdoor", "indoor")
HEIGHT = 256
CELL_SR = solid_angles(HEIGHT)[:, None] * np.ones((1, 2 * HEIGHT))


def opened(name: str) -> tuple[Recording, Truth]:
    return open_recording(FOLDER / name), read_truth(FOLDER / name / "truth")


def blocks(cells: np.ndarray) -> np.ndarray:
    """Sums over blocks of 8 × 8 cells."""
    return cells.reshape(HEIGHT // 8, 8, HEIGHT // 4, 8).sum(axis=(1, 3))


def test_together_they_are_small() -> None:
    files = [path for name in NAMES for path in (FOLDER / name).rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 8e6


@pytest.mark.parametrize("name", NAMES)
def test_they_are_whole_and_say_where_they_come_from(name: str) -> None:
    recording, truth = opened(name)
    assert len(recording) == len(truth.moments) >= 24
    assert not [bracket for bracket in recording if isinstance(bracket, Exception)]
    assert recording.manifest.licence == "CC0-1.0"
    assert "@pmndrs/assets@1.7.0" in recording.manifest.source
    assert "python -m recordings.make" in recording.manifest.source


@pytest.mark.parametrize("name", NAMES)
def test_the_shortest_exposure_never_clips(name: str) -> None:
    recording, _ = opened(name)
    sensor = recording.sensor
    for index in range(len(recording)):
        shortest = min(recording.read_bracket(index).frames, key=lambda f: f.exposure.signal)
        assert sensor.linear_table()[shortest.counts.max(), 0] < sensor.saturation


def test_the_sun_exceeds_20000_times_the_mean_in_the_pixels_of_the_shortest_exposure() -> None:
    recording, truth = opened("outdoor")
    table = recording.sensor.linear_table()[:, 0]
    for index in (0, 2, 4, 20, 23):  # the sun is free
        shortest = min(recording.read_bracket(index).frames, key=lambda f: f.exposure.signal)
        peak = luminance(table[shortest.counts]).max() / shortest.exposure.signal
        mean = luminance(truth.moments[index].true_map().integral()) / (4 * np.pi)
        assert peak > 2e4 * mean


def test_the_cloud_and_the_lamp_are_there() -> None:
    sun = [moment.discs[0] for moment in opened("outdoor")[1].moments]
    light = np.array([luminance(disc.irradiance) for disc in sun])
    assert light.min() < 0.05 * light.max()
    assert light[0] == light[-1] == light.max()
    lamp = [moment.discs[0] for moment in opened("indoor")[1].moments]
    assert np.arccos(lamp[0].direction @ lamp[-1].direction) > np.radians(120)


@pytest.mark.parametrize(("name", "index"), [("outdoor", 0), ("outdoor", 21), ("indoor", 12)])
def test_merge_and_remap_find_the_truth_again(name: str, index: int) -> None:
    """Blocks of 8 × 8 cells within 5 % (JPEG, noise, footprint), the source's flux within 3 %."""
    recording, truth = opened(name)
    assert recording.calibration_path is not None
    calibration = read_calibration(recording.calibration_path)
    image = merge_bracket(recording.read_bracket(index), recording.sensor)
    found = apply_remap(build_remap(calibration, HEIGHT), image)
    moment = truth.moments[index]
    there = moment.true_map()
    assert not found.clipped.any()

    seen = blocks(found.valid.astype(np.float64)) == 64
    assert seen.mean() > 0.4
    ratio = blocks(luminance(found.radiance) * CELL_SR) / blocks(
        luminance(there.radiance) * CELL_SR
    )
    assert abs(np.median(ratio[seen]) - 1) < 0.005
    assert np.quantile(abs(ratio[seen] - 1), 0.95) < 0.05

    (disc,) = moment.discs
    near = cell_directions(HEIGHT) @ disc.direction > np.cos(disc.angular_radius_rad + 0.05)
    flux = luminance(found.radiance) * CELL_SR * near
    true_flux = luminance(there.radiance) * CELL_SR * near
    assert flux.sum() == pytest.approx(true_flux.sum(), rel=0.03)
    directions = cell_directions(HEIGHT)
    centroid, true_centroid = (
        np.tensordot(each, directions, axes=2) / each.sum() for each in (flux, true_flux)
    )
    assert np.linalg.norm(centroid - true_centroid) < 0.25 * np.pi / HEIGHT
