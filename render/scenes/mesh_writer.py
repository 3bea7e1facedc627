"""Meshes with colours of their vertices, as files for other programs.

Input  : meshes, and a colour of each vertex.    Output : PLY, in binary, one mesh of all.
Kept   : positions, normals, triangles; colours in steps of 1/255, sRGB-coded, as `load_meshes` and
         most programs take them.
Not kept: materials and texture coordinates.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from capture.output import replacing
from capture.sensor import srgb_encode
from render.scenes.scene import Mesh
from render.scenes.triangle_tables import gather_geometry


def write_ply(
    path: Path, meshes: Sequence[Mesh], colours: NDArray[np.floating], *, force: bool = True
) -> None:
    """Write meshes with a linear colour in [0, 1] of each of their vertices, (V, 3).

    Raises
    ------
    InputError
        If the file exists and `force` is False.
    """
    geometry = gather_geometry(meshes)
    joined = trimesh.Trimesh(
        geometry.positions,
        geometry.faces,
        vertex_normals=geometry.attributes[:, :3],
        vertex_colors=np.rint(255 * srgb_encode(colours)).astype(np.uint8),
        process=False,
    )
    with replacing(path, force=force) as partial:
        partial.write_bytes(trimesh.exchange.ply.export_ply(joined, vertex_normal=True))
