"""The same spheres of many materials under a point light and under a captured environment.

Input  : maps.    Output : how different spheres look, pictures.
Cost   : three seconds for each map.
Fails  : how well people tell materials apart is not measured, only how far the pictures differ.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.claims.contract import Claim, Finding, Maps, over
from render.reference.tracing import render_reference
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Material, Scene

ROUGHNESS = (0.15, 0.3, 0.5, 0.75)
SIZE_PX = (320, 80)

_OVER_POINT = "difference under the map over under a point light"
_GREY = (0.5, 0.5, 0.5)
_ERROR = 0.01
_MOST_SECONDS = 8.0
_LIGHT_FROM = np.array([[-0.5, 0.7, 0.5]]) / math.sqrt(0.99)

Floats = NDArray[np.float32]


def spheres() -> tuple[Scene, Camera]:
    """Return a row of spheres, one for each roughness, from the front; nothing below them."""
    count = len(ROUGHNESS)
    meshes = tuple(
        sphere((2.2 * (k - 0.5 * (count - 1)), 0.0, 0.0), 1.0, Material(_GREY, roughness))
        for k, roughness in enumerate(ROUGHNESS)
    )
    # From far away, so that all are seen from one direction.
    distance_m = 60.0
    fov_rad = 2 * math.atan(1.1 / distance_m)
    camera = Camera(np.array([0.0, 0.0, distance_m]), np.zeros(3), fov_rad, SIZE_PX)
    return Scene(meshes, None), camera


def under_point_light() -> Floats:
    """Return the picture (H, W, 4) under one light from the upper left."""
    light = LightSet(_LIGHT_FROM, np.full((1, 3), math.pi), np.zeros(1))
    return _picture(light)


def under(environment: EnvironmentMap) -> Floats:
    """Return the picture (H, W, 4) under a map."""
    return _picture(environment)


def differences(picture: Floats) -> list[float]:
    """Return how far each sphere differs from the next: the RMS of log ratios of radiance.

    A hundredth of the spheres' mean is added to all of them: what is in shadow under a point light
    shows no material.
    """
    width = SIZE_PX[0] // len(ROUGHNESS)
    tiles = picture.reshape(SIZE_PX[1], len(ROUGHNESS), width, 4).astype(np.float64)
    inside = (tiles[..., 3] == 1).all(axis=1)
    # What is known by what shadows take of it may come out below 0 by its error.
    shades = np.maximum(tiles[..., :3].mean(axis=-1), 0.0).transpose(1, 0, 2)[:, inside]
    logarithms = np.log(shades + 0.01 * shades.mean())
    return [float(each) for each in np.sqrt(np.mean(np.diff(logarithms, axis=0) ** 2, axis=1))]


def _point_light_against_environments(maps: Maps) -> list[Finding]:
    from_point = differences(under_point_light())
    findings = []
    for name, environment in maps.items():
        from_map = differences(under(environment))
        for k in range(len(ROUGHNESS) - 1):
            figures = {
                "difference under the map": from_map[k],
                "difference under a point light": from_point[k],
                _OVER_POINT: over(from_map[k], from_point[k]),
            }
            setting = f"{name}, roughness {ROUGHNESS[k]:g} and {ROUGHNESS[k + 1]:g}"
            findings.append(Finding(setting, figures, from_map[k] > from_point[k]))
    return findings


def _picture(light: LightSet | EnvironmentMap) -> Floats:
    scene, camera = spheres()
    traced = render_reference(scene, camera, light, error=_ERROR, seconds=_MOST_SECONDS)
    return traced.radiance


POINT_LIGHT = Claim(
    "a point light against a captured environment",
    "Materials show in a captured environment what a point light does not show of them.",
    "Fleming, Dror, Adelson, Journal of Vision 3(5), 2003, of people; here of pictures",
    "Dielectric spheres that differ in roughness alone: root mean square of the log ratio of the "
    "radiance of neighbours. Holds where the map makes them differ more than the point light does.",
    _point_light_against_environments,
    _OVER_POINT,
)
