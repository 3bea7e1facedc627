"""Lights as baked transport takes them: cells of the sky, and a few narrow lights beside them."""

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import LUMINANCE_WEIGHTS
from lighting.sphere import harmonics
from render.baked.direction_cells import direction_cells, spread_over_cells
from render.lights.discs import Discs
from render.lights.narrow_lights import narrow_lights
from render.lights.reaching_lights import reaching_lights
from render.scenes.scene import Scene

Array = NDArray[np.float64]

_RAYS_SIDE = 2  # rays per cell and sample, per axis


class SkyCells:
    """The cells of a scene's sky.

    Parameters
    ----------
    scene : Scene
    widest : float
        Radius below which a light is narrow, in widths of a cell.

    Attributes
    ----------
    rays : (D, S, 3) float64
        Directions that are traced of each cell.
    """

    def __init__(self, scene: Scene, widest: float = 1.0) -> None:
        self._scene = scene
        upper_only = scene.ground is not None
        self._cells = direction_cells(upper_only=upper_only)
        self._widest_rad = widest * self._cells.width_rad
        self._basis = harmonics.basis(self._cells.points).mean(axis=1)
        self.rays = direction_cells(upper_only=upper_only, subdivisions=_RAYS_SIDE).points

    def split(self, lights: LightSet) -> tuple[Array, Discs]:
        """Return ∫L dω of each cell, (D, 3), and the lights that keep shadows of their own.

        Of these nothing is mirrored.
        """
        directions, irradiance, radius_rad = reaching_lights(lights, self._scene)
        discs = Discs(directions, irradiance, radius_rad, np.zeros_like(irradiance))
        narrow = narrow_lights(irradiance, radius_rad, self._widest_rad)
        wide = discs.taken(~narrow)
        light = spread_over_cells(self._cells, wide.directions, wide.irradiance, wide.radius_rad)
        light += np.maximum(self._basis @ lights.fill, 0.0) * self._cells.solid_angle_sr
        return light, discs.taken(narrow)

    def received_upward(self, light: Array) -> Array:
        """Return the irradiance (3,) of level ground by ∫L dω of each cell."""
        received: Array = np.maximum(self._cells.points[:, :, 1], 0.0).mean(axis=1) @ light
        return received

    def unshaded(self, light: Array, narrow: Discs) -> NDArray[np.float32]:
        """Return the radiance (3,) of the ground where nothing shades it."""
        if self._scene.ground is None:
            return np.zeros(3, np.float32)
        upward = self.received_upward(light) + narrow.directions[:, 1] @ narrow.irradiance
        return (upward * self._scene.ground.reflectance / np.pi).astype(np.float32)


def luminance_of_all(light: Array, narrow: Discs) -> float:
    """Return the luminance of ∫L dω of cells and narrow lights together."""
    return float((light.sum(axis=0) + narrow.irradiance.sum(axis=0)) @ LUMINANCE_WEIGHTS)
