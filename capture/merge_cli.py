"""`fishlight merge`: one bracket made into linear radiance."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from capture.alignment import Alignment, align_bracket
from capture.arguments import Output, WholeNumber, parse_exposures, size_text, tell
from capture.bracket_sources import read_bracket
from capture.ghosts import find_ghosts, without_ghosts
from capture.merge import merge_bracket
from capture.output import check_place
from capture.primaries import PrimariesName
from capture.radiance_files import check_hdr_suffix, write_radiance
from capture.sensor import in_primaries
from capture.sensor_files import read_sensor


def merge(
    *sources: Path,
    output: Output,
    exposures: str | None = None,
    bracket: WholeNumber = 0,
    response: Path | None = None,
    align: Annotated[bool, Parameter(negative="--no-align")] = True,
    ghosts: Annotated[bool, Parameter(negative="--no-ghosts")] = True,
    primaries: PrimariesName = "rec709",
    force: bool = False,
) -> None:
    """Merge one bracket to linear radiance.

    Parameters
    ----------
    sources
        A recording; or photographs, or a folder of them.
    output
        An EXR file with radiance, its variance and the masks `valid` and `clipped`; or .hdr,
        which keeps radiance alone.
    exposures
        Exposure times in seconds, as for `import`; not for a recording.
    bracket
        Which bracket, from 0.
    response
        The camera's response, as `calibrate response` writes it, instead of the recording's or an
        assumed one.
    align
        Lay frames that moved over the darkest one, by a shift and a turn. A bracket from a tripod
        is not touched.
    ghosts
        Take what moved between the exposures from one of them.
    primaries
        What the output's red, green and blue are; it names them. Rec.709 cuts off the most
        saturated colours of RAW files.
    force
        Replace the output if it exists.
    """
    check_hdr_suffix(output)
    check_place(output, force=force)  # refused before the work, not after
    times_s = None if exposures is None else parse_exposures(exposures)
    measured = None if response is None else read_sensor(response)
    chosen, sensor, notes = read_bracket(sources, times_s, bracket, measured)
    sensor = in_primaries(sensor, primaries)
    if align:
        aligned = align_bracket(chosen, sensor)
        chosen, sensor = aligned.bracket, aligned.sensor
        notes += _alignment_notes(aligned.alignments)
    image = merge_bracket(chosen, sensor)
    moved = np.zeros(image.valid.shape, np.bool_)
    if ghosts:
        moved = find_ghosts(chosen, sensor)
        image = without_ghosts(image, chosen, sensor, moved)
    write_radiance(output, image, comments=f"sensor: {sensor.source}", force=force)
    tell((f"sensor: {sensor.source}", *notes))
    print(
        f"{output}: {size_text(image.size_px)} from {len(chosen.frames)} exposures, "
        f"clipped {image.clipped.mean():.3%}, not valid {1 - image.valid.mean():.3%}"
        + (f", ghosts {moved.mean():.3%}" if ghosts else "")
    )


def _alignment_notes(alignments: Sequence[Alignment]) -> tuple[str, ...]:
    notes = []
    moved_px = [found.motion_px for found in alignments if found.is_moved]
    if moved_px:
        notes.append(
            f"frames that had moved, by up to {max(moved_px):.1f} px, and were laid straight: "
            f"{len(moved_px)} of {len(alignments)}"
        )
    unsure = [str(found.frame_index) for found in alignments if not found.is_certain]
    if unsure:
        notes.append(
            "frames that show too little to tell whether they moved, taken to lie as the next "
            f"darker one does: {', '.join(unsure)}"
        )
    return tuple(notes)
