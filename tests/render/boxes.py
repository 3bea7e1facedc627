"""Boxes for tests: flat faces, exact edges."""

import numpy as np

from render.scenes.scene import Material, Mesh

WHITE = Material((1.0, 1.0, 1.0), specular=0.0)


def box(low, high, material=WHITE):
    """Return the box between two corners, closed, each face with its own normal."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    positions, normals, faces = [], [], []
    for axis in range(3):
        for side in (0, 1):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            corners = np.tile(low, (4, 1))
            corners[:, axis] = (low, high)[side][axis]
            corners[[1, 2], u] = high[u]
            corners[[2, 3], v] = high[v]
            normal = np.zeros(3)
            normal[axis] = 2 * side - 1
            first = 4 * len(positions)
            quad = [[0, 1, 2], [0, 2, 3]] if side else [[0, 2, 1], [0, 3, 2]]
            positions.append(corners)
            normals.append(np.tile(normal, (4, 1)))
            faces.append(first + np.array(quad))
    return Mesh(
        np.concatenate(positions).astype(np.float32),
        np.concatenate(normals).astype(np.float32),
        np.concatenate(faces).astype(np.int32),
        material,
    )
