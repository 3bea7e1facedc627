"""Still pictures: found, put in order, exposed and grouped into brackets. No pixel is looked at.

Input  : files or a folder, and exposure times if the files tell none or wrong ones.
Output : PhotoPlan, the brackets of Photograph.
Fails  : where exposures drift from bracket to bracket (aperture priority), no pattern recurs and
         all photographs are taken for one bracket; giving the exposure times settles it.
"""

import re
from collections import Counter
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from pathlib import Path

from capture.camera_files import FRAME_SUFFIXES
from capture.errors import InputError
from capture.exif import Exif, read_exif
from capture.files import check_file
from capture.frame import Exposure
from capture.pictures import PICTURE_SUFFIXES
from capture.radiance_files import HDR_SUFFIXES
from capture.raw import RAW_SUFFIXES

HINT = "give the times of one bracket in seconds: --exposures 0.001,0.01,…"

BRACKET_INTERVAL_S = 1.0
"""Time between brackets whose files tell none."""

_LISTED = 4


@dataclass(frozen=True)
class Photograph:
    """A still picture, not yet decoded. `timestamp_s` counts from the first one of its plan."""

    path: Path
    exposure: Exposure
    timestamp_s: float


@dataclass(frozen=True)
class PhotoPlan:
    """Which photographs form which bracket.

    Attributes
    ----------
    brackets : tuple of tuple of Photograph
        In order; timestamps never fall.
    camera : str
        Make and model; empty where the files do not tell.
    notes : tuple of str
        What was assumed, for people.
    """

    brackets: tuple[tuple[Photograph, ...], ...]
    camera: str = ""
    notes: tuple[str, ...] = ()


def find_photographs(sources: Sequence[Path]) -> list[Path]:
    """Return the files among `sources`, and those of a folder in the order of their names.

    Numbers in names count by value: img2 comes before img10. Hidden files are left out.

    Raises
    ------
    InputError
        If a source does not exist, a folder holds no picture, a file is named twice, or there are
        files of several kinds (RAW beside the JPEG of the same shot).
    """
    paths: list[Path] = []
    for source in sources:
        if source.is_dir():
            found = sorted(filter(_holds_a_frame, source.iterdir()), key=_natural_order)
            if not found:
                raise InputError(f"{source}: no picture, RAW or EXR file to be found")
            paths += found
        else:
            check_file(source)
            paths.append(source)
    for path, count in Counter(path.resolve() for path in paths).items():
        if count > 1:
            raise InputError(f"{path} is named {count} times; a photograph counts once")
    for kind in (PICTURE_SUFFIXES, RAW_SUFFIXES, HDR_SUFFIXES):
        others = [path for path in paths if path.suffix.lower() not in kind]
        if 0 < len(others) < len(paths):
            same = next(path for path in paths if path.suffix.lower() in kind)
            raise InputError(
                f"{same.name} and {others[0].name} are files of different kinds; name those of one"
            )
    return paths


def plan_brackets(paths: Sequence[Path], exposures_s: Sequence[float] | None = None) -> PhotoPlan:
    """Return the brackets that photographs form.

    Exposures come from EXIF, and photographs are ordered by their time; a bracket ends where the
    same set of exposures begins again, and if nothing recurs there is one bracket. With
    `exposures_s` no EXIF exposure is looked at: the times are dealt out in the order of `paths`,
    at gain 1. Radiance files are a bracket each; their exposure is 1 s by definition.

    Raises
    ------
    InputError
        If an exposure is missing or not positive, a bracket is incomplete, or the files are of
        several cameras or orientations.
    """
    if paths[0].suffix.lower() in HDR_SUFFIXES:
        if exposures_s is not None:
            raise InputError(f"{paths[0]} holds radiance, which has no exposure: no --exposures")
        return _plan(paths, [Exposure(1.0)] * len(paths), [None] * len(paths), 1, "")
    tags = [read_exif(path) for path in paths]
    check_alike("camera", paths, [tag.camera or "an unnamed one" for tag in tags])
    check_alike("orientation", paths, [tag.orientation for tag in tags])
    camera = tags[0].camera
    if exposures_s is not None:
        exposures = _given_exposures(paths, exposures_s)
        return _plan(paths, exposures, [tag.timestamp_s for tag in tags], len(exposures_s), camera)
    exposures = _exif_exposures(paths, tags)
    order = _order_of_time(paths, tags)
    paths = [paths[i] for i in order]
    exposures = [exposures[i] for i in order]
    length = bracket_length(exposures)
    return _plan(paths, exposures, [tags[i].timestamp_s for i in order], length, camera)


def bracket_length(exposures: Sequence[Hashable]) -> int:
    """Return how many frames a bracket has: the shortest run that holds the same set each time.

    A last run that is cut short is let pass if two are whole. Where nothing recurs, all are one
    bracket.
    """
    count = len(exposures)
    cut_short = None
    for length in range(1, count // 2 + 1):
        first = Counter(exposures[:length])
        whole = count - count % length
        starts = range(length, whole, length)
        if any(Counter(exposures[start : start + length]) != first for start in starts):
            continue
        if whole == count:
            return length
        if cut_short is None and Counter(exposures[whole:]) <= first:
            cut_short = length
    return cut_short or count


def check_alike(quality: str, paths: Sequence[Path], values: Sequence[Hashable]) -> None:
    """Raise InputError, listing the odd ones, unless all files have the same value."""
    ((usual, _),) = Counter(values).most_common(1)
    odd = [
        f"{path.name} ({value})"
        for path, value in zip(paths, values, strict=True)
        if value != usual
    ]
    if odd:
        listed = ", ".join(odd[:_LISTED])
        if len(odd) > _LISTED:
            listed += f" and {len(odd) - _LISTED} more"
        raise InputError(
            f"the photographs differ in {quality}: most have {usual}, but {listed}; "
            "leave out what does not belong"
        )


def _plan(
    paths: Sequence[Path],
    exposures: Sequence[Exposure],
    timestamps_s: Sequence[float | None],
    length: int,
    camera: str,
) -> PhotoPlan:
    if left_over := len(paths) % length:
        raise InputError(
            f"{len(paths)} photographs do not make up brackets of {length}: {left_over} left over, "
            f"the last {paths[-1]}; add the missing ones, leave these out, or {HINT}"
        )
    known = [time_s for time_s in timestamps_s if time_s is not None]
    notes: tuple[str, ...] = ()
    if len(known) == len(paths) and known == sorted(known):
        relative_s = [time_s - known[0] for time_s in known]
    else:
        relative_s = [i // length * BRACKET_INTERVAL_S for i in range(len(paths))]
        if len(paths) > length:
            notes = (f"no usable capture times: brackets are put {BRACKET_INTERVAL_S:g} s apart",)
    photographs = [Photograph(*values) for values in zip(paths, exposures, relative_s, strict=True)]
    starts = range(0, len(photographs), length)
    brackets = tuple(tuple(photographs[start : start + length]) for start in starts)
    return PhotoPlan(brackets, camera, notes)


def _given_exposures(paths: Sequence[Path], times_s: Sequence[float]) -> list[Exposure]:
    try:
        bracket = [Exposure(time_s) for time_s in times_s]
    except InputError as error:
        raise InputError(f"--exposures: {error}") from None
    if not bracket:
        raise InputError("--exposures: at least one exposure time is wanted")
    return [bracket[i % len(bracket)] for i in range(len(paths))]


def _exif_exposures(paths: Sequence[Path], tags: Sequence[Exif]) -> list[Exposure]:
    for path, tag in zip(paths, tags, strict=True):
        if tag.time_s is None:
            raise InputError(f"{path}: its EXIF tells no exposure time; {HINT}")
    # A camera either tells these or does not; a file without them among others was edited.
    for name, values in (
        ("ISO speed", [tag.gain for tag in tags]),
        ("f-number", [tag.f_number for tag in tags]),
    ):
        silent = [path for path, value in zip(paths, values, strict=True) if value is None]
        if 0 < len(silent) < len(paths):
            raise InputError(
                f"{silent[0]}: its EXIF tells no {name}, though other photographs' does; {HINT}"
            )
    exposures = []
    for path, tag in zip(paths, tags, strict=True):
        try:
            exposures.append(Exposure(tag.time_s or 0.0, tag.gain or 1.0, tag.f_number))
        except InputError as error:
            raise InputError(f"{path}: its EXIF cannot be right: {error}; {HINT}") from None
    return exposures


def _order_of_time(paths: Sequence[Path], tags: Sequence[Exif]) -> list[int]:
    """Return the positions in order of time, then name; in order of name where no time is told."""
    known_s = [tag.timestamp_s for tag in tags if tag.timestamp_s is not None]
    times_s = known_s if len(known_s) == len(paths) else [0.0] * len(paths)
    return sorted(range(len(paths)), key=lambda i: (times_s[i], _natural_order(paths[i])))


def _holds_a_frame(path: Path) -> bool:
    return path.suffix.lower() in FRAME_SUFFIXES and not path.name.startswith(".")


def _natural_order(path: Path) -> list[tuple[int, str]]:
    parts = re.findall(r"[0-9]+|[^0-9]+", path.name.casefold())
    return [(int(part), "") if part.isdecimal() else (2**63, part) for part in parts]
