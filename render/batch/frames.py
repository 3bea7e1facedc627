"""The work on a run of frames, in the order of its three steps.

`prepare_run` reads, merges and remaps, for each run by itself; `light_run` finds lights, one run
after the other, from what the last one left; `preview_run` draws both. All that a step leaves is
written before it ends, under names of runs.py.

Input  : a Job and a Run, picklable, as are the results.
Output : files in the job's folder; a RunRecord for those who follow.
Cost   : as a replay; beside it a preview, about 30 ms. A step holds one picture at a time, and of
         each frame of the run its sums over blocks (2.4 MB) and its preview (1.6 MB).
Fails  : a frame that cannot be read, or merged, is marked and left out, as in a replay; so is one
         that ended three processes (attempts.py). What cannot be written ends the step.
"""

import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from capture.errors import FishlightError, UnreadableFrame
from capture.manifest import FrameRecord
from capture.merge import merge_bracket
from capture.output import write_json
from capture.picture_memory import PictureMemory
from capture.pictures import write_png
from capture.radiance import RadianceImage
from capture.radiance_files import write_radiance
from capture.recording import Recording
from lighting.blocks.block_sums import BlockSums
from lighting.blocks.source_blocks import apply_source_blocks
from lighting.light_files import write_lights
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import write_environment
from lighting.maps.remap import apply_remap
from lighting.measures.sequence_table import FrameRow, light_columns
from lighting.stream.light_stream import next_lights
from render.batch.attempts import MOST_ATTEMPTS, attempt
from render.batch.light_memory import read_memory, write_memory
from render.batch.operators import Operators, kernels, operators_of
from render.batch.runs import Job, Run, next_link
from render.output.preview import marked, with_lights
from render.output.view import auto_exposure_ev

RADIANCE, MAPS, LIGHTS, PREVIEWS = "radiance", "maps", "lights", "previews"
SUFFIXES = {RADIANCE: ".exr", MAPS: ".exr", LIGHTS: ".json", PREVIEWS: ".png"}
"""Of the files in each folder of results."""
RUNS, ATTEMPTS = "runs", "attempts"

_PREVIEW_SIZE_PX = (1024, 512)


@dataclass(frozen=True, eq=False)
class PreparedFrame:
    """A frame before its lights are found.

    Attributes
    ----------
    row : FrameRow
        As far as it is known; with a failure if the frame is not usable.
    image_digest : str
    view : BlockSums, EnvironmentMap or None
        That the lights are found in, if there are to be any.
    shown : (H, W, 3) uint8 or None
        The map as a picture, if there is to be a preview.
    """

    row: FrameRow
    image_digest: str
    view: BlockSums | EnvironmentMap | None = None
    shown: NDArray[np.uint8] | None = None


class RunRecord(msgspec.Struct, frozen=True):
    """What became of a run: `link` is what lights of the next one follow."""

    link: str
    rows: tuple[FrameRow, ...]

    @property
    def is_whole(self) -> bool:
        """Whether no frame failed."""
        return all(row.failure is None for row in self.rows)


@dataclass(frozen=True, eq=False)
class LitRun:
    """What `light_run` leaves: the record, and lights by position if a preview needs them."""

    record: RunRecord
    lights: dict[int, LightSet]


def record_path(job: Job, run: Run, link: str) -> Path:
    """Return where a run's record is, if its lights follow those that `link` stands for."""
    return job.folder / RUNS / f"{run.start:06d}-{run.digest(job, link)}.json"


def memory_path(record: Path) -> Path:
    """Return where the memory is that belongs to a record."""
    return record.with_suffix(".memory")


def prepare_run(job: Job, run: Run) -> list[PreparedFrame]:
    """Return each frame of a run, read, merged and remapped; write its radiance and its map.

    Raises
    ------
    InputError
        If the calibration changed meanwhile, or a file cannot be written.
    """
    recording = job.with_brackets(run.brackets)
    memory = PictureMemory()
    return [
        _prepare_frame(job, recording, position, digest, memory)
        for position, digest in enumerate(run.image_digests, start=1)
    ]


def light_run(
    job: Job, run: Run, prepared: Sequence[PreparedFrame], link: str, before: Path | None
) -> LitRun:
    """Return the record of a run, and write it with its lights and what they leave to the next.

    Parameters
    ----------
    job, run : Job, Run
    prepared : sequence of PreparedFrame
        From `prepare_run`.
    link : str
        Digest that the run's lights follow.
    before : Path or None
        Where the run before left its memory; None for the first run.
    """
    path = record_path(job, run, link)
    memory = None if before is None else read_memory(before)
    rows, found = [], {}
    for position, frame in enumerate(prepared):
        row = frame.row
        if row.failure is None:
            link = next_link(link, frame.image_digest)
        if frame.view is not None:
            with kernels:
                lights, memory = next_lights(
                    frame.view,
                    job.settings.plan,
                    memory,
                    timestamp_s=row.time_s,
                    source=f"{job.recording.folder.name}, bracket {row.bracket}",
                )
            files = {}
            if "lights" in job.settings.stages:
                write = partial(write_lights, lights=lights, force=True)
                files["lights_file"] = _save(job, LIGHTS, row.bracket, link, write)
            if frame.shown is not None:
                found[position] = lights
                digest = next_link(job.map_digest(frame.image_digest), link)
                files["preview_file"] = _name(job, PREVIEWS, row.bracket, digest)
            row = msgspec.structs.replace(row, **light_columns(lights), **files)
        rows.append(row)
    record = RunRecord(link, tuple(rows))
    write_memory(memory_path(path), memory)
    write_json(path, record)
    return LitRun(record, found)


def preview_run(job: Job, prepared: Sequence[PreparedFrame], lit: LitRun) -> None:
    """Write the preview of each frame that has lights: its map, and a ring at each light."""
    for position, lights in lit.lights.items():
        name, shown = lit.record.rows[position].preview_file, prepared[position].shown
        if name is None or shown is None:
            raise ValueError("lights are only kept for frames that are to have a preview")
        _write_missing(job, name, partial(_write_preview, shown=shown, lights=lights))


def error_line(error: BaseException) -> str:
    """Return what went wrong in a line; of a defect of fishlight also where."""
    if isinstance(error, FishlightError):
        return str(error)
    frames = traceback.extract_tb(error.__traceback__)
    place = f" in {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    return f"{type(error).__name__}{place}: {error}"


def _prepare_frame(
    job: Job, recording: Recording, position: int, image_digest: str, memory: PictureMemory
) -> PreparedFrame:
    records = recording.brackets[position]
    operators = operators_of(job)
    row = _row(job, records)
    try:
        with attempt(job.folder / ATTEMPTS, image_digest):
            image, environment, view = _see(job, recording, position, operators, memory)
            files = {}
            if "merge" in job.settings.stages:
                comments = f"sensor: {recording.sensor.source}"
                write = partial(write_radiance, image=image, comments=comments)
                files["radiance_file"] = _save(job, RADIANCE, row.bracket, image_digest, write)
            if environment is not None and "remap" in job.settings.stages:
                write = partial(write_environment, environment=environment)
                digest = job.map_digest(image_digest)
                files["map_file"] = _save(job, MAPS, row.bracket, digest, write)
            row = msgspec.structs.replace(
                row, clipped_share=float(image.clipped.mean()), scale=image.scale, **files
            )
            shown = _shown(environment) if "preview" in job.settings.stages else None
    except UnreadableFrame as error:
        return PreparedFrame(msgspec.structs.replace(row, failure=str(error)), image_digest)
    return PreparedFrame(row, image_digest, view, shown)


def _see(
    job: Job, recording: Recording, position: int, operators: Operators, memory: PictureMemory
) -> tuple[RadianceImage, EnvironmentMap | None, BlockSums | EnvironmentMap | None]:
    """Return a frame's radiance, map and what its lights are found in.

    Raises
    ------
    UnreadableFrame
        If three attempts failed, whatever it was: a batch goes on.
    """
    attempts_left = MOST_ATTEMPTS
    while True:
        try:
            bracket = recording.read_bracket(position)
            with kernels:
                image = merge_bracket(bracket, recording.sensor, memory)
                environment = (
                    None if operators.remap is None else apply_remap(operators.remap, image)
                )
                if operators.source_blocks is not None:
                    return image, environment, apply_source_blocks(operators.source_blocks, image)
            return image, environment, environment if job.settings.needs_lights else None
        except Exception as error:
            attempts_left -= 1
            if not attempts_left:
                raise UnreadableFrame(error_line(error)) from error


def _row(job: Job, records: Sequence[FrameRecord]) -> FrameRow:
    times_s = [record.time_s for record in records]
    return FrameRow(
        recording=job.folder.name,
        bracket=records[0].bracket,
        time_s=min(record.timestamp_s for record in records),
        exposure_count=len(records),
        shortest_s=min(times_s),
        longest_s=max(times_s),
    )


def _shown(environment: EnvironmentMap | None) -> NDArray[np.uint8] | None:
    """Return a map at an exposure of its own, so that noon and night can be seen."""
    if environment is None:
        return None
    covered = environment.valid[..., None].astype(np.float32)
    exposure_ev = auto_exposure_ev(np.concatenate([environment.radiance, covered], axis=-1))
    return marked(environment, exposure_ev, _PREVIEW_SIZE_PX)


def _write_preview(path: Path, shown: NDArray[np.uint8], lights: LightSet) -> None:
    write_png(path, with_lights(shown, lights))


def _name(job: Job, kind: str, bracket: int, digest: str) -> str:
    return f"{job.folder.name}/{kind}/{bracket:06d}-{digest}{SUFFIXES[kind]}"


def _save(job: Job, kind: str, bracket: int, digest: str, write: Callable[[Path], object]) -> str:
    """Write a result, unless it is there already; return its name in the output."""
    name = _name(job, kind, bracket, digest)
    _write_missing(job, name, write)
    return name


def _write_missing(job: Job, name: str, write: Callable[[Path], object]) -> None:
    path = job.folder.parent / name
    if not path.exists():
        path.parent.mkdir(exist_ok=True)
        write(path)
