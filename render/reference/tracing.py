"""A picture of a scene under all its light, with the standard error of each pixel.

Direct light only, by ray tracing: what no other renderer here may assume. Passes are added until
the error is as small as asked for, or the time is over.

Input  : a scene, a camera; an EnvironmentMap or a LightSet.
Output : linear radiance, in the light's scale.
Cost   : see tests/benchmarks/reference.py.
Fails  : only light that comes straight from the map or the discs: none by way of other surfaces.
         A near mirror of discs of a few arc seconds is seen too rarely for its error to be known.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.rays.embree import Occluders, intersect16_address, occluded16_address
from render.rays.row_order import row_order
from render.reference.accumulation import Progress, accumulate, mean_and_variance, nothing_yet
from render.reference.emitters import draw_pool, emitters_of
from render.reference.irradiance import irradiance_of
from render.reference.passes import Sums, add_pass
from render.reference.pixel_rays import SIDE, view_of
from render.reference.sampled_light import Rays
from render.reference.surfaces import scene_tables
from render.scenes.scene import Camera, Scene

POOL = 1 << 16
"""Directions drawn for a pass."""

_RAYS = Rays(side=2, light=16, lobe=4)
_MOST_LIGHT = 256


@dataclass(frozen=True, eq=False)
class ReferencePicture:
    """A picture and how well it is known.

    Attributes
    ----------
    radiance : (H, W, 4) float32
        Linear Rec.709, and what share of a pixel the scene covers.
    standard_error : (H, W, 3) float32
        Of each pixel's radiance: the standard deviation of the mean over passes.
    relative_error : float
        Root mean square of the standard error over that of the picture.
    passes, shadow_rays : int
        Independent estimates that this is the mean of, and the rays that were traced for them.
    """

    radiance: NDArray[np.float32]
    standard_error: NDArray[np.float32]
    relative_error: float
    passes: int
    shadow_rays: int


def render_reference(
    scene: Scene,
    camera: Camera,
    light: EnvironmentMap | LightSet,
    *,
    error: float = 0.01,
    seconds: float = math.inf,
    seed: int = 0,
    spent: Rays = _RAYS,
    pool_size: int = POOL,
    progress: Progress | None = None,
    on_pass: Callable[[Progress], None] | None = None,
) -> ReferencePicture:
    """Return the picture of `scene`, as exact as asked for.

    Parameters
    ----------
    error : float
        Relative error to stop at.
    seconds : float
        Time to stop after, but not before there are `LEAST_PASSES`.
    seed : int
        The same one gives the same passes; another, pictures with independent errors.
    spent : Rays
        What the first passes spend, with a power of two of rays; later ones may spend more.
    pool_size : int
        A power of two, `side`² × 256 or more.
    progress : Progress or None
        Of the same picture, to go on from; it is changed.
    on_pass : callable or None
        Told the progress after each pass.
    """
    tables = scene_tables(scene)
    emitters = emitters_of(light, above_horizon=scene.ground is not None)
    rows = row_order(0, -(-camera.size_px[1] // SIDE))
    view = view_of(camera)
    with Occluders(tables.positions, tables.faces) as occluders:
        functions = intersect16_address(), occluded16_address()

        def add(number: int, factor: int, sums: Sums) -> None:
            rng = np.random.default_rng([seed, number])
            pool = draw_pool(emitters, pool_size, rng)
            smooth = irradiance_of(pool)
            each = int(rng.integers(1 << 62))
            more = spent._replace(light=factor * spent.light, lobe=factor * spent.lobe)
            add_pass(
                functions, occluders.address, view, tables, emitters, pool, smooth, more, each,
                rows, sums,
            )  # fmt: skip

        progress = nothing_yet(camera.size_px) if progress is None else progress
        accumulate(
            add,
            progress,
            error=error,
            seconds=seconds,
            most_factor=max(_MOST_LIGHT // spent.light, 1),
            on_pass=on_pass,
        )
    return picture_of(progress)


def picture_of(progress: Progress) -> ReferencePicture:
    """Return the picture that passes have made so far."""
    mean, variance = mean_and_variance(progress)
    return ReferencePicture(
        mean.astype(np.float32),
        np.sqrt(variance).astype(np.float32),
        progress.relative_error,
        progress.passes,
        int(progress.sums.rays.sum()),
    )
