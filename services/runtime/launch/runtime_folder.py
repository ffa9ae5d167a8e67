"""The folder of one start, for what its processes share: sockets, heartbeats, copies of files."""

import shutil
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from services.runtime.os import system

LONGEST = 56  # [bytes] a socket's path must stay below 107
PREFIX = "lindy-run-"


@contextmanager
def runtime_folder() -> Generator[Path]:
    """A new one, removed at the end. Those of starts that were killed are removed now."""
    place = tempfile.gettempdir()
    place = place if len(place) <= LONGEST else "/tmp"
    sweep(Path(place))
    with tempfile.TemporaryDirectory(  # whose disk may have become read-only meanwhile
        prefix=PREFIX, dir=place, ignore_cleanup_errors=True
    ) as name:
        lock = system.lock(Path(name))  # ends with this process, however that ends
        try:
            yield Path(name)
        finally:
            if lock is not None:
                lock.release()


def sweep(place: Path) -> None:
    """Remove the folders whose start has ended without removing them: nobody holds their locks.
    An empty one may be new, and not locked yet; where a disk has no locks, nothing is known."""
    for folder in place.glob(f"{PREFIX}*"):
        with suppress(OSError):  # somebody else's
            if folder.is_symlink() or not any(folder.iterdir()):
                continue
            if (lock := system.lock(folder)) is None:
                continue
            if lock.is_known:
                shutil.rmtree(folder, ignore_errors=True)
            lock.release()
