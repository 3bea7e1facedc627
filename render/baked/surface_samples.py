"""What the samples of a picture show, in tiles as the kernels of baked transport take them.

Input  : what rays found.    Output : arrays (tiles, …, TILE) in float32.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.maps.environment import LUMINANCE_WEIGHTS
from render.baked.transport_kernel import TILE
from render.rays.surface_rows import (
    ALPHA2,
    F0,
    F90,
    FACE_NORMAL,
    FIELDS,
    GROUND,
    KIND,
    MATT,
    NORMAL,
    NOTHING,
    POSITION,
)
from render.rays.traced_scene import TracedScene
from render.scenes.scene import Camera

_FLOATS = NDArray[np.float32]

_LEAST_ALPHA2 = 1e-10


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Samples that hit something, squares of 4 × 4 together.

    Attributes
    ----------
    hit, ground : (H, W) bool
        Which samples show anything, and which the ground.
    samples : (tiles, TILE) int64
        Index of each in the picture; the last tile is filled up with ones that another has too.
    surface : (tiles, 14, TILE) float32
        As `transport_kernel.trace_transport` takes it.
    matt : (tiles, 3, TILE) float32
        ρ / π.
    f0 : (tiles, 3, TILE) float32
        Share of light that is mirrored at normal incidence.
    f90 : (tiles, TILE) float32
        And at grazing incidence.
    """

    hit: NDArray[np.bool_]
    ground: NDArray[np.bool_]
    samples: NDArray[np.int64]
    surface: _FLOATS
    matt: _FLOATS
    f0: _FLOATS
    f90: _FLOATS


def surface_samples(traced: TracedScene, camera: Camera, seen: _FLOATS) -> SurfaceSamples:
    """Return the samples of `seen`, (H, W, FIELDS) of surface_rows, that show anything."""
    kind = seen[..., KIND]
    samples = _in_tiles(kind != NOTHING)
    values = seen.reshape(-1, FIELDS)[samples]
    colours = (values[..., MATT : MATT + 3], values[..., F0 : F0 + 3])
    matt, f0 = (np.ascontiguousarray(each.swapaxes(1, 2)) for each in colours)
    surface = _surface(values, camera, traced.offset_m)
    f90 = np.ascontiguousarray(values[..., F90])
    return SurfaceSamples(kind != NOTHING, kind == GROUND, samples, surface, matt, f0, f90)


def _in_tiles(hit: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the samples that hit something, (tiles, TILE)."""
    samples = np.flatnonzero(hit)
    row, column = np.divmod(samples, hit.shape[1])
    samples = samples[np.lexsort((column % 4, row % 4, column // 4, row // 4))]
    return np.resize(samples, (-(-len(samples) // TILE), TILE))


def _surface(values: _FLOATS, camera: Camera, offset_m: float) -> _FLOATS:
    """Return position, normals, view, α² (below 0 where nothing is mirrored) and f0."""
    position, facing = (values[..., at : at + 3] for at in (POSITION, FACE_NORMAL))
    toward_eye = camera.eye - position
    toward_eye /= np.linalg.norm(toward_eye, axis=-1, keepdims=True)
    f0 = values[..., F0 : F0 + 3] @ LUMINANCE_WEIGHTS
    alpha2 = np.maximum(values[..., ALPHA2], _LEAST_ALPHA2)
    columns = [
        position + offset_m * facing,
        values[..., NORMAL : NORMAL + 3],
        facing,
        toward_eye,
        np.where(f0 > 0, alpha2, -1.0)[..., None],
        f0[..., None],
    ]
    surface = np.concatenate(columns, axis=-1).swapaxes(1, 2)
    return np.ascontiguousarray(surface, np.float32)


def mirror_tint(f0: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the colour (tiles, 3, TILE) of mirror reflections, with luminance 1."""
    luminance = np.einsum("tcs,c->ts", f0, LUMINANCE_WEIGHTS.astype(np.float32))[:, None]
    return np.divide(f0, luminance, out=np.zeros_like(f0), where=luminance > 0)
