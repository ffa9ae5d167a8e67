"""Reads a recording as typed messages, also after a crash.

Every file is read from its beginning, chunk by chunk, so a file without an index (the recorder
was killed) reads like any other: up to its last whole chunk. A damaged chunk is left out, and
`Recording.damage` says so. Messages come in the order of their
arrival at the recorder, which is the order of `log_ns`.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, NamedTuple
from weakref import finalize

import msgspec
from mcap.records import Attachment, Channel, Metadata

from messages import topics
from messages.message import Message
from messages.payload import UNDECODABLE
from messages.topic import AnyTopic
from services.recorder.foxglove.channel import is_view
from services.recorder.io.mcap_file import MAGIC
from services.recorder.io.parts import FIRST, parts_in
from services.runtime.config.disk import reason, require_room
from services.runtime.config.errors import LindyError
from tools.recordings.mcap_copy import McapCopy, new_mcap
from tools.recordings.mcap_records import (
    ALWAYS,
    HASH,
    MERGED,
    Damage,
    Described,
    Raw,
    Span,
    Wants,
    always,
    index_of,
    nowhere,
    records_in,
)

COUNT = re.compile(r"[0-9]{1,16}")  # what a recorder writes; anybody may have altered it
RESERVE = 256_000  # [bytes] left free by merging, for the report


Decoding = Callable[[bytes], Message | None]


class RecordedMessage(NamedTuple):
    """A message of a recording."""

    key: str
    message: Message
    log_ns: int  # [ns] UTC of arrival
    publish_ns: int  # [ns] UTC of the message's own stamp; of arrival if of an unknown clock


class Recording:
    """One dive: its messages, metadata and attachments. Iterating gives every `RecordedMessage`."""

    def __init__(self, files: list[Path]) -> None:
        self.files = files
        self.unreadable: Counter[str] = Counter()  # messages skipped so far, by key
        self.advance: Callable[[int], None] = nowhere  # told how many bytes of `size` were read
        self._streams: dict[Path, BinaryIO] = {}  # open for as long as this is: each is read often
        finalize(self, _close, self._streams)
        self._read: dict[Path, Damage] = {}  # of the files that were read to their ends
        self._described: list[Metadata | Attachment] | None = None
        self._decoding: dict[str, Decoding] = {}

    def __iter__(self) -> Iterator[RecordedMessage]:
        return self._typed(self.raw())

    def of(self, *wanted: AnyTopic) -> Iterator[RecordedMessage]:
        """The messages of these topics, or families of topics."""
        return self._typed(self.raw(lambda key: any(topic.covers(key) for topic in wanted)))

    def _typed(self, rows: Iterable[Raw]) -> Iterator[RecordedMessage]:
        for raw in rows:
            if (message := self.decode(raw)) is not None:
                yield RecordedMessage(raw.key, message, raw.log_ns, raw.publish_ns)

    def raw(self, wants: Wants = always, within: Span = ALWAYS) -> Iterator[Raw]:
        """Every message, not decoded. What is recorded for Foxglove is computed from these, and
        left out.

        Args:
            wants: which keys; the messages of others are passed over.
            within: as `mcap_records.records` takes it.
        """

        def wanted(key: str) -> bool:
            return not is_view(key) and wants(key)

        for path in self.files:
            for record in self.records(path, wanted, within):
                if isinstance(record, Raw) and record.key:
                    yield record

    def records(
        self, path: Path, wants: Wants = always, within: Span = ALWAYS
    ) -> Iterator[Raw | Described]:
        """Everything in one of its files, as `mcap_records.records` gives it. `damage` knows what
        is wrong with it at the end."""
        before = sum(file.stat().st_size for file in self.files[: self.files.index(path)])
        damage, advance = Damage(), self.advance

        def at(position: int) -> None:
            advance(before + position)

        stream = self.opened(path)
        yield from records_in(stream, at=at, damage=damage, wants=wants, within=within)
        self._read[path] = damage

    def opened(self, path: Path) -> BinaryIO:
        """One of its files; to be read from wherever one seeks."""
        if path not in self._streams:
            self._streams[path] = path.open("rb")
        return self._streams[path]

    def close(self) -> None:
        """So that its files can be moved on every system; they are opened again where needed."""
        _close(self._streams)

    def copy(
        self,
        path: Path,
        to: McapCopy,
        but: Sequence[str] = (HASH,),
        wants: Wants = always,
        within: Span = ALWAYS,
    ) -> int:
        """Copy one of its files; how many messages there are in the copy.

        Args:
            but: names of metadata that are left out; the hash is that of the whole.
        """
        before = to.messages
        to.next_file()
        begin, end = within
        for record in self.records(path, wants, within):
            if isinstance(record, Raw):
                is_in = begin <= record.log_ns < end
            else:
                is_in = not (isinstance(record, Metadata) and record.name in but)
            if is_in:
                to.add(record)
        return to.messages - before

    @property
    def damage(self) -> list[str]:
        """What is wrong with the files that were read to their ends, one sentence each."""
        return [said for path, found in self._read.items() for said in found.in_words(path.name)]

    def require_messages(self) -> None:
        """
        Raises:
            LindyError: it holds none, and what is wrong with it.
        """
        if next(self.raw(), None) is None:
            raise self.empty(self.files[0])

    def empty(self, path: Path) -> LindyError:
        """That it holds no messages, and what is wrong with it.

        Args:
            path: as the user has named it.
        """
        return LindyError("; ".join([f"{path} holds no messages", *self.damage]))

    @property
    def size(self) -> int:
        """[bytes] of all files."""
        return sum(path.stat().st_size for path in self.files)

    def decode(self, raw: Raw) -> Message | None:
        """The typed message, or None, counted, when this version of Lindy cannot read it."""
        if (decoding := self._decoding.get(raw.key)) is None:
            topic = topics.find(raw.key)
            decoding = self._decoding[raw.key] = self.decoding(raw.key, topic and topic.message)
        return decoding(raw.data)

    def decoding(self, key: str, kind: type[Message] | None) -> "Decoding":
        """What `decode` does with the messages of a key.

        Args:
            kind: what to make of them; None: this version of Lindy does not know the key.
        """
        decode, unreadable = kind and msgspec.json.Decoder(kind).decode, self.unreadable

        def decoding(data: bytes) -> Message | None:
            if decode is not None:
                try:
                    return decode(data)
                except UNDECODABLE:
                    pass
            unreadable[key] += 1
            return None

        return decoding

    def origin_ns(self) -> int | None:
        """[ns] UTC from which the seconds of a recording count: its first message, or, where it was
        cut out of another, that of the whole. None: it holds no message."""
        whole = self.metadata("cut").get("origin_ns")
        if whole is not None and COUNT.fullmatch(whole[-16:]) and len(whole) <= 19:
            return int(whole)
        first = next(self.raw(), None)
        return None if first is None else first.log_ns

    def keys(self) -> set[str]:
        """Of its messages: from the summaries, or where there is none, by reading all of it."""
        found: set[str] = set()
        for path in self.files:
            stream = self.opened(path)
            described = index_of(stream, path.stat().st_size).described
            for record in described or records_in(stream, wants=lambda _: False):
                if isinstance(record, Channel) and not is_view(record.topic):
                    found.add(record.topic)
        return found

    def metadata(self, name: str) -> dict[str, str]:
        """Keys and values of all metadata records of that name; the last value counts."""
        found: dict[str, str] = {}
        for entries in self._entries(name):
            found |= entries
        return found

    def losses(self) -> Counter[str]:
        """What the recorder itself counted, summed over its restarts. A killed recorder leaves
        no count."""
        losses: Counter[str] = Counter()
        for entries in self._entries("losses"):
            losses.update({n: int(c) for n, c in entries.items() if COUNT.fullmatch(c)})
        return losses

    def _entries(self, name: str) -> Iterator[dict[str, str]]:
        found = (each for each in self.described() if isinstance(each, Metadata))
        return (each.metadata for each in found if each.name == name)

    def attachment(self, name: str) -> bytes | None:
        """An attached file, such as `topics.json`."""
        return next((a.data for a in self.attachments() if a.name == name), None)

    def attachments(self) -> Iterator[Attachment]:
        """All attached files. Every part of a dive carries the same ones."""
        return (record for record in self.described() if isinstance(record, Attachment))

    def described(self) -> list[Metadata | Attachment]:
        """Everything in the files that is not a message. Read once."""
        if self._described is None:
            self._described = [
                record
                for path in self.files
                for record in records_in(self.opened(path), open_chunks=False)
                if isinstance(record, Metadata | Attachment)
            ]
        return self._described


def open_recording(place: Path | str) -> Recording:
    """The recording in a dive's folder, or in one file.

    Raises:
        LindyError: there is none, it cannot be read, or it is not an MCAP file.
    """
    path = Path(place)
    try:
        files = parts_in(path) if path.is_dir() else [path]
        if not files:
            near = path / "latest"
            meant = f"; did you mean {near}?" if near.exists() else ""
            raise LindyError(f"there is no recording in {path}{meant}")
        recording = Recording(files)
        for file in files:
            if not MAGIC.startswith(recording.opened(file).read(len(MAGIC))):
                raise LindyError(f"{file} is not a recording: it does not begin as MCAP files do")
    except OSError as error:
        raise LindyError(f"cannot read {error.filename or path}: {error.strerror}") from None
    return recording


def _close(streams: dict[Path, BinaryIO]) -> None:
    for stream in streams.values():
        stream.close()
    streams.clear()


def log_hash(path: Path) -> str | None:
    """SHA-256 over everything recorded, in order, as the recorder wrote it at the end of the dive.
    None when it did not end cleanly or was interrupted.

    Raises:
        LindyError: as `open_recording`.
    """
    recording = open_recording(path)
    return recording.metadata(HASH).get("sha256") if len(recording.files) == 1 else None


def merge_parts(folder: Path) -> bool:
    """After a dive: make one complete `dive.mcap` of several parts, or of one without an end.

    Whole chunks and metadata are kept, except the hash, which no longer applies. A metadata record
    `merged` has the number of messages of each part. All parts belong to this dive, because it
    began in a folder without a dive.

    Returns:
        False when there was nothing to do.

    Raises:
        LindyError: as `open_recording`, or the folder cannot be written.
    """
    recording = open_recording(folder)
    parts = recording.files
    if len(parts) == 1 and is_whole(parts[0]):
        return False
    try:
        require_room(folder, sum(part.stat().st_size for part in parts) + RESERVE)
        with new_mcap(folder / "merging.mcap") as copy:
            merged = {part.name: str(recording.copy(part, copy)) for part in parts}
            copy.metadata(Metadata(MERGED, merged))
        recording.close()
        whole = folder / FIRST
        (folder / "merging.mcap").replace(whole)
        for part in parts:
            if part != whole:
                part.unlink()
    except OSError as error:
        raise LindyError(f"cannot merge the recording in {folder}: {reason(error)}") from None
    return True


def is_whole(path: Path) -> bool:
    """Was the file finished, so that any MCAP reader can open it?"""
    data_end = len(MAGIC)
    with path.open("rb") as stream:
        if path.stat().st_size < 2 * data_end:
            return False
        stream.seek(-data_end, 2)
        return stream.read() == MAGIC
