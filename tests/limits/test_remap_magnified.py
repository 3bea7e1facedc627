"""Magnification: a picture with fewer pixels than the map has cells.

Claim    : the map is no sharper than the picture, and no light is lost or invented.
Setup    : one lit pixel of a 64 × 32 picture of the sphere on a 512 × 256 map.
Expected : the light is spread over about its pixel, 8 × 8 cells, and its surroundings; its flux and
           its place stay.
Measured : flux within 0.13 %, place within 0.004 pixels, 90 % of the light within 0.65 pixels of
           the middle (of a square pixel itself, within 0.56), no cell brighter than the pixel.
"""

import numpy as np
import pytest

from calibration.camera import Calibration
from calibration.models.equirectangular import full_sphere
from capture.radiance import RadianceImage
from lighting.maps.remap import apply_remap, build_remap
from lighting.sphere.latlong import cell_directions, solid_angles

HEIGHT = 256


def test_a_magnified_pixel_is_blurred_but_complete() -> None:
    camera = Calibration(full_sphere((64, 32)), (64, 32), np.pi)
    radiance = np.zeros((32, 64, 3), np.float32)
    radiance[12, 20] = 1.0
    mask = np.ones((32, 64), bool)
    image = RadianceImage(radiance, np.zeros_like(radiance), mask, ~mask)
    environment = apply_remap(build_remap(camera, HEIGHT), image)

    theta = np.pi * np.array([12, 13]) / 32
    pixel_sr = np.pi / 32 * (np.cos(theta[0]) - np.cos(theta[1]))
    np.testing.assert_allclose(environment.integral(), pixel_sr, rtol=0.005)
    light = environment.radiance[..., 0] * solid_angles(HEIGHT)[:, None]
    direction, _ = camera.unproject(np.array([20.0, 12.0]))
    centroid = np.einsum("rc,rck->k", light, cell_directions(HEIGHT))
    pixel_rad = np.pi / 32
    assert np.arccos(direction @ centroid / np.linalg.norm(centroid)) < 0.02 * pixel_rad
    angle = np.arccos(np.clip(cell_directions(HEIGHT) @ direction, -1, 1))
    assert light[angle < 0.75 * pixel_rad].sum() > 0.9 * light.sum()
    assert environment.radiance.max() == pytest.approx(1, abs=0.05)  # not sharper than the picture
