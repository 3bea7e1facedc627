"""What rays hit: a scene as arrays for compiled loops, and the surface at a hit.

Input  : meshes with materials, a ground.    Output : what reflects light, 16 rays at a time.
Cost   : about 100 ns a ray that hits.
Fails  : textures are looked up without mipmaps: a picture of few samples a pixel is noisy where
         they are fine, and is still right in the mean.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from capture.sensor import srgb_decode
from render.rays.embree import PACKET, coherent16, intersect16
from render.scenes.scene import Material, Mesh, Scene

Floats = NDArray[np.float32]

ORIGIN, NORMAL, FACE_NORMAL, TO_EYE, MATT, F0 = 0, 3, 6, 9, 12, 15
F90, ALPHA2, HIT = 18, 19, 20
FIELDS = 21
"""Rows of a surface: where its rays begin, shading normal, face normal, direction to the eye, ρ/π
and f0 (3 each); f90, α², and whether anything was hit."""

FAR_M = np.float32(1e30)
_DIELECTRIC_F0 = np.float32(0.04)  # refractive index 1.5, as in glTF
_SMALLEST_ALPHA2 = np.float32(4e-6)  # as shade.frag has it
_SMALLEST_N_V = np.float32(1e-4)
OFFSET = 2e-5
"""Of the meshes' radius: rays begin that far off their surface."""
_DECODED = srgb_decode(np.arange(256) / 255.0).astype(np.float32)


class Tables(NamedTuple):
    """A scene, flat.

    Attributes
    ----------
    positions, normals, colours : (V, 3) float32
    coordinates : (V, 2) float32
    faces : (F, 3) int32
    mesh_of_face : (F,) int32
    factors : (M, 6) float32
        Base colour (3), roughness, metalness, specular of each mesh.
    textures : (M, 2, 3) int64
        First texel, width and height (0 without one) of base colour; of roughness and metalness.
    texels : (T, 3) uint8
    ground : (5,) float32
        Height, radius (negative without a ground), reflectance (3).
    sphere : (4,) float32
        Centre and radius of a sphere around the meshes.
    """

    positions: Floats
    normals: Floats
    colours: Floats
    coordinates: Floats
    faces: NDArray[np.int32]
    mesh_of_face: NDArray[np.int32]
    factors: Floats
    textures: NDArray[np.int64]
    texels: NDArray[np.uint8]
    ground: Floats
    sphere: Floats


def scene_tables(scene: Scene) -> Tables:
    """Return the arrays of a scene."""
    meshes = scene.meshes
    starts = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
    faces = [mesh.faces + np.int32(start) for mesh, start in zip(meshes, starts, strict=False)]
    positions = _joined([mesh.positions for mesh in meshes], 3)
    materials = [mesh.material for mesh in meshes]
    textures, texels = _textures(materials)
    factors = [(*m.base_colour, m.roughness, m.metalness, m.specular) for m in materials]
    ground = scene.ground
    return Tables(
        positions,
        _joined([mesh.normals for mesh in meshes], 3),
        _joined([_or_constant(mesh, mesh.vertex_colour, 1.0, 3) for mesh in meshes], 3),
        _joined([_or_constant(mesh, mesh.texture_coordinates, 0.0, 2) for mesh in meshes], 2),
        np.concatenate([np.zeros((0, 3), np.int32), *faces]),
        np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes]).astype(np.int32),
        np.array(factors, np.float32).reshape(-1, 6),
        textures,
        texels,
        np.array(
            (0, -1, 0, 0, 0)
            if ground is None
            else (ground.y_m, ground.radius_m, *ground.reflectance),
            np.float32,
        ),
        _bounding_sphere(positions),
    )


def _joined(parts: list[Floats], width: int) -> Floats:
    return np.concatenate([np.zeros((0, width), np.float32), *parts])


def _or_constant(mesh: Mesh, values: Floats | None, constant: float, width: int) -> Floats:
    shape = len(mesh.positions), width
    return np.full(shape, constant, np.float32) if values is None else values


def _textures(materials: list[Material]) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    table = np.zeros((len(materials), 2, 3), np.int64)
    texels = [np.zeros((0, 3), np.uint8)]
    first = 0
    for row, material in enumerate(materials):
        pictures = material.base_colour_texture, material.roughness_metalness_texture
        for slot, picture in enumerate(pictures):
            if picture is not None:
                height, width, channels = picture.shape
                table[row, slot] = first, width, height
                flat = picture.reshape(-1, channels)
                texels.append(np.pad(flat, ((0, 0), (0, 3 - channels))))
                first += len(flat)
    return table, np.concatenate(texels)


def _bounding_sphere(positions: Floats) -> Floats:
    if not len(positions):
        return np.zeros(4, np.float32)
    centre = 0.5 * (positions.min(axis=0).astype(np.float64) + positions.max(axis=0))
    radius_m = 1.0001 * np.linalg.norm(positions - centre, axis=1).max()  # as float32 rounds
    return np.array([*centre, radius_m], np.float32)


@njit(nogil=True)
def find_surfaces(
    function: int,
    scene: int,
    tables: Tables,
    rays: Floats,
    valid: NDArray[np.int32],
    out: Floats,
) -> None:  # pragma: no cover - compiled
    """Set `out` (FIELDS, 16) to what rays of a `hit_packet` hit; its normals face their origin.

    Rows 0 to 2 and 4 to 6 of `rays` are given, and `valid`; the rest is overwritten.
    """
    _aim(tables, rays)
    coherent16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
    _set_found(tables, rays, valid, out)


@njit(nogil=True)
def find_surfaces_apart(
    function: int,
    scene: int,
    tables: Tables,
    rays: Floats,
    valid: NDArray[np.int32],
    out: Floats,
) -> None:  # pragma: no cover - compiled
    """Do what `find_surfaces` does, faster for rays that run apart."""
    _aim(tables, rays)
    intersect16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
    _set_found(tables, rays, valid, out)


@njit(nogil=True)
def _aim(tables: Tables, rays: Floats) -> None:  # pragma: no cover - compiled
    """Let rays end at the ground."""
    geometry = rays[18].view(np.int32)
    for i in range(PACKET):
        rays[3, i] = 0
        rays[8, i] = _to_ground(tables.ground, rays, i)
        geometry[i] = -1


@njit(nogil=True)
def _set_found(
    tables: Tables, rays: Floats, valid: NDArray[np.int32], out: Floats
) -> None:  # pragma: no cover - compiled
    geometry, face = rays[18].view(np.int32), rays[17].view(np.int32)
    for i in range(PACKET):
        out[HIT, i] = np.float32(valid[i] != 0 and rays[8, i] < FAR_M)
        if valid[i] and geometry[i] != -1:
            _set_on_mesh(tables, face[i], rays, i, out)
        elif out[HIT, i] > 0:
            _set_on_ground(tables.ground, rays, i, out)
        else:
            out[MATT : F90 + 1, i] = 0


@njit(nogil=True)
def _to_ground(ground: Floats, rays: Floats, i: int) -> np.float32:  # pragma: no cover - compiled
    if ground[1] < 0 or rays[5, i] == 0:
        return FAR_M
    distance = (ground[0] - rays[1, i]) / rays[5, i]
    x = rays[0, i] + distance * rays[4, i]
    z = rays[2, i] + distance * rays[6, i]
    met = distance > 0 and x * x + z * z <= ground[1] * ground[1]
    return distance if met else FAR_M


@njit(nogil=True)
def _set_on_ground(ground: Floats, rays: Floats, i: int, out: Floats) -> None:  # pragma: no cover
    side = np.float32(1) if rays[5, i] < 0 else np.float32(-1)
    for axis in range(3):
        out[ORIGIN + axis, i] = rays[axis, i] + rays[8, i] * rays[4 + axis, i]
        out[NORMAL + axis, i] = out[FACE_NORMAL + axis, i] = side * np.float32(axis == 1)
        out[MATT + axis, i] = ground[2 + axis] / np.float32(math.pi)
        out[F0 + axis, i] = 0
    out[ORIGIN + 1, i] = ground[0]
    out[F90, i] = 0
    out[ALPHA2, i] = 1
    _set_to_eye(rays, i, out)


@njit(nogil=True)
def _set_on_mesh(
    tables: Tables, face: int, rays: Floats, i: int, out: Floats
) -> None:  # pragma: no cover - compiled
    u, v = rays[15, i], rays[16, i]
    w = np.float32(1) - u - v
    a, b, c = tables.faces[face, 0], tables.faces[face, 1], tables.faces[face, 2]
    p, n = tables.positions, tables.normals
    facing = rays[12, i] * rays[4, i] + rays[13, i] * rays[5, i] + rays[14, i] * rays[6, i]
    length = math.sqrt(rays[12, i] ** 2 + rays[13, i] ** 2 + rays[14, i] ** 2)
    side = (np.float32(1) if facing < 0 else np.float32(-1)) / length
    agrees = squared = np.float32(0)
    for axis in range(3):
        normal = w * n[a, axis] + u * n[b, axis] + v * n[c, axis]
        out[FACE_NORMAL + axis, i] = side * rays[12 + axis, i]
        out[NORMAL + axis, i] = normal
        agrees += normal * out[FACE_NORMAL + axis, i]
        squared += normal * normal
    length = math.sqrt(squared)
    side = (np.float32(1) if agrees >= 0 else np.float32(-1)) / (length if length > 0 else 1)
    offset = np.float32(OFFSET) * tables.sphere[3]
    for axis in range(3):
        out[NORMAL + axis, i] *= side
        if length == 0:  # they cancel
            out[NORMAL + axis, i] = out[FACE_NORMAL + axis, i]
        # More exact than the distance along the ray, which may be long.
        place = w * p[a, axis] + u * p[b, axis] + v * p[c, axis]
        out[ORIGIN + axis, i] = place + offset * out[FACE_NORMAL + axis, i]
    _set_to_eye(rays, i, out)
    _set_material(tables, face, u, v, i, out)


@njit(nogil=True)
def _set_to_eye(rays: Floats, i: int, out: Floats) -> None:  # pragma: no cover - compiled
    """Set the direction back along a ray, turned as far as it takes to be above the normal."""
    length = math.sqrt(rays[4, i] ** 2 + rays[5, i] ** 2 + rays[6, i] ** 2)
    above = np.float32(0)
    for axis in range(3):
        out[TO_EYE + axis, i] = -rays[4 + axis, i] / length
        above += out[TO_EYE + axis, i] * out[NORMAL + axis, i]
    if above < _SMALLEST_N_V:
        squared = np.float32(0)
        for axis in range(3):
            out[TO_EYE + axis, i] += (_SMALLEST_N_V - above) * out[NORMAL + axis, i]
            squared += out[TO_EYE + axis, i] ** 2
        for axis in range(3):
            out[TO_EYE + axis, i] /= math.sqrt(squared)


@njit(nogil=True)
def _set_material(
    tables: Tables, face: int, u: float, v: float, i: int, out: Floats
) -> None:  # pragma: no cover - compiled
    """Set ρ/π, f0, f90 and α², as gbuffer.frag has them."""
    w = np.float32(1) - u - v
    a, b, c = tables.faces[face, 0], tables.faces[face, 1], tables.faces[face, 2]
    mesh = tables.mesh_of_face[face]
    t = tables.coordinates
    s = w * t[a, 0] + u * t[b, 0] + v * t[c, 0]
    up = w * t[a, 1] + u * t[b, 1] + v * t[c, 1]
    rough, metal = tables.factors[mesh, 3], tables.factors[mesh, 4]
    specular = tables.factors[mesh, 5]
    if tables.textures[mesh, 1, 1]:
        rough *= _texel_mean(tables, mesh, 1, 0, s, up)
        metal *= _texel_mean(tables, mesh, 1, 1, s, up)
    for k in range(3):
        tint = tables.colours
        base = tables.factors[mesh, k] * (w * tint[a, k] + u * tint[b, k] + v * tint[c, k])
        if tables.textures[mesh, 0, 1]:
            base *= _texel_mean(tables, mesh, 0, k, s, up)
        out[MATT + k, i] = base * (1 - metal) / np.float32(math.pi)
        out[F0 + k, i] = (1 - metal) * _DIELECTRIC_F0 * specular + metal * base
    out[F90, i] = (1 - metal) * specular + metal
    out[ALPHA2, i] = max(rough**4, _SMALLEST_ALPHA2)


@njit(nogil=True)
def _texel_mean(
    tables: Tables, mesh: int, slot: int, channel: int, s: float, up: float
) -> float:  # pragma: no cover - compiled
    """Return a texture's linear value at (s, up), repeated and bilinear."""
    first, width, height = tables.textures[mesh, slot]
    x, y = s * width - 0.5, (1 - up) * height - 0.5
    column, row = math.floor(x), math.floor(y)
    right, down = x - column, y - row
    value = 0.0
    for j in range(2):
        for i in range(2):
            at = first + (int(row) + j) % height * width + (int(column) + i) % width
            code = tables.texels[at, channel]
            texel = _DECODED[code] if slot == 0 else np.float32(code) / np.float32(255)
            value += (right if i else 1 - right) * (down if j else 1 - down) * texel
    return value
