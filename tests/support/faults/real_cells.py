"""Faults in real processes: several in one dive, one after the other."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from services.runtime.config.errors import LindyError
from tests.support.faults.catalogue import FAULTS, HANG_S, KILL_S, ONLOOKERS
from tests.support.faults.fault import FaultCase
from tests.support.faults.figures import Figures, disarmed, figures, with_disarm
from tests.support.faults.modes import DOWN, FlownMode
from tests.support.faults.real_dive import RealFaultDive, real_dive
from tools.recordings.recording import open_recording

MORE_S = 2.0  # [s] longer than on virtual time: a busy computer starts processes slowly
WAITS_S = 12.0  # [s] … and what writes files is given ten seconds before it is ended
LONGEST_RECOVERY_S = 45.0  # [s] after the beginning, for the pilot to be in control again
STEADY_S = 2.0  # [s] of undisturbed flight between two cells
REQUEST_S = 6.0  # [s] for which a request is repeated, and thrusters come to rest
FILLED = 24 * 2**20  # [bytes] of a small disk
PILOTED = FlownMode("stabilised", "pioneer", (*DOWN, "7,0.3,0,0,0,,"), 10.0)
AT_REST = FlownMode("stabilised", "pioneer", DOWN, 9.0)  # a stick that is out refuses to arm


class RealCell(NamedTuple):
    fault: FaultCase
    figures: Figures
    note: str = ""  # what else was measured


Cells = Generator[RealCell]


def _named(*begins: str) -> list[FaultCase]:
    real = [fault for fault in FAULTS if fault.real is not None]
    return [fault for fault in real if fault.name.startswith(begins)]


def _stops(seconds: float) -> list[FaultCase]:
    return [f for f in _named("SIGSTOP") if f.name.endswith(f" {seconds:g} s")]


def fly_all() -> Cells:
    """About ten minutes."""
    took = dict(_disarmed(_named("kill -9") + _stops(20.0)))
    plan = (
        _named("kill -9"),
        _stops(0.3) + _stops(2.0),
        _stops(20.0),
        _named("cable", "link", "imu silent", "pressure silent", "vertical dead", "port dead"),
    )
    for faults in plan:
        for cell in _in_one_dive(faults):
            name = cell.fault.name
            if name in took:
                cell = cell._replace(figures=with_disarm(cell.figures, took[name]))
            yield cell
    yield from _of_their_own()


@contextmanager
def _flown(mode: FlownMode, *more: str) -> Generator[RealFaultDive]:
    with (
        TemporaryDirectory(prefix="lindy-faults-") as folder,
        real_dive(mode, Path(folder), *more) as dive,
    ):
        yield dive


def _in_one_dive(faults: Sequence[FaultCase]) -> Cells:
    """What each fault does; the drone stays armed."""
    cells: list[tuple[RealCell, int]] = []
    with _flown(PILOTED) as dive:
        for fault in faults:
            dive.wait_steady(STEADY_S)
            begin = dive.now
            _cause(dive, fault)
            dive.run(fault.after + (WAITS_S if _waits_long(fault) else MORE_S))
            cells.append((RealCell(fault, _until_recovered(dive, begin)), begin))
        dive.end()
        for cell, begin in cells:
            note = _lost(dive.out, begin) if cell.fault.name.endswith("recorder") else ""
            yield cell._replace(note=note)


def _until_recovered(dive: RealFaultDive, begin: int) -> Figures:
    """The figures when the pilot is in control again, or when that takes too long."""
    measured = figures(dive.seen, begin, dive.now, holds_depth=True)
    while measured.recovered is None and dive.now - begin < LONGEST_RECOVERY_S * 1e9:
        dive.run(1.0)
        measured = figures(dive.seen, begin, dive.now, holds_depth=True)
    return measured


def _waits_long(fault: FaultCase) -> bool:
    """The supervisor gives a slow disk ten seconds."""
    return fault.lasts > 10.0 and any(name in fault.name for name in ONLOOKERS)


def _cause(dive: RealFaultDive, fault: FaultCase) -> None:
    """Begin it, let it last, end it. What hangs for long is ended by the supervisor before."""
    assert fault.real is not None
    fault.real.begin(dive)
    dive.run(fault.flown)
    if not _waits_long(fault):
        fault.real.end(dive)


def _lost(out: Path, killed_ns: int) -> str:
    """How much of what was before the recorder's end is not in the file."""
    stamps = [e.message.stamp_ns for e in open_recording(out) if e.key == "state"]
    before = max((stamp for stamp in stamps if stamp <= killed_ns), default=0)
    after = min((stamp for stamp in stamps if stamp > killed_ns), default=killed_ns)
    lost, gap = (killed_ns - before) / 1e9, (after - before) / 1e9
    return f"the last {lost:.2f} s before it are lost; nothing recorded for {gap:.2f} s"


def _disarmed(faults: Sequence[FaultCase]) -> Generator[tuple[str, float | None]]:
    """The fault, and how long a disarm takes while it lasts [s]; None: it is not possible."""
    with _flown(AT_REST) as dive:
        for fault in faults:
            dive.wait_steady(STEADY_S)
            assert fault.real is not None
            fault.real.begin(dive)
            dive.run(fault.ask_at)
            asked = dive.now
            dive.ask(kind="disarm")
            took = None
            while took is None and dive.now < asked + REQUEST_S * 1e9:
                dive.run(0.2)
                took = disarmed(dive.seen, asked, dive.now)
            fault.real.end(dive)
            yield fault.name, took
            dive.run(6.0 if not _waits_long(fault) else 12.0)
            _arm(dive)


def _arm(dive: RealFaultDive) -> None:
    for _ in range(5):
        dive.ask(kind="arm")
        dive.run(2.0)
        if dive.seen.statuses and dive.seen.statuses[-1].armed:
            return


def _of_their_own() -> Cells:
    yield from _busy()
    yield from _full_disk()
    yield from _folder_removed()
    yield from _supervisor_killed()


def _only_real(name: str, cause: str, lasts: float, *, back: float | None = None) -> FaultCase:
    return FaultCase(name=name, cause=cause, lasts=lasts, back=back)


def _busy() -> Cells:
    """Four processes that never rest."""
    fault = _only_real("4 busy processes", "too slow", 8.0)
    with _flown(PILOTED) as dive:
        dive.wait_steady(STEADY_S)
        begin = dive.now
        hogs = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(4)]
        try:
            dive.run(fault.lasts)
        finally:
            for hog in hogs:
                hog.kill()
                hog.wait()
        dive.run(fault.after)
        yield RealCell(fault, figures(dive.seen, begin, dive.now, holds_depth=True))


def _full_disk() -> Cells:
    """The dive's folder is on a small disk that fills."""
    fault = _only_real("disk full", "disk", 8.0)
    mount, umount = shutil.which("mount"), shutil.which("umount")
    with TemporaryDirectory(prefix="lindy-faults-") as folder:
        small = Path(folder) / "small"
        small.mkdir()
        options = ["-t", "tmpfs", "-o", f"size={FILLED}", "tmpfs", str(small)]
        if mount is None or umount is None or subprocess.run([mount, *options]).returncode != 0:
            return  # not allowed here: the page says which cells were flown
        try:
            with real_dive(PILOTED, small) as dive:
                dive.wait_steady(STEADY_S)
                begin = dive.now
                filler = small / "filler"
                with suppress(OSError), filler.open("wb", buffering=0) as file:
                    while True:
                        file.write(bytes(1 << 16))
                dive.run(fault.lasts)
                filler.unlink()
                dive.run(fault.after)
                measured = figures(dive.seen, begin, dive.now, holds_depth=True)
                status = dive.end()
                yield RealCell(fault, measured, f"the dive ends with status {status}")
        finally:
            subprocess.run([umount, "-l", str(small)], check=True)


def _folder_removed() -> Cells:
    """Somebody removes the dive's folder; then a service dies."""
    fault = _only_real("folder removed, control killed", "disk", 6.0, back=KILL_S)
    with _flown(PILOTED) as dive:
        dive.wait_steady(STEADY_S)
        pid = dive.running.pids["control"]
        shutil.rmtree(dive.out)
        begin = dive.now
        os.kill(pid, 9)
        dive.run(fault.lasts)
        measured = _until_recovered(dive, begin)
        note = "the dive goes on" if dive.alive else "the dive has ended"
        with suppress(LindyError):
            dive.end()
        yield RealCell(fault, measured, note)


def _supervisor_killed() -> Cells:
    """Everybody ends; a real vehicle's driver then stops its thrusters by itself."""
    fault = _only_real("kill -9 supervisor", "process ends", 0.0)
    with _flown(PILOTED) as dive:
        dive.wait_steady(STEADY_S)
        pids = set(dive.running.pids.values())
        begin = dive.now
        dive.process.kill()
        dive.process.wait()
        gone = _until(lambda: not any(map(_exists, pids)), HANG_S)
        dive.run(0.2)
        measured = figures(dive.seen, begin, dive.now, holds_depth=True)
        words = "some processes are left" if gone is None else f"all gone after {gone:.2f} s"
        yield RealCell(fault, measured, f"{words}; nothing is started again")


def _until(happened: Callable[[], bool], patience_s: float) -> float | None:
    """[s] Until it happened; None: it did not."""
    began = time.monotonic()
    while (passed := time.monotonic() - began) < patience_s:
        if happened():
            return passed
        time.sleep(0.01)  # other processes do it
    return None


def _exists(pid: int) -> bool:
    """A zombie does not exist any more."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return stat.rsplit(")", 1)[1].split()[0] != "Z"
