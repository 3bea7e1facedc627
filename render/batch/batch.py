"""Many recordings to radiance, maps, lights and previews, on this machine or on a cluster.

Input  : folders of recordings.
Output : a folder with index.sqlite, a row for each frame, report.json about the last batch, and for
each recording a folder with radiance/, maps/, lights/ and previews/. Maps and lights are, byte for
byte, those of a replay.
Results that are there already stay as they are (runs.py); a batch that was stopped by anything is
started again, and goes on. At most a run of frames for each worker is done twice.
Cost   : see tests/benchmarks/batch.py.
Fails  : the workers of a cluster see recordings and output under the same paths as this process; a
disk that is not shared is not noticed before the first result is missed. Two batches at a time into
the same folder do the same work twice.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from pathlib import Path

from capture.errors import FishlightError, InputError
from capture.output import check_place, write_json
from capture.recording import open_recording
from lighting.measures.sequence_table import SequenceTable
from render.batch.cluster import connected
from render.batch.frames import RunRecord, error_line
from render.batch.runs import RUN_LENGTH, Settings, open_job
from render.batch.sequence import RecordingSequence
from render.batch.tracking import FrameSequence, Tracker

INDEX_NAME = "index.sqlite"
REPORT_NAME = "report.json"

_TOLD = 50
"""Failures that a summary names; the index has those of all frames."""


@dataclass
class BatchSummary:
    """What a batch did.

    Attributes
    ----------
    made, kept : int
        Frames whose results were made, and were there already.
    failed_frames : int
        Frames that could not be read, or were given up.
    stopped_recordings : int
        Recordings that could not be begun, or not be worked on to their end.
    reasons : list of str
        A line for each of the first failures.
    """

    made: int = 0
    kept: int = 0
    failed_frames: int = 0
    stopped_recordings: int = 0
    reasons: list[str] = field(default_factory=list)

    @property
    def has_failures(self) -> bool:
        """Whether anything failed."""
        return bool(self.failed_frames or self.stopped_recordings)

    def count(self, record: RunRecord, *, is_kept: bool) -> None:
        """Count the frames of a run."""
        failed = [row for row in record.rows if row.failure is not None]
        usable_count = len(record.rows) - len(failed)
        self.kept += usable_count * is_kept
        self.made += usable_count * (not is_kept)
        self.failed_frames += len(failed)
        for row in failed:
            self._tell(f"{row.recording}, bracket {row.bracket}: {row.failure}")

    def stop(self, reason: str) -> None:
        """Count a recording that cannot be worked on."""
        self.stopped_recordings += 1
        self._tell(reason)

    def _tell(self, reason: str) -> None:
        if len(self.reasons) < _TOLD:
            self.reasons.append(reason)


def run_batch(
    recordings: Sequence[Path],
    output: Path,
    settings: Settings,
    *,
    calibration_path: Path | None = None,
    scheduler: str | None = None,
    worker_count: int | None = None,
    run_length: int = RUN_LENGTH,
    on_frames: Callable[[int, bool], None] = lambda _count, _is_kept: None,
    say: Callable[[str], None] = lambda _text: None,
) -> BatchSummary:
    """Take every frame of all recordings to the results that `settings` ask for.

    Parameters
    ----------
    recordings : sequence of Path
    output : Path
        Folder for the results; made if it does not exist.
    settings : Settings
    calibration_path : Path or None
        Calibration to use instead of the recordings' own.
    scheduler : str or None
        Address of a dask scheduler; a cluster on this machine if not given.
    worker_count : int or None
        Processes of that; as many as there are cores if not given.
    run_length : int
        Frames that a worker is given at a time.
    on_frames : callable
        Told how many frames are done, and whether their results were there already.
    say : callable
        Told when a scheduler that was named has no workers: they are waited for.

    Raises
    ------
    InputError
        If the output cannot be used, the index not be written, or no scheduler answers.
    """
    make_output(output)
    summary = BatchSummary()
    with SequenceTable(output / INDEX_NAME) as table:

        def conclude(record: RunRecord, *, is_kept: bool = False) -> None:
            table.put(record.rows)
            summary.count(record, is_kept=is_kept)
            on_frames(len(record.rows), is_kept)

        def sequences() -> Iterator[FrameSequence]:
            """Open one recording after the other; a manifest is held while it is worked on."""
            names: set[Path] = set()
            for path in recordings:
                try:
                    job, brackets = open_job(path, output, settings, calibration_path)
                    if job.folder in names:
                        raise InputError(f"{path}: the same recording as another that was named")
                except InputError as error:
                    summary.stop(str(error))
                    continue
                names.add(job.folder)
                sequence = RecordingSequence(
                    job, brackets, partial(conclude, is_kept=True), run_length
                )
                sequence.pass_over()
                if not sequence.is_finished:
                    yield sequence

        def stop(sequence: FrameSequence, error: BaseException) -> None:
            summary.stop(f"{sequence.job.recording.folder}: {error_line(error)}")

        def miss_workers() -> None:
            if scheduler is not None:  # this machine's own are begun again by themselves
                say(
                    f"{scheduler} has no workers; waiting for one. Start it where fishlight is "
                    f"installed: dask worker {scheduler}"
                )

        unfinished = sequences()
        first = next(unfinished, None)
        if first is not None:
            with connected(scheduler, worker_count) as client:
                try:
                    tracker = Tracker(client, conclude, stop, miss_workers)
                    tracker.run_all(chain([first], unfinished))
                except (
                    FishlightError
                ) as error:  # the scheduler is lost, or the index's disk is full
                    summary.stop(str(error))
    try:
        write_json(output / REPORT_NAME, {"schema": "fishlight-batch-report/1", **vars(summary)})
    except InputError as error:
        summary.stop(str(error))
    return summary


def make_output(output: Path) -> None:
    """Make the folder for the results; InputError if nothing can be written there."""
    if output.exists() and not output.is_dir():
        raise InputError(f"{output} is a file; the results need a folder")
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{output}: cannot be made ({error.strerror})") from None
    check_place(output / INDEX_NAME, force=True)


def frame_count(recordings: Sequence[Path]) -> int:
    """Return how many frames there are in all recordings that can be opened."""
    total = 0
    for path in recordings:
        with suppress(InputError):
            total += len(open_recording(path))
    return total
