"""How far a picture is from the truth: as a number, and as eyes see it.

Input  : a picture of one sample per pixel, a reference picture.    Output : relative RMSE, ꟻLIP.
Cost   : ꟻLIP takes 0.1 s of CPU time for each exposure of 640×480 pixels.
Fails  : in textures finer than a pixel, where one sample is not the mean but counts as if it were.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from render.measures.flip import hdr_flip
from render.rays.surface_rows import KIND, NORMAL, NOTHING, POSITION, empty_surfaces, in_picture
from render.rays.traced_scene import TracedScene
from render.scenes.scene import Camera, Scene

Floats = NDArray[np.float32]

_ALIKE = 0.9  # cosine between normals of one smooth surface, in neighbouring pixels
_LEVEL = 0.3  # sine of the angle by which it may lie off the pixel's tangent plane


@dataclass(frozen=True, eq=False)
class Truth:
    """What a picture should be, and where it can be told.

    Attributes
    ----------
    radiance, standard_error : (H, W, 3) float32
    is_compared : (H, W) bool
        Not on outlines, where one sample shows one thing and the truth the mean of two.
    """

    radiance: Floats
    standard_error: Floats
    is_compared: NDArray[np.bool_]

    @cached_property
    def variance(self) -> float:
        """Mean over the compared pixels of the squared standard error."""
        return float(np.mean(self.standard_error[self.is_compared].astype(np.float64) ** 2))

    @cached_property
    def least_flip(self) -> float:
        """The `mean_flip` of a perfect picture, were it as noisy as this: what no other is below.

        Unlike a square, ꟻLIP cannot be freed of the truth's own noise.
        """
        noise = np.random.default_rng(0).standard_normal((*self.is_compared.shape, 1), np.float32)
        return mean_flip(np.maximum(self.radiance + noise * self.standard_error, 0), self)


def relative_rmse(picture: Floats, truth: Truth) -> float:
    """Return the root mean square error of a picture (H, W, 3 or 4) over that of the truth.

    What the truth itself errs by, independently of the picture, is taken off.
    """
    compared = truth.is_compared
    true = truth.radiance[compared].astype(np.float64)
    square = float(np.mean((picture[..., :3][compared] - true) ** 2))
    return math.sqrt(max(square - truth.variance, 0.0) / float(np.mean(true**2)))


def mean_flip(picture: Floats, truth: Truth) -> float:
    """Return the mean over compared pixels of how different picture and truth look.

    Elsewhere the picture is given the truth's values, so that nothing there is seen.
    """
    compared = truth.is_compared
    seen = np.where(compared[..., None], picture[..., :3], truth.radiance)
    return float(hdr_flip(seen, truth.radiance)[compared].mean(dtype=np.float64))


def away_from_outlines(scene: Scene, camera: Camera) -> NDArray[np.bool_]:
    """Return the pixels (H, W) that show, with all eight around them, one smooth surface."""
    surfaces = empty_surfaces(camera.size_px)
    traced = TracedScene(scene)
    traced.find_surfaces(camera, camera.size_px, surfaces)
    traced.release()
    seen = in_picture(surfaces, camera.size_px)
    position, normal = (seen[..., at : at + 3] for at in (POSITION, NORMAL))
    inside = seen[..., KIND] != NOTHING
    inside[[0, -1]] = inside[:, [0, -1]] = False
    for rows in (-1, 0, 1):
        for columns in (-1, 0, 1):
            around, facing, kind = (
                np.roll(each, (rows, columns), (0, 1))
                for each in (position, normal, seen[..., KIND])
            )
            away = around - position
            off = np.abs(np.sum(away * normal, axis=-1))
            inside &= off <= _LEVEL * np.linalg.norm(away, axis=-1)
            inside &= (np.sum(facing * normal, axis=-1) > _ALIKE) & (kind == seen[..., KIND])
    return inside
