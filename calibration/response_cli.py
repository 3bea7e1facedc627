"""`fishlight calibrate response`: the camera's tone curve, from a recording's own brackets."""

import sys
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from capture.arguments import WholeNumber
from capture.errors import InputError, UnreadableFrame
from capture.frame import Bracket
from capture.output import check_place
from capture.recording import Recording, open_recording

_MOST_BRACKETS = 4


def calibrate_response(
    recording: Path,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    apply: bool = False,
    method: str = "monotone",
    exposure_tolerance_ev: float = 0.0,
    brackets: WholeNumber = _MOST_BRACKETS,
    force: bool = False,
) -> None:
    """Estimate the response of the camera that made a recording, from the recording's brackets.

    The error is by how much the same patch differs between neighbouring exposures, in the median
    of patches that the fit did not see. Without --output or --apply it is only printed.

    Parameters
    ----------
    recording
        Brackets of JPEG or other 8-bit frames, of a still scene.
    output
        A JSON file for the response and its standard deviation.
    apply
        Put the response into the recording, so that merging uses it.
    method
        monotone, debevec, robertson or mitsunaga.
    exposure_tolerance_ev
        Standard deviation of the exposures' labels in stops, such as 0.05 for rounded times; 0
        believes them.
    brackets
        How many brackets to use, spread evenly over the recording.
    force
        Replace the output if it exists.
    """
    # Here, so that no other command waits for scipy.
    from calibration.response import estimate_response
    from calibration.response_files import apply_response, write_response

    if output is not None:
        check_place(output, force=force)
    opened = open_recording(recording)
    used = _readable(opened, brackets)
    try:
        response = estimate_response(used, method, exposure_tolerance_ev)
    except InputError as error:
        raise InputError(f"{recording}: {error}") from None
    corrections = response.curve.correction_ev
    if np.any(corrections):
        listed = ", ".join(f"{each:+.3f}" for each in corrections)
        print(f"exposures corrected by {listed} EV, from the darkest on")
    print(
        f"{recording}: {response.method} response from {response.patch_count} patches of "
        f"{len(used)} brackets; neighbouring exposures differ by {response.held_out_ev:.3f} EV on "
        f"patches it did not see, by {response.assumed_ev:.3f} EV with the assumed sRGB"
    )
    if output is not None:
        write_response(output, response, opened.sensor, opened.manifest.source, force=force)
        print(f"{output}: response and standard deviation of 256 counts")
    if apply:
        apply_response(recording, response, opened.sensor)
        print(f"{recording}: merges with this response from now on")


def _readable(recording: Recording, most: int) -> list[Bracket]:
    """Return up to `most` brackets, spread evenly; those that cannot be read are told and left."""
    if most < 1:
        raise InputError(f"--brackets must be 1 or more, got {most}")
    positions = np.linspace(0, len(recording) - 1, min(most, len(recording))).astype(int)
    brackets = []
    failure = ""
    for position in positions:
        try:
            brackets.append(recording.read_bracket(int(position)))
        except UnreadableFrame as error:
            failure = str(error)
            print(f"note: left out: {error}", file=sys.stderr)
    if not brackets:
        raise InputError(failure)
    return brackets
