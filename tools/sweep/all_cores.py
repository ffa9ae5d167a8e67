"""The same function for many jobs, on all cores.

Each worker is a fresh process. Ctrl-C reaches only the process that started them, also while they
start, and a worker whose parent is gone, however it ended, ends too.
"""

import os
import signal
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from multiprocessing import get_context, parent_process
from multiprocessing.synchronize import Event
from typing import TypeVar

from services.runtime.config.errors import LindyError
from services.runtime.os import system

J = TypeVar("J")
R = TypeVar("R")
POLL_S = 0.2  # [s] between two looks at whether to stop
SPAWN = get_context("spawn")
KILLED = "a worker process was killed, perhaps because the memory was full"

_stop: Event | None = None  # in a worker: set when it is to stop


def asked_to_stop() -> bool:
    """In a worker: is the rest not wanted any more?"""
    return _stop is not None and _stop.is_set()


def on_all_cores(
    work: Callable[[J], R],
    jobs: Sequence[J],
    workers: int | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> Generator[tuple[int, R] | None]:
    """(index of the job, its result) in the order in which they are finished, and None every now
    and then while nothing is.

    Args:
        work: can be pickled, as its arguments and results can; it may ask `asked_to_stop`.
        workers: processes; None: one for each core.
        stop: ask for the end; the jobs at hand are then finished, and no others are begun.

    Raises:
        LindyError: a worker was killed.
        Exception: what `work` raised.
    """
    workers, left = workers or system.cores(), iter(enumerate(jobs))
    pending, told = dict[Future[R], int](), SPAWN.Event()
    pool = ProcessPoolExecutor(workers, SPAWN, _begin, (told,))
    try:
        while True:
            if stop():
                told.set()
            else:
                # Ctrl-C, which a terminal sends to all of them, never reaches a process that is
                # started meanwhile.
                let_go = system.hold_back([signal.SIGINT])
                try:
                    for index, job in islice(left, workers - len(pending)):
                        pending[pool.submit(work, job)] = index
                finally:
                    let_go()
            if not pending:
                return
            done, _ = wait(pending, timeout=POLL_S, return_when=FIRST_COMPLETED)
            for future in sorted(done, key=lambda one: one.exception() is not None):
                yield pending.pop(future), future.result()  # none is lost with an error
            if not done:
                yield None
    except BrokenProcessPool:
        if not stop():  # else a signal to the whole process group has ended the workers, too
            raise LindyError(KILLED) from None
    finally:
        told.set()
        pool.shutdown(cancel_futures=True)


def in_order(work: Callable[[J], R], jobs: Sequence[J], workers: int | None = None) -> list[R]:
    """All results, in the order of the jobs. Arguments and errors as of `on_all_cores`."""
    results = dict(result for result in on_all_cores(work, jobs, workers) if result is not None)
    return [results[index] for index in range(len(jobs))]


def _begin(told: Event) -> None:
    """In a new worker."""
    global _stop
    _stop = told
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_parent, daemon=True).start()


def _end_with_the_parent() -> None:
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
