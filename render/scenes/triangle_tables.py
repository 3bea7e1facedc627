"""A scene's meshes as tables that compiled loops read: vertices, triangles, materials, texels.

Input  : meshes.    Output : Geometry and Appearance, of all meshes together.
Cost   : Geometry about 1 ms per 70,000 triangles, made for every pose; Appearance once.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from capture.sensor import srgb_decode
from render.scenes.scene import Material, Mesh
from render.scenes.texture_pyramid import pyramid

_FLOATS = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Geometry:
    """Triangles of all meshes, one list.

    Attributes
    ----------
    positions : (V, 3) float32
    attributes : (V, 8) float32
        Normal (3), texture coordinates (2), colour (3).
    faces : (F, 3) int32
    mesh_of_face : (F,) int32
    centre, radius_m : (3,) float64, float
        A sphere around them, about the middle of their bounding box; (0, 0) if there are none.
    """

    positions: _FLOATS
    attributes: _FLOATS
    faces: NDArray[np.int32]
    mesh_of_face: NDArray[np.int32]
    centre: NDArray[np.float64]
    radius_m: float


@dataclass(frozen=True, eq=False)
class Appearance:
    """Materials of all meshes.

    Attributes
    ----------
    factors : (M, 6) float32
        Base colour (3), roughness, metalness, specular; a row per mesh.
    textures : (M, 2, 4) int64
        First texel, width, height and number of levels, 0 without a texture: of the base colour,
        then of roughness and metalness.
    texels : (T, 3) float32
        Linear, every texture's levels one after another, each half as large as the one before.
    """

    factors: _FLOATS
    textures: NDArray[np.int64]
    texels: _FLOATS


def gather_geometry(meshes: Sequence[Mesh]) -> Geometry:
    """Return the triangles of `meshes`."""
    if not meshes:
        none = np.zeros((0, 3), np.float32)
        faces = np.zeros((0, 3), np.int32)
        return Geometry(none, np.zeros((0, 8), np.float32), faces, faces[:, 0], np.zeros(3), 0.0)
    counts = [len(mesh.positions) for mesh in meshes]
    first = np.cumsum([0, *counts])
    positions = np.concatenate([mesh.positions for mesh in meshes])
    attributes = np.empty((len(positions), 8), np.float32)
    for mesh, (start, stop) in zip(meshes, pairwise(first), strict=True):
        attributes[start:stop, :3] = mesh.normals
        coordinates, colour = mesh.texture_coordinates, mesh.vertex_colour
        attributes[start:stop, 3:5] = 0.0 if coordinates is None else coordinates
        attributes[start:stop, 5:] = 1.0 if colour is None else colour
    faces = np.concatenate(
        [mesh.faces + np.int32(start) for mesh, start in zip(meshes, first[:-1], strict=True)]
    )
    mesh_of_face = np.repeat(
        np.arange(len(meshes), dtype=np.int32), [len(mesh.faces) for mesh in meshes]
    )
    centre = 0.5 * (positions.min(axis=0).astype(np.float64) + positions.max(axis=0))
    offset = positions - centre.astype(np.float32)
    radius_m = float(np.sqrt(np.einsum("ij,ij->i", offset, offset).max()))
    return Geometry(positions, attributes, faces, mesh_of_face, centre, radius_m)


def gather_appearance(materials: Sequence[Material]) -> Appearance:
    """Return the materials, one of each mesh, with the pyramids of their textures."""
    factors = [
        (*each.base_colour, each.roughness, each.metalness, each.specular) for each in materials
    ]
    texels = [np.zeros((0, 3), np.float32)]
    textures = np.zeros((len(materials), 2, 4), np.int64)
    first = 0
    for row, material in enumerate(materials):
        colour, rough_metal = material.base_colour_texture, material.roughness_metalness_texture
        for slot, picture in enumerate(
            (
                None if colour is None else srgb_decode(colour / 255.0),
                None
                if rough_metal is None
                else np.pad(rough_metal / 255.0, ((0, 0),) * 2 + ((0, 1),)),
            )
        ):
            if picture is None:
                continue
            levels = pyramid(picture[::-1].astype(np.float32))  # row 0 is at v = 0 now
            textures[row, slot] = first, picture.shape[1], picture.shape[0], len(levels)
            texels += [level.reshape(-1, 3) for level in levels]
            first += sum(level.shape[0] * level.shape[1] for level in levels)
    return Appearance(
        np.array(factors, np.float32).reshape(-1, 6), textures, np.concatenate(texels)
    )
