"""A mirror ball of chrome dims light by channel and angle; every way to lights takes that out."""

from dataclasses import replace

import numpy as np
import pytest

import lighting.maps.remap_image
from calibration.camera import Calibration
from calibration.models.mirror_ball import MirrorBall
from capture.radiance import RadianceImage
from lighting.blocks.source_blocks import apply_source_blocks, build_source_blocks, picture_blocks
from lighting.maps.environment import EnvironmentMap
from lighting.maps.remap import apply_remap, build_remap
from lighting.maps.remap_image import remap_image
from lighting.simulation.scenario import Moment
from lighting.simulation.simulate import build_view, see

CHROME = (0.55, 0.5, 0.6)
DARK = Calibration(
    MirrorBall((47.5, 47.5), 47.0, 12.0), (96, 96), np.radians(150), reflectance=CHROME
)
BRIGHT = replace(DARK, reflectance=())
ROOM = (4.0, 3.0, 2.0)


def seen_by(camera: Calibration) -> RadianceImage:
    """The simulated picture of an even room."""
    room = EnvironmentMap(
        np.full((16, 32, 3), ROOM, np.float32), np.ones((16, 32), bool), np.zeros((16, 32), bool)
    )
    radiance = see(build_view(camera, 16), Moment(0.0, room))
    plane = np.ones((96, 96), bool)
    return RadianceImage(radiance, np.zeros_like(radiance), plane, ~plane)


def test_a_simulated_chrome_ball_shows_half_the_light() -> None:
    picture = seen_by(DARK).radiance
    np.testing.assert_allclose(picture[47, 47], np.multiply(ROOM, CHROME), rtol=1e-3)
    directions, seen = DARK.unproject(np.array([[3.0, 47.5]]))
    assert seen.all()
    rim = DARK.reflected_share(directions)[0]
    assert rim[1] > 1.02 * CHROME[1]  # its red dips first, as that of metals does
    np.testing.assert_allclose(picture[47, 3], ROOM * rim, rtol=1e-3)


def test_a_map_has_the_light_of_the_room(monkeypatch: pytest.MonkeyPatch) -> None:
    picture = seen_by(DARK)
    at_once = apply_remap(build_remap(DARK, 16), picture)
    np.testing.assert_allclose(at_once.radiance[at_once.valid], [ROOM] * at_once.valid.sum(), 1e-4)
    monkeypatch.setattr(lighting.maps.remap_image, "_OPERATOR_PX", 0)
    monkeypatch.setattr(lighting.maps.remap_image, "_BAND_PX", 1000)
    banded = remap_image(DARK, picture, 16)
    np.testing.assert_allclose(banded.radiance[banded.valid], [ROOM] * banded.valid.sum(), 1e-4)


def test_blocks_of_the_picture_have_the_light_of_the_room() -> None:
    clear = apply_source_blocks(build_source_blocks(BRIGHT, 8), seen_by(BRIGHT))
    for sums in (
        apply_source_blocks(build_source_blocks(DARK, 8), seen_by(DARK)),
        picture_blocks(DARK, seen_by(DARK), 8),
    ):
        np.testing.assert_allclose(sums.sums, clear.sums, rtol=1e-4, atol=1e-5)
