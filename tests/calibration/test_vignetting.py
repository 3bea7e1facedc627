"""Vignetting from samples and from pictures, against lenses whose vignetting is known."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from calibration.camera import Calibration
from calibration.files import read_calibration, read_object, write_calibration
from calibration.models.equisolid import Equisolid
from calibration.report_cli import report
from calibration.vignetting import Samples, Trial, VignettingFit, fit_vignetting
from calibration.vignetting_cli import calibrate_vignetting
from calibration.vignetting_published import from_published
from calibration.vignetting_record import (
    correction_error,
    read_vignetting_record,
    vignetting_record,
)
from calibration.vignetting_samples import Shot, flat_samples, lamp_samples, overlap_samples
from capture.errors import InputError
from capture.radiance import RadianceImage
from capture.radiance_files import write_radiance
from tests.calibration.lit_pictures import LENS, SIZE, UNEVEN_LENS, lamp, scene, shot, turned

AHEAD = np.array([0.0, 0.0, 1.0])


def flats(lens: Calibration) -> list[Shot]:
    """Two flat fields, the camera turned about its axis between them."""
    even = np.full((SIZE, SIZE), 5.0)
    return [shot(turned(lens, 0, roll), even, seed=i) for i, roll in enumerate((0.0, np.pi))]


def lamps(lens: Calibration) -> list[Shot]:
    """A lamp from rim to rim in 31 steps, at many azimuths."""
    cameras = [turned(lens, yaw, 1.7 * i) for i, yaw in enumerate(np.linspace(-1.45, 1.45, 31))]
    return [shot(each, lamp(each, AHEAD), f"lamp {i}", i) for i, each in enumerate(cameras)]


def overlapping(lens: Calibration) -> list[Shot]:
    """A still scene from five turns of the camera."""
    turns = [(0.0, 0.0), (0.7, 1.0), (-0.7, 2.2), (1.4, 4.0), (-1.4, 5.0)]
    cameras = [turned(lens, *each) for each in turns]
    return [shot(each, scene(each), seed=i) for i, each in enumerate(cameras)]


def fitted(lens: Calibration, fit: VignettingFit) -> Calibration:
    return replace(lens, vignetting=fit.chosen.radial, uneven_vignetting=fit.chosen.uneven)


def errors(lens: Calibration, fit: VignettingFit) -> NDArray[np.float64]:
    """Of V to 85° from the axis, at twelve azimuths."""
    angle, azimuth = np.meshgrid(np.linspace(0, np.radians(85), 50), np.arange(12) * np.pi / 6)
    directions = np.stack(
        [np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), np.cos(angle)], axis=-1
    )
    world = directions @ lens.R_world_camera.T
    return fitted(lens, fit).illumination(world) - lens.illumination(world)


@pytest.mark.parametrize(
    ("sample", "lens", "limit"),
    [
        # A patch's noise is 1 %/√25, and the lamp's flux has that of some 20 pixels.
        (lambda lens: flat_samples(flats(lens)), LENS, 1e-3),
        (lambda lens: flat_samples(flats(lens)), UNEVEN_LENS, 1e-3),
        (lambda lens: lamp_samples(lamps(lens), 0.06), UNEVEN_LENS, 2.5e-2),
        (lambda lens: overlap_samples(overlapping(lens)), UNEVEN_LENS, 2e-3),
    ],
    ids=["flat", "flat, uneven", "lamp", "overlap"],
)
def test_a_lens_is_found_from_its_pictures(
    sample: Callable[[Calibration], Samples], lens: Calibration, limit: float
) -> None:
    fit = fit_vignetting(sample(lens))
    assert np.abs(errors(lens, fit)).max() < limit
    assert len(fit.chosen.uneven) == len(lens.uneven_vignetting)
    assert fit.seen_rad[1] > np.radians(80)


def samples_of(lens: Calibration, noise: float, seed: int = 0, count: int = 400) -> Samples:
    """Samples of one light, each its own block."""
    random = np.random.default_rng(seed)
    angle, azimuth = random.uniform(0, 1.5, count), random.uniform(-np.pi, np.pi, count)
    in_camera = np.stack(
        [np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), np.cos(angle)], axis=-1
    )
    value = 7 * lens.illumination(in_camera @ lens.R_world_camera.T)
    log_value = np.log(value) + noise * random.standard_normal(count)
    return Samples(
        angle, azimuth, log_value, np.zeros(count, int), np.arange(count), tells_unevenness=True
    )


@pytest.mark.parametrize(
    ("vignetting", "uneven"),
    [((), ()), ((-0.2,), ()), ((-0.3, 0.05), ()), ((-0.2,), (0.05, 0.02))],
)
def test_no_more_is_modelled_than_the_samples_need(
    vignetting: tuple[float, ...], uneven: tuple[float, ...]
) -> None:
    lens = replace(LENS, vignetting=vignetting, uneven_vignetting=uneven)
    fit = fit_vignetting(samples_of(lens, 0.01))
    assert (len(fit.chosen.radial), len(fit.chosen.uneven)) == (len(vignetting), len(uneven))
    assert fit.chosen.held_out == pytest.approx(0.01, rel=0.15)


def test_pictures_of_something_else_are_refused() -> None:
    with pytest.raises(InputError, match=r"differ by 3\d% from what any vignetting"):
        fit_vignetting(samples_of(LENS, 0.3, seed=4))


def test_without_noise_the_coefficients_are_exact() -> None:
    fit = fit_vignetting(samples_of(UNEVEN_LENS, 0.0))
    np.testing.assert_allclose(fit.chosen.radial, UNEVEN_LENS.vignetting, atol=1e-8)
    np.testing.assert_allclose(fit.chosen.uneven, UNEVEN_LENS.uneven_vignetting, atol=1e-8)


def test_outliers_hardly_move_it() -> None:
    clean = samples_of(LENS, 0.005)
    log_value = clean.log_value.copy()
    log_value[::8] -= 0.5
    fit = fit_vignetting(replace(clean, log_value=log_value))
    assert np.abs(errors(LENS, fit)).max() < 0.01


@pytest.mark.parametrize(("noise", "count"), [(0.02, 150), (0.01, 400)], ids=["vague", "clear"])
def test_the_stated_deviation_is_that_of_the_error(noise: float, count: int) -> None:
    # Vague samples let a form through that is too simple; that is part of the deviation.
    angle = np.array([0.5, 1.0, 1.4])
    ratios = []
    for seed in range(15):
        samples = replace(samples_of(LENS, noise, seed, count), tells_unevenness=False)
        fit = fit_vignetting(samples)
        error = fitted(LENS, fit).relative_illumination(angle) - LENS.relative_illumination(angle)
        ratios.append(error / fit.deviation(angle))
    assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.5


def test_one_flat_field_cannot_tell_uneven_light_from_an_uneven_lens() -> None:
    samples = flat_samples(flats(UNEVEN_LENS)[:1])
    assert fit_vignetting(samples).chosen.uneven == ()


def test_dust_and_clipped_pixels_do_not_matter() -> None:
    even, turned_over = flats(LENS)
    radiance = even.image.radiance.copy()
    radiance[100:104, 60:64] *= 0.3  # a quarter of a patch
    clipped = np.zeros((SIZE, SIZE), bool)
    clipped[:, 152:] = True  # patches of 5 pixels: 3 of each row of the one from 150 on
    radiance[clipped] = 99
    image = replace(even.image, radiance=radiance, clipped=clipped)
    samples = flat_samples([replace(even, image=image), turned_over])
    assert samples.log_value.max() < np.log(5.1)
    fit = fit_vignetting(samples)
    assert np.abs(errors(LENS, fit)).max() < 2e-3


def test_pixels_next_to_clipped_ones_are_not_compared() -> None:
    spoilt = []
    for each in overlapping(UNEVEN_LENS):
        clipped = np.zeros((SIZE, SIZE), bool)
        clipped[::12] = True
        radiance = np.where(clipped[..., None], np.float32(0), each.image.radiance)
        image = replace(each.image, radiance=radiance, clipped=clipped)
        spoilt.append(replace(each, image=image))
    samples = overlap_samples(spoilt)
    assert np.abs(errors(UNEVEN_LENS, fit_vignetting(samples))).max() < 3e-3


def test_a_record_tells_the_largest_deviation_around_the_axis() -> None:
    trial = Trial((-0.1,), (0.02, 0.0), 0.01, True)
    fit = VignettingFit(trial, np.diag([0.0, 1e-4, 0.0]), (0.0, 1.0), 99, (trial,))
    record = vignetting_record(fit, LENS, "flat", ["a.exr"])
    # Of θ cos φ the coefficient is known to 0.01.
    np.testing.assert_allclose(record.sigma, 0.01 * np.array(record.angle_rad), atol=1e-12)


def test_pictures_that_cannot_be_used_are_refused() -> None:
    lit = lamps(LENS)[5]
    clipped = np.ones((SIZE, SIZE), bool)
    with pytest.raises(InputError, match=r"lamp 5: the lamp .* clipped"):
        lamp_samples([replace(lit, image=replace(lit.image, clipped=clipped))], 0.06)
    with pytest.raises(InputError, match="does not stand out"):
        lamp_samples([shot(LENS, np.ones((SIZE, SIZE)))], 0.06)
    with pytest.raises(InputError, match="cut off"):
        lamp_samples([shot(LENS, np.zeros((SIZE, SIZE)))], 0.06)
    edge = turned(LENS, 1.57)
    with pytest.raises(InputError, match="cut off by the rim"):
        lamp_samples([shot(edge, lamp(edge, AHEAD))], 0.06)
    back = [turned(LENS, yaw) for yaw in (0.0, np.pi)]
    with pytest.raises(InputError, match="hardly overlap"):
        overlap_samples([shot(each, scene(each)) for each in back])
    with pytest.raises(InputError, match="10 measurements or more"):
        fit_vignetting(lamp_samples(lamps(LENS)[:6], 0.06))
    with pytest.raises(InputError, match="×"):
        Shot("small", RadianceImage(*[np.ones((9, 9, 3))] * 2, *[np.ones((9, 9), bool)] * 2), LENS)


def test_a_published_polynomial_is_exact_where_the_lens_is_equidistant() -> None:
    # r = f θ, so R = θ f / unit and v_i = k_i (f / unit)^2i.
    focal_px, unit_px = LENS.model.project(np.array([1.0, 0, 0]))[0][0] - (SIZE - 1) / 2, 100.0
    ratio = focal_px / (np.pi / 2) / unit_px
    radial, worst = from_published(LENS, (-0.3, 0.1, -0.02), unit_px)
    np.testing.assert_allclose(radial, [-0.3 * ratio**2, 0.1 * ratio**4, -0.02 * ratio**6])
    assert worst < 1e-9


def test_of_another_lens_its_error_is_told() -> None:
    lens = Calibration(Equisolid((119.5, 119.5), 80.0), (SIZE, SIZE), np.radians(95))
    radial, worst = from_published(lens, (-0.3, 0.1, -0.05))
    angle = np.linspace(0, np.radians(95), 60)
    r = 160 * np.sin(angle / 2) / (SIZE / np.sqrt(2))
    truth = 1 - 0.3 * r**2 + 0.1 * r**4 - 0.05 * r**6
    found = replace(lens, vignetting=radial).relative_illumination(angle)
    assert np.abs(found / truth - 1).max() <= worst * 1.01 < 1.1e-3
    with pytest.raises(InputError, match="not positive"):
        from_published(lens, (-3.0,))


def test_from_pictures_to_a_calibration(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pictures = [tmp_path / "a.exr", tmp_path / "b.exr"]
    for path, each in zip(pictures, flats(LENS), strict=True):
        write_radiance(path, each.image)
    start, output = tmp_path / "start.json", tmp_path / "cal.json"
    write_calibration(start, replace(LENS, vignetting=()), lens_fit={"kept": 1})
    calibrate_vignetting(*pictures, calibration=[start], source="flat", output=output)
    told = capsys.readouterr()
    assert "V(91°) = 0." in told.out
    assert "extrapolated" not in told.err
    found = read_calibration(output)
    rim = found.relative_illumination(1.5)
    assert rim == pytest.approx(LENS.relative_illumination(1.5), abs=2e-3)
    content = read_object(output)
    assert content["lens_fit"] == {"kept": 1}
    assert content["vignetting_fit"]["pictures"] == ["a.exr", "b.exr"]
    assert 0 < content["vignetting_fit"]["sigma"][-1] < 2e-3
    record = read_vignetting_record(output)
    assert record is not None
    share, angle_rad = correction_error(record, found)
    darkest = found.relative_illumination(found.valid_angle_rad)
    assert share == pytest.approx(content["vignetting_fit"]["sigma"][-1] / darkest)
    assert angle_rad == pytest.approx(found.valid_angle_rad)
    assert read_vignetting_record(start) is None
    without_lens = tmp_path / "vignetting.json"
    write_calibration(without_lens, found, vignetting_fit=content["vignetting_fit"])
    report(without_lens)
    told = capsys.readouterr().out
    assert told.startswith("vignetting from 2 pictures (flat)")
    assert f"sure to {share:.2%} or better" in told
    cut = {**content["vignetting_fit"], "sigma": [0.1]}
    write_calibration(without_lens, found, vignetting_fit=cut)
    with pytest.raises(InputError, match="as many of sigma"):
        report(without_lens)

    narrow = tmp_path / "published.json"
    calibrate_vignetting(
        calibration=[start], source="published", coefficients="-0.3,0.1", output=narrow
    )
    assert "2 coefficients in θ², within 0.00%" in capsys.readouterr().out
    with pytest.raises(InputError, match="one for each picture"):
        calibrate_vignetting(
            *pictures, calibration=[start], source="overlap", output=tmp_path / "no.json"
        )
    with pytest.raises(InputError, match="give pictures; or"):
        calibrate_vignetting(calibration=[start], source="flat", output=tmp_path / "no.json")
