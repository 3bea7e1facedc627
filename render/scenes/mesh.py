"""Meshes from files: OBJ, glTF, GLB and PLY, with their materials.

Input  : a file that trimesh reads.    Output : Model: meshes in the file's own frame and unit.
Kept   : positions, normals, base colour with its texture or vertex colours, roughness and metalness
         with their texture; OBJ's Kd or map_Kd, and Ns as roughness.
Not kept: normal, occlusion and emission maps, transparency, colours per face, glTF's extensions;
         `notes` says so. Animation. Reflectance factors come in steps of 1/255, which is how
         trimesh holds them.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from capture.errors import InputError
from capture.sensor import srgb_decode
from render.scenes.gltf import check_gltf
from render.scenes.scene import Material, Mesh

MESH_SUFFIXES = (".obj", ".gltf", ".glb", ".ply")
MAX_FACES = 20_000_000

_IGNORED_MAPS = {
    "normalTexture": "normal maps",
    "occlusionTexture": "occlusion maps",
    "emissiveTexture": "emission maps",
}
# What float32 holds: squares of lengths, and a thousandth of the extent beside the coordinates.
_SMALLEST_EXTENT_M, _LARGEST_EXTENT_M = 1e-12, 1e12
_FARTHEST_IN_EXTENTS = 1000


@dataclass(frozen=True)
class Model:
    """Meshes of a file, and in `notes` what the file holds that they do not."""

    meshes: tuple[Mesh, ...]
    notes: tuple[str, ...] = ()


def load_meshes(path: Path) -> Model:
    """Return the triangles of a file with their materials.

    Normals that the file does not give are made smooth, except in glTF, where the standard asks
    for flat ones. sRGB is decoded: textures, vertex colours of PLY and OBJ, and OBJ's Kd, which the
    formats leave open and most programs take as display colours. Where OBJ names a colour map, Kd
    is not applied. glTF's factors and vertex colours are linear already.

    Raises
    ------
    InputError
        If the file cannot be read, is compressed, has no triangles, more than 20 million of them,
        or vertices that are not finite, or if float32 cannot hold its shape.
    """
    suffix = path.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        raise InputError(f"{path}: a mesh is read from {', '.join(MESH_SUFFIXES)}")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    is_gltf = suffix in (".gltf", ".glb")
    notes: set[str] = set()
    if is_gltf:
        notes.update(check_gltf(path))
    try:
        scene = trimesh.load_scene(path, process=False)
        parts = [
            (scene.geometry[name], transform)
            for transform, name in map(scene.graph.get, scene.graph.nodes_geometry)
            if isinstance(scene.geometry[name], trimesh.Trimesh)
        ]
    except Exception as error:  # trimesh raises whatever its parsers meet
        raise InputError(f"{path}: not a readable mesh file ({error})") from None
    parts = [(part, transform) for part, transform in parts if len(part.faces)]
    if not parts:
        raise InputError(f"{path}: holds no triangles")
    face_count = sum(len(part.faces) for part, _ in parts)
    if face_count > MAX_FACES:
        raise InputError(f"{path}: {face_count} triangles, more than {MAX_FACES}; simplify it")
    try:
        meshes = tuple(_mesh(part, transform, is_gltf, notes) for part, transform in parts)
        _check_extent(meshes)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return Model(meshes, tuple(f"{path.name}: {note} ignored" for note in sorted(notes)))


def smooth_normals(
    positions: NDArray[np.floating], faces: NDArray[np.integer]
) -> NDArray[np.float64]:
    """Return the mean normal of the triangles around each vertex, by area, (V, 3) unit vectors.

    Vertices at one place share their triangles, so that a texture's seam does not show. A vertex
    without area around it gets +Y.
    """
    places, index = np.unique(positions, axis=0, return_inverse=True)
    index = index.reshape(-1)
    across = _face_normals(positions, faces)
    total = np.zeros((len(places), 3))
    for axis in range(3):
        total[:, axis] = np.bincount(
            index[faces].reshape(-1), np.repeat(across[:, axis], 3), minlength=len(places)
        )
    return _unit_or_up(total)[index]


def _mesh(
    part: trimesh.Trimesh, transform: NDArray[np.float64], is_gltf: bool, notes: set[str]
) -> Mesh:
    # trimesh computes normals on demand; those already in its cache are the file's.
    given = "vertex_normals" in part._cache.cache
    positions = np.asarray(part.vertices, np.float64) @ transform[:3, :3].T + transform[:3, 3]
    faces = np.asarray(part.faces, np.int32)
    material, coordinates, colour = _appearance(part.visual, is_gltf, notes)
    if not np.all(np.isfinite(positions)):
        raise InputError("vertices are NaN or infinite")
    if faces.min() < 0 or faces.max() >= len(positions):
        raise InputError(f"triangles name vertices outside 0 … {len(positions) - 1}")
    if given:
        # Normals transform with the inverse transpose.
        normals = _unit_or_up(np.asarray(part.vertex_normals) @ np.linalg.pinv(transform[:3, :3]))
    elif is_gltf:
        corners = faces.reshape(-1)
        positions = positions[corners]
        coordinates = None if coordinates is None else coordinates[corners]
        colour = None if colour is None else colour[corners]
        faces = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
        normals = np.repeat(_unit_or_up(_face_normals(positions, faces)), 3, axis=0)
    else:
        normals = smooth_normals(positions, faces)
    return Mesh(
        positions.astype(np.float32),
        normals.astype(np.float32),
        faces,
        material,
        None if coordinates is None else coordinates.astype(np.float32),
        None if colour is None else colour.astype(np.float32),
    )


def _appearance(
    visual: Any, is_gltf: bool, notes: set[str]
) -> tuple[Material, NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Material, texture coordinates (V, 2) and linear vertex colour (V, 3) of a part."""
    if visual.kind == "vertex":
        colour = _share_of_largest(visual.vertex_colors)
        return Material((1.0, 1.0, 1.0)), None, colour if is_gltf else srgb_decode(colour)
    if visual.kind == "face":
        notes.add("colours per face are")
    if visual.kind != "texture":
        return Material(), None, None
    material, uv = visual.material, visual.uv
    coordinates = None if uv is None else np.asarray(uv, np.float64)
    if is_gltf:
        colours = visual.vertex_attributes.get("color")
        return (
            _from_gltf(material, coordinates is not None, notes),
            coordinates,
            None if colours is None else _share_of_largest(colours),
        )
    return _from_obj(material, coordinates is not None), coordinates, None


def _from_gltf(material: Any, has_coordinates: bool, notes: set[str]) -> Material:
    notes.update(
        f"{plural} are" for name, plural in _IGNORED_MAPS.items() if getattr(material, name)
    )
    if material.alphaMode in ("MASK", "BLEND"):
        notes.add("transparency is")
    factor = material.baseColorFactor
    base = (1.0, 1.0, 1.0) if factor is None else tuple(np.asarray(factor)[:3] / 255)
    # What glTF leaves out is 1.
    roughness = 1.0 if material.roughnessFactor is None else material.roughnessFactor
    metalness = 1.0 if material.metallicFactor is None else material.metallicFactor
    colours = material.baseColorTexture if has_coordinates else None
    factors = material.metallicRoughnessTexture if has_coordinates else None
    return Material(
        base,
        float(roughness),
        float(metalness),
        base_colour_texture=None if colours is None else _pixels(colours),
        # glTF keeps roughness in green and metalness in blue.
        roughness_metalness_texture=None if factors is None else _pixels(factors)[..., 1:3],
    )


def _from_obj(material: Any, has_coordinates: bool) -> Material:
    image = material.image
    # trimesh gives a part without material a grey image, which comes from no file.
    if image is not None and "file_path" not in image.info:
        return Material()
    if not material.glossiness >= 0:
        raise InputError(f"a material's Ns is {material.glossiness:g}; it must be at least 0")
    roughness = float((2 / (material.glossiness + 2)) ** 0.25)  # Blinn-Phong's exponent as α
    if image is not None and has_coordinates:
        return Material((1.0, 1.0, 1.0), roughness, base_colour_texture=_pixels(image))
    base = tuple(srgb_decode(np.asarray(material.diffuse)[:3] / 255))
    return Material(base, roughness)


def _share_of_largest(colours: Any) -> NDArray[np.float64]:
    """R, G, B in [0, 1] of colours (V, 3 or 4), which are float or unsigned integers."""
    values = np.asarray(colours)[:, :3]
    largest = np.iinfo(values.dtype).max if values.dtype.kind == "u" else 1
    return np.clip(values.astype(np.float64) / largest, 0, 1)


def _pixels(image: Any) -> NDArray[np.uint8]:
    """R, G, B of a PIL image, (h, w, 3)."""
    return np.asarray(image.convert("RGB"))


def _check_extent(meshes: tuple[Mesh, ...]) -> None:
    """Raise InputError for what float32 arithmetic would draw wrong without a word."""
    low = np.min([mesh.positions.min(axis=0) for mesh in meshes], axis=0).astype(np.float64)
    high = np.max([mesh.positions.max(axis=0) for mesh in meshes], axis=0).astype(np.float64)
    extent_m = float(np.linalg.norm(high - low))
    farthest_m = float(np.maximum(np.abs(low), np.abs(high)).max())
    if not _SMALLEST_EXTENT_M <= extent_m <= _LARGEST_EXTENT_M:
        raise InputError(
            f"is {extent_m:g} m across; from {_SMALLEST_EXTENT_M:g} to {_LARGEST_EXTENT_M:g} m "
            "can be drawn"
        )
    if farthest_m > _FARTHEST_IN_EXTENTS * extent_m:
        raise InputError(
            f"is {extent_m:g} m across but {farthest_m:g} m from the origin, too far for float32 "
            "to hold its shape; move it to the origin"
        )


def _face_normals(
    positions: NDArray[np.floating], faces: NDArray[np.integer]
) -> NDArray[np.float64]:
    """Return normals of triangles, (F, 3), as long as twice their area."""
    a, b, c = positions[faces].astype(np.float64).transpose(1, 0, 2)
    return np.cross(b - a, c - a)


def _unit_or_up(vectors: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return vectors (N, 3) of unit length; +Y for those that are zero or not finite."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    usable = (length > 0) & np.isfinite(length)
    return np.where(usable, vectors / np.where(usable, length, 1), [0.0, 1.0, 0.0])
