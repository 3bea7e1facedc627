"""RAW files of cameras, developed to linear counts.

Input  : a RAW file that LibRaw knows, DNG among them.    Output : counts and their Sensor.
Cost   : 0.3 s to start the decoding process, and about 0.06 s per megapixel.
Fails  : without a colour matrix, in the file or in LibRaw's tables, the primaries are the
         camera's own and colours are pale. Light below the black level is lost (counts are not
         negative), which brightens the darkest tones by a fraction of the read noise.

RAW decoders have a history of memory faults on crafted files, and they parse what anyone may have
sent: decoding runs in a separate process with a limit on memory and time, and a crash there is
one unreadable frame here.
"""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.errors import UnreadableFrame
from capture.files import MAX_PIXELS, check_file
from capture.sensor import Sensor

RAW_SUFFIXES = frozenset(
    (".arw", ".cr2", ".cr3", ".crw", ".dng", ".nef", ".nrw", ".orf", ".pef", ".raf", ".rw2", ".srw")
)

_WORKER = Path(__file__).with_name("raw_worker.py")
_TIMEOUT_S = 120.0
_MAX_BYTES = 4 * 2**30  # 2^27 pixels as the sensor's 2 bytes, LibRaw's 8 and our 6, with room


def read_raw(path: Path) -> tuple[NDArray[np.uint16], Sensor]:
    """Return linear Rec.709 counts, (H, W, 3), 0 at black and 65535 at white, and their sensor.

    The file is developed alike whatever it shows (raw_worker.develop says how), in daylight white
    balance: light of D65 is neutral, an incandescent lamp is orange. Pixels lie as the sensor has
    them, not turned to the camera's orientation.

    Raises
    ------
    UnreadableFrame
        If the file is damaged, hostile, or of a kind that LibRaw does not know.
    InputError
        If it does not exist.
    """
    check_file(path)
    limits = [str(MAX_PIXELS), str(_MAX_BYTES)]
    try:
        # -P keeps this folder, whose modules have short names, off the worker's import path.
        worker = subprocess.run(
            [sys.executable, "-P", str(_WORKER), str(path.absolute()), *limits],
            capture_output=True,
            stdin=subprocess.DEVNULL,
            timeout=_TIMEOUT_S,
            # Each thread of numpy's linear algebra would take its share of the address space.
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise UnreadableFrame(
            f"{path}: not developed within {_TIMEOUT_S:.0f} s; the file is damaged"
        ) from None
    if worker.returncode:
        raise UnreadableFrame(f"{path}: {_reason(worker)}")
    header, _, pixels = worker.stdout.partition(b"\n")
    levels = json.loads(header)
    counts = np.frombuffer(pixels, np.uint16).reshape(levels["shape"])
    black = "/".join(f"{level:g}" for level in sorted(set(levels["black_dn"])))
    source = f"RAW developed linearly; in the file black {black}, white {levels['white_dn']}"
    return counts, Sensor(black_dn=0.0, white_dn=65535.0, source=source)


def _reason(worker: "subprocess.CompletedProcess[bytes]") -> str:
    if worker.returncode < 0:
        name = signal.Signals(-worker.returncode).name
        return f"the RAW decoder crashed on it ({name}); the file is damaged"
    lines = worker.stderr.decode(errors="replace").strip().splitlines()
    return f"cannot be developed ({lines[-1] if lines else 'no reason given'})"
