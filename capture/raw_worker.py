"""Develops one RAW file in a process of its own, which capture.raw starts and may kill.

Run as `python raw_worker.py FILE MAX_PIXELS MAX_BYTES`. Writes one line of JSON to stdout, then
the counts, (H, W, 3) uint16. A file that cannot be developed gives exit code 1 and one line on
stderr.
"""

import json
import resource
import sys
from typing import Any

import numpy as np
import rawpy
from numpy.typing import NDArray


def develop(path: str, max_pixels: int) -> tuple[dict[str, Any], NDArray[np.uint16]]:
    """Return what the file says of its levels, and linear Rec.709 counts.

    Nothing depends on the picture's content or on the camera's automatic choices, so that all
    frames of a bracket are developed alike:

    - white balance is the camera's daylight setting, never "as shot" or automatic;
    - white is the sensor's white level (LibRaw would take the brightest pixel if it came near);
    - colours are interpolated bilinearly: a count is a mean of measured ones, proportional to
      light, where edge-seeking methods decide differently from frame to frame;
    - channels are clipped at white, so a full pixel is full in all three.
    """
    with rawpy.RawPy() as raw:
        raw.open_file(path)
        width, height = raw.sizes.raw_width, raw.sizes.raw_height
        if width * height > max_pixels:
            raise ValueError(f"the header says {width}×{height} px, more than {max_pixels}")
        raw.unpack()
        black, white = list(raw.black_level_per_channel), raw.white_level
        counts = raw.postprocess(
            demosaic_algorithm=rawpy.DemosaicAlgorithm.LINEAR,
            gamma=(1, 1),
            no_auto_bright=True,
            adjust_maximum_thr=0.0,
            highlight_mode=rawpy.HighlightMode.Clip,
            use_camera_wb=False,
            use_auto_wb=False,
            output_color=rawpy.ColorSpace.sRGB,
            output_bps=16,
            user_flip=0,
        )
    if counts.shape[2] == 1:  # a sensor without a colour filter
        counts = np.repeat(counts, 3, axis=2)
    return {"black_dn": black, "white_dn": white}, np.ascontiguousarray(counts, np.uint16)


def main() -> None:
    """Develop the file named on the command line within the memory it allows."""
    path, max_pixels, max_bytes = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    resource.setrlimit(resource.RLIMIT_AS, (max_bytes, max_bytes))
    try:
        levels, counts = develop(path, max_pixels)
    except (rawpy.LibRawError, rawpy.NotSupportedError, ValueError) as error:
        # LibRaw's messages are bytes: b'Unsupported file format or not RAW file'
        reason = error.args[0] if error.args else error
        sys.exit(reason.decode() if isinstance(reason, bytes) else str(reason))
    except MemoryError:
        sys.exit(f"needs more than the {max_bytes} bytes of memory that a file may use")
    header = json.dumps({"shape": counts.shape, **levels})
    sys.stdout.buffer.write(header.encode() + b"\n")
    sys.stdout.buffer.write(counts.data)


if __name__ == "__main__":
    main()
