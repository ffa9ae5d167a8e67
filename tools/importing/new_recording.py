"""An imported recording on disk, written by what writes that of a dive."""

import contextlib
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager
from itertools import chain
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

    def now(self) -> Ns:
        return BEFORE_NS

    def log(self, level: Level, text: str) -> None:
        if level == "error":
            self.said.append(text)

    def restore_checkpoint(self, kind: type[RecordingCheckpoint]) -> RecordingCheckpoint | None:
        """None: it is the first time."""

    def save_checkpoint(self, what: RecordingCheckpoint) -> None:
        """It is not started again."""


def record(
    messages: Iterator[Imported], stack: Stack, vehicle: Vehicle, used: Path, log: str
) -> None:
    """
    Args:
        messages: one or more, in the order of their arrival.
        stack: of which vehicle, into which folder.
        used: the map.
        log: name of the file that they are from.

    Raises:
        LindyError: the disk fails, or a message is none of ours.
    """
    data, changed_ns = used.read_bytes(), used.stat().st_mtime_ns
    own_map = AttachedFile(used.name, "application/toml", data, changed_ns)
    attached, views = [*attachments(stack), own_map], Views(vehicle)
    first = next(messages)
    node = ImportNode(first.arrival_ns)
    offset, encode = node.wall_offset_ns, msgspec.msgpack.Encoder().encode
    intake = Intake(node.outbox, offset, views=views)
    session = McapSession(node, stack, attached, {"imported": log})
    try:
        for number, (topic, message, arrival) in enumerate(chain([first], messages), 1):
            # By the clock of the services of a dive, which is never UTC.
            stamps = ((name, getattr(message, name, None)) for name in ("stamp_ns", "actuated_ns"))
            changed = {name: at - offset for name, at in stamps if at is not None}
            ours = msgspec.structs.replace(message, **changed)
            checked = intake.check(topic.key, topic.encoding, encode(ours), arrival - offset)
            if checked is None:
                raise LindyError(f"{topic.key}: this cannot be recorded: {ours}")
            for row in intake.rows(topic.key, checked):
                session.write(row)
            if number % FLUSHED == 0:
                session.flush(node.now())
                _require_disk(node)
        session.flush(node.now())
    finally:
        session.close(intake.log_hash())
    _require_disk(node)


def _require_disk(node: ImportNode) -> None:
    if node.said or node.outbox.counts[events.NOT_RECORDED().name]:
        raise LindyError(" ".join(node.said) or "the recording could not be written")


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
