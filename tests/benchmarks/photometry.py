"""How true light is: vignetting, absolute scale, a clipped sun, colours, two mirror balls as one.

Every case is simulated, so that the truth is known. `error` and `worst` are in %, of colours ΔE00:
vignetting : 240 px pictures with 1 % noise; of V to 85° from the axis, rms and largest; `covered`
             is the share within twice the predicted standard deviation.
scale      : of the factor, by a 180° fisheye of 512 px with 1 % noise in the outdoor map; by a
             level meter, or 40 spots of 0.5° of which those count that are told to vary by less
             than 5 %, median and largest.
sun        : 50° high over the outdoor map, as bright as three times its sky, cut off and recovered;
             the largest of the illuminance of surfaces that face six ways and the sun, and before.
colours    : of the 24 patches, by spectra of patches, light and camera sensors (those that
             colour-science has), what it told of itself, and before: white balance alone.
two balls  : ray-traced at D/R = 8, turned by 90° and an unknown bit more, 210 px, 1 % noise; mean
             of radiance, `seam` where both pictures count; and `energy`, of the whole's.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import colour
import numpy as np
from numpy.typing import NDArray

from calibration.ball import fit_ball, pose
from calibration.ball_cone import Pinhole
from calibration.ball_outline import find_outline
from calibration.camera import LEVEL, UP, Calibration
from calibration.colour_chart import NEUTRALS, reference_colours
from calibration.colour_matrix import difference, fit_colours
from calibration.models.equidistant import Equidistant
from calibration.vignetting import Samples, fit_vignetting
from calibration.vignetting_samples import flat_samples, lamp_samples, overlap_samples
from capture.primaries import REC709, rgb_to_xyz
from capture.radiance import CD_M2, RadianceImage
from lighting.maps.combine import View, align_views, combine_views, trust
from lighting.maps.environment import EnvironmentMap, luminance
from lighting.maps.environment_files import read_environment
from lighting.maps.remap_image import remap_image
from lighting.photometry.absolute_scale import scale_from_illuminance, scale_from_luminance
from lighting.photometry.clipped_source import recover_clipped
from lighting.photometry.disc import disc_shares
from lighting.photometry.illuminance import FACINGS, surface_illuminance
from lighting.simulation.scenario import Moment
from lighting.simulation.simulate import build_view, see
from lighting.sphere.latlong import cell_directions, solid_angles
from tests.calibration.ball_pictures import backdrop, room, scene_of, trace
from tests.calibration.lit_pictures import LENS, UNEVEN_LENS
from tests.calibration.test_vignetting import flats, lamps, overlapping

Array = NDArray[np.float64]

OUTDOOR = Path(__file__).parents[2] / "recordings/outdoor/truth/map-0000.exr"
CD_M2_PER_UNIT = 7300.0
UPWARD = (0.0, 1.0, 0.0)


def run(repeats: int) -> list[dict[str, Any]]:
    """Return rows {stage, case, system, ms, ratio, accuracy}."""
    del repeats  # the cases are many
    rows: list[dict[str, Any]] = []
    for name, measure in CASES.items():
        for case, accuracy in measure():
            start_s = time.perf_counter()
            figures = accuracy()
            rows.append(
                {
                    "stage": "photometry",
                    "case": f"{name}: {case}",
                    "system": "fishlight",
                    "ms": (time.perf_counter() - start_s) * 1e3,
                    "ratio": None,
                    "accuracy": figures,
                }
            )
    return rows


Case = tuple[str, Callable[[], dict[str, float]]]


def vignetting() -> list[Case]:
    """From each of the three kinds of pictures, of a lens that is even and one that is not."""
    ways: dict[str, Callable[[Calibration], Samples]] = {
        "two flat fields": lambda lens: flat_samples(flats(lens)),
        "one lamp, 31 pictures": lambda lens: lamp_samples(lamps(lens), 0.06),
        "five overlapping pictures": lambda lens: overlap_samples(overlapping(lens)),
    }
    lenses = {"even": LENS, "uneven": UNEVEN_LENS}
    return [
        (f"{way}, {name} lens", lambda s=sample, c=lens: _vignetting_error(s, c))
        for way, sample in ways.items()
        for name, lens in lenses.items()
    ]


def _vignetting_error(
    sample: Callable[[Calibration], Samples], lens: Calibration
) -> dict[str, float]:
    fit = fit_vignetting(sample(lens))
    angle, azimuth = np.meshgrid(np.radians(np.arange(86.0)), np.arange(12) * np.pi / 6)
    across = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1) * np.sin(angle)[..., None]
    in_camera = np.concatenate([across, np.cos(angle)[..., None]], axis=-1)
    true = lens.illumination(in_camera @ lens.R_world_camera.T)
    error = np.abs(fit.chosen.illumination(angle, azimuth) - true)
    covered = error <= 2 * fit.deviation(angle, azimuth) + 1e-12
    return {
        "error": 100 * float(np.sqrt(np.mean((error / true) ** 2))),
        "worst": 100 * float((error / true).max()),
        "covered": float(covered.mean()),
    }


def scale() -> list[Case]:
    """From a spot's luminance or a level meter's illuminance."""
    truth, _ = read_environment(OUTDOOR)
    camera = Calibration(Equidistant((255.5, 255.5), 512 / np.pi), (512, 512), np.pi / 2, UP)
    radiance = see(build_view(camera, truth.height), Moment(0.0, truth))
    radiance *= 1 + 0.01 * np.random.default_rng(0).standard_normal(radiance.shape)
    world = remap_image(camera, _picture(radiance), 256)

    def spots() -> dict[str, float]:
        rng = np.random.default_rng(1)
        errors = []
        for _ in range(40):
            towards = rng.standard_normal(3)
            towards[1] = abs(towards[1]) + 0.3
            towards /= np.linalg.norm(towards)
            shares = disc_shares(truth.height, towards, np.radians(0.5))
            meter = CD_M2_PER_UNIT * (shares * luminance(truth.radiance)).sum()
            factor, told = scale_from_luminance(world, towards, np.radians(0.5), float(meter))
            if told < 0.05:
                errors.append(100 * abs(factor / CD_M2_PER_UNIT - 1))
        return {"error": float(np.median(errors)), "worst": max(errors)}

    def level_meter() -> dict[str, float]:
        meter = CD_M2_PER_UNIT * surface_illuminance(truth, UPWARD).total
        factor = scale_from_illuminance(world, UPWARD, meter)
        return {"error": 100 * abs(factor / CD_M2_PER_UNIT - 1)}

    return [("spots of 0.5°", spots), ("a level meter", level_meter)]


def sun() -> list[Case]:
    """A sun cut off, its map right or 2 % too bright."""
    sky = replace(read_environment(OUTDOOR)[0], scale=CD_M2)
    towards = np.array([np.cos(np.radians(50)) * 0.6, np.sin(np.radians(50)), 0.0])
    towards[2] = -np.cos(np.radians(50)) * 0.8
    clipped = cell_directions(sky.height) @ towards > np.cos(np.radians(1.0))
    disc_sr = float(solid_angles(sky.height) @ clipped.sum(axis=1))
    warm = np.array([1.0, 0.96, 0.9], np.float32)
    brightness = 3 * surface_illuminance(sky, UPWARD).total / disc_sr / luminance(warm)
    light = sky.radiance + clipped[..., None] * brightness * warm
    truth = replace(sky, radiance=light.astype(np.float32))
    cut = np.minimum(truth.radiance, 2 * sky.radiance.max())
    facings = [*FACINGS.values(), tuple(towards.tolist())]
    true = np.array([surface_illuminance(truth, each).total for each in facings])

    def error(world: EnvironmentMap) -> float:
        got = np.array([surface_illuminance(world, each).total for each in facings])
        return 100 * float(np.abs(got / true - 1).max())

    def recovered(factor: float) -> dict[str, float]:
        known = replace(truth, radiance=cut.astype(np.float32) * np.float32(factor))
        known = replace(known, clipped=clipped)
        whole = recover_clipped(known, UPWARD, float(true[0]))
        return {"error": error(whole), "before": error(known)}

    return [
        ("scale right", lambda: recovered(1.0)),
        ("scale 2 % too large", lambda: recovered(1.02)),
    ]


def colours() -> list[Case]:
    """The chart under four lights, by two cameras' sensors."""
    return [
        (f"{camera}, {light}", lambda c=camera, w=light: _colour_error(c, w))
        for camera in ("Nikon 5100 (NPL)", "Sigma SDMerill (NPL)")
        for light in ("D65", "D50", "A", "FL2")
    ]


def _colour_error(camera: str, light: str) -> dict[str, float]:
    shape = colour.SpectralShape(400, 700, 10)
    chart = colour.SDS_COLOURCHECKERS["ISO 17321-1"].values()
    patches = np.array([each.copy().align(shape).values for each in chart])
    lamp = colour.SDS_ILLUMINANTS[light].copy().align(shape).values
    sensors = colour.MSDS_CAMERA_SENSITIVITIES[camera].copy().align(shape).values
    eye = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values
    xyz = (patches * lamp) @ eye / (lamp @ eye[:, 1])
    true = np.linalg.solve(rgb_to_xyz(REC709), xyz.T).T
    measured = (patches * lamp) @ sensors / (lamp @ sensors[:, 1])
    measured *= 1 + 0.005 * np.random.default_rng(0).standard_normal(measured.shape)
    white_xy = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"][light]
    fit = fit_colours(measured, reference_colours(white_xy, light), NEUTRALS, np.eye(3))
    balance = true[19] / measured[19]

    def delta_e(estimate: Array) -> float:
        exposed = estimate * (true[:, 1].sum() / estimate[:, 1].sum())
        return float(difference(exposed, true).mean())

    return {
        "error": delta_e(measured @ fit.matrix.T),
        "before": delta_e(measured * balance),
        "told": fit.after,
    }


def two_balls() -> list[Case]:
    """From pictures to one map: outline, calibration, registration and mean."""
    scene = scene_of(8.0, 210.0, (470, 470))
    stood = [pose(0.3, 0.0, 0.0), pose(0.3 - np.pi / 2 + 0.05, 0.03, -0.02)]
    pictures = [_traced_room(scene, each) for each in stood]

    def combined() -> dict[str, float]:
        pinhole = Pinhole(scene.focal_px, scene.principal_px)
        views = []
        for picture, told in zip(pictures, (stood[0], pose(2.0, 0.0, 0.0)), strict=True):
            outline = find_outline(picture.radiance, pinhole)
            fit = fit_ball(outline, scene.size_px, pinhole, R_world_camera=told)
            views.append(View(picture, fit.calibration))
        aligned, _ = align_views(views)
        world, _ = combine_views(aligned, 128)
        truth = _room_in_world(cell_directions(128))
        error = np.abs(luminance(world.radiance) / luminance(truth) - 1)
        weights = [trust(each.calibration, world, 0.0)[0] for each in aligned]
        share = weights[0] / (weights[0] + weights[1])
        seam = (share > 0.2) & (share < 0.8)
        energy = world.integral().sum() / (solid_angles(128) @ truth.sum(axis=(1, 2)))
        return {
            "error": 100 * float(np.mean(error[~seam])),
            "seam": 100 * float(np.mean(error[seam])),
            "energy": 100 * abs(float(energy) - 1),
        }

    return [("90° apart", combined)]


def _traced_room(scene: Any, R_world_camera: Array) -> RadianceImage:
    width, height = scene.size_px
    grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
    steps = (np.arange(3) + 0.5) / 3 - 0.5
    radiance = np.zeros((height, width, 3))
    radiance += 0.01 * np.random.default_rng(0).standard_normal(radiance.shape)
    for dy in steps:
        for dx in steps:
            directions, hits = trace(scene, grid + np.array([dx, dy]))
            shown = backdrop(directions)
            shown[hits] = _room_in_world(directions[hits] @ R_world_camera.T)
            radiance += shown / 9
    return _picture(radiance)


def _room_in_world(directions: Array) -> Array:
    return room(directions @ LEVEL)  # it is drawn with +y down


def _picture(radiance: Array) -> RadianceImage:
    plane = np.ones(radiance.shape[:2], np.bool_)
    linear = np.maximum(radiance, 0).astype(np.float32)
    return RadianceImage(linear, np.zeros_like(linear), plane, ~plane)


CASES: dict[str, Callable[[], list[Case]]] = {
    "vignetting": vignetting,
    "scale": scale,
    "sun": sun,
    "colours": colours,
    "two balls": two_balls,
}
