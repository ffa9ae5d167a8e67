"""Work done in copies of this process, so that many cells share one start of a dive.

A copy (fork) goes on from the very state of its parent; its result comes back through a pipe. The
parent must have one thread, and nothing open that copies may not share.
"""

import os
import sys
import traceback
from collections.abc import Callable, Generator, Iterable
from selectors import EVENT_READ, DefaultSelector
from typing import NamedTuple, NoReturn

Work = Callable[[], bytes]


class Copy(NamedTuple):
    """A process that works."""

    key: int
    pid: int
    pipe: int


def in_copies(jobs: Iterable[tuple[int, Work]], workers: int) -> Generator[tuple[int, bytes]]:
    """(key, result) of each job, as they are finished. A job is asked for when there is a free
    worker, so that jobs may change this process one after the other.

    Raises:
        RuntimeError: a copy failed; it has said why.
    """
    with DefaultSelector() as selector:
        results: dict[int, bytearray] = {}

        def finished() -> Generator[tuple[int, bytes]]:
            for ready, _ in selector.select():
                copy: Copy = ready.data
                data = os.read(copy.pipe, 1 << 16)
                results[copy.key] += data
                if not data:
                    selector.unregister(copy.pipe)
                    os.close(copy.pipe)
                    _, status = os.waitpid(copy.pid, 0)
                    if status != 0:
                        raise RuntimeError(f"cell {copy.key} failed")
                    yield copy.key, bytes(results.pop(copy.key))

        for key, work in jobs:
            while len(selector.get_map()) >= workers:
                yield from finished()
            copy = _start(key, work)
            results[key] = bytearray()
            selector.register(copy.pipe, EVENT_READ, copy)
        while selector.get_map():
            yield from finished()


def _start(key: int, work: Work) -> Copy:
    sys.stdout.flush()
    sys.stderr.flush()
    mine, theirs = os.pipe()
    pid = os.fork()
    if pid == 0:
        _work_and_end(work, theirs)
    os.close(theirs)
    return Copy(key, pid, mine)


def _work_and_end(work: Work, pipe: int) -> NoReturn:
    """In the copy. It ends without what the parent would do at its end."""
    status = 1
    try:
        data = work()
        while data:
            data = data[os.write(pipe, data) :]
        status = 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(status)
