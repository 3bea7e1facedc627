"""RAW files of cameras: linear counts of the camera's own channels, and their Sensor.

Input  : a RAW file that LibRaw knows, DNG among them.
Output : counts between one black and one white level for all files, whatever theirs are.
Cost   : 0.3 s to start the decoding process, once, and about 0.1 s per megapixel.
Fails  : without a colour matrix, in the file or in LibRaw's table, the channels are taken for red,
         green and blue as they are, and colours are pale and off. capture.raw_decoding says what
         else is not done.

Nothing depends on the picture's content or on the camera's automatic choices: all frames of a
bracket are decoded alike. There is no white balance in the counts; capture.raw_colour makes
radiance of them.
"""

from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from capture.decoding import decode
from capture.errors import UnreadableFrame
from capture.files import check_file
from capture.raw_colour import DngMatrix, camera_to_rec709
from capture.sensor import Sensor

RAW_SUFFIXES = frozenset(
    (".arw", ".cr2", ".cr3", ".crw", ".dng", ".nef", ".nrw", ".orf", ".pef", ".raf", ".rw2", ".srw")
)

BLACK_DN, WHITE_DN = 4096, 65535
"""Where counts are brought to. Noise below black stays measurable, so that it averages out."""

_FULL_WELL_E, _READ_NOISE_E = 30_000.0, 4.0  # no file tells


class RawFacts(msgspec.Struct, frozen=True):
    """What a RAW file says besides its counts, by LibRaw's colours: R, G, B and the second G."""

    black_dn: tuple[float, float, float, float]
    white_dn: tuple[float, float, float, float]
    is_grey: bool
    table: tuple[tuple[float, float, float], ...]
    matrices: tuple[DngMatrix, ...]
    analog_balance: tuple[float, float, float] | None


def read_raw(path: Path) -> tuple[NDArray[np.uint16], RawFacts]:
    """Return linear counts, (H, W, 3), BLACK_DN to WHITE_DN, and what the file says of them.

    The missing colours of a mosaic are means of their neighbours; a count of WHITE_DN is full, or
    was interpolated from a full one. Pixels lie as the sensor has them, not turned to the camera's
    orientation.

    Raises
    ------
    UnreadableFrame
        If the file is damaged, hostile, or of a kind that LibRaw does not know.
    InputError
        If it does not exist, or the sensor's colours are not red, green and blue.
    """
    check_file(path)
    facts, arrays = decode("raw", path)
    try:
        return arrays["counts"], msgspec.convert(facts, RawFacts)
    except (msgspec.ValidationError, KeyError) as error:
        raise UnreadableFrame(f"{path}: cannot be developed ({error})") from None


def raw_sensor(facts: RawFacts) -> Sensor:
    """Return the sensor of a RAW file's counts; imports colour-science, which takes its time."""
    used = (0,) if facts.is_grey else (0, 1, 2, 3)
    black, white = (
        "/".join(dict.fromkeys(f"{levels[i]:g}" for i in used))
        for levels in (facts.black_dn, facts.white_dn)
    )
    matrix, origin = None, "no colours"
    if not facts.is_grey:
        matrix, origin = camera_to_rec709(facts.matrices, facts.analog_balance, facts.table)
    # The file's own steps are coarser than those of the counts.
    range_dn = np.subtract(facts.white_dn, facts.black_dn)[list(used)].min()
    step_e = _FULL_WELL_E / range_dn / np.sqrt(12)
    return Sensor(
        black_dn=BLACK_DN,
        white_dn=WHITE_DN,
        full_well_e=_FULL_WELL_E,
        read_noise_e=float(np.hypot(_READ_NOISE_E, step_e)),
        source=f"RAW, linear, in the file black {black}, white {white}; {origin}",
        colour_matrix=matrix,
    )
