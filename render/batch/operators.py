"""A camera's ways from pictures to maps and to blocks, kept by each process while it needs them.

Cost   : a second or two a megapixel to make; then the memory of `build_remap` and
         `build_source_blocks`, for one camera at a time.
"""

import hashlib
import threading
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from calibration.files import read_calibration
from capture.errors import InputError
from capture.files import read_bytes
from lighting.blocks.source_blocks import SourceBlocks, build_source_blocks
from lighting.maps.remap import Remap, build_remap
from lighting.reduce import BLOCK_METHODS
from render.batch.runs import Job

kernels = threading.Lock()
"""A process may be at several runs at once, and numba's threads must not be called by two."""


@dataclass(frozen=True)
class Operators:
    """Ways to maps and to blocks; None for what is not needed."""

    remap: Remap | None
    source_blocks: SourceBlocks | None


def operators_of(job: Job) -> Operators:
    """Return the operators that a job needs, made at the first call.

    Raises
    ------
    InputError
        If the calibration is not what it was when the batch began.
    """
    settings = job.settings
    by_blocks = settings.needs_lights and settings.plan.method in BLOCK_METHODS
    with kernels:
        return _operators(
            _CalibrationFile(job.calibration_digest, job.calibration_path),
            settings.map_height if settings.needs_map else None,
            settings.plan.block_rows if by_blocks else None,
        )


@dataclass(frozen=True)
class _CalibrationFile:
    """Recordings of one camera have a copy each: what is in it counts, not where it is."""

    digest: str
    path: Path | None = field(compare=False)


@lru_cache(maxsize=1)
def _operators(file: _CalibrationFile, map_height: int | None, block_rows: int | None) -> Operators:
    if file.path is None:
        return Operators(None, None)
    if hashlib.sha256(read_bytes(file.path)).hexdigest() != file.digest:
        raise InputError(f"{file.path}: changed while the batch was at work; start it again")
    calibration = read_calibration(file.path)
    return Operators(
        None if map_height is None else build_remap(calibration, map_height),
        None if block_rows is None else build_source_blocks(calibration, block_rows),
    )
