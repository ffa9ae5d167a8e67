"""The outcome of a dive: files, report, summary and exit status."""

import sys
from collections import Counter
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from traceback import extract_tb

from msgspec import UNSET
from msgspec.structs import replace

from messages import events, topics
from messages.link import LatencyBudget
from messages.text import harmless
from messages.vehicle import VehicleStatus
from services.recorder.io.parts import parts_in
from services.runtime.config.errors import EndedByUserError, LindyError, NeedsRealTimeError
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from tools.analysis.dive import RecordedDive, read_dive
from tools.analysis.losses import losses
from tools.exit_status import DONE, LOST
from tools.fresh import write_fresh
from tools.health_sums import HealthOfAll
from tools.recordings.progress import reading
from tools.recordings.recording import log_hash, merge_parts, open_recording
from tools.report.report import Extras, Report, counted, encode, ending, processes, report_on
from tools.report.summary import Elsewhere, elsewhere, lined_up, summary, unrecorded

SAID = f"exit status {LOST}: data was lost, or a service did not work for a while"
RECORDER, HUB = "recorder", "hub_"
# What the recorder counts for messages that are not in its file.
NOT_IN_FILE = {row.name for row in (events.NOT_RECORDED, events.OVERFLOWED, events.UNREADABLE)}
WITHOUT_KEYS = "there were no keys: whoever reached the port could fly the drone"
WRITTEN = ("dive.mcap", "dive.rrd", "report.json")


class Outcome:
    """Collected during the dive, summed up after it."""

    def __init__(self, stack: Stack) -> None:
        self.exit = "clean"  # or why it ended otherwise
        self.stopped = False  # the user ended it
        self.restarts: Callable[[], dict[str, int]] = dict
        self.hung: Callable[[], dict[str, int]] = dict  # times each did not answer
        self.shared: dict[str, str] = {}  # service → OS process, where it shares one
        self.gone: list[str] = []  # services that were not alive at the end
        self.speedup: float | None = None  # [-] virtual over real time
        self._stack = stack
        self._health = HealthOfAll(joined=stack.apart)
        self._error: LindyError | None = None
        self._drone_heard = self._armed = False
        self._lost_s = 0.0  # [s] in which the pilot saw nothing of the drone

    def listen(self, node: Node) -> None:
        """Keep the health of all services; the recorder does not receive its own."""
        node.each(topics.HEALTH, lambda health, _: self._health.add(health))
        node.each(topics.LATENCY, self.see_latency)

    @contextmanager
    def of_the_dive(self) -> Generator[None]:
        """An aborted dive is still summed up, as far as it was recorded.

        Raises:
            NeedsRealTimeError: it cannot be flown on virtual time: there was no dive.
        """
        try:
            yield
        except NeedsRealTimeError:
            raise
        except LindyError as error:
            self._error = error
            self.exit = str(error)
        except Exception as error:  # the services have ended; what they recorded is whole
            where = extract_tb(error.__traceback__)[-1]
            at = f"{Path(where.filename).name}:{where.lineno}"
            self.exit = f"an error in Lindy itself, at {at}: {type(error).__name__}: {error}"
            self._error = LindyError(self.exit)
            self._error.__cause__ = error

    def sum_up(self, other: Elsewhere | None = None) -> int:
        """Write `report.json` and print the summary, and what only the other machine recorded, if
        there is one. Returns the exit status.

        Raises:
            LindyError: why the dive was aborted, or why there is no report.
        """
        folder = self._stack.out_dir
        self.require_recording()
        try:
            lost = self._report(folder, other)
        except BrokenPipeError:  # nobody reads the summary; the report is written
            raise
        except Exception as error:  # whatever it is: the recording is worth more than its report
            if error is self._error:
                raise
            raise LindyError(self._kept(folder, error)) from error
        self.complain()
        return _status(lost=lost)

    def require_recording(self) -> None:
        """Raises LindyError: nothing was recorded, and why."""
        if not parts_in(folder := self._stack.out_dir):
            kind = EndedByUserError if self.stopped else LindyError
            why = f"the dive ended before anything was recorded in {folder}"
            raise self._error or kind(why)

    def require_dive(self, dive: RecordedDive) -> None:
        """
        Raises:
            LindyError: it was aborted before anything of it was recorded, as where a service cannot
                start: there was no dive to sum up.
        """
        if self._error is not None and not any(each.count for each in dive.streams.values()):
            raise self._error

    def sum_up_unrecorded(self, side: str, other: str) -> int:
        """Print what is known on the side without a report. Returns the exit status.

        Raises:
            LindyError: why the dive was aborted.
        """
        restarts, folder = self.restarts(), self._stack.out_dir
        if parts_in(folder):
            merge(folder)
        deaf = side == "topside" and not self._drone_heard
        unarmed = "the drone was never heard" if deaf else "" if self._armed else "never armed"
        counts = losses(self._health.sums) + self._silences()  # as far as they arrived here
        troubles = [
            *filter(None, [unarmed]),
            *processes(restarts, self.gone, self.shared),
            *counted(counts),
        ]
        how = f"{side} of {self._stack.drone_name}, {ending(self.exit, troubles)}"
        files = written(folder)
        text = unrecorded(how, restarts, self.gone, other, files, self.shared, self._lost_s)
        print(text, flush=True)
        self._tell_insecure()
        self.complain()
        return _status(lost=self._was_away(restarts))

    def _tell_insecure(self) -> None:
        if self._stack.insecure:
            print(lined_up([("insecure", WITHOUT_KEYS)]), flush=True)

    def see_status(self, status: VehicleStatus, _: int) -> None:
        """A status of the drone has arrived."""
        self._drone_heard = True
        self._armed = self._armed or status.armed

    def see_latency(self, latency: LatencyBudget, _: int) -> None:
        """The link monitor has said how long nothing of the drone arrived."""
        self._lost_s = latency.lost_s

    def _was_away(self, restarts: Mapping[str, int]) -> bool:
        """Was there a time in which a service did not work?"""
        return any(restarts.values()) or any(self.hung().values())

    def _report(self, folder: Path, other: Elsewhere | None) -> bool:
        """Was something lost, or did a service not work for a while?"""
        merged = merge(folder)
        recording = open_recording(folder)
        with reading("reporting", recording.size) as recording.advance:
            dive = read_dive(recording, apart=self._stack.apart)
        self.require_dive(dive)
        # The recorder writes the hash last; merged parts have none.
        ended = merged or log_hash(folder) is not None
        report = report_on(dive, self._extras(finished=ended))
        unwritten = None  # why there is no report: the summary is worth reading without it
        try:
            write_fresh(folder / "report.json", encode(report))
        except LindyError as error:
            unwritten = error
        print(summary(report, dive.max_depth_m, written(folder)), flush=True)
        if other is not None:
            print(elsewhere(report, other), flush=True)
        self._tell_insecure()
        if unwritten is not None:
            raise unwritten
        if events.DISK_ERROR.name in report.losses or not ended:
            full = events.DISK_ERROR.name in report.losses
            why = "the disk was full or failed" if full else "it was not finished"
            print(f"lindy: the recording in {folder} is incomplete: {why}", file=sys.stderr)
        return data_was_lost(dive, report) or not ended or self._was_away(self.restarts())

    def _kept(self, folder: Path, error: Exception) -> str:
        """In one sentence: there is no report, but nothing else is lost."""
        why = str(error) if isinstance(error, LindyError) else f"{type(error).__name__}: {error}"
        before = "" if self.exit == "clean" else f"{self.exit}; "
        names = ", ".join(path.name for path in parts_in(folder))
        return f"{before}the report failed ({why}), but the recording is kept: {names} in {folder}"

    def _silences(self) -> Counter[str]:
        """How often each process ran but did not answer, as counts have it."""
        return Counter({events.HUNG(name).name: times for name, times in self.hung().items()})

    def complain(self) -> None:
        """Raises LindyError: why the dive was aborted, if it was."""
        if self.exit != "clean":
            raise self._error or LindyError(self.exit)

    def _extras(self, *, finished: bool) -> Extras:
        extras = Extras(
            exit=self.exit,
            gone=self.gone,
            finished=finished,
            restarts=self.restarts(),
            losses=self._silences(),
            shared=self.shared,
            health=self._health.sums,
        )
        if self.speedup is None:
            return extras
        hashed = log_hash(self._stack.out_dir)
        return replace(extras, speedup=self.speedup, log_hash=hashed or UNSET)

    def report_in_memory(self, dive: RecordedDive, hashed: str) -> Report:
        """The report of a dive without files."""
        extras = Extras(exit=self.exit, health=self._health.sums, log_hash=hashed)
        return report_on(dive, replace(extras, speedup=self.speedup or UNSET))


def _status(*, lost: bool) -> int:
    """The exit status. One that is not 0 is said: `make` and shells show only its number."""
    if not lost:
        return DONE
    print(SAID, flush=True)
    return LOST


def merge(folder: Path) -> bool:
    """Merge the parts of the recording into one file, or leave them as they are where they cannot
    be copied, and print that."""
    try:
        return merge_parts(folder)
    except LindyError as error:
        print(f"{error}; its parts stay as they are", flush=True)
        return False


def data_was_lost(dive: RecordedDive, report: Report) -> bool:
    """Were there messages in this dive that the recording does not have?"""
    kinds = {name.partition(":")[0] for name in dive.losses}
    restarts = {name: service.restarts for name, service in report.services.items()}
    return bool(kinds & NOT_IN_FILE) or bool(report.holes) or was_deaf(restarts)


def was_deaf(restarts: Mapping[str, int]) -> bool:
    """A restarted recorder or hub received nothing for a while."""
    return any(count > 0 and name.startswith((RECORDER, HUB)) for name, count in restarts.items())


def written(folder: Path) -> list[Path]:
    return [path for name in WRITTEN if (path := folder / name).is_file()]


def title(stack: Stack) -> str:
    """Title of a dive on the screen."""
    pilot = stack.pilot.replace(":", " ").rpartition("/")[2]
    first = "INSECURE, no keys · " if stack.insecure else ""
    return harmless(f"{first}{stack.drone_name} · {stack.link} · {pilot}")
