"""A computer that fails under a dive of real processes: `python -m
tests.support.faults.failing_computer` flies each failure and prints a table, in five minutes.

Each comes twice: the first time the pilot must be in control again when it has ended; the second a
disarm is asked for while it lasts.
"""

import os
import resource
import shutil
import subprocess
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple, TypeVar

from tests.support.faults.catalogue import HANG_S
from tests.support.faults.figures import Figures, disarmed, figures, with_disarm
from tests.support.faults.modes import FlownMode
from tests.support.faults.real_cells import PILOTED
from tests.support.faults.real_dive import RealFaultDive, real_dive

LASTS_S = 6.0  # [s]
BEFORE_S = 2.0  # [s] of undisturbed flight
ASKED_S = 6.0  # [s] for which a request to disarm is repeated, and thrusters come to rest
LONGEST_S = 45.0  # [s] after the beginning, for the pilot to be in control again
DISK = 64 * 2**20  # [bytes]
INODES = 200
MODULES = "modules"  # folder
GROUPS = Path("/sys/fs/cgroup/pids")

T = TypeVar("T")
Hurts = Callable[[RealFaultDive], AbstractContextManager[None]]


class NotHereError(Exception):
    """This computer cannot be made to fail so."""


class Failure(NamedTuple):
    name: str
    hurt: Hurts  # while it is entered
    disk: Callable[[Path], AbstractContextManager[None]] = lambda _: nullcontext()
    kills: bool = True  # control, as it begins: can it be started again?

    @property
    def in_words(self) -> str:
        return f"{self.name}, control killed" if self.kills else self.name


def main() -> None:
    print("| failure, for 6 s | said [s] | thrust zero [s] | in control [s] | disarm [s] |")
    print("| --- | --- | --- | --- | --- |")
    for failure in FAILURES:
        try:
            found = _flown(failure, PILOTED)
        except NotHereError:
            print(f"| {failure.in_words} | not possible on this computer | | | |", flush=True)
            continue
        times = found.announced, found.thrust_zero, found.recovered, found.disarmed
        words = " | ".join("–" if each is None else f"{each:.2f}" for each in times)
        print(f"| {failure.in_words} | {words} |", flush=True)


def _flown(failure: Failure, mode: FlownMode) -> Figures:
    with TemporaryDirectory(prefix="lindy-faults-") as folder:
        disk, modules = Path(folder) / "disk", Path(folder) / MODULES
        disk.mkdir()
        modules.mkdir()
        with (
            failure.disk(disk),
            real_dive(mode, Path(folder), out=disk / "dive", modules=modules) as dive,
        ):
            dive.wait_steady(BEFORE_S)
            begin = dive.now
            _suffer(dive, failure, lambda: dive.run(LASTS_S))
            measured = _when_back(dive, begin)
            dive.wait_steady(BEFORE_S)
            took = _suffer(dive, failure, lambda: _asked_to_disarm(dive))
            dive.run(BEFORE_S)
            dive.end()
            return with_disarm(measured, took)


def _suffer(dive: RealFaultDive, failure: Failure, meanwhile: Callable[[], T]) -> T:
    with failure.hurt(dive):
        if failure.kills:
            dive.kill("control")
        return meanwhile()


def _when_back(dive: RealFaultDive, begin: int) -> Figures:
    dive.run(HANG_S)
    while True:
        found = figures(dive.seen, begin, dive.now, holds_depth=True)
        if found.recovered is not None or dive.now - begin > LONGEST_S * 1e9 or not dive.alive:
            return found
        dive.run(1.0)


def _asked_to_disarm(dive: RealFaultDive) -> float | None:
    dive.run(1.0)
    asked, took = dive.now, None
    dive.ask(kind="disarm")
    while took is None and dive.now < asked + ASKED_S * 1e9:
        dive.run(0.2)
        took = disarmed(dive.seen, asked, dive.now)
    return took


# How it fails.


def _family(dive: RealFaultDive) -> list[int]:
    """Process ids of the dive's program and of all that it has started."""
    children: dict[int, list[int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            parent = int(stat.read_text().rpartition(")")[2].split()[1])
            children.setdefault(parent, []).append(int(stat.parent.name))

    def below(pid: int) -> Iterator[int]:
        yield pid
        for child in children.get(pid, []):
            yield from below(child)

    return list(below(dive.process.pid))


@contextmanager
def _limited(dive: RealFaultDive, kind: int, used: Callable[[Path], int]) -> Generator[None]:
    """None of them gets more than it uses now."""
    before: dict[int, tuple[int, int]] = {}
    for pid in _family(dive):
        with suppress(OSError):
            before[pid] = resource.prlimit(pid, kind)
            most = before[pid][1]
            resource.prlimit(pid, kind, (used(Path(f"/proc/{pid}")), most))
    try:
        yield
    finally:
        for pid in _family(dive):  # what was started meanwhile has the limits of its parent
            with suppress(OSError):
                resource.prlimit(pid, kind, before.get(pid, before[dive.process.pid]))


def _descriptors(dive: RealFaultDive) -> AbstractContextManager[None]:
    return _limited(dive, resource.RLIMIT_NOFILE, lambda place: len([*(place / "fd").iterdir()]))


def _memory(dive: RealFaultDive) -> AbstractContextManager[None]:
    def used(place: Path) -> int:
        return int((place / "statm").read_text().split()[0]) * resource.getpagesize()

    return _limited(dive, resource.RLIMIT_AS, used)


@contextmanager
def _processes(dive: RealFaultDive) -> Generator[None]:
    """No thread and no process more: a limit for users does not bind root, a group's does."""
    group = GROUPS / f"lindy-faults-{dive.process.pid}"
    try:
        group.mkdir()
    except OSError as error:
        raise NotHereError from error
    try:
        for pid in _family(dive):
            (group / "cgroup.procs").write_text(str(pid))
        (group / "pids.max").write_text((group / "pids.current").read_text())
        yield
    finally:
        (group / "pids.max").write_text("max")
        for pid in _family(dive):
            with suppress(OSError):
                (GROUPS / "cgroup.procs").write_text(str(pid))
        with suppress(OSError):
            group.rmdir()


@contextmanager
def _one_core(dive: RealFaultDive) -> Generator[None]:
    before = os.sched_getaffinity(0)
    _pin(dive, {min(before)})
    try:
        yield
    finally:
        _pin(dive, before)


def _pin(dive: RealFaultDive, cores: set[int]) -> None:
    for pid in _family(dive):
        with suppress(OSError):
            for thread in Path(f"/proc/{pid}/task").iterdir():
                os.sched_setaffinity(int(thread.name), cores)


@contextmanager
def _library(dive: RealFaultDive) -> Generator[None]:
    """Whoever imports numpy now gets a file that is cut off."""
    damaged = dive.folder / MODULES / "numpy.py"
    damaged.write_text("def array(")
    try:
        yield
    finally:
        damaged.unlink()


# Disks.


def _run(*words: str) -> None:
    program = shutil.which(words[0], path=f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin")
    if program is None or subprocess.run([program, *words[1:]], capture_output=True).returncode:
        raise NotHereError(words[0])


@contextmanager
def _mounted(place: Path, *options: str) -> Generator[None]:
    _run("mount", *options, str(place))
    try:
        yield
    finally:
        _run("umount", "-l", str(place))


def _small(place: Path) -> AbstractContextManager[None]:
    return _mounted(place, "-t", "tmpfs", "-o", f"size={DISK},nr_inodes={INODES}", "tmpfs")


@contextmanager
def _image(place: Path) -> Generator[None]:
    """A disk in a file, which can be made to hang."""
    image = place.with_name("image")
    with image.open("wb") as file:
        file.truncate(DISK)
    _run("mkfs.ext4", "-q", str(image))
    with _mounted(place, "-o", "loop", str(image)):
        yield


@contextmanager
def _read_only(dive: RealFaultDive) -> Generator[None]:
    place = str(dive.out.parent)
    # A disk with files open for writing refuses it; one that has found itself damaged does not ask.
    _run("mount", "-o", "remount,abort", place)
    yield


@contextmanager
def _hangs(dive: RealFaultDive) -> Generator[None]:
    """Whoever writes there waits, and no signal ends that, as with a server that is away."""
    place = str(dive.out.parent)
    _run("fsfreeze", "-f", place)
    try:
        yield
    finally:
        _run("fsfreeze", "-u", place)


@contextmanager
def _no_files(dive: RealFaultDive) -> Generator[None]:
    """The disk has room, but takes no further file."""
    made: list[Path] = []
    with suppress(OSError):
        for number in range(2 * INODES):
            path = dive.out.parent / f"filler-{number}"
            path.touch()
            made.append(path)
    try:
        yield
    finally:
        for path in made:
            path.unlink()


FAILURES = (
    Failure("no descriptors left", _descriptors),
    Failure("no memory left", _memory),
    Failure("no processes left", _processes),
    Failure("one core taken away", _one_core, kills=False),
    Failure("a library damaged", _library),
    Failure("no inodes left", _no_files, _small),
    Failure("the disk hangs", _hangs, _image),
    Failure("the disk read-only", _read_only, _image),
)

if __name__ == "__main__":
    main()
