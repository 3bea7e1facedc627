"""What is rendered: meshes with a material, a ground plane, and the camera that sees them.

World frame as everywhere: right-handed, metres, +Y up. Colours are linear Rec.709 reflectances.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from capture.arrays import read_only
from capture.errors import InputError


@dataclass(frozen=True)
class Material:
    """Metallic-roughness material, the model of glTF 2.0.

    Attributes
    ----------
    base_colour : (3,) float
        Linear reflectance in [0, 1]: of the diffuse part, or at normal incidence for a metal.
    roughness : float
        Perceptual roughness in [0, 1]; its square is the GGX width α.
    metalness : float
        0 is a dielectric, 1 a metal.
    specular : float
        Strength in [0, 1] of a dielectric's mirror reflection (glTF's KHR_materials_specular):
        1 reflects 4 % at normal incidence; 0 leaves a purely Lambertian surface.
    base_colour_texture : (h, w, 3) uint8 or None
        sRGB-coded, multiplies `base_colour`; row 0 is at texture coordinate v = 1.
    roughness_metalness_texture : (h, w, 2) uint8 or None
        Linear, multiplies `roughness` and `metalness`.
    """

    base_colour: tuple[float, float, float] = (0.5, 0.5, 0.5)
    roughness: float = 1.0
    metalness: float = 0.0
    specular: float = 1.0
    base_colour_texture: NDArray[np.uint8] | None = None
    roughness_metalness_texture: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        factors = (*self.base_colour, self.roughness, self.metalness, self.specular)
        if len(factors) != 6 or not all(0 <= factor <= 1 for factor in factors):
            raise InputError(
                "base colour, roughness, metalness and specular must lie in [0, 1], got "
                f"{self.base_colour}, {self.roughness}, {self.metalness}, {self.specular}"
            )
        for name, channels in (("base_colour_texture", 3), ("roughness_metalness_texture", 2)):
            texture = getattr(self, name)
            if texture is not None:
                checked = read_only(name, texture, np.uint8, (None, None, channels))
                object.__setattr__(self, name, checked)


@dataclass(frozen=True)
class Mesh:
    """Triangles of one material.

    Attributes
    ----------
    positions, normals : (V, 3) float32
        Normals have unit length. Both sides of a triangle are drawn.
    faces : (F, 3) int32
    material : Material
    texture_coordinates : (V, 2) float32 or None
        (u, v) with v upward; zeros where None.
    vertex_colour : (V, 3) float32 or None
        Linear, multiplies the base colour; white where None.
    """

    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    faces: NDArray[np.int32]
    material: Material = field(default_factory=Material)
    texture_coordinates: NDArray[np.float32] | None = None
    vertex_colour: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        positions = read_only("positions", self.positions, np.float32, (None, 3))
        count = len(positions)
        arrays: dict[str, NDArray[Any]] = {
            "positions": positions,
            "normals": read_only("normals", self.normals, np.float32, (count, 3)),
            "faces": read_only("faces", self.faces, np.int32, (None, 3)),
        }
        for name, width in (("texture_coordinates", 2), ("vertex_colour", 3)):
            values = getattr(self, name)
            if values is not None:
                arrays[name] = read_only(name, values, np.float32, (count, width))
        for name, values in arrays.items():
            if not np.all(np.isfinite(values)):
                raise InputError(f"mesh {name} holds NaN or infinite values")
            object.__setattr__(self, name, values)
        faces = arrays["faces"]
        if len(faces) == 0:
            raise InputError("a mesh needs at least one triangle")
        if faces.min() < 0 or faces.max() >= count:
            raise InputError(f"mesh faces name vertices outside 0 … {count - 1}")


@dataclass(frozen=True)
class Ground:
    """A level Lambertian disc, opaque: what comes from below its plane reaches nothing."""

    y_m: float = 0.0
    reflectance: tuple[float, float, float] = (0.5, 0.5, 0.5)
    radius_m: float = 50.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.y_m) and math.isfinite(self.radius_m) and self.radius_m > 0):
            raise InputError(
                f"the ground needs a height and a positive radius, got y {self.y_m} m, "
                f"radius {self.radius_m} m"
            )


@dataclass(frozen=True)
class Camera:
    """A pinhole camera of square pixels without roll.

    Attributes
    ----------
    eye, target : (3,) float64
        Where it stands and what stands in the centre of its picture, in m.
    vertical_fov_rad : float
        Angle between the upper and lower edge of the picture, in (0, π).
    size_px : (int, int)
        (width, height).
    up : (3,) float64
        Direction that is up in the picture; not parallel to the view.
    """

    eye: NDArray[np.float64]
    target: NDArray[np.float64]
    vertical_fov_rad: float = math.radians(40.0)
    size_px: tuple[int, int] = (640, 480)
    up: NDArray[np.float64] = field(default_factory=lambda: np.array([0.0, 1.0, 0.0]))

    def __post_init__(self) -> None:
        for name in ("eye", "target", "up"):
            vector = read_only(name, getattr(self, name), np.float64, (3,))
            object.__setattr__(self, name, vector)
        width, height = self.size_px
        if width < 1 or height < 1:
            raise InputError(f"a picture needs at least one pixel, got {width}×{height}")
        if not 0 < self.vertical_fov_rad < math.pi:
            raise InputError(f"the field of view must lie in (0, π), got {self.vertical_fov_rad}")
        side = np.cross(self.target - self.eye, self.up)
        if not (np.all(np.isfinite(side)) and np.linalg.norm(side) > 0):
            raise InputError(
                f"a camera at {self.eye} looking at {self.target} has no view, "
                "or its up direction is parallel to it"
            )

    def axes(self) -> NDArray[np.float64]:
        """Right, up and backward as the rows of a rotation, (3, 3): world → OpenGL's camera."""
        backward = _unit(self.eye - self.target)
        right = _unit(np.cross(self.up, backward))
        return np.stack([right, np.cross(backward, right), backward])

    def half_extent(self) -> tuple[float, float]:
        """Tangent of half the field of view, across and up."""
        up = math.tan(0.5 * self.vertical_fov_rad)
        return up * self.size_px[0] / self.size_px[1], up

    def world_to_clip(self, near_m: float, far_m: float) -> NDArray[np.float64]:
        """OpenGL's clip matrix (4, 4) for column vectors: clip = M (x, y, z, 1)."""
        axes = self.axes()
        view = np.eye(4)
        view[:3, :3] = axes
        view[:3, 3] = -axes @ self.eye
        across, up = self.half_extent()
        depth = far_m - near_m
        projection = np.array(
            [
                [1 / across, 0, 0, 0],
                [0, 1 / up, 0, 0],
                [0, 0, -(far_m + near_m) / depth, -2 * far_m * near_m / depth],
                [0, 0, -1, 0],
            ]
        )
        return projection @ view


@dataclass(frozen=True)
class Scene:
    """Meshes that cast and receive shadows, and a ground that only receives them.

    Without a ground (None) lights from below reach the meshes.
    """

    meshes: tuple[Mesh, ...]
    ground: Ground | None = field(default_factory=Ground)

    def __post_init__(self) -> None:
        object.__setattr__(self, "meshes", tuple(self.meshes))
        if not self.meshes and self.ground is None:
            raise InputError("a scene needs a mesh or a ground")


def _unit(vector: ArrayLike) -> NDArray[np.float64]:
    vector = np.asarray(vector, np.float64)
    return vector / np.linalg.norm(vector)
