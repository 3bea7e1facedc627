"""Objects set down on the ground of a plate."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import yaw_rotation
from capture.errors import InputError
from render.scenes.scene import Mesh

Array = NDArray[np.float64]


def placed(
    meshes: Sequence[Mesh], point: Array, yaw_rad: float, height_m: float | None
) -> tuple[Mesh, ...]:
    """Return meshes that stand on the ground, y = 0, the middle of their box above a point.

    Parameters
    ----------
    point : (3,) float64
        Where on the ground.
    yaw_rad : float
        Their front, +Z as in glTF, is turned so far toward +X.
    height_m : float or None
        How high they become, all together; as they are if None.

    Raises
    ------
    InputError
        If the height is not positive, or flat meshes are to have one.
    """
    positions = np.concatenate([mesh.positions for mesh in meshes]).astype(np.float64)
    low, high = positions.min(axis=0), positions.max(axis=0)
    scale = 1.0
    if height_m is not None:
        if not (0 < height_m < np.inf and high[1] > low[1]):
            raise InputError(
                f"objects {high[1] - low[1]:g} m high cannot be made {height_m:g} m high"
            )
        scale = height_m / (high[1] - low[1])
    middle = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    turn = yaw_rotation(yaw_rad)
    return tuple(
        replace(
            mesh,
            positions=(scale * (mesh.positions - middle) @ turn.T + point).astype(np.float32),
            normals=(mesh.normals @ turn.T).astype(np.float32),
        )
        for mesh in meshes
    )
