"""Colours from a ColorChecker whose every patch is known."""

from pathlib import Path

import colour
import cv2
import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from calibration.colour_chart import (
    NEUTRALS,
    find_corners,
    measure_patches,
    reference_colours,
)
from calibration.colour_cli import calibrate_colour
from calibration.colour_matrix import difference, fit_colours
from capture.errors import InputError
from capture.frame import Exposure
from capture.primaries import REC709, rgb_to_xyz
from capture.radiance import RadianceImage
from capture.recording_writer import create_recording
from capture.sensor import assumed_sensor
from capture.sensor_files import read_sensor

Array = NDArray[np.float64]

D65 = REC709[3]
CAMERA = np.array([[0.9, 0.25, 0.02], [0.2, 1.1, 0.15], [0.05, 0.3, 0.8]]) * 0.6
"""What the camera's channels measure of linear Rec.709."""
CORNERS = np.array([[60.0, 50.0], [260.0, 62.0], [255.0, 190.0], [52.0, 182.0]])


def chart(colours: Array, corners: Array = CORNERS) -> Array:
    """A picture (240, 320, 3) of a chart with black between its patches, on grey."""
    flat = np.full((460, 660, 3), 0.15)
    flat[30:430, 30:630] = 0.03
    for patch, shown in enumerate(colours):
        row, column = divmod(patch, 6)
        flat[40 + 100 * row : 120 + 100 * row, 40 + 100 * column : 120 + 100 * column] = shown
    centres = np.array([[80, 80], [580, 80], [580, 380], [80, 380]], np.float32)
    place = cv2.getPerspectiveTransform(centres, corners.astype(np.float32))
    return np.asarray(
        cv2.warpPerspective(flat, place, (320, 240), flags=cv2.INTER_AREA, borderValue=(0.15,) * 3)
    )


def image_of(radiance: Array, clipped: NDArray[np.bool_] | None = None) -> RadianceImage:
    plane = radiance.shape[:2]
    mask = np.zeros(plane, bool) if clipped is None else clipped
    return RadianceImage(radiance, np.zeros_like(radiance), np.ones(plane, bool), mask)


def test_the_reference_is_the_published_chart() -> None:
    colours = reference_colours(D65)
    # Under D65 white is neutral to half a percent, 90 % bright, and black 3 %.
    assert colours[18] @ [0.2126, 0.7152, 0.0722] == pytest.approx(0.9, abs=0.02)
    np.testing.assert_allclose(colours[NEUTRALS][1:5] / colours[NEUTRALS][1:5, 1:2], 1, atol=0.04)
    assert np.argmax(colours[12]) == 2  # blue
    assert np.argmax(colours[13]) == 1  # green
    assert np.argmax(colours[14]) == 0  # red
    # Under a filament, white is as orange as the filament: x, y of A in Rec.709.
    lamp = reference_colours((0.44758, 0.40745))
    assert lamp[19, 0] > 1.5 * lamp[19, 1] > 3 * lamp[19, 2]


def spectral(light: str) -> tuple[Array, Array]:
    """Linear Rec.709 (24, 3) of a chart's spectra that are not those corrected by, and its xy."""
    shape = colour.SpectralShape(400, 700, 10)
    chart = colour.SDS_COLOURCHECKERS["ISO 17321-1"].values()
    patches = np.array([each.copy().align(shape).values for each in chart])
    lamp = colour.SDS_ILLUMINANTS[light].copy().align(shape).values
    observer = "CIE 1931 2 Degree Standard Observer"
    eye = colour.MSDS_CMFS[observer].copy().align(shape).values
    xyz = (patches * lamp) @ eye / (lamp @ eye[:, 1])
    return np.linalg.solve(rgb_to_xyz(REC709), xyz.T).T, colour.CCS_ILLUMINANTS[observer][light]


@pytest.mark.parametrize(("light", "without"), [("A", 1.5), ("FL2", 4.0)])
def test_the_reference_under_a_known_lamp_is_what_spectra_say(light: str, without: float) -> None:
    true, white_xy = spectral(light)
    assert difference(reference_colours(white_xy, light), true).mean() < 1.3
    assert difference(reference_colours(white_xy), true).mean() > without
    d50 = (0.34567, 0.35850)
    np.testing.assert_allclose(reference_colours(d50, "D50"), reference_colours(d50), atol=1e-3)


def test_patches_are_measured_where_the_corners_say() -> None:
    colours = reference_colours(D65) @ CAMERA.T
    measured = measure_patches(image_of(chart(colours)), CORNERS)
    np.testing.assert_allclose(measured, colours, rtol=1e-5)


def test_a_chart_is_found() -> None:
    found = find_corners(image_of(chart(reference_colours(D65) @ CAMERA.T)))
    np.testing.assert_allclose(found, CORNERS, atol=4)
    with pytest.raises(InputError, match="give --corners"):
        find_corners(image_of(np.full((240, 320, 3), 0.2)))


def test_charts_that_cannot_be_measured_are_refused() -> None:
    picture = chart(reference_colours(D65) @ CAMERA.T)
    clipped = np.zeros((240, 320), bool)
    clipped[178:186, 48:56] = True
    with pytest.raises(InputError, match="row 4, column 1 of the chart is clipped"):
        measure_patches(image_of(picture, clipped), CORNERS)
    with pytest.raises(InputError, match="in the order dark skin"):
        measure_patches(image_of(picture), CORNERS[::-1])
    with pytest.raises(InputError, match="photograph it larger"):
        measure_patches(image_of(picture), CORNERS / 20 + 50)
    with pytest.raises(InputError, match="row 1, column 1 of the chart has 0 pixels"):
        measure_patches(image_of(picture), CORNERS - 500)


def noisy(measured: Array, share: float, seed: int = 0) -> Array:
    return measured * (1 + share * np.random.default_rng(seed).standard_normal(measured.shape))


def test_an_exact_camera_is_inverted_but_for_exposure() -> None:
    true = reference_colours(D65)
    fit = fit_colours(true @ CAMERA.T, true, NEUTRALS, np.eye(3))
    exact = np.linalg.inv(CAMERA)
    np.testing.assert_allclose(fit.matrix / fit.matrix[1, 1], exact / exact[1, 1], atol=1e-9)
    assert fit.worst < 1e-6
    assert fit.before > 5


@pytest.mark.parametrize(
    ("camera", "form"),
    [(np.diag([0.5, 1.0, 0.7]), "white balance"), (CAMERA, "grey stays grey")],
    ids=["no crosstalk", "crosstalk"],
)
def test_the_simplest_form_that_does_is_taken(camera: Array, form: str) -> None:
    true = reference_colours(D65)
    fit = fit_colours(noisy(true @ camera.T, 0.01), true, NEUTRALS, np.eye(3))
    assert fit.form == form
    assert fit.after < 1.2
    assert fit.after == next(each.held_out for each in fit.trials if each.form == form)


def test_grey_keeps_its_luminance_and_becomes_the_light_s_colour() -> None:
    white_xy = (0.44758, 0.40745)
    true = reference_colours(white_xy)
    measured = noisy(true @ CAMERA.T, 0.01)
    old = np.diag([1.2, 1.0, 1.5])
    fit = fit_colours(measured, true, NEUTRALS, old)
    weights = np.array([0.2126, 0.7152, 0.0722])
    grey = measured[NEUTRALS].sum(axis=0)
    assert weights @ fit.matrix @ grey == pytest.approx(weights @ old @ grey)
    shown, wanted = fit.matrix @ grey, true[NEUTRALS].sum(axis=0)
    np.testing.assert_allclose(shown / shown[1], wanted / wanted[1], rtol=0.03)


def test_the_difference_is_that_of_luo_cui_and_rigg() -> None:
    # A grey 1 % of L* brighter: ΔL' = 1 and S_L = 1 + 0.015·0/√20 = 1 at L* = 50.
    grey = lambda lightness: np.full((1, 3), ((lightness + 16) / 116) ** 3)  # noqa: E731
    assert difference(grey(50.5), grey(49.5))[0] == pytest.approx(1.0, rel=1e-3)


def test_colours_without_a_chart_are_refused() -> None:
    with pytest.raises(InputError, match="hardly differ"):
        fit_colours(np.ones((24, 3)), reference_colours(D65), NEUTRALS, np.eye(3))


def test_from_a_photograph_to_a_sensor(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    true = reference_colours(D65, "D65")
    counts = np.round(chart(true @ CAMERA.T) * 60000).astype(np.uint16)
    photograph, output = tmp_path / "chart.tiff", tmp_path / "sensor.json"
    cv2.imwrite(str(photograph), counts[..., ::-1])
    corners = " ".join(f"{x},{y}" for x, y in CORNERS)
    calibrate_colour(photograph, output=output, corners=corners, exposures="0.01")
    told = capsys.readouterr().out
    assert "grey stays grey" in told or "any matrix" in told
    matrix = read_sensor(output).colour_matrix
    assert matrix is not None
    seen = true @ CAMERA.T @ matrix.T
    np.testing.assert_allclose(seen / seen.mean(), true / true.mean(), atol=0.02)
    content = msgspec.json.decode(output.read_bytes())
    assert content["delta_e"] < 0.5 < content["delta_e_before"]
    again = tmp_path / "again.json"  # the matrix that the sensor had before does not matter
    calibrate_colour(photograph, output=again, corners=corners, exposures="0.01", response=output)
    np.testing.assert_allclose(read_sensor(again).colour_matrix, matrix)
    with create_recording(tmp_path / "r", "", assumed_sensor(np.uint16)) as writer:
        writer.write_frame(counts, Exposure(1.0), 0.0, 0)
    with pytest.raises(InputError, match="has its exposures"):
        calibrate_colour(tmp_path / "r", output=tmp_path / "no.json", exposures="0.01")
    for flags, message in (
        ({"light": "sunny"}, "--light: wanted"),
        ({"light": "0.9,0.9"}, "no light's"),
        ({"corners": "1,2 3,4"}, "--corners: wanted"),
    ):
        with pytest.raises(InputError, match=message):
            calibrate_colour(photograph, output=tmp_path / "no.json", exposures="0.01", **flags)  # type: ignore[arg-type]
