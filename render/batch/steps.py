"""The three tasks of a run, as a dask worker does them with its share of numba's threads.

Tasks that prepare are long: they leave dask's count of busy threads (`secede`), so that the short
ones, for which the next run may be waiting, never queue behind them.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numba
from distributed import get_worker, secede

from render.batch.frames import LitRun, PreparedFrame, light_run, prepare_run, preview_run
from render.batch.runs import Job, Run


class Steps(NamedTuple):
    """What is done with each run, as in frames.py."""

    prepare: Callable[[Job, Run], list[PreparedFrame]] = prepare_run
    light: Callable[[Job, Run, Sequence[PreparedFrame], str, Path | None], LitRun] = light_run
    preview: Callable[[Job, Sequence[PreparedFrame], LitRun], None] = preview_run


def seceded(step: Callable[..., Any], *arguments: Any) -> Any:
    """Call a step beside those that dask counts."""
    secede()
    return with_share_of_threads(step, *arguments)


def with_share_of_threads(step: Callable[..., Any], *arguments: Any) -> Any:
    """Call a step with as many threads of numba's as the worker was given."""
    numba.set_num_threads(min(get_worker().state.nthreads, numba.get_num_threads()))
    return step(*arguments)
