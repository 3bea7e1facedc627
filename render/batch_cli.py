"""`fishlight batch`: many recordings to radiance, maps, lights and previews."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Protocol

from cyclopts import Parameter
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)
from rich.progress import Task as ProgressTask
from rich.text import Text

from capture.arguments import Output, WholeNumber
from capture.errors import InputError
from lighting.light_arguments import Count, Error, MethodName, most_lights
from lighting.reduce import ADAPTIVE
from lighting.remap_cli import check_map_height
from lighting.stream.light_stream import LightPlan
from render.batch.runs import STAGES, Settings


def batch(
    *recordings: Path,
    output: Output,
    stages: str = ",".join(STAGES),
    scheduler: str | None = None,
    count: Count = 64,
    error: Error = None,
    method: MethodName = ADAPTIVE,
    steady: Annotated[bool, Parameter(negative="--no-steady")] = True,
    height: WholeNumber = 512,
    calibration: Path | None = None,
) -> None:
    """Turn any number of recordings into radiance, maps, lights and previews.

    What is there already stays as it is: a batch that was stopped, by whatever, goes on where it
    was, and one with more recordings does only these. Maps and lights are what `fishlight replay`
    makes, to the byte. Exits with 1 if anything failed.

    Parameters
    ----------
    recordings
        Folders with a manifest.json.
    output
        Folder for the results: for each recording a folder, and index.sqlite with a row for each
        frame, which pandas, DuckDB and `fishlight chart sequence` read.
    stages
        Whose results are written: some of merge (radiance, EXR), remap (maps, EXR), lights (JSON)
        and preview (the map and its lights, PNG).
    scheduler
        Address of a dask scheduler, such as tcp://host:8786, whose workers see recordings and
        output under the same paths as this machine does; `dask worker ADDRESS` starts one. Without
        it, this machine's cores.
    steady
        Smooth what trembles from frame to frame, as `fishlight replay` does.
    height
        Rows of the lat-long maps, which are twice as wide.
    calibration
        Calibration to use instead of the recordings' own.
    """
    # Here, so that no other command waits for dask.
    from render.batch.batch import frame_count, make_output, run_batch

    if not recordings:
        raise InputError("nothing to do: name recordings, folders with a manifest.json")
    check_map_height(height)
    most, error = most_lights(count, error, method)
    named = tuple(name.strip() for name in stages.split(","))
    settings = Settings(named, LightPlan(most, method, error, is_steady=steady), height)
    make_output(output)
    start_s = time.monotonic()
    with _progress(frame_count(recordings)) as on_frames:
        summary = run_batch(
            recordings,
            output,
            settings,
            calibration_path=calibration,
            scheduler=scheduler,
            on_frames=on_frames,
            say=lambda text: print(f"fishlight: {text}", file=sys.stderr, flush=True),
        )
    for reason in summary.reasons:
        print(f"fishlight: failed: {reason}", file=sys.stderr)
    rate_hz = summary.made / (time.monotonic() - start_s)
    print(
        f"{output}: recordings {len(recordings)}, {summary.stopped_recordings} of them stopped; "
        f"frames made {summary.made} ({rate_hz:.1f} a second), kept {summary.kept}, "
        f"failed {summary.failed_frames}"
    )
    if summary.has_failures:
        sys.exit(1)


class _OnFrames(Protocol):
    def __call__(self, count: int, is_kept: bool, /) -> None: ...


@contextmanager
def _progress(total: int) -> Iterator[_OnFrames]:
    """Show how many frames are done, their rate and the time left; nothing in a pipe."""
    bar = Progress(
        TextColumn("batch"),
        BarColumn(),
        MofNCompleteColumn(),
        _RateColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        disable=not sys.stderr.isatty(),
        transient=True,
    )
    with bar:
        task = bar.add_task("batch", total=total)

        def on_frames(count: int, is_kept: bool) -> None:
            if is_kept:  # or the rate would be that of looking
                bar.update(task, total=(bar.tasks[0].total or 0) - count)
            else:
                bar.advance(task, count)

        yield on_frames


class _RateColumn(ProgressColumn):
    """Frames a second."""

    def render(self, task: ProgressTask) -> Text:
        """Return the rate of the last half minute."""
        return Text(f"{task.speed:.1f} frames/s" if task.speed else "")
