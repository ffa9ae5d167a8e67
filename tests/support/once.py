"""What a run of the tests makes once, in whichever of its processes needs it first."""

import fcntl
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest


def once(
    factory: pytest.TempPathFactory, worker: str, name: str, make: Callable[[Path], object]
) -> Path:
    """The folder of this name, filled by `make` in the first process that asks for it.

    Args:
        worker: what the fixture `worker_id` says.
    """
    base = factory.getbasetemp()
    folder = (base if worker == "master" else base.parent) / name
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            unfinished = folder.with_suffix(".unfinished")
            shutil.rmtree(unfinished, ignore_errors=True)
            unfinished.mkdir()
            make(unfinished)
            # Not renamed: a venv's programs, and a dive's notes, name their own place.
            folder.symlink_to(unfinished, target_is_directory=True)
    return folder.resolve()
