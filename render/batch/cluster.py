"""The processes that a batch works with: this machine's, or those of a cluster that is there.

Fails  : dask trusts whoever reaches its scheduler. One of this machine's own is reached from this
machine alone, by any user of it; on a machine that is shared with people who are not trusted, start
one with TLS and name it.
"""

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager

import dask
from distributed import Client, LocalCluster

from capture.errors import InputError

_CONNECT_S = 20
_ALLOWED_FAILURES = 100
"""Deaths of workers that one run survives: batch/attempts.py gives up frames long before."""

_ENVIRONMENT = {"OPENBLAS_NUM_THREADS": 1}
"""Of each process, in place of dask's, which has memory given back to the system at once: pictures
would be written to fresh pages, and a frame take a quarter more time."""

_QUIET = {
    "distributed.worker.profile.enabled": False,  # of all threads' stacks, 100 times a second
    "distributed.admin.tick.interval": "1s",  # to see an event loop hang, 50 times a second
    "distributed.admin.system-monitor.interval": "5s",  # for a page that nobody looks at
}
"""What dask watches itself with, in every process: a twentieth of a core without this."""


@contextmanager
def connected(scheduler: str | None, worker_count: int | None = None) -> Iterator[Client]:
    """Yield a client of the cluster at `scheduler`, or of one that lasts as long as the block.

    A cluster of its own has a process for each core, and a limit of memory for each process that
    together make up the machine's; one that exceeds it is ended, and another begun.

    Raises
    ------
    InputError
        If there is no scheduler at that address.
    """
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=_CONNECT_S)
        except (OSError, ValueError) as error:
            raise InputError(f"{scheduler}: no scheduler answers ({error})") from None
        with client:
            yield client
        return
    cores = len(os.sched_getaffinity(0))
    worker_count = worker_count or cores
    with (
        dask.config.set(
            {
                "distributed.scheduler.allowed-failures": _ALLOWED_FAILURES,
                "distributed.nanny.pre-spawn-environ": _ENVIRONMENT,
                **_QUIET,
            }
        ),
        LocalCluster(
            n_workers=worker_count,
            threads_per_worker=max(1, cores // worker_count),
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client
