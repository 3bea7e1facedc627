"""Mesh files: what comes in, and what is refused."""

import base64
import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

from capture.errors import InputError
from render.live.models import load_models
from render.scenes.mesh import load_meshes, smooth_normals

DATA = Path(__file__).resolve().parents[2].parent / "shared/data"
TRIANGLE_OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def write(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def gltf_box(path, **material):
    box = trimesh.creation.box()
    uv = np.random.default_rng(0).uniform(0, 1, (8, 2))
    box.visual = trimesh.visual.TextureVisuals(
        uv=uv, material=trimesh.visual.material.PBRMaterial(**material)
    )
    scene = trimesh.Scene()
    turn = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])
    scene.add_geometry(box, transform=turn @ np.diag([1.0, 2.0, 3.0, 1.0]))
    scene.export(path)
    return path, uv


def test_obj_without_normals_and_material(tmp_path):
    (mesh,) = load_meshes(write(tmp_path / "t.obj", TRIANGLE_OBJ)).meshes
    assert_allclose(mesh.positions, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert_allclose(mesh.normals, np.tile([0, 0, 1], (3, 1)))
    assert mesh.material.base_colour == (0.5, 0.5, 0.5)


def test_obj_material_is_decoded_from_srgb(tmp_path):
    write(tmp_path / "m.mtl", "newmtl red\nKd 0.5 0.2 0.0\nNs 30\n")
    text = "mtllib m.mtl\nusemtl red\n" + TRIANGLE_OBJ
    (mesh,) = load_meshes(write(tmp_path / "t.obj", text)).meshes
    # sRGB 0.5 → 0.214, 0.2 → 0.0331; α = √(2/(Ns + 2)) = ¼, and roughness is its root.
    assert_allclose(mesh.material.base_colour, [0.214, 0.0331, 0], atol=3e-3)
    assert_allclose(mesh.material.roughness, 0.5)


def test_obj_texture_comes_with_its_coordinates(tmp_path):
    pixels = np.random.default_rng(0).integers(0, 256, (4, 6, 3), np.uint8)
    Image.fromarray(pixels).save(tmp_path / "c.png")
    write(tmp_path / "m.mtl", "newmtl a\nKd 0.1 0.1 0.1\nmap_Kd c.png\n")
    text = (
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 0.75\nusemtl a\n"
        "f 1/1 2/2 3/3\n"
    )
    (mesh,) = load_meshes(write(tmp_path / "t.obj", text)).meshes
    assert_array_equal(mesh.material.base_colour_texture, pixels)
    assert mesh.material.base_colour == (1, 1, 1)
    top = mesh.positions[:, 1] == 1
    assert_allclose(mesh.texture_coordinates[top], [[0, 0.75]])


@pytest.mark.parametrize("name", ["b.glb", "b.gltf"])
def test_gltf_material_and_transform(tmp_path, name):
    colours = np.full((2, 2, 3), 90, np.uint8)
    factors = np.zeros((2, 2, 3), np.uint8)
    factors[...] = (7, 100, 200)  # occlusion, roughness, metalness
    path, uv = gltf_box(
        tmp_path / name,
        baseColorFactor=[0.2, 0.4, 0.6, 1.0],
        roughnessFactor=0.3,
        metallicFactor=0.7,
        baseColorTexture=Image.fromarray(colours),
        metallicRoughnessTexture=Image.fromarray(factors),
    )
    (mesh,) = load_meshes(path).meshes
    assert_allclose(mesh.material.base_colour, [0.2, 0.4, 0.6], atol=1 / 255)
    assert (mesh.material.roughness, mesh.material.metalness) == (0.3, 0.7)
    assert_array_equal(mesh.material.base_colour_texture, colours)
    assert_array_equal(mesh.material.roughness_metalness_texture[0, 0], [100, 200])
    # A unit box, 2 high and 3 deep, then turned by 90° about +Y: 3 along X.
    assert_allclose(np.ptp(mesh.positions, axis=0), [3, 2, 1], atol=1e-6)
    # No normals in the file: flat ones, each along an axis.
    assert_allclose(np.abs(mesh.normals).max(axis=1), 1, atol=1e-6)
    outward = (mesh.normals * mesh.positions).sum(axis=1)
    assert np.all(outward > 0.4)
    found = {tuple(row) for row in np.round(mesh.texture_coordinates, 5).tolist()}
    assert found == {tuple(row) for row in np.round(uv.astype(np.float32), 5).tolist()}


def test_gltf_normals_stay_upright_under_uneven_scaling(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2)
    assert ball.vertex_normals.shape == (162, 3)  # computed, so that they are exported
    scene = trimesh.Scene()
    scene.add_geometry(ball, transform=np.diag([1.0, 2.0, 4.0, 1.0]))
    scene.export(tmp_path / "e.glb", include_normals=True)
    (mesh,) = load_meshes(tmp_path / "e.glb").meshes
    assert len(mesh.positions) == 162  # not flat
    # On the ellipsoid x² + y²/4 + z²/16 = 1 the normal is along (x, y/4, z/16).
    expected = mesh.positions / [1, 4, 16]
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert_allclose(mesh.normals, expected, atol=0.02)


def test_what_is_ignored_is_said(tmp_path):
    picture = Image.fromarray(np.zeros((2, 2, 3), np.uint8))
    path, _ = gltf_box(tmp_path / "b.glb", normalTexture=picture, alphaMode="BLEND")
    notes = ("b.glb: normal maps are ignored", "b.glb: transparency is ignored")
    assert load_meshes(path).notes == notes
    assert load_models([path]).notes == notes


def test_extensions_that_are_ignored_are_said(tmp_path):
    path, _ = gltf_box(tmp_path / "b.gltf")
    header = json.loads(path.read_text())
    header["extensionsUsed"] = ["KHR_texture_transform", "EXT_texture_webp"]
    path.write_text(json.dumps(header))
    assert load_meshes(path).notes == ("b.gltf: what KHR_texture_transform says is ignored",)


def test_ply_vertex_colours_are_decoded_from_srgb(tmp_path):
    header = "ply\nformat ascii 1.0\nelement vertex 3\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz")
    header += "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    body = "0 0 0 255 0 0\n1 0 0 188 188 188\n0 1 0 0 0 255\n3 0 1 2\n"
    (mesh,) = load_meshes(write(tmp_path / "t.ply", header + body)).meshes
    assert_allclose(mesh.vertex_colour, [[1, 0, 0], [0.503] * 3, [0, 0, 1]], atol=1e-3)


COMPONENT_TYPES = {"u1": 5121, "u2": 5123, "f4": 5126}


def gltf_triangle_with_colours(path, colours, **primitive):
    """A triangle whose COLOR_0 is the array; integers are normalised."""
    data = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]).tobytes() + colours.tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    kind = colours.dtype.str[1:]
    header = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "buffers": [{"byteLength": len(data), "uri": uri}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": len(data) - 36},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {
                "bufferView": 1,
                "componentType": COMPONENT_TYPES[kind],
                "normalized": kind != "f4",
                "count": 3,
                "type": "VEC4",
            },
        ],
        "materials": [{"pbrMetallicRoughness": {}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, **primitive}]}],
    }
    return write(path, json.dumps(header))


@pytest.mark.parametrize("kind", ["u1", "u2", "f4"])
@pytest.mark.parametrize("primitive", [{}, {"material": 0}])
def test_gltf_vertex_colours_are_linear(tmp_path, kind, primitive):
    share = np.array([[1.0, 0.0, 0.2, 1.0], [0.4, 0.6, 0.8, 1.0], [0.2, 0.2, 0.2, 1.0]])
    largest = 1.0 if kind == "f4" else np.iinfo(kind).max
    colours = np.round(share * largest, 6).astype("<" + kind)
    path = gltf_triangle_with_colours(tmp_path / "t.gltf", colours, **primitive)
    if kind == "u2" and not primitive:
        with pytest.raises(InputError, match="16-bit vertex colours"):
            load_meshes(path)
        return
    (mesh,) = load_meshes(path).meshes
    assert_allclose(mesh.vertex_colour, share[:, :3], atol=1e-6)
    assert mesh.material.base_colour == (1, 1, 1)


def test_smooth_normals_of_a_sphere_are_radial_across_seams():
    ball = trimesh.creation.icosphere(subdivisions=3)
    # Every triangle with corners of its own, as at a seam everywhere.
    positions = ball.vertices[ball.faces].reshape(-1, 3)
    faces = np.arange(len(positions)).reshape(-1, 3)
    normals = smooth_normals(positions, faces)
    assert (normals * positions).sum(axis=1).min() > np.cos(np.radians(1))


def test_smooth_normals_of_nothing_point_up():
    assert_array_equal(smooth_normals(np.zeros((3, 3)), np.array([[0, 1, 2]])), [[0, 1, 0]] * 3)


TRIANGLE_PLY = b"""ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 %d
"""


def glb(header):
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<5I", 0x46546C67, 2, 20 + len(text), len(text), 0x4E4F534A) + text


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.stl", b"", "read from .obj"),
        ("a.obj", b"", "no triangles"),
        ("a.obj", b"hello, this is a text\n", "no triangles"),
        ("a.obj", b"v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", "NaN"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "a.obj"),
        ("a.obj", b"v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", "0 m across"),
        ("a.obj", b"v 0 0 0\nv 1e-30 0 0\nv 0 1e-30 0\nf 1 2 3\n", "1e-30 m across"),
        ("a.obj", b"v 1e6 0 0\nv 1000001 0 0\nv 1e6 1 0\nf 1 2 3\n", "move it to the origin"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 3\n", "not a readable mesh"),
        ("a.glb", b"glTF", "not a complete glTF"),
        ("a.glb", glb({"asset": {"version": "2.0"}})[:30], "not a complete glTF"),
        ("a.gltf", b"[1, 2]", "not a complete glTF"),
        ("a.gltf", b'{"asset": {"version": "2.0"}}', "a.gltf"),
        ("a.glb", glb({"meshes": [{}]}), "not a valid glTF"),
        (
            "a.glb",
            glb({"meshes": [{"primitives": [{"attributes": {"COLOR_0": 3}}]}]}),
            "valid glTF",
        ),
        ("a.glb", glb({"extensionsUsed": ["KHR_draco_mesh_compression"]}), "Draco"),
        ("a.glb", glb({"extensionsUsed": None}), "not a valid glTF"),
        ("a.gltf", b'{"a": ' + b"[" * 200_000, "not a complete glTF"),
        ("a.ply", TRIANGLE_PLY % 3, "vertices outside 0 … 2"),
    ],
)
def test_unusable_files_are_refused_in_one_line_that_names_them(tmp_path, name, content, message):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=message) as failure:
        load_meshes(path)
    assert str(path) in str(failure.value)
    assert "\n" not in str(failure.value)


@pytest.mark.parametrize("shininess", ["-2", "-5", "nan"])
def test_a_shininess_that_is_none_is_refused(tmp_path, shininess):
    (tmp_path / "a.mtl").write_text(f"newmtl m\nKd 1 1 1\nNs {shininess}\n")
    path = tmp_path / "a.obj"
    path.write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n")
    with pytest.raises(InputError, match=r"a\.obj: a material's Ns is"):
        load_meshes(path)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        load_meshes(tmp_path / "a.obj")


@pytest.mark.data
@pytest.mark.parametrize("name", ["spot", "suzanne", "teapot", "rocker-arm"])
def test_common_objects_load(name):
    path = DATA / "objects-common" / f"{name}.obj"
    if not path.exists():
        pytest.skip(f"{path} is not here")
    (mesh,) = load_meshes(path).meshes
    assert len(mesh.faces) > 900
    assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)


@pytest.mark.data
def test_draco_files_are_refused():
    path = DATA / "objects-pmndrs" / "bunny.glb"
    if not path.exists():
        pytest.skip(f"{path} is not here")
    with pytest.raises(InputError, match="KHR_draco_mesh_compression"):
        load_meshes(path)
