"""glTF headers: what trimesh would read wrong without a word, found before it reads.

Input  : a .gltf or .glb file.    Output : what its extensions say and nobody reads; an InputError
for what cannot be read.
"""

import json
import struct
from pathlib import Path
from typing import Any

from capture.errors import InputError

# Extensions that change what the file's numbers mean, and that trimesh passes over.
_UNREADABLE_EXTENSIONS = (
    "KHR_draco_mesh_compression",
    "EXT_meshopt_compression",
    "KHR_mesh_quantization",
    "KHR_texture_basisu",
)
_HONOURED_EXTENSIONS = ("KHR_materials_pbrSpecularGlossiness", "EXT_texture_webp")
_UNSIGNED_SHORT = 5123  # a componentType
_GLB_MAGIC, _GLB_JSON = 0x46546C67, 0x4E4F534A


def check_gltf(path: Path) -> set[str]:
    """Return what the reader passes over in a file; refuse one that it would read wrong.

    Raises
    ------
    InputError
        If the file is not complete, or holds geometry or colours in a form that trimesh misreads.
    """
    header = _header(path)
    try:
        used = list(header.get("extensionsUsed", []))
        cuts_colours = _has_bare_16_bit_colours(header)
    except (KeyError, IndexError, TypeError) as error:
        raise InputError(f"{path}: not a valid glTF file ({error!r})") from None
    for name in _UNREADABLE_EXTENSIONS:
        if name in used:
            raise InputError(
                f"{path}: is packed with {name}, which fishlight cannot read; export it without "
                "(for Draco: gltf-transform copy in.glb out.glb)"
            )
    if cuts_colours:
        raise InputError(
            f"{path}: has 16-bit vertex colours without a material, which cannot be read; "
            "give it a material, or export 8-bit or float colours"
        )
    return {f"what {name} says is" for name in used if name not in _HONOURED_EXTENSIONS}


def _has_bare_16_bit_colours(header: dict[str, Any]) -> bool:
    """Whether trimesh would cut vertex colours to their lower 8 bits."""
    return any(
        "material" not in primitive
        and "COLOR_0" in primitive["attributes"]
        and header["accessors"][primitive["attributes"]["COLOR_0"]]["componentType"]
        == _UNSIGNED_SHORT
        for mesh in header.get("meshes", [])
        for primitive in mesh["primitives"]
    )


def _header(path: Path) -> dict[str, Any]:
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
    except (ValueError, struct.error, RecursionError) as error:
        raise InputError(f"{path}: not a complete glTF file ({error})") from None
    return header
