"""`fishlight simulate`: from environment maps to the recording of a camera that stood in them."""

import sys
from pathlib import Path

import numpy as np

from capture.arguments import Output, WholeNumber, parse_exposures
from capture.errors import InputError
from capture.recording_writer import replaces_recording
from lighting.maps.environment_files import read_environment
from lighting.simulation.scenario import scenario
from lighting.simulation.simulate import FrameFormat, simulate_recording

_BRACKETS = 24


def simulate(
    *maps: Path,
    output: Output,
    calibration: Path,
    exposures: str | None = None,
    brackets: WholeNumber | None = None,
    rate_hz: float = 2.0,
    yaw_deg_per_s: float = 0.0,
    lamp: bool = False,
    cloud: bool = False,
    seed: WholeNumber = 0,
    format: FrameFormat = "jpeg",
    force: bool = False,
) -> None:
    """Record what a camera would see in an HDR environment, with the truth beside it.

    Parameters
    ----------
    maps
        Lat-long maps, EXR or Radiance .hdr: one, or one for each bracket.
    output
        The recording, a folder; its folder truth/ holds maps, lights' directions and response.
    calibration
        The camera's cal.json.
    exposures
        Exposure times of a bracket in seconds, such as 0.001,0.01 or 1/1000,1/100. Left out, they
        are chosen so that nothing clips in the shortest and the longest shows the shade.
    brackets
        Number of brackets: 24 for one map, else as many as there are maps.
    rate_hz
        Brackets per second.
    yaw_deg_per_s
        Rate at which the world turns about its +Y axis, from +Z toward +X.
    lamp
        A lamp moves across the sky, from +X to −X.
    cloud
        A cloud crosses the sun in the middle of the recording.
    seed
        Of the noise.
    format
        jpeg or png: 8 bits, sRGB-coded; png16: 16 bits, linear.
    force
        Replace the recording if it exists.
    """
    if not maps:
        raise InputError("nothing to stand in: name an environment map, .exr or .hdr")
    if seed < 0:
        raise InputError(f"--seed must not be negative, got {seed}")
    replaces_recording(output, force=force)  # refused before the work, not after
    environments = []
    for path in maps:
        environment, cleaned = read_environment(path)
        environments.append(environment)
        for remark in cleaned.remarks:
            print(f"note: {path}: {remark}", file=sys.stderr)
    default_count = _BRACKETS if len(maps) == 1 else len(maps)
    moments = scenario(
        environments,
        bracket_count=default_count if brackets is None else brackets,
        rate_hz=rate_hz,
        yaw_rad_per_s=float(np.radians(yaw_deg_per_s)),
        lamp=lamp,
        cloud=cloud,
    )
    times_s = simulate_recording(
        output,
        moments,
        calibration,
        exposures_s=None if exposures is None else parse_exposures(exposures),
        frame_format=format,
        seed=seed,
        source=f"simulated from {', '.join(path.name for path in maps)}",
        force=force,
    )
    times = ", ".join(f"{time_s:.3g}" for time_s in times_s)
    print(f"{output}: brackets {len(moments)}, exposures {times} s, truth in {output / 'truth'}")
