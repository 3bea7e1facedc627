"""What is to be done with a recording: runs of its frames, and what their results are called.

A name holds the digest of all that a result depends on: frames, calibration, settings, fishlight's
version; for lights, which remember, also of every frame before. So a result that is there is the
right one, and what a change touches has another name.

Input  : a recording's folder, Settings.    Output : a Job, cut into Runs.
Fails  : while fishlight is being worked on, its version stays and its numbers change: use a fresh
         output folder.
"""

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from importlib.metadata import version
from pathlib import Path

import msgspec

from calibration.files import read_calibration
from capture.errors import InputError
from capture.files import read_bytes
from capture.manifest import FrameRecord
from capture.recording import Recording, open_recording
from lighting.reduce import BLOCK_METHODS
from lighting.stream.light_stream import LightPlan

STAGES = ("merge", "remap", "lights", "preview")
RUN_LENGTH = 16
"""Frames of a run: about a second of work, so that a lost worker costs little, and dealing runs out
costs little beside them."""

_DIGITS = 16
_FORMAT = "fishlight-batch/1"

Brackets = tuple[tuple[FrameRecord, ...], ...]


@dataclass(frozen=True)
class Settings:
    """What is to become of every frame.

    Attributes
    ----------
    stages : tuple of str
        Whose results are written, some of `STAGES`.
    plan : LightPlan
        Without a time budget: the lights would depend on the machine.
    map_height : int
    """

    stages: tuple[str, ...] = STAGES
    plan: LightPlan = field(default_factory=LightPlan)
    map_height: int = 512

    def __post_init__(self) -> None:
        unknown = [name for name in self.stages if name not in STAGES]
        if unknown or not self.stages:
            raise InputError(
                f"stages are some of {', '.join(STAGES)}, got {','.join(self.stages)!r}"
            )
        if self.plan.budget_ms is not None:
            raise InputError(
                "a batch has no time budget: its lights must not depend on the machine"
            )

    @property
    def needs_calibration(self) -> bool:
        """Whether anything is to be known of where pixels look."""
        return self.needs_map or self.needs_lights

    @property
    def needs_map(self) -> bool:
        """Whether there is to be a map of each frame."""
        by_map = self.needs_lights and self.plan.method not in BLOCK_METHODS
        return by_map or "remap" in self.stages or "preview" in self.stages

    @property
    def needs_lights(self) -> bool:
        """Whether there are to be lights of each frame."""
        return "lights" in self.stages or "preview" in self.stages


@dataclass(frozen=True)
class Job:
    """What all runs of a recording share; small, since it travels with each.

    Attributes
    ----------
    recording : Recording
        With its first bracket only, whose size all have.
    calibration_path : Path or None
        None if nothing needs one.
    calibration_digest : str
    folder : Path
        Of the results, absolute.
    settings : Settings
    """

    recording: Recording
    calibration_path: Path | None
    calibration_digest: str
    folder: Path
    settings: Settings

    def with_brackets(self, brackets: Brackets) -> Recording:
        """Return the recording of the first bracket, then of these."""
        return replace(self.recording, brackets=(*self.recording.brackets, *brackets))

    @cached_property
    def first_link(self) -> str:
        """Digest that the lights of the first frame follow."""
        plan = asdict(self.settings.plan)
        height = 0 if self.settings.plan.method in BLOCK_METHODS else self.settings.map_height
        return _digest(
            version("fishlight"), self.recording.folder.name, self.calibration_digest, plan, height
        )

    def image_digest(self, bracket: Sequence[FrameRecord]) -> str:
        """Digest of what a frame's radiance depends on."""
        return _digest(self._sensor_digest, list(bracket))

    def map_digest(self, image_digest: str) -> str:
        """Digest of what a frame's map depends on."""
        return _digest(image_digest, self.calibration_digest, self.settings.map_height)

    @cached_property
    def _sensor_digest(self) -> str:
        return _digest(_FORMAT, version("fishlight"), self.recording.manifest.sensor)


@dataclass(frozen=True)
class Run:
    """Frames one after the other.

    Attributes
    ----------
    start : int
        Position of the first in the recording.
    brackets : tuple of tuple of FrameRecord
    image_digests : tuple of str
    """

    start: int
    brackets: Brackets
    image_digests: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.brackets)

    def digest(self, job: Job, link: str) -> str:
        """Digest of the run's results, if its lights follow those that `link` stands for."""
        settings = (sorted(job.settings.stages), job.settings.map_height)
        return _digest(link, self.image_digests, settings)


def next_link(link: str, image_digest: str) -> str:
    """Return the digest of a frame's lights, which follow those that `link` stands for."""
    return _digest(link, image_digest)


def open_job(
    recording_folder: Path, output: Path, settings: Settings, calibration_path: Path | None = None
) -> tuple[Job, Brackets]:
    """Return what is to be done with a recording, and its brackets.

    Raises
    ------
    InputError
        If the recording or its calibration cannot be used.
    """
    recording = open_recording(recording_folder.resolve())
    path, digest = None, ""
    if settings.needs_calibration:
        path = calibration_path or recording.calibration_path
        if path is None:
            raise InputError(
                f"{recording_folder} names no calibration; give one with --calibration cal.json"
            )
        path = path.resolve()
        digest = hashlib.sha256(read_bytes(path)).hexdigest()
        read_calibration(path).check_size(recording.size_px, str(recording_folder))
    common = replace(
        recording,
        manifest=msgspec.structs.replace(recording.manifest, frames=()),
        brackets=recording.brackets[:1],
    )
    identity = _digest(recording.folder.name, recording.brackets[0])[:8]
    folder = output.resolve() / f"{recording.folder.name}-{identity}"
    return Job(common, path, digest, folder, settings), recording.brackets


def run_at(job: Job, brackets: Brackets, start: int, length: int = RUN_LENGTH) -> Run:
    """Return the run of at most `length` frames that begins at position `start`."""
    run = brackets[start : start + length]
    return Run(start, run, tuple(job.image_digest(bracket) for bracket in run))


def _digest(*parts: object) -> str:
    content: Iterable[object] = parts
    return hashlib.sha256(msgspec.json.encode(content)).hexdigest()[:_DIGITS]
