"""A calibration file as it was, but for the pose of its camera."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibration.camera import Calibration
from calibration.files import read_calibration, read_records, write_calibration


def write_posed(
    path: Path,
    start_path: Path,
    calibration: Calibration,
    R_world_camera: NDArray[np.float64],
    *,
    force: bool,
) -> None:
    """Write the calibration with another pose, and what `start_path` keeps of its making.

    But for how its lens was made, if the calibration has another.
    """
    posed = replace(calibration, R_world_camera=R_world_camera)
    records = read_records(start_path)
    if calibration.model != read_calibration(start_path).model:
        records.pop("lens_fit", None)
    write_calibration(path, posed, **records, force=force)
