"""The simulated camera: light kept, noise as stated, recordings that repeat."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.camera import LEVEL, UP, Calibration
from calibration.files import write_calibration
from calibration.models.equidistant import Equidistant
from calibration.models.equirectangular import full_sphere
from calibration.models.equisolid import Equisolid
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.mirror_ball import MirrorBall
from capture.errors import InputError
from capture.frame import Exposure
from capture.recording import open_recording
from capture.sensor import Sensor
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import write_environment
from lighting.simulate_cli import simulate
from lighting.simulation.scenario import Disc, Moment, scenario
from lighting.simulation.simulate import (
    build_view,
    expose,
    fitting_exposures,
    see,
    simulate_recording,
    simulated_sensor,
)
from lighting.simulation.truth import read_truth

SIDE = 120
SIZE = (SIDE, SIDE)
CENTRE = ((SIDE - 1) / 2, (SIDE - 1) / 2)
CAMERAS = {
    "equisolid, up": Calibration(Equisolid(CENTRE, 40.0), SIZE, np.radians(93), UP),
    "equidistant, vignetting": Calibration(
        Equidistant(CENTRE, 34.0), SIZE, np.radians(95), UP, vignetting=(-0.1,)
    ),
    "Kannala-Brandt, level": Calibration(
        KannalaBrandt(CENTRE, 30.0, -0.02, 0.003), SIZE, np.radians(110), LEVEL
    ),
    "mirror ball": Calibration(MirrorBall(CENTRE, 58.0, 6.0), SIZE, np.pi, LEVEL),
    "equirectangular": Calibration(full_sphere((240, 120)), (240, 120), np.pi),
}
every_camera = pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())


def environment(radiance: np.ndarray) -> EnvironmentMap:
    seen = np.ones(radiance.shape[:2], np.bool_)
    return EnvironmentMap(radiance.astype(np.float32), seen, ~seen)


def bright_dark(height: int = 32) -> EnvironmentMap:
    """A map with some of everything."""
    return environment(np.random.default_rng(4).gamma(0.3, 1.0, (height, 2 * height, 3)))


DARK = environment(np.zeros((8, 16, 3)))


@every_camera
def test_a_constant_world_is_constant_but_for_vignetting(camera: Calibration) -> None:
    view = build_view(camera, 8)
    light = see(view, Moment(0.0, environment(np.full((8, 16, 3), 0.75)), yaw_rad=0.3))
    expected = 0.75 * view.illumination * np.ones(3)
    np.testing.assert_allclose(light[view.seen], expected, rtol=1e-6)
    assert not light[~view.seen].any()
    assert (view.illumination.min() < 0.9) == bool(camera.vignetting)


def test_the_pixels_of_the_full_sphere_hold_its_light() -> None:
    view = build_view(CAMERAS["equirectangular"], 32)
    assert view.solid_angle.sum() == pytest.approx(4 * np.pi, rel=1e-4)
    world = bright_dark()
    light = see(view, Moment(0.0, world, yaw_rad=0.1))
    flux = (light * view.solid_angle[..., None]).sum(axis=(0, 1))
    np.testing.assert_allclose(flux, world.integral(), rtol=0.01)


def test_a_pixel_has_the_solid_angle_between_its_corners() -> None:
    # A cell of a lat-long picture has (2π/W)(sin δ_bottom − sin δ_top); the straight sides of the
    # quadrilateral cut a little off it.
    view = build_view(CAMERAS["equirectangular"], 32)
    edges = np.sin(np.linspace(-np.pi / 2, np.pi / 2, 121))
    expected = 2 * np.pi / 240 * np.diff(edges)
    np.testing.assert_allclose(view.solid_angle, np.repeat(expected[:, None], 240, 1), rtol=0.01)


def test_cells_stand_where_the_grid_says() -> None:
    y, x = np.mgrid[0:32, 0:64]
    above = environment((y < 16)[..., None] * np.ones(3))
    toward_x = environment((x < 32)[..., None] * np.ones(3))
    view = build_view(CAMERAS["equirectangular"], 32)
    expected = np.zeros((120, 240, 3))
    expected[:60] = 1.0
    np.testing.assert_array_equal(see(view, Moment(0.0, above)), expected)
    # A level camera that looks along +Z has +X at its left.
    expected = np.zeros((120, 240, 3))
    expected[:, :120] = 1.0
    np.testing.assert_array_equal(see(view, Moment(0.0, toward_x)), expected)


def test_the_pixels_of_a_fisheye_hold_its_cap() -> None:
    # A cap of half-angle θ has 2π(1 − cos θ); the rim is whole pixels.
    view = build_view(CAMERAS["equisolid, up"], 32)
    cap = 2 * np.pi * (1 - np.cos(np.radians(93)))
    assert view.solid_angle.sum() == pytest.approx(cap, rel=2e-3)


@every_camera
@pytest.mark.parametrize("radius_rad", [1e-5, 0.00465, 0.05, 0.2])
def test_a_disc_keeps_its_flux_whatever_its_size(camera: Calibration, radius_rad: float) -> None:
    view = build_view(camera, 8)
    for pixel in ([70.3, 50.8], [59.5, 60.0], [41.0, 75.5]):
        direction = camera.unproject(np.array(pixel))[0]
        disc = Disc("lamp", direction, radius_rad, np.array([3.0, 2.0, 1.0]))
        light = see(view, Moment(0.0, DARK, discs=(disc,)))
        light[view.seen] /= view.illumination
        flux = (light * view.solid_angle[..., None]).sum(axis=(0, 1))
        np.testing.assert_allclose(flux, disc.irradiance, rtol=1e-9)
        # No pixel is brighter than the disc, but for the unevenness of its points.
        assert (light <= 1.05 * disc.radiance).all()


@pytest.mark.parametrize("direction", [[0, 0, -1], [0, 1, 0], [0, -1, 0]], ids=["seam", "+Y", "−Y"])
def test_seam_and_poles_lose_no_flux(direction: list[float]) -> None:
    view = build_view(CAMERAS["equirectangular"], 8)
    disc = Disc("sun", np.array(direction, np.float64), 0.03, np.ones(3))
    light = see(view, Moment(0.0, DARK, discs=(disc,)))
    flux = (light * view.solid_angle[..., None]).sum(axis=(0, 1))
    np.testing.assert_allclose(flux, 1.0, rtol=1e-3)


def test_a_disc_stands_where_its_direction_projects() -> None:
    camera = CAMERAS["equisolid, up"]
    view = build_view(camera, 8)
    y, x = np.mgrid[0:SIDE, 0:SIDE]
    for pixel in ([70.3, 50.8], [40.0, 81.5], [59.5, 59.5]):
        disc = Disc("sun", camera.unproject(np.array(pixel))[0], 0.06, np.ones(3))
        flux = see(view, Moment(0.0, DARK, discs=(disc,)))[..., 0] * view.solid_angle
        centroid = np.array([(flux * x).sum(), (flux * y).sum()]) / flux.sum()
        np.testing.assert_allclose(centroid, pixel, atol=0.02)


def test_a_disc_outside_the_view_is_not_seen() -> None:
    view = build_view(CAMERAS["equisolid, up"], 8)
    disc = Disc("sun", np.array([0.0, -1.0, 0.0]), 0.1, np.ones(3))
    assert not see(view, Moment(0.0, DARK, discs=(disc,))).any()


def test_yaw_by_whole_cells_is_a_rolled_map() -> None:
    view = build_view(CAMERAS["Kannala-Brandt, level"], 32)
    world = bright_dark()
    rolled = replace(world, radiance=np.roll(world.radiance, -5, axis=1))
    turned = see(view, Moment(0.0, world, yaw_rad=5 * np.pi / 32))
    # Samples on the border of two cells may fall to either.
    same = np.isclose(turned, see(view, Moment(0.0, rolled)), rtol=1e-5)
    assert same.mean() > 0.99


def test_maps_of_another_height_than_the_view_are_refused() -> None:
    view = build_view(CAMERAS["equirectangular"], 32)
    with pytest.raises(InputError, match="one size"):
        see(view, Moment(0.0, DARK))


def test_noise_has_the_mean_and_variance_of_photons_and_read_out() -> None:
    sensor = Sensor(1000.0, 65535.0, full_well_e=20_000.0, read_noise_e=12.0)
    exposure = Exposure(0.5, gain=2.0)
    light = np.full((200, 200, 3), 0.3)  # a linear value of 0.3 · 0.5 · 2
    counts = expose(light, exposure, sensor, np.random.default_rng(1)).astype(np.float64)
    dn_per_e = (65535 - 1000) / (20_000 / 2)
    electrons = (counts - 1000) / dn_per_e
    # 3000 e: σ² = 3000 + 12²; the mean of n = 120,000 is normal, its variance has σ² √(2/n).
    variance = 3000 + 144
    assert abs(electrons.mean() - 3000) < 5 * np.sqrt(variance / counts.size)
    assert electrons.var() == pytest.approx(variance, rel=5 * np.sqrt(2 / counts.size))


def test_what_exceeds_a_full_pixel_is_clipped() -> None:
    light = np.array([[[1.2, 1e30, 0.0]]])
    for frame_format, white in (("png", 255), ("png16", 65535)):
        sensor = simulated_sensor(frame_format)
        counts = expose(light, Exposure(1.0), sensor, np.random.default_rng(0))
        np.testing.assert_array_equal(counts[0, 0, :2], white)
        assert counts[0, 0, 2] < 0.05 * white


class NoNoise:
    """A generator that draws every mean."""

    poisson = staticmethod(np.asarray)

    def standard_normal(self, shape):
        return np.zeros(shape)


@pytest.mark.parametrize("frame_format", ["png", "png16"])
def test_the_count_is_the_one_nearest_to_the_light(frame_format: str) -> None:
    quiet = simulated_sensor(frame_format)
    linear = np.linspace(0.0, 1.0, 30_000).reshape(100, 100, 3)
    counts = expose(linear, Exposure(1.0), quiet, NoNoise())
    table = quiet.linear_table()[: int(quiet.white_dn) + 1, 0]
    below, above = table[np.maximum(counts, 1) - 1], table[np.minimum(counts, len(table) - 2) + 1]
    error = np.abs(table[counts] - linear)
    assert (error <= np.minimum(np.abs(below - linear), np.abs(above - linear)) + 1e-6).all()


@settings(max_examples=15, deadline=None)
@given(peak=st.floats(1.0, 1e6), seed=st.integers(0, 99))
def test_nothing_clips_in_the_shortest_of_the_fitting_exposures(peak: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    radiance = rng.random((8, 16, 3))
    radiance[2, 3] = peak
    disc = Disc("sun", np.array([0.6, 0.8, 0.0]), 0.05, peak * rng.random(3) * 0.01)
    moments = [Moment(0.0, environment(radiance), 1.1, 0.2, (disc,))]
    view = build_view(CAMERAS["equisolid, up"], 8)
    sensor = simulated_sensor("jpeg")
    times_s = fitting_exposures(moments, view, sensor)
    assert list(times_s) == sorted(times_s)
    shortest = expose(see(view, moments[0]), Exposure(times_s[0]), sensor, rng)
    assert sensor.linear_table()[shortest.max(), 0] < sensor.saturation
    longest = expose(see(view, moments[0]), Exposure(times_s[-1]), sensor, rng)
    assert np.median(longest[view.seen]) > 80


def test_exposures_cannot_be_chosen_for_the_dark() -> None:
    view = build_view(CAMERAS["equisolid, up"], 8)
    with pytest.raises(InputError, match="--exposures"):
        fitting_exposures([Moment(0.0, DARK)], view, simulated_sensor("jpeg"))


@pytest.fixture
def camera_file(tmp_path: Path) -> Path:
    path = tmp_path / "cal.json"
    write_calibration(path, CAMERAS["equisolid, up"])
    return path


def frames(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted((folder / "frames").iterdir())}


def test_the_same_seed_gives_the_same_bytes_and_a_frame_its_own_noise(
    tmp_path: Path, camera_file: Path
) -> None:
    def record(name: str, **changes: object) -> Path:
        wanted = {"bracket_count": 3, "rate_hz": 2.0, "lamp": True}
        moments = scenario([bright_dark()], **wanted)
        options = {"exposures_s": [0.01, 0.2], "seed": 7, "source": "test", **changes}
        simulate_recording(tmp_path / name, moments, camera_file, **options)
        return tmp_path / name

    once, again, other = record("once"), record("again"), record("other", seed=8)
    first = {p.relative_to(once): p.read_bytes() for p in once.rglob("*") if p.is_file()}
    second = {p.relative_to(again): p.read_bytes() for p in again.rglob("*") if p.is_file()}
    assert first == second
    assert len(frames(once)) == 6
    assert all(a != b for a, b in zip(frames(once).values(), frames(other).values(), strict=True))


@pytest.mark.parametrize("frame_format", ["jpeg", "png", "png16"])
def test_a_recording_opens_with_its_sensor_camera_and_truth(
    tmp_path: Path, camera_file: Path, frame_format: str
) -> None:
    moments = scenario([bright_dark()], bracket_count=2, rate_hz=2.0, lamp=True, yaw_rad_per_s=0.5)
    folder = tmp_path / "recording"
    simulate_recording(
        folder,
        moments,
        camera_file,
        exposures_s=[0.01, 0.2],
        frame_format=frame_format,
        source="test",
        licence="CC0-1.0",
    )
    recording = open_recording(folder)
    brackets = list(recording)
    assert [len(bracket.frames) for bracket in brackets] == [2, 2]
    assert [frame.exposure.time_s for frame in brackets[1].frames] == [0.01, 0.2]
    assert [frame.timestamp_s for frame in brackets[1].frames] == [0.5, 0.75]
    assert brackets[0].frames[0].size_px == SIZE
    assert recording.sensor.white_dn == (65535 if frame_format == "png16" else 255)
    assert recording.calibration_path is not None
    assert recording.calibration_path.read_bytes() == camera_file.read_bytes()

    truth = read_truth(folder / "truth")
    assert len(truth.moments) == 2
    for told, lived in zip(truth.moments, moments, strict=True):
        assert (told.timestamp_s, told.yaw_rad) == (lived.timestamp_s, lived.yaw_rad)
        np.testing.assert_array_equal(told.environment.radiance, lived.environment.radiance)
        np.testing.assert_array_equal(told.discs[0].direction, lived.discs[0].direction)
        np.testing.assert_array_equal(told.discs[0].irradiance, lived.discs[0].irradiance)
    np.testing.assert_array_equal(truth.sensor.linear_table(), recording.sensor.linear_table())


def test_truth_that_is_not_there_or_damaged_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"truth\.json"):
        read_truth(tmp_path)
    (tmp_path / "truth.json").write_text('{"schema": "fishlight-truth/1"}')
    with pytest.raises(InputError, match=r"truth\.json"):
        read_truth(tmp_path)


def test_the_command_needs_a_map_and_a_seed_that_counts(tmp_path: Path, camera_file: Path) -> None:
    with pytest.raises(InputError, match="map"):
        simulate(output=tmp_path / "out", calibration=camera_file)
    with pytest.raises(InputError, match="--seed"):
        simulate(tmp_path / "a.exr", output=tmp_path / "out", calibration=camera_file, seed=-1)


def test_the_command_records_as_many_brackets_as_maps(
    tmp_path: Path, camera_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    maps = [tmp_path / "a.exr", tmp_path / "b.exr"]
    for path, level in zip(maps, (0.2, 0.4), strict=True):
        write_environment(path, environment(np.full((8, 16, 3), level)))
    folder = tmp_path / "recording"
    simulate(*maps, output=folder, calibration=camera_file, exposures="1/2,1", format="png")
    assert "brackets 2" in capsys.readouterr().out
    dim, bright = open_recording(folder)
    decode = simulated_sensor("png").linear_table()[:, 0]
    for bracket, level in ((dim, 0.2), (bright, 0.4)):
        for frame in bracket.frames:
            measured = decode[frame.counts[60, 60]] / frame.exposure.time_s
            np.testing.assert_allclose(measured, level, rtol=0.1)
    with pytest.raises(InputError, match="--force"):
        simulate(*maps, output=folder, calibration=camera_file)
    simulate(*maps, output=folder, calibration=camera_file, exposures="1", force=True)
    assert len(frames(folder)) == 2
