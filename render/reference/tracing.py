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
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from render.rays.embree import Occluders, intersect16_address, occluded16_address
from render.reference.emitters import draw_pool, emitters_of
from render.reference.irradiance import irradiance_of
from render.reference.passes import Rays, Sums, add_pass
from render.reference.pixel_rays import SIDE
from render.reference.surfaces import scene_tables
from render.scenes.scene import Camera, Scene

POOL = 1 << 16
"""Directions drawn for a pass."""

LEAST_PASSES = 4
"""Fewer tell too little about their spread."""

_RAYS = Rays(side=2, light=16, lobe=4)
_MOST_LIGHT = 256
_PASSES = 8  # that are aimed at
_GOLDEN = 0.6180339887498949


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
    on_pass: Callable[[int, float], None] | None = None,
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
    on_pass : callable or None
        Told the number of passes and the relative error after each.
    """
    tables = scene_tables(scene)
    emitters = emitters_of(light, above_horizon=scene.ground is not None)
    width, height = camera.size_px
    rows = np.arange(-(-height // SIDE))
    rows = rows[np.argsort(rows * _GOLDEN % 1)]
    rng = np.random.default_rng(seed)
    with Occluders(tables.positions, tables.faces) as occluders:
        functions = intersect16_address(), occluded16_address()
        view = _view(camera)

        def add(spent: Rays, sums: Sums) -> None:
            pool = draw_pool(emitters, pool_size, rng)
            smooth = irradiance_of(pool)
            each = int(rng.integers(1 << 62))
            add_pass(
                functions, occluders.address, view, tables, emitters, pool, smooth, spent, each,
                rows, sums,
            )  # fmt: skip

        return _until_known(add, (height, width), spent, error, seconds, on_pass)


def _until_known(
    add: Callable[[Rays, Sums], None],
    shape: tuple[int, int],
    spent: Rays,
    error: float,
    seconds: float,
    on_pass: Callable[[int, float], None] | None,
) -> ReferencePicture:
    """Return the picture of passes that `add` adds to sums.

    If far more passes were needed than tell their spread, they begin anew with more rays each:
    those of one pass err less together than those of many.
    """
    start = time.perf_counter()
    sums, passes = _nothing(shape), 0
    may_grow = True
    while True:
        add(spent, sums)
        passes += 1
        if passes < LEAST_PASSES:
            continue
        picture = _picture(sums, passes)
        if on_pass is not None:
            on_pass(passes, picture.relative_error)
        elapsed_s = time.perf_counter() - start
        pass_s = elapsed_s / passes
        if picture.relative_error <= error or elapsed_s + pass_s > seconds:
            return picture
        if may_grow:
            may_grow = False
            wanted = LEAST_PASSES * (picture.relative_error / error) ** 2 if error else math.inf
            affordable = (seconds - elapsed_s) / pass_s
            larger = min(wanted, affordable) / _PASSES
            factor = 2 ** int(math.log2(min(max(larger, 1), _MOST_LIGHT / spent.light)))
            if factor > 1:
                spent = spent._replace(light=factor * spent.light, lobe=factor * spent.lobe)
                sums, passes = _nothing(shape), 0


def _nothing(shape: tuple[int, int]) -> Sums:
    return Sums(
        np.zeros((*shape, 4)), np.zeros((*shape, 4)), np.zeros(-(-shape[0] // SIDE), np.int64)
    )


def _view(camera: Camera) -> NDArray[np.float32]:
    right, up, backward = camera.axes()
    across, half_height = camera.half_extent()
    width, height = camera.size_px
    corner = half_height * up - across * right - backward
    return np.array(
        [camera.eye, corner, 2 * across / width * right, -2 * half_height / height * up], np.float32
    )


def _picture(sums: Sums, passes: int) -> ReferencePicture:
    mean = sums.radiance / passes
    spread = np.maximum(sums.squares[..., :3] / passes - mean[..., :3] ** 2, 0.0)
    variance = spread / (passes - 1)
    # The picture's square has its own error in it.
    power = np.maximum(np.mean(mean[..., :3] ** 2 - variance), np.finfo(float).tiny)
    return ReferencePicture(
        mean.astype(np.float32),
        np.sqrt(variance).astype(np.float32),
        float(np.sqrt(variance.mean() / power)),
        passes,
        int(sums.rays.sum()),
    )
