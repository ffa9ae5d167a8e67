"""An imported recording on disk, written by what writes that of a dive."""

import contextlib
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path

import msgspec

from messages import events
from messages.events import Level, Outbox
from messages.units import Ns
from services.marine.vehicle import Vehicle
from services.recorder.core import Intake
from services.recorder.foxglove.views import Views
from services.recorder.io.attachments import AttachedFile, attachments
from services.recorder.io.mcap_session import McapSession, RecordingCheckpoint
from services.recorder.io.parts import part_path
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from tools.importing.conversion import Imported
from tools.live.dive_folder import out_folder, point_latest

FLUSHED = 5_000  # messages between two flushes
BEFORE_NS = 10_000_000_000  # [ns] by the clock of the stamps at the first message


class ImportNode:
    """What the recorder's session needs of a service's node: here there is no service."""

    sides: Mapping[str, object] = {"drone": None}

    def __init__(self, first_ns: Ns) -> None:
        """
        Args:
            first_ns: [ns] UTC of the first message.
        """
        self.outbox = Outbox()
        self.wall_offset_ns = first_ns - BEFORE_NS
        self.said: list[str] = []  # errors of the disk
        self._now = BEFORE_NS

    def now(self) -> Ns:
        return self._now

    def log(self, level: Level, text: str) -> None:
        if level == "error":
            self.said.append(text)

    def restore_checkpoint(self, kind: type[RecordingCheckpoint]) -> RecordingCheckpoint | None:
        """None: it is the first time."""

    def save_checkpoint(self, what: RecordingCheckpoint) -> None:
        """It is not started again."""


class NewRecording:
    """Takes messages in the order of their arrival. A context: at its end the recording is
    complete."""

    def __init__(self, folder: Path, vehicle: str, used: AttachedFile, log: str) -> None:
        """
        Args:
            used: the map.
            log: name of the file that it is from.

        Raises:
            LindyError: there is no such vehicle, or its file is wrong.
        """
        self._stack = Stack(vehicle=vehicle, link="perfect", pilot="imported", out=str(folder))
        self.vehicle = self._stack.vehicle_name
        numbers = self._stack.section("vehicle", Vehicle)
        self.imu_rotation = numbers.mounting.imu.rotation  # its axes to the body's
        self._views = Views(numbers)
        self._attached = [*attachments(self._stack), used]
        self._described = {"imported": log}
        self._encode = msgspec.msgpack.Encoder().encode
        self._opened: tuple[ImportNode, Intake, McapSession] | None = None
        self._written = 0

    def __enter__(self) -> "NewRecording":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """
        Raises:
            LindyError: the disk fails.
        """
        if self._opened is None:
            return
        node, intake, session = self._opened
        if kind is None:
            session.flush(node.now())
        session.close(intake.log_hash())
        if kind is None:
            _require_disk(node)

    def write(self, new: Imported) -> None:
        """
        Raises:
            LindyError: the disk fails, or the message is none of ours.
        """
        topic, message, arrival = new
        node, intake, session = self._opened or self._open(arrival)
        ours = _by_services_clock(message, node.wall_offset_ns)
        payload = self._encode(ours)
        at = arrival - node.wall_offset_ns
        checked = intake.check(topic.key, topic.encoding, payload, at)
        if checked is None:
            raise LindyError(f"{topic.key}: this cannot be recorded: {ours}")
        for row in intake.rows(topic.key, checked):
            session.write(row)
        self._written += 1
        if self._written % FLUSHED == 0:
            session.flush(node.now())
            _require_disk(node)

    def _open(self, first_ns: Ns) -> tuple[ImportNode, Intake, McapSession]:
        node = ImportNode(first_ns)
        intake = Intake(node.outbox, node.wall_offset_ns, views=self._views)
        attached, described = self._attached, self._described
        session = McapSession(node, self._stack, attached, described)
        self._opened = node, intake, session
        return self._opened


def _require_disk(node: ImportNode) -> None:
    if node.said or node.outbox.counts[events.NOT_RECORDED().name]:
        raise LindyError(" ".join(node.said) or "the recording could not be written")


def _by_services_clock(message: msgspec.Struct, offset: Ns) -> msgspec.Struct:
    """Stamps [ns UTC] by the clock of the services of a dive, which is never UTC."""
    changed = {
        name: value - offset
        for name in ("stamp_ns", "actuated_ns")
        if (value := getattr(message, name, None)) is not None
    }
    return msgspec.structs.replace(message, **changed)


@contextmanager
def new_folder(out: Path) -> Generator[Path]:
    """A folder for a recording, as `lindy dive` makes it; where the import fails, nothing of it
    stays.

    Raises:
        LindyError: it cannot be made or written to.
    """
    missing = [path for path in (out.resolve(), *out.resolve().parents) if not path.exists()]
    folder = out_folder(out)
    new = [folder] if folder not in missing else missing
    try:
        yield folder
    except BaseException:
        part_path(folder, 1).unlink(missing_ok=True)
        for path in new:
            with contextlib.suppress(OSError):
                path.rmdir()
        raise
    point_latest(folder)


def attached_map(path: Path) -> AttachedFile:
    data = path.read_bytes()
    return AttachedFile(path.name, "application/toml", data, path.stat().st_mtime_ns)
