"""Illuminance, absolute scale and the clipped sun, against closed forms."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from calibration.camera import UP, Calibration
from calibration.files import write_calibration
from calibration.models.equidistant import Equidistant
from capture.errors import InputError
from capture.radiance import CD_M2
from capture.radiance_files import write_hdr
from lighting.absolute_cli import illuminance, recover, scale
from lighting.maps.environment import EnvironmentMap, luminance
from lighting.maps.environment_files import read_environment, write_environment
from lighting.photometry.absolute_scale import (
    grey_card_luminance,
    in_cd_m2,
    scale_from_illuminance,
    scale_from_luminance,
)
from lighting.photometry.clipped_source import recover_clipped
from lighting.photometry.illuminance import FACINGS, sphere_illuminance, surface_illuminance
from lighting.sphere.caps import SUN_RADIUS_RAD
from lighting.sphere.latlong import cell_directions, direction_to_grid, solid_angles
from render.main import main

UPWARD = (0.0, 1.0, 0.0)


def sky(luminance_of_cells: NDArray[np.float64] | float, height: int = 32) -> EnvironmentMap:
    """A grey map that was seen everywhere."""
    shape = (height, 2 * height)
    radiance = np.broadcast_to(np.asarray(luminance_of_cells), shape)[..., None] * np.ones(3)
    return EnvironmentMap(radiance, np.ones(shape, bool), np.zeros(shape, bool))


def with_sun(towards: NDArray[np.float64], height: int = 64, full: float = 50.0) -> EnvironmentMap:
    """A sky of 1 with a clipped cap of 2° radius."""
    inside = cell_directions(height) @ towards > np.cos(np.radians(2))
    column, row = np.rint(direction_to_grid(towards, height)).astype(int)
    inside[np.clip(row, 0, height - 1), column % (2 * height)] = True
    return replace(sky(np.where(inside, full, 1.0), height), clipped=inside, scale=CD_M2)


@pytest.mark.parametrize("facing", FACINGS)
@pytest.mark.parametrize("height", [2, 8, 30])
def test_a_constant_sky_gives_pi_times_its_luminance(facing: str, height: int) -> None:
    assert surface_illuminance(sky(3.0, height), FACINGS[facing]).total == pytest.approx(3 * np.pi)
    assert sphere_illuminance(sky(3.0, height)).total == pytest.approx(3 * np.pi)


def test_a_luminance_that_rises_with_the_zenith_cosine() -> None:
    # L = max(cos θ, 0): horizontal ∫ cos² dω = 2π/3; vertical by symmetry
    # ∫ cos θ sin θ cos φ sin θ dθ dφ = 2 · 1/3; sphere ∫ cos dω / 4 = π/4.
    up = np.maximum(cell_directions(256)[..., 1], 0)
    world = sky(up, 256)
    assert surface_illuminance(world, UPWARD).total == pytest.approx(2 * np.pi / 3, rel=1e-4)
    for facing in ("+X", "-X", "+Z", "-Z"):
        assert surface_illuminance(world, FACINGS[facing]).total == pytest.approx(2 / 3, rel=1e-4)
    assert surface_illuminance(world, FACINGS["down"]).total == 0
    assert sphere_illuminance(world).total == pytest.approx(np.pi / 4, rel=1e-4)


@pytest.mark.parametrize("facing", ["+X", "-X", "+Z", "-Z", "up", "down"])
def test_a_small_lamp_shines_on_the_side_that_it_stands_on(facing: str) -> None:
    height, towards = 128, np.array(FACINGS[facing])
    lamp = cell_directions(height) @ towards > np.cos(np.radians(3))
    world = sky(lamp.astype(float), height)
    flux = float(solid_angles(height) @ lamp.sum(axis=1))
    opposite = -towards
    assert surface_illuminance(world, towards).total == pytest.approx(flux, rel=2e-3)
    assert surface_illuminance(world, opposite).total == 0
    oblique = towards + np.cross(towards, [0.6, 0.0, 0.8]) + np.cross(towards, [0.0, 1.0, 0.0])
    cosine = 1 / np.linalg.norm(oblique)
    assert surface_illuminance(world, oblique).total == pytest.approx(flux * cosine, rel=3e-3)


def test_shares_of_clipped_and_unseen_are_told() -> None:
    world = sky(1.0)
    rows = np.arange(32)[:, None] * np.ones(64)
    clipped, valid = rows < 8, rows < 16  # clipped within 45° of the zenith: sin² 45° = 1/2
    half = replace(world, clipped=clipped, valid=valid)
    received = surface_illuminance(half, UPWARD)
    assert received.clipped_share == pytest.approx(0.5)
    assert received.unseen_share == 0
    assert surface_illuminance(half, (1, 0, 0)).unseen_share == pytest.approx(0.5)
    assert surface_illuminance(half, (0, -1, 0)).unseen_share == pytest.approx(1)


@settings(max_examples=20, deadline=None)
@given(
    factor=st.floats(1e-3, 1e5),
    normal=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda n: np.linalg.norm(n) > 0.1),
)
def test_every_measurement_finds_the_same_scale(
    factor: float, normal: tuple[float, float, float]
) -> None:
    height = 16
    truth = sky(1.5 + cell_directions(height)[..., 2], height)
    absolute = in_cd_m2(truth, factor)
    lux = surface_illuminance(absolute, normal).total
    assert scale_from_illuminance(truth, normal, lux) == pytest.approx(factor, rel=1e-5)
    column, row = np.rint(direction_to_grid(np.array(normal), height)).astype(int)
    cell = np.clip(row, 0, height - 1), column % (2 * height)
    spot = float(luminance(absolute.radiance[cell]))
    found, _ = scale_from_luminance(truth, normal, 0.0, spot)
    assert found == pytest.approx(factor, rel=1e-5)


def test_a_spot_is_the_mean_by_solid_angle_and_tells_its_spread() -> None:
    height = 64
    bright = cell_directions(height)[..., 0] > 0  # half of a spot around the zenith
    factor, unevenness = scale_from_luminance(
        sky(np.where(bright, 3.0, 1.0), height), UPWARD, 0.3, 8
    )
    assert factor == pytest.approx(4)
    assert unevenness == pytest.approx(0.5)
    # A spot within a cell beside the edge may be beyond it by a slightly different aim.
    beside = (-0.02, 1.0, 0.0)
    factor, unevenness = scale_from_luminance(
        sky(np.where(bright, 3.0, 1.0), height), beside, 0.0, 8
    )
    assert factor == pytest.approx(8)
    assert unevenness > 0.5
    assert scale_from_luminance(sky(2.0), beside, 0.01, 8) == pytest.approx((4, 0))


def test_a_grey_card_is_a_matt_surface() -> None:
    assert grey_card_luminance(0.18, 1000 * np.pi) == pytest.approx(180)
    with pytest.raises(InputError, match="from 0 to 1"):
        grey_card_luminance(18, 1000)
    with pytest.raises(InputError, match="positive"):
        grey_card_luminance(0.18, -5)


def test_scales_that_would_be_wrong_are_refused() -> None:
    shape = (32, 64)
    top = np.zeros(shape, bool)
    top[:4] = True
    clipped = replace(sky(1.0), clipped=top)
    with pytest.raises(InputError, match="would be too large"):
        scale_from_illuminance(clipped, UPWARD, 100)
    with pytest.raises(InputError, match="clipped"):
        scale_from_luminance(clipped, UPWARD, 0.1, 100)
    unseen = replace(sky(1.0), valid=~top)
    with pytest.raises(InputError, match="did not see"):
        scale_from_illuminance(unseen, UPWARD, 100)
    with pytest.raises(InputError, match="did not see"):
        scale_from_luminance(unseen, UPWARD, 0.1, 100)
    with pytest.raises(InputError, match="in cd/m² already"):
        in_cd_m2(in_cd_m2(sky(1.0), 2), 2)
    with pytest.raises(InputError, match="beyond"):
        in_cd_m2(sky(1e30), 1e30)
    with pytest.raises(InputError, match="black"):
        scale_from_luminance(sky(0.0), UPWARD, 0.1, 100)
    with pytest.raises(InputError, match="black"):
        scale_from_illuminance(sky(0.0), UPWARD, 100)
    for wrong in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="positive and finite"):
            scale_from_illuminance(sky(1.0), UPWARD, wrong)
    with pytest.raises(InputError, match="not all 0"):
        scale_from_illuminance(sky(1.0), (0, 0, 0), 1)


def test_in_the_shade_of_what_is_clipped_the_rest_sets_the_scale() -> None:
    world = replace(with_sun(np.array([0.6, 0.8, 0.0])), scale="relative")
    alone = surface_illuminance(
        replace(world, radiance=np.where(world.clipped[..., None], 0, world.radiance)), UPWARD
    ).total
    factor = scale_from_illuminance(world, UPWARD, 7 * alone, clipped_were_shaded=True)
    assert factor == pytest.approx(7)


@pytest.mark.parametrize(
    "towards",
    [[0.6, 0.8, 0.0], [0.0, 1.0, 0.0], [0.01, 0.5, -0.866], [-0.3, 0.2, 0.5]],
    ids=["slope", "zenith", "seam", "low"],
)
@pytest.mark.parametrize("radius_rad", [SUN_RADIUS_RAD, 0.1, None])
def test_a_recovered_sun_gives_what_was_measured(
    towards: list[float], radius_rad: float | None
) -> None:
    sun = np.array(towards) / np.linalg.norm(towards)
    world = with_sun(sun, 128)
    lux = 5 * surface_illuminance(world, UPWARD).total
    whole = recover_clipped(world, UPWARD, lux, radius_rad)
    assert surface_illuminance(whole, UPWARD).total == pytest.approx(lux, rel=1e-6)
    assert not whole.clipped.any()
    # Facing the sun, its flux is what the horizontal lacked over the cosine: the place is right.
    missing = lux - surface_illuminance(world, UPWARD).total
    facing = surface_illuminance(whole, sun).total - surface_illuminance(world, sun).total
    assert facing == pytest.approx(missing / sun[1], rel=0.03)
    assert np.all(whole.radiance >= world.radiance * (1 - 1e-6))
    changed = (whole.radiance != world.radiance).any(axis=-1)
    reach = max(radius_rad or 0, np.radians(2)) + 1.5 * np.pi / 128
    assert np.all(cell_directions(128)[changed] @ sun > np.cos(reach))


def test_the_recovered_light_has_the_colour_of_what_is_clipped() -> None:
    world = with_sun(np.array([0.6, 0.8, 0.0]))
    tinted = replace(
        world, radiance=np.where(world.clipped[..., None], [60, 50, 40], world.radiance)
    )
    whole = recover_clipped(tinted, UPWARD, 100.0)
    assert surface_illuminance(whole, UPWARD).total == pytest.approx(100.0)
    gained = (whole.integral() - tinted.integral()) / whole.integral()[0]
    np.testing.assert_allclose(gained / gained[1], [1.2, 1.0, 0.8], rtol=1e-3)


@pytest.mark.parametrize(
    ("cells", "regions"),
    [
        ([(0, 5), (0, 40)], 1),  # across the pole
        ([(9, 0), (9, 63)], 1),  # across the seam
        ([(9, 0), (10, 63)], 1),  # and by corners, both ways
        ([(10, 0), (9, 63)], 1),
        ([(9, 1), (9, 63)], 2),
        ([(9, 4), (11, 4)], 2),
        ([(1, 5), (1, 40)], 2),
    ],
)
def test_regions_touch_across_the_seam_and_the_pole(
    cells: list[tuple[int, int]], regions: int
) -> None:
    clipped = np.zeros((32, 64), bool)
    clipped[tuple(np.transpose(cells))] = True
    world = replace(sky(1.0), clipped=clipped, scale=CD_M2)
    if regions == 1:
        assert not recover_clipped(world, UPWARD, 1e4).clipped.any()
    else:
        with pytest.raises(InputError, match=f"{regions} separate regions"):
            recover_clipped(world, UPWARD, 1e4)


def test_recoveries_that_make_no_sense_are_refused() -> None:
    sun = np.array([0.6, 0.8, 0.0])
    world = with_sun(sun)
    with pytest.raises(InputError, match="lx already"):
        recover_clipped(world, UPWARD, 1.0)
    with pytest.raises(InputError, match="from where the meter"):
        recover_clipped(world, (-1, 0, 0), 1e4)
    with pytest.raises(InputError, match="nothing in the map is clipped"):
        recover_clipped(replace(sky(1.0), scale=CD_M2), UPWARD, 1e4)
    two = replace(world, clipped=world.clipped | with_sun(np.array([-0.6, 0.8, 0.0])).clipped)
    with pytest.raises(InputError, match="2 separate regions"):
        recover_clipped(two, UPWARD, 1e4)
    with pytest.raises(InputError, match="fishlight scale"):
        recover_clipped(replace(world, scale="relative"), UPWARD, 1e4)
    with pytest.raises(InputError, match="between 0° and 90°"):
        recover_clipped(world, UPWARD, 1e4, 2.0)
    with pytest.raises(InputError, match=r"1e\+41 lx are beyond"):
        recover_clipped(world, UPWARD, 1e41)


def test_from_files_to_a_recovered_sun(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    relative, absolute, whole = (tmp_path / f"{name}.exr" for name in ("rel", "abs", "whole"))
    camera = tmp_path / "cal.json"
    write_calibration(camera, Calibration(Equidistant((31.5, 31.5), 20.0), (64, 64), 1.5, UP))
    write_environment(relative, replace(with_sun(np.array([0.6, 0.8, 0.0])), scale="relative"))
    illuminance(relative)
    told = capsys.readouterr().out
    assert "horizontal, up: " in told
    assert "(relative); a lower bound, " in told
    scale(relative, output=absolute, luminance_cd_m2=2000, pixel="31.5,31.5", calibration=camera)
    told = capsys.readouterr().out
    assert "2000 cd/m² per unit; the spot and what is just beside it vary by 0.0%" in told
    assert "horizontal, down: 6283 lx\n" in told
    recover(absolute, output=whole, illuminance_lx=90_000)
    told = capsys.readouterr().out
    assert "of 9e+04 lx were missing" in told
    assert "horizontal, up: 9e+04 lx\n" in told
    assert read_environment(whole)[0].scale == CD_M2
    card = tmp_path / "card.exr"
    scale(relative, output=card, grey_card=0.18, illuminance_lx=1000, direction="0,1,0")
    assert "57.2958 cd/m² per unit" in capsys.readouterr().out  # 180/π
    scale(relative, output=card, cd_m2_per_unit=57.2958, force=True)
    assert "horizontal, down: 180 lx" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ({}, "give one of --luminance-cd-m2"),
        ({"luminance_cd_m2": 1.0, "illuminance_lx": 1.0}, "give one of"),
        ({"luminance_cd_m2": 1.0, "cd_m2_per_unit": 1.0}, "give one of"),
        ({"cd_m2_per_unit": -1.0}, "must be positive"),
        ({"luminance_cd_m2": 1.0}, "--direction X,Y,Z or --pixel"),
        ({"luminance_cd_m2": 1.0, "pixel": "1,2"}, "needs the --calibration"),
        ({"luminance_cd_m2": 1.0, "direction": "1,2"}, "wanted 3 numbers"),
        ({"grey_card": 0.18}, "needs --illuminance-lx"),
        ({"illuminance_lx": 1.0, "facing": "north"}, r"--facing: wanted up, down, \+X"),
        ({"illuminance_lx": 1.0, "direction": "0,1,0"}, "or --grey-card"),
    ],
)
def test_flags_that_contradict_each_other(
    tmp_path: Path, flags: dict[str, float | str], message: str
) -> None:
    write_environment(tmp_path / "map.exr", sky(1.0))
    with pytest.raises(InputError, match=message):
        scale(tmp_path / "map.exr", output=tmp_path / "out.exr", **flags)  # type: ignore[arg-type]
    assert not (tmp_path / "out.exr").exists()


def test_of_several_clipped_regions_the_one_that_is_named_gets_the_light() -> None:
    sun = np.array([0.6, 0.8, 0.0])
    world = with_sun(sun)
    glints = np.zeros_like(world.clipped)
    glints[10, 100] = glints[30, 7] = True
    world = replace(world, clipped=world.clipped | glints)
    with pytest.raises(InputError, match=r"3 separate regions .* say where"):
        recover_clipped(world, UPWARD, 500)
    whole = recover_clipped(world, UPWARD, 500, towards=(0.62, 0.8, 0.0))
    np.testing.assert_array_equal(whole.clipped, glints)
    assert surface_illuminance(whole, UPWARD).total == pytest.approx(500)
    brightest = np.argmax(whole.radiance.sum(axis=-1))
    assert cell_directions(whole.height).reshape(-1, 3)[brightest] @ sun > np.cos(0.06)
    with pytest.raises(InputError, match="nothing is clipped there; the nearest"):
        recover_clipped(world, UPWARD, 500, towards=(0.0, -1.0, 0.0))


def test_the_commands_take_directions_that_begin_with_a_minus(tmp_path: Path) -> None:
    relative = tmp_path / "map.exr"
    write_environment(relative, sky(2.0))
    spot = ["--luminance-cd-m2", "500", "--direction"]
    meter = ["--illuminance-lx", "500", "--facing"]
    for number, arguments in enumerate(([*meter, "-Z"], [*meter, "-0.6,0.8,0"], [*spot, "-1,0,0"])):
        output = tmp_path / f"{number}.exr"
        with pytest.raises(SystemExit, match="0"):
            main(["scale", str(relative), "-o", str(output), *arguments])
        assert read_environment(output)[0].scale == CD_M2


def test_what_is_amiss_in_a_map_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    radiance = np.ones((8, 16, 3), np.float32)
    radiance[0, 0, 1], radiance[4, 4, 0] = np.nan, -1
    write_hdr(tmp_path / "map.exr", radiance)
    illuminance(tmp_path / "map.exr")
    assert "map.exr: set to 0 in the file: 1 NaN, 1 negative values" in capsys.readouterr().out


def test_what_is_refused_of_a_map_names_its_file(tmp_path: Path) -> None:
    path, output = tmp_path / "map.exr", tmp_path / "abs.exr"
    write_environment(path, sky(0.0))
    with pytest.raises(InputError, match=r"map\.exr: the spot is black"):
        scale(path, output=output, luminance_cd_m2=500, direction="0,1,0")
    with pytest.raises(InputError, match=r"map\.exr: the map is relative"):
        recover(path, output=output, illuminance_lx=500)
