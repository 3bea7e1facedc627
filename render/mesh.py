"""Meshes from files: OBJ, glTF, GLB and PLY, with their materials.

Input  : a file that trimesh reads.    Output : Model: meshes in the file's own frame and unit.
Kept   : positions, normals, base colour with its texture or vertex colours, roughness and metalness
         with their texture; OBJ's Kd or map_Kd, and Ns as roughness.
Not kept: normal, occlusion and emission maps, transparency, colours per face, animation; `notes`
         says so. Reflectance factors come in steps of 1/255, which is how trimesh holds them.
"""

import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from capture.errors import InputError
from capture.sensor import srgb_decode
from render.scene import Material, Mesh

MESH_SUFFIXES = (".obj", ".gltf", ".glb", ".ply")
MAX_FACES = 20_000_000

# Extensions that change what the file's numbers mean, and that trimesh passes over.
_UNREADABLE_EXTENSIONS = (
    "KHR_draco_mesh_compression",
    "EXT_meshopt_compression",
    "KHR_mesh_quantization",
    "KHR_texture_basisu",
)
_IGNORED_MAPS = {
    "normalTexture": "normal maps",
    "occlusionTexture": "occlusion maps",
    "emissiveTexture": "emission maps",
}
_GLB_MAGIC, _GLB_JSON = 0x46546C67, 0x4E4F534A


@dataclass(frozen=True)
class Model:
    """Meshes of a file, and in `notes` what the file holds that they do not."""

    meshes: tuple[Mesh, ...]
    notes: tuple[str, ...] = ()


def load_meshes(path: Path) -> Model:
    """Return the triangles of a file with their materials.

    Normals that the file does not give are made smooth, except in glTF, where the standard asks
    for flat ones. sRGB is decoded: textures, vertex colours, and OBJ's Kd, which the format leaves
    open and most programs take as a display colour. Where OBJ names a colour map, Kd is not
    applied. glTF's factors are linear already.

    Raises
    ------
    InputError
        If the file cannot be read, is compressed, or has no triangles, more than 20 million of
        them, or vertices that are not finite.
    """
    suffix = path.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        raise InputError(f"{path}: a mesh is read from {', '.join(MESH_SUFFIXES)}")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if suffix in (".gltf", ".glb"):
        _refuse_unreadable_extensions(path)
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
    flat = suffix in (".gltf", ".glb")
    notes: set[str] = set()
    try:
        meshes = tuple(_mesh(part, transform, flat, notes) for part, transform in parts)
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
    part: trimesh.Trimesh, transform: NDArray[np.float64], flat: bool, notes: set[str]
) -> Mesh:
    # trimesh computes normals on demand; those already in its cache are the file's.
    given = "vertex_normals" in part._cache.cache
    positions = np.asarray(part.vertices, np.float64) @ transform[:3, :3].T + transform[:3, 3]
    faces = np.asarray(part.faces, np.int32)
    material, coordinates, colour = _appearance(part.visual, notes)
    if not np.all(np.isfinite(positions)):
        raise InputError("vertices are NaN or infinite")
    if given:
        # Normals transform with the inverse transpose.
        normals = _unit_or_up(np.asarray(part.vertex_normals) @ np.linalg.pinv(transform[:3, :3]))
    elif flat:
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
    visual: Any, notes: set[str]
) -> tuple[Material, NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Material, texture coordinates (V, 2) and linear vertex colour (V, 3) of a part."""
    if visual.kind == "vertex":
        colour = srgb_decode(np.asarray(visual.vertex_colors)[:, :3] / 255)
        return Material((1.0, 1.0, 1.0)), None, colour
    if visual.kind == "face":
        notes.add("colours per face are")
    if visual.kind != "texture":
        return Material(), None, None
    material, uv = visual.material, visual.uv
    coordinates = None if uv is None else np.asarray(uv, np.float64)
    if isinstance(material, trimesh.visual.material.PBRMaterial):
        return _from_gltf(material, coordinates is not None, notes), coordinates, None
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
    roughness = float((2 / (material.glossiness + 2)) ** 0.25)  # Blinn-Phong's exponent as α
    if image is not None and has_coordinates:
        return Material((1.0, 1.0, 1.0), roughness, base_colour_texture=_pixels(image))
    base = tuple(srgb_decode(np.asarray(material.diffuse)[:3] / 255))
    return Material(base, roughness)


def _pixels(image: Any) -> NDArray[np.uint8]:
    """R, G, B of a PIL image, (h, w, 3)."""
    return np.asarray(image.convert("RGB"))


def _refuse_unreadable_extensions(path: Path) -> None:
    used = _gltf_header(path).get("extensionsUsed", [])
    for name in _UNREADABLE_EXTENSIONS:
        if name in used:
            raise InputError(
                f"{path}: is packed with {name}, which fishlight cannot read; export it without "
                "(for Draco: gltf-transform copy in.glb out.glb)"
            )


def _gltf_header(path: Path) -> dict[str, Any]:
    """Return the JSON of a glTF or GLB file."""
    try:
        data = path.read_bytes()
        if path.suffix.lower() == ".glb":
            magic, _, _, length, kind = struct.unpack_from("<5I", data)
            if (magic, kind) != (_GLB_MAGIC, _GLB_JSON) or len(data) < 20 + length:
                raise ValueError("no GLB header")
            data = data[20 : 20 + length]
        header = json.loads(data)
        if not isinstance(header, dict):
            raise ValueError("no JSON object")
    except (ValueError, struct.error) as error:
        raise InputError(f"{path}: not a complete glTF file ({error})") from None
    return header


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
