"""Pictures of a scene that stands still before a camera that stands still: only the light changes.

What each sample passes on from each of a few hundred fixed cells of the sky (and from each narrow
light) is traced once. A frame is then a product: transport × light, at any number of lights.

Input  : a scene, a camera and LightSets.    Output : linear radiance, in the lights' scale.
Cost   : tracing, seconds; a frame, see tests/benchmarks/render.py; memory, a byte per sample and
         cell. A narrow light that moves is traced anew.
Fails  : light within a cell comes from all of it, so shadows of lights that are no narrower blur by
         up to a cell (9° across), and highlights narrower than that are as wide
         (tests/limits/test_render_baked_gloss.py). A metal's edge keeps its colour where Fresnel
         makes it white.
"""

from dataclasses import dataclass, replace
from types import TracebackType
from typing import Any, Self

import moderngl
import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere import harmonics
from render.background import look_up, map_coordinates, picture_rays
from render.casters import gather_casters
from render.direction_cells import direction_cells, disc_points, spread_over_cells
from render.embree import Occluders, occluded16_address
from render.gbuffer import GBuffer
from render.reaching_lights import reaching_lights
from render.scene import Camera, Scene
from render.transport_kernel import TILE, add_transported, place, trace_transport

Array = NDArray[np.float64]

NARROW_LIGHTS = 8
NARROW_SHARE = 0.02
"""Lights no wider than two cells that give at least this share of the light keep shadows of their
own, the strongest first and no more than so many."""

_OFFSET = 1e-4  # of the casters' radius: rays start that far off their surface
_CELL_RAYS_SIDE = 2  # rays per cell and sample, per axis
_DISC_RAYS = (4, 16)
_DISC_RAYS_PER_RAD = 140.0  # 4 for the sun, 16 from a radius of 5° on
_STILL = 0.25  # of a narrow light's radius: it moves by less without being traced anew
_STILL_LEAST_RAD = 1e-3
_GLOSS_LEAST_ALPHA2 = 0.1**2  # a lobe as wide as the points of a cell are apart
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


class BakedRenderer:
    """Draws one scene from one camera under any light sets, from transport traced beforehand.

    Needs OpenGL only while it is made. Owns Embree's memory: use it as a context manager.

    Parameters
    ----------
    context : moderngl.Context
    scene : Scene
    camera : Camera
    samples_per_axis : int
        Each pixel is the mean of its square of samples.
    """

    def __init__(
        self, context: moderngl.Context, scene: Scene, camera: Camera, samples_per_axis: int = 1
    ) -> None:
        self._scene = scene
        self._camera = camera
        self._samples_per_axis = samples_per_axis
        width, height = (samples_per_axis * length for length in camera.size_px)
        self._shape = height, width
        seen = _read(context, scene, camera, (width, height))
        casters = gather_casters(scene.meshes)
        faces = np.concatenate([casters.closed_faces, casters.open_faces])
        self._occluders = Occluders(casters.positions, faces)
        self._sphere = np.array([*casters.centre, casters.radius_m], np.float32)

        hit = seen["position_hit"][..., 3] > 0
        self._hit = hit.astype(np.float32)
        self._samples = _in_tiles(hit)
        self._surface = _surface(seen, self._samples, camera, casters.radius_m)
        self._matt, self._mirror = _colours(seen, self._samples)
        self._cells = direction_cells(upper_only=scene.ground is not None)
        self._basis = harmonics.basis(self._cells.points).mean(axis=1)
        coarse = direction_cells(upper_only=scene.ground is not None, subdivisions=_CELL_RAYS_SIDE)
        self._sky = self._trace(coarse.points)
        self._narrow: list[_Narrow] = []

        unseen = np.flatnonzero(~hit.ravel())
        self._unseen = unseen
        rays = picture_rays(camera, (width, height)).reshape(-1, 3)[unseen]
        self._unseen_at = map_coordinates(rays)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.release()

    def release(self) -> None:
        """Free Embree's memory."""
        self._occluders.release()

    def render(
        self, lights: LightSet, background: EnvironmentMap | None = None
    ) -> NDArray[np.float32]:
        """Return the picture under `lights`, as `Renderer.render` does."""
        directions, irradiance, radius_rad = reaching_lights(lights, self._scene)
        narrow = self._narrow_lights(irradiance, radius_rad)
        wide = ~narrow
        light = spread_over_cells(self._cells, directions[wide], irradiance[wide], radius_rad[wide])
        light += np.maximum(self._basis @ lights.fill, 0.0) * self._cells.solid_angle_sr
        picture = np.zeros((len(self._surface), 3, TILE), np.float32)
        self._sky.add(light, picture)
        self._remember(directions[narrow], irradiance[narrow], radius_rad[narrow])
        for each in self._narrow:
            each.transport.add(each.irradiance[None], picture)
        return self._assembled(picture, background)

    def _trace(self, points: Array) -> "_Transport":
        """Trace the transport of cells, each with points (D, S, 3)."""
        tiles, count = len(self._surface), len(points)
        mirroring = np.flatnonzero((self._surface[:, 12] > 0).any(axis=1))
        mirror_row = np.full(tiles, -1)
        mirror_row[mirroring] = np.arange(len(mirroring))
        matt = np.zeros((tiles, count, TILE), np.uint8)
        mirror = np.zeros((len(mirroring), count, TILE), np.uint8)
        matt_step = np.zeros((tiles, TILE), np.float32)
        mirror_step = np.zeros((len(mirroring), TILE), np.float32)
        trace_transport(
            occluded16_address(),
            self._occluders.address,
            self._sphere,
            self._surface,
            points.astype(np.float32),
            mirror_row,
            matt,
            matt_step,
            mirror,
            mirror_step,
        )
        matt_scale = self._matt * matt_step[:, None]
        mirror_scale = self._mirror[mirroring] * mirror_step[:, None]
        return _Transport(matt, matt_scale, mirroring, mirror, mirror_scale)

    def _narrow_lights(self, irradiance: Array, radius_rad: Array) -> NDArray[np.bool_]:
        """Return which lights (K,) keep shadows of their own."""
        power = irradiance @ _LUMINANCE
        strong = (power >= NARROW_SHARE * power.sum()) & (radius_rad < self._cells.width_rad)
        chosen = np.argsort(-power * strong, kind="stable")[:NARROW_LIGHTS]
        narrow = np.zeros(len(power), np.bool_)
        narrow[chosen] = strong[chosen]
        return narrow

    def _remember(self, directions: Array, irradiance: Array, radius_rad: Array) -> None:
        """Set the narrow lights, tracing those that are not where one was."""
        before, self._narrow = self._narrow, []
        for direction, power, radius in zip(directions, irradiance, radius_rad, strict=True):
            still_rad = max(_STILL * radius, _STILL_LEAST_RAD)
            same = (each for each in before if each.is_near(direction, radius, still_rad))
            found = next(same, None)
            if found is None:
                rays = int(np.clip(_DISC_RAYS[0] + _DISC_RAYS_PER_RAD * radius, *_DISC_RAYS))
                transport = self._trace(disc_points(direction, radius, rays)[None])
                found = _Narrow(direction, float(radius), power, transport)
            self._narrow.append(replace(found, irradiance=power))

    def _assembled(
        self, picture: NDArray[np.float32], background: EnvironmentMap | None
    ) -> NDArray[np.float32]:
        height, width = self._shape
        out = np.zeros((height * width, 4), np.float32)
        place(picture, self._samples, out)
        if background is not None:
            look_up(np.ascontiguousarray(background.radiance), self._unseen_at, self._unseen, out)
        n = self._samples_per_axis
        samples = out.reshape(height // n, n, width // n, n, 4)
        return samples[:, 0, :, 0] if n == 1 else samples.mean(axis=(1, 3), dtype=np.float32)


@dataclass(frozen=True, eq=False)
class _Transport:
    """What samples pass on of the light of each cell, as `trace_transport` fills it.

    The scales, (tiles, 3, TILE), are the radiance of a step under a unit of light.
    """

    matt: NDArray[np.uint8]
    matt_scale: NDArray[np.float32]
    mirroring: NDArray[np.intp]
    mirror: NDArray[np.uint8]
    mirror_scale: NDArray[np.float32]

    def add(self, light: Array, picture: NDArray[np.float32]) -> None:
        """Add the radiance under ∫L dω of each cell, (D, 3), to `picture` (tiles, 3, TILE)."""
        of_cells = light.astype(np.float32)
        add_transported(self.matt, self.matt_scale, of_cells, picture)
        mirrored = np.zeros((len(self.mirroring), *picture.shape[1:]), np.float32)
        add_transported(self.mirror, self.mirror_scale, of_cells, mirrored)
        picture[self.mirroring] += mirrored


@dataclass(frozen=True, eq=False)
class _Narrow:
    """A narrow light and its transport."""

    direction: Array
    radius_rad: float
    irradiance: Array
    transport: _Transport

    def is_near(self, direction: Array, radius_rad: float, still_rad: float) -> bool:
        """Whether a light is so like this one that its transport serves."""
        chord = float(np.linalg.norm(direction - self.direction))
        return chord < still_rad and abs(radius_rad - self.radius_rad) < still_rad


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


def _in_tiles(hit: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the samples that hit something, (tiles, TILE), squares of 4 × 4 together.

    The last tile is filled up with samples that another one has too.
    """
    samples = np.flatnonzero(hit)
    row, column = np.divmod(samples, hit.shape[1])
    samples = samples[np.lexsort((column % 4, row % 4, column // 4, row // 4))]
    return np.resize(samples, (-(-len(samples) // TILE), TILE))


def _surface(
    seen: dict[str, NDArray[np.float32]],
    samples: NDArray[np.int64],
    camera: Camera,
    radius_m: float,
) -> NDArray[np.float32]:
    """Return what `trace_transport` needs to know of each sample, (tiles, 14, TILE)."""
    values = {name: texture.reshape(-1, 4)[samples] for name, texture in seen.items()}
    position, facing = values["position_hit"][..., :3], values["face_normal_f90"][..., :3]
    toward_eye = camera.eye - position
    toward_eye /= np.linalg.norm(toward_eye, axis=-1, keepdims=True)
    f0 = values["f0"][..., :3] @ _LUMINANCE
    alpha2 = np.maximum(values["normal_roughness"][..., 3] ** 4, _GLOSS_LEAST_ALPHA2)
    columns = [
        position + _OFFSET * radius_m * facing,
        values["normal_roughness"][..., :3],
        facing,
        toward_eye,
        np.where(f0 > 0, alpha2, -1.0)[..., None],
        f0[..., None],
    ]
    surface: NDArray[Any] = np.concatenate(columns, axis=-1).swapaxes(1, 2)
    return np.ascontiguousarray(surface, np.float32)


def _colours(
    seen: dict[str, NDArray[np.float32]], samples: NDArray[np.int64]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return ρ/π, and the colour of mirror reflections with luminance 1, (tiles, 3, TILE) each."""
    rho = seen["diffuse_reflectance"].reshape(-1, 4)[samples][..., :3]
    f0 = seen["f0"].reshape(-1, 4)[samples][..., :3]
    luminance = (f0 @ _LUMINANCE)[..., None]
    tint = np.divide(f0, luminance, out=np.zeros_like(f0), where=luminance > 0)
    matt, mirror = ((each.swapaxes(1, 2)).astype(np.float32) for each in (rho / np.pi, tint))
    return np.ascontiguousarray(matt), np.ascontiguousarray(mirror)
