"""What the samples of a picture show, in tiles as the kernels of baked transport take them.

Input  : a G-buffer.    Output : arrays (tiles, …, TILE) in float32.
"""

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from lighting.maps.environment import LUMINANCE_WEIGHTS
from render.baked.transport_kernel import TILE
from render.opengl.gbuffer import GBuffer
from render.scenes.scene import Camera, Scene

_FLOATS = NDArray[np.float32]

_OFFSET = 1e-4  # of the casters' radius: rays start that far off their surface
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


def surface_samples(
    context: moderngl.Context,
    scene: Scene,
    camera: Camera,
    size_px: tuple[int, int],
    radius_m: float,
) -> SurfaceSamples:
    """Return what the samples (width, height) of a picture show; `radius_m` is the casters'."""
    seen = _read(context, scene, camera, size_px)
    hit = seen["position_hit"][..., 3] > 0
    samples = _in_tiles(hit)
    values = {name: texture.reshape(-1, 4)[samples] for name, texture in seen.items()}
    colours = (values["diffuse_reflectance"] / np.pi, values["f0"])
    matt, f0 = (np.ascontiguousarray(each[..., :3].swapaxes(1, 2), np.float32) for each in colours)
    surface = _surface(values, camera, radius_m)
    f90 = np.ascontiguousarray(values["face_normal_f90"][..., 3])
    return SurfaceSamples(hit, _ground(seen, scene, radius_m), samples, surface, matt, f0, f90)


def _read(
    context: moderngl.Context, scene: Scene, camera: Camera, size_px: tuple[int, int]
) -> dict[str, NDArray[np.float32]]:
    """Return the G-buffer's textures (H, W, 4), rows from the top."""
    gbuffer = GBuffer(context, scene, camera, size_px)
    width, height = size_px
    seen = {
        name: np.frombuffer(texture.read(), np.float32).reshape(height, width, 4)[::-1]
        for name, texture in gbuffer.textures
    }
    gbuffer.release()
    return seen


def _ground(seen: dict[str, _FLOATS], scene: Scene, radius_m: float) -> NDArray[np.bool_]:
    """Return the samples (H, W) that show the ground: a level face at its height."""
    position, upward = seen["position_hit"], seen["face_normal_f90"][..., 1]
    if scene.ground is None:
        return np.zeros(upward.shape, np.bool_)
    off_m = np.abs(position[..., 1] - scene.ground.y_m)
    far_m = np.linalg.norm(position[..., :3], axis=-1)
    is_level = (off_m <= _OFFSET * np.maximum(far_m, radius_m)) & (upward > 0.999)
    return (position[..., 3] > 0) & is_level


def _in_tiles(hit: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the samples that hit something, (tiles, TILE)."""
    samples = np.flatnonzero(hit)
    row, column = np.divmod(samples, hit.shape[1])
    samples = samples[np.lexsort((column % 4, row % 4, column // 4, row // 4))]
    return np.resize(samples, (-(-len(samples) // TILE), TILE))


def _surface(values: dict[str, _FLOATS], camera: Camera, radius_m: float) -> _FLOATS:
    """Return position, normals, view, α² (below 0 where nothing is mirrored) and f0."""
    position, facing = values["position_hit"][..., :3], values["face_normal_f90"][..., :3]
    toward_eye = camera.eye - position
    toward_eye /= np.linalg.norm(toward_eye, axis=-1, keepdims=True)
    f0 = values["f0"][..., :3] @ LUMINANCE_WEIGHTS
    alpha2 = values["normal_roughness"][..., 3] ** 4
    columns = [
        position + _OFFSET * radius_m * facing,
        values["normal_roughness"][..., :3],
        facing,
        toward_eye,
        np.where(f0 > 0, np.maximum(alpha2, _LEAST_ALPHA2), -1.0)[..., None],
        f0[..., None],
    ]
    surface = np.concatenate(columns, axis=-1).swapaxes(1, 2)
    return np.ascontiguousarray(surface, np.float32)


def mirror_tint(f0: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the colour (tiles, 3, TILE) of mirror reflections, with luminance 1."""
    luminance = np.einsum("tcs,c->ts", f0, LUMINANCE_WEIGHTS.astype(np.float32))[:, None]
    return np.divide(f0, luminance, out=np.zeros_like(f0), where=luminance > 0)
