"""Records a dive to MCAP files, part after part, and survives disk errors.

At the start of a dive, a disk that cannot be written is an error the user can correct, and stops
the service with one sentence. During a dive it must not affect anything else: the recording stops
with one log line, everything not written is counted, and every few seconds a new part is tried. A
new one, because the old one was truncated and ended after its last flush.

Existing files are never written to.
"""

import json
from collections import Counter
from pathlib import Path
from typing import Literal, Protocol

import msgspec

from messages import topics
from services.recorder.core import RecordedRow
from services.recorder.foxglove_schema import foxglove_schema
from services.recorder.io.mcap_file import McapFile
from services.recorder.io.parts import free_part, part_path
from services.runtime.config.disk import reason, require_room
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack

RESERVE = 256_000  # [bytes] left free for the report and for the end of the file
RETRY_NS = 5_000_000_000  # [ns] between two attempts to record again


class CannotRecordError(LindyError):
    """The disk does not take a recording."""


class RecordingCheckpoint(msgspec.Struct):
    """Checkpoint: how many parts this dive has."""

    parts: int = 0


class SessionNode(Protocol):
    """What the session needs of the service's node: counters, log and checkpoints."""

    counts: Counter[str]
    wall_offset_ns: int  # [ns] UTC minus the clock of stamps

    def count(self, name: str, times: int = 1) -> None: ...
    def log(self, level: Literal["info", "warning", "error"], text: str) -> None: ...
    def restore_checkpoint(self, kind: type[RecordingCheckpoint]) -> RecordingCheckpoint | None: ...
    def save_checkpoint(self, what: RecordingCheckpoint) -> None: ...


class McapSession:
    """Writes the rows of one dive, part after part."""

    def __init__(self, node: SessionNode, stack: Stack) -> None:
        """Open the next part of this dive.

        Raises:
            CannotRecordError: the folder or the file cannot be written.
        """
        self._node = node
        self._stack = stack
        self._vehicle_file = stack.vehicle_path.read_bytes()
        self._file: McapFile | None = None
        self._interrupted = False  # the log says that recording has stopped
        self._retry_at = 0  # [ns]
        self._opened = node.restore_checkpoint(RecordingCheckpoint) or RecordingCheckpoint()
        path = part_path(stack.out_dir, self._opened.parts + 1)
        try:
            stack.out_dir.mkdir(parents=True, exist_ok=True)
            self._open()
        except OSError as error:
            if self._opened.parts == 0:  # the dive begins: the user can correct it
                sentence = f"cannot write the recording {path}: {reason(error)}"
                raise CannotRecordError(sentence) from None
            self._stopped(path, error)  # started again in mid-dive

    def write(self, row: RecordedRow) -> None:
        """Add a row, or count it as not recorded while there is no file."""
        if self._file is None:
            self._node.count("not_recorded")
            return
        try:
            if not self._file.has_channel(row.key):
                kind = row.topic.message
                self._file.open_channel(row.key, kind.__name__, foxglove_schema(kind))
            self._file.write(row.key, row.data, row.log_ns, row.publish_ns, row.sequence)
        except OSError as error:
            self._fail(self._file, error)

    def flush(self, now: int) -> None:
        """Flush, so that the rows survive a crash of this process; or try a new part."""
        if self._file is None:
            if now >= self._retry_at:
                self._retry_at = now + RETRY_NS
                self._try_again()
            return
        try:
            require_room(self._stack.out_dir, RESERVE)
            self._file.flush()
        except OSError as error:
            self._retry_at = now + RETRY_NS
            self._fail(self._file, error)
            return
        if self._interrupted and self._file.flushed > 0:
            self._interrupted = False
            self._node.log("info", f"recording continues in {self._file.path}")

    def close(self, log_hash: str) -> None:
        """Write the counts of losses, the hash and the index."""
        if self._file is None:
            return
        try:
            self._file.flush()
            losses = {name: str(count) for name, count in sorted(self._node.counts.items())}
            self._file.metadata("losses", losses)
            self._file.metadata("hash", {"sha256": log_hash})
            self._file.finish()
        except OSError as error:
            self._fail(self._file, error)

    def _open(self) -> None:
        require_room(self._stack.out_dir, RESERVE)
        number = free_part(self._stack.out_dir, self._opened.parts + 1)
        file = McapFile(part_path(self._stack.out_dir, number))
        try:
            self._preface(file)
            file.flush()
            self._node.save_checkpoint(RecordingCheckpoint(number))
        except OSError:
            file.discard()
            raise
        self._opened = RecordingCheckpoint(number)
        self._file = file

    def _preface(self, file: McapFile) -> None:
        """Metadata that a reader needs before the first message."""
        stack = self._stack
        file.metadata("dive", about(stack))
        clock = {
            "utc_minus_stamp_ns": str(self._node.wall_offset_ns),
            "publish_time": "the stamp by this clock; the arrival where the stamp is of another "
            "machine's clock and the difference is not known",
        }
        file.metadata("clock", clock)
        file.attach(stack.vehicle_path.name, "application/toml", self._vehicle_file)
        file.attach("topics.json", "application/json", _topic_table())

    def _fail(self, file: McapFile, error: OSError) -> None:
        if file.flushed > 0:
            file.abandon()
        else:  # nothing in it: the next attempt can use its name
            file.discard()
            self._opened = RecordingCheckpoint(self._opened.parts - 1)
        self._file = None
        self._node.count("not_recorded", file.unflushed)
        self._stopped(file.path, error)

    def _stopped(self, path: Path, error: OSError) -> None:
        self._node.count("disk_error")
        if not self._interrupted:
            self._interrupted = True
            self._node.log(
                "error",
                f"recording stopped: cannot write {path}: {reason(error)}; "
                f"trying again every {RETRY_NS // 10**9} s",
            )

    def _try_again(self) -> None:
        try:
            self._open()
        except OSError:
            self._node.count("disk_error")


def about(stack: Stack) -> dict[str, str]:
    """What a recording says of its dive."""
    return {
        "vehicle": stack.vehicle_name,
        "drone": stack.drone_name,
        "link": stack.link,
        "pilot": stack.pilot,
        "seed": str(stack.seed),
        "overrides": json.dumps(stack.overrides),
    }


def _topic_table() -> bytes:
    rows = [
        {
            "key": topic.key,
            "type": topic.message.__name__,
            "hz": topic.hz,
            "qos": topic.qos.value,
            "way": topic.way.value,
        }
        for topic in topics.ALL
    ]
    return json.dumps(rows, indent=1).encode()
