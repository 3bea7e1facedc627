"""Small recordings for batches, and what a sequential replay makes of them."""

from pathlib import Path

import numpy as np

from calibration.camera import UP, Calibration
from calibration.files import read_calibration, write_calibration
from calibration.models.equidistant import Equidistant
from capture.errors import UnreadableFrame
from capture.merge import merge_bracket
from capture.recording import open_recording
from lighting.blocks.source_blocks import apply_source_blocks, build_source_blocks
from lighting.light_files import write_lights
from lighting.maps.environment_files import write_environment
from lighting.maps.remap import apply_remap, build_remap
from lighting.reduce import BLOCK_METHODS
from lighting.simulation.scenario import scenario
from lighting.simulation.simulate import simulate_recording
from lighting.stream.light_stream import next_lights
from render.batch.runs import Settings
from tests.environments import outdoors

SIZE = 40
EXPOSURES_S = (1 / 1000, 1 / 30)


def record(folder: Path, brackets: int) -> Path:
    """Return a recording of a sky that turns, so fast that lights and cells come and go."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    calibration = folder.parent / "calibration.json"
    model = Equidistant(((SIZE - 1) / 2,) * 2, SIZE / np.pi)
    write_calibration(calibration, Calibration(model, (SIZE,) * 2, np.pi / 2, UP))
    moments = scenario([outdoors(32)], bracket_count=brackets, rate_hz=10, yaw_rad_per_s=2.0)
    simulate_recording(
        folder,
        moments,
        calibration,
        exposures_s=EXPOSURES_S,
        frame_format="png",
        source="simulated for a test",
    )
    return folder


def replayed(folder: Path, settings: Settings, output: Path) -> dict[str, list[bytes]]:
    """Return the bytes of every map and lights file, one frame after the other."""
    recording = open_recording(folder)
    assert recording.calibration_path is not None
    calibration = read_calibration(recording.calibration_path)
    remap = build_remap(calibration, settings.map_height)
    blocks = build_source_blocks(calibration, settings.plan.block_rows)
    memory, files = None, {"maps": [], "lights": []}
    output.mkdir()
    for bracket in recording:
        if isinstance(bracket, UnreadableFrame):
            continue
        image = merge_bracket(bracket, recording.sensor)
        environment = apply_remap(remap, image)
        by_blocks = settings.plan.method in BLOCK_METHODS
        lights, memory = next_lights(
            apply_source_blocks(blocks, image) if by_blocks else environment,
            settings.plan,
            memory,
            timestamp_s=bracket.timestamp_s,
            source=f"{folder.name}, bracket {bracket.index}",
        )
        write_environment(output / "map.exr", environment)
        write_lights(output / "lights.json", lights, force=True)
        files["maps"].append((output / "map.exr").read_bytes())
        files["lights"].append((output / "lights.json").read_bytes())
    return files


def results(output: Path, recording: Path) -> dict[str, list[bytes]]:
    """Return the bytes of every map and lights file of a batch, in the order of frames."""
    [folder] = output.glob(f"{recording.name}-*")
    return {
        kind: [path.read_bytes() for path in sorted((folder / kind).glob("[!.]*"))]
        for kind in ("maps", "lights")
    }


def damage(recording: Path, bracket: int) -> None:
    """Change a byte of a frame's file."""
    frame = open_recording(recording).brackets[bracket][0]
    path = recording / frame.file
    content = bytearray(path.read_bytes())
    content[-30] ^= 1
    path.write_bytes(content)
