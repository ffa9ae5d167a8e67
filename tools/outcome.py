"""What is left when a dive is over: files, a report, a summary and an exit status."""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

from msgspec import UNSET
from msgspec.structs import replace

from messages import topics
from messages.health import Health
from services.recorder.parts import parts_in
from services.runtime.errors import LindyError
from services.runtime.node import Node
from services.runtime.stack import Stack
from tools.recording import log_hash, merge_parts, open_recording
from tools.report import Dive, Extras, Report, encode, read_dive, report_on, summary

CLEAN, DATA_LOST = 0, 3  # exit statuses
RECORDER, HUB = "recorder", "hub_"
# What the recorder counts when something that was said is not in the file.
NOT_IN_FILE = {"not_recorded", "overflowed", "unreadable"}
WRITTEN = ("dive.mcap", "dive.rrd", "report.json")


class Outcome:
    """Filled while the dive goes on, summed up after it."""

    def __init__(self, stack: Stack) -> None:
        self.exit = "clean"  # or why it ended otherwise
        self.restarts: Callable[[], dict[str, int]] = dict
        self.speedup: float | None = None  # [-] virtual over real time
        self._stack = stack
        self._health: list[Health] = []
        self._error: LindyError | None = None

    def listen(self, node: Node) -> None:
        """Keep what services say of themselves; the recorder cannot hear itself."""
        node.each(topics.HEALTH, lambda health, _: self._health.append(health))

    @contextmanager
    def of_the_dive(self) -> Generator[None]:
        """A dive that breaks off is still summed up, as far as it was recorded."""
        try:
            yield
        except LindyError as error:
            self._error = error
            self.exit = str(error)

    def sum_up(self) -> int:
        """Write `report.json` and print the summary. Returns the exit status.

        Raises:
            LindyError: why the dive broke off.
        """
        folder = self._stack.out_dir
        if not parts_in(folder):
            raise self._error or LindyError(
                f"the dive ended before anything was recorded in {folder}"
            )
        merge_parts(folder)
        dive = read_dive(open_recording(folder))
        report = report_on(dive, self._extras())
        write(folder / "report.json", encode(report))
        files = [path for name in WRITTEN if (path := folder / name).is_file()]
        print(summary(report, dive.max_depth_m, files), flush=True)
        if self.exit != "clean":
            raise self._error or LindyError(self.exit)
        return DATA_LOST if data_was_lost(dive, report) else CLEAN

    def _extras(self) -> Extras:
        extras = Extras(
            exit=self.exit,
            restarts=self.restarts(),
            health=self._health,
        )
        if self.speedup is None:
            return extras
        hashed = log_hash(self._stack.out_dir)
        return replace(extras, speedup=self.speedup, log_hash=hashed or UNSET)


def data_was_lost(dive: Dive, report: Report) -> bool:
    """Is there something that was said in this dive and that the recording does not have? A
    recorder or a hub that had to be started again was deaf for a while."""
    kinds = {name.partition(":")[0] for name in dive.losses}
    return bool(kinds & NOT_IN_FILE) or any(
        service.restarts
        for name, service in report.services.items()
        if name == RECORDER or name.startswith(HUB)
    )


def write(path: Path, data: bytes) -> None:
    try:
        path.write_bytes(data)
    except OSError as error:
        raise LindyError(f"cannot write {path}: {error.strerror}") from None


def title(stack: Stack) -> str:
    """What a dive is called on the screen."""
    pilot = stack.pilot.replace(":", " ").rpartition("/")[2]
    return f"{stack.vehicle} · {stack.link} · {pilot}"
