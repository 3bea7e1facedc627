"""One recording on its way through a batch: which run is next, and what its lights follow.

Runs are prepared in any order, several at a time; their lights follow one another. A run whose
record and files are all there is passed over, so a batch that was cut off goes on where it was.

A run is looked for under the digest of all before it. So one that has to be done again, for a file
that is gone or a frame that failed, is done alone, and the look goes on once it is known what it
came to: nearly always the same as before.
"""

from collections.abc import Callable
from pathlib import Path

import msgspec

from capture.errors import InputError
from capture.files import read_bytes
from capture.output import PARTIAL_PREFIX
from render.batch.attempts import forget_attempts
from render.batch.frames import ATTEMPTS, RUNS, SUFFIXES, RunRecord, memory_path, record_path
from render.batch.runs import RUN_LENGTH, Brackets, Job, Run, run_at


class RecordingSequence:
    """Runs of one recording; makes the folders of its results.

    Parameters
    ----------
    job : Job
    brackets : tuple of tuple of FrameRecord
        All of the recording.
    on_kept : callable
        Told of the record of each run that is passed over.
    run_length : int
        Frames of a run.

    Attributes
    ----------
    job : Job
    link : str
        Digest that the lights of the next run follow.
    before : Path or None
        Where the run before it left its memory.
    in_flight : int
        Runs that were handed out and are not concluded.
    """

    def __init__(
        self,
        job: Job,
        brackets: Brackets,
        on_kept: Callable[[RunRecord], None],
        run_length: int = RUN_LENGTH,
    ) -> None:
        self.job = job
        self.link = job.first_link
        self.before: Path | None = None
        self.in_flight = 0
        self._brackets = brackets
        self._run_length = run_length
        self._on_kept = on_kept
        self._position = 0
        self._waits = False
        (job.folder / RUNS).mkdir(parents=True, exist_ok=True)
        forget_attempts(job.folder / ATTEMPTS)
        self._present: set[str] = set()
        for kind in (*SUFFIXES, RUNS):
            for path in (job.folder / kind).glob("*"):
                if path.name.startswith(PARTIAL_PREFIX):  # left by a kill
                    path.unlink(missing_ok=True)
                else:
                    self._present.add(f"{job.folder.name}/{kind}/{path.name}")

    @property
    def is_finished(self) -> bool:
        """Whether every run is concluded."""
        return self._position >= len(self._brackets) and not self.in_flight

    def pass_over(self) -> bool:
        """Pass over runs that are complete; return whether the next one is there in part.

        Only while no run is in flight: then it is known what the next one follows.
        """
        while not self.in_flight and self._position < len(self._brackets):
            run = run_at(self.job, self._brackets, self._position, self._run_length)
            record = self._read_record(run)
            if record is None or not self._is_complete(run, record):
                return record is not None
            self._position += len(run)
            self._follow(run, record)
            self._on_kept(record)
        return False

    def next_run(self) -> Run | None:
        """Return the next run to prepare; None if there is none, or none yet."""
        if self._waits:
            return None
        self._waits = self.pass_over()
        if self._position >= len(self._brackets):
            return None
        if not self._waits:
            self._present.clear()  # nothing of what comes is there: a long list is not kept
        run = run_at(self.job, self._brackets, self._position, self._run_length)
        self._position += len(run)
        self.in_flight += 1
        return run

    def conclude(self, run: Run, record: RunRecord) -> None:
        """Go on from the record of the earliest run that is in flight."""
        self._follow(run, record)
        self.in_flight -= 1
        self._waits = False

    def _follow(self, run: Run, record: RunRecord) -> None:
        self.before = memory_path(record_path(self.job, run, self.link))
        self.link = record.link

    def _read_record(self, run: Run) -> RunRecord | None:
        path = record_path(self.job, run, self.link)
        if not path.exists():
            return None
        try:
            return msgspec.json.decode(read_bytes(path), type=RunRecord)
        except (msgspec.MsgspecError, InputError):
            return None  # as good as missing: it is made anew

    def _is_complete(self, run: Run, record: RunRecord) -> bool:
        files = {
            name
            for row in record.rows
            for name in (row.radiance_file, row.map_file, row.lights_file, row.preview_file)
            if name is not None
        }
        remembers = memory_path(record_path(self.job, run, self.link)).exists()
        return record.is_whole and remembers and files <= self._present
