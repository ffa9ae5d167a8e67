"""Records a dive to MCAP files, part after part, and survives disk errors.

At the start of a dive, a disk that cannot be written is an error the user can correct, and stops
the service with one sentence. During a dive it must not affect anything else: the recording stops
with one log line, everything not written is counted, and every few seconds a new part is tried. A
new one, because the old one was truncated and ended after its last flush.

Every part is a complete file with the attachments and schemas, and can be read alone.

Existing files are never written to.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec

from messages import events, topics
from messages.link import Clock
from messages.video import FilmAnswer, FilmRequest
from services.recorder.core import RecordedRow
from services.recorder.io.attachments import AttachedFile, attachments
from services.recorder.io.mcap_file import McapFile
from services.recorder.io.parts import free_part, part_path
from services.runtime.config.disk import reason, require_room
from services.runtime.config.errors import LindyError
from services.runtime.config.passwords import without_passwords
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

RESERVE = 256_000  # [bytes] left free for the report and for the end of the file
RETRY_NS = 5_000_000_000  # [ns] between two attempts to record again


class CannotRecordError(LindyError):
    """The disk does not take a recording."""


class RecordingCheckpoint(msgspec.Struct):
    """Checkpoint: how many parts this dive has."""

    parts: int = 0
    # [ns] UTC minus the clock of stamps when the dive began. All of its parts count by that, also
    # where the computer has learnt the time of day meanwhile, as one without a clock battery does.
    utc_minus_stamp_ns: int | None = None


class McapSession:
    """Writes the rows of one dive, part after part."""

    def __init__(
        self,
        node: Node,
        stack: Stack,
        attached: Sequence[AttachedFile] | None = None,
        described: Mapping[str, str] | None = None,
    ) -> None:
        """Open the next part of this dive.

        Args:
            attached: the files that it was started with; None: those of `stack`.
            described: what the file says of the dive otherwise than `stack`.

        Raises:
            CannotRecordError: the folder or the file cannot be written.
        """
        self._node = node
        self._stack = stack
        self._attachments = attachments(stack) if attached is None else attached
        self._described = {**(described or {})}
        self._clock = b""  # newest message of the link monitor, as JSON
        self._file: McapFile | None = None
        self._interrupted = False  # the log says that recording has stopped
        self._retry_at = 0  # [ns]
        self._gaps = False  # the disk failed for a while
        self._opened = node.restore_checkpoint(RecordingCheckpoint) or RecordingCheckpoint()
        if self._opened.utc_minus_stamp_ns is not None:
            node.wall_offset_ns = self._opened.utc_minus_stamp_ns
        path = part_path(stack.out_dir, self._opened.parts + 1)
        try:
            stack.out_dir.mkdir(parents=True, exist_ok=True)
            self._open()
        except OSError as error:
            if self._opened.parts == 0:  # the dive begins: the user can correct it
                sentence = f"cannot write the recording {path}: {reason(error)}"
                raise CannotRecordError(sentence) from None
            self._stopped(path, error)  # started again in mid-dive

    def films(self, request: FilmRequest, now: int) -> FilmAnswer:
        """The pilot films: is there a file for it?"""
        why = "" if self._file is not None else "the disk has failed: nothing is recorded"
        return FilmAnswer(stamp_ns=now, id=request.id, accepted=not why, reason=why)

    def write(self, row: RecordedRow) -> None:
        """Add a row, or count it as not recorded while there is no file."""
        file = self._file
        key, schema, data, log_ns, publish_ns, sequence, is_view = row
        if file is None:
            if not is_view:
                self._node.outbox.tell(events.NOT_RECORDED())
            return
        try:
            if not file.has_channel(key):
                file.open_channel(key, *schema)
            file.write(key, data, log_ns, publish_ns, sequence, is_view=is_view)
            if key == topics.CLOCK.key:
                self._clock = data
        except OSError as error:
            self._fail(file, error)

    def flush(self, now: int) -> None:
        """Flush, so that the rows survive a crash of this process; or try a new part."""
        if self._file is None:
            if now >= self._retry_at:
                self._retry_at = now + RETRY_NS
                try:
                    self._open()
                except OSError:
                    self._node.outbox.tell(events.DISK_ERROR())
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
            counts = self._node.outbox.counts  # of what this part lost
            losses = {name: str(counts[name]) for name in sorted(counts) if counts[name]}
            self._file.metadata("losses", losses)
            if self._clock:
                self._file.metadata("clock_offset", _clock_offset(self._clock))
            if not self._gaps:  # it is the hash of everything that was heard
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
            self._opened = RecordingCheckpoint(number, self._node.wall_offset_ns)
            self._node.save_checkpoint(self._opened)
        except OSError:
            file.discard()
            raise
        self._file = file

    def _preface(self, file: McapFile) -> None:
        """Metadata that a reader needs before the first message."""
        stack = self._stack
        side = {"side": next(iter(self._node.sides))}  # of which everything is recorded
        file.metadata("dive", about(stack) | side | self._described)
        clock = {
            "utc_minus_stamp_ns": str(self._node.wall_offset_ns),
            "publish_time": "the stamp by this clock; the arrival where the stamp is of another "
            "machine's clock and the difference is not known",
        }
        file.metadata("clock", clock)
        log_ns = self._node.now() + self._node.wall_offset_ns
        for each in self._attachments:
            file.attach(each.name, each.media_type, each.data, log_ns, each.create_ns)
        file.attach("topics.json", "application/json", _topic_table(), log_ns, log_ns)

    def _fail(self, file: McapFile, error: OSError) -> None:
        if file.flushed > 0:
            file.abandon()
        else:  # nothing in it: the next attempt can use its name
            file.discard()
            self._opened = msgspec.structs.replace(self._opened, parts=self._opened.parts - 1)
        self._file = None
        self._node.outbox.tell(events.NOT_RECORDED(), file.unflushed)
        self._stopped(file.path, error)

    def _stopped(self, path: Path, error: OSError) -> None:
        self._gaps = True
        self._node.outbox.tell(events.DISK_ERROR())
        if not self._interrupted:
            self._interrupted = True
            self._node.log(
                "error",
                f"recording stopped: cannot write {path}: {reason(error)}; "
                f"trying again every {RETRY_NS // 10**9} s",
            )


def about(stack: Stack) -> dict[str, str]:
    """What a recording says of its dive."""
    return {
        "vehicle": stack.vehicle_name,
        "drone": stack.drone_name,
        "link": stack.link,
        "pilot": stack.pilot,
        "seed": str(stack.seed),
        "overrides": json.dumps([*map(without_passwords, stack.overrides)]),
    }


def _clock_offset(newest: bytes) -> dict[str, str]:
    """What was known at the end of the drone's clock minus the topside's, with its greatest error;
    empty: not known."""
    clock = msgspec.json.decode(newest, type=Clock)
    known = {
        "offset_ns": clock.offset_ns,
        "bound_ns": clock.bound_ns,
        "drift_ppm": clock.drift_ppm,
    }
    return {name: "" if value is None else str(value) for name, value in known.items()}


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
