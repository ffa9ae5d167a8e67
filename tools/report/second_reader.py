"""A long recording is read by two processes: the second one gathers the streams that cost most, as
much as all others together, and hands their rows over, a block at a time."""

import signal
from collections import Counter
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Thread
from typing import NamedTuple

from messages import topics
from services.runtime.os import system
from tools.recordings.mcap_records import Noticed
from tools.recordings.recording import Recording
from tools.report.columns import WANTED, Gathering, RowBlocks, StreamColumns, StreamFigures

LONG = 50_000_000  # [bytes] eight minutes of a dive; a shorter one is read before a process starts
# All of the drone's clock, so that no stamp of them is converted.
COSTLY = (topics.STATE, topics.ACTUATION, topics.TRUTH, topics.THRUSTERS)
THEIRS: Mapping[str, StreamFigures] = {
    wanted.topic.key: wanted for wanted in WANTED if wanted.topic in COSTLY
}
SPAWN = get_context("spawn")


class SecondHalf(NamedTuple):
    """By the second process."""

    streams: Mapping[str, StreamColumns]  # by key
    unreadable: Mapping[str, int]  # messages that this version of Lindy cannot read, by key


NOTHING = SecondHalf({}, {})


class SecondReader:
    """The streams of a recording that another process reads."""

    keys = frozenset(THEIRS)

    def __init__(self, files: Sequence[Path]) -> None:
        """
        Raises:
            OSError: no process can be started.
        """
        self._blocks = {key: RowBlocks(len(wanted.names)) for key, wanted in THEIRS.items()}
        self._unreadable: Counter[str] | None = None
        rows, sending = SPAWN.Pipe(duplex=False)
        self._process = SPAWN.Process(target=_read, args=(files, sending), daemon=True)
        let_go = system.hold_back([signal.SIGINT])  # a terminal sends it to all processes
        try:
            self._process.start()
        finally:
            let_go()
            sending.close()
        self._taking = Thread(target=self._take, args=(rows,), daemon=True)
        self._taking.start()

    def found(self) -> SecondHalf | None:
        """Once it has read all. None: it ended before that, as when it is killed."""
        self._taking.join()
        if self._unreadable is None:
            return None
        streams = {
            key: StreamColumns(THEIRS[key].names, blocks) for key, blocks in self._blocks.items()
        }
        return SecondHalf(streams, self._unreadable)

    def end(self) -> None:
        self._process.kill()
        self._process.join()

    def _take(self, rows: Connection) -> None:
        with rows, suppress(EOFError, OSError):
            while not isinstance(said := rows.recv(), Counter):
                key, block = said
                self._blocks[key].add_bytes(block)
            self._unreadable = said


@contextmanager
def second_reader(recording: Recording) -> Generator[SecondReader | None]:
    """None: it would not save time, because the recording is short, or this process has one core;
    or there is no room for another process."""
    reader = None
    if recording.size >= LONG and system.cores() > 1 and parent_process() is None:
        with suppress(OSError, RuntimeError):  # the latter for want of a thread
            reader = SecondReader(recording.files)
    try:
        yield reader
    finally:
        if reader is not None:
            reader.end()


def _read(files: list[Path], sending: Connection) -> None:
    """In the second process: ends without a word where the first one will meet the same error."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    recording = Recording(files)
    gatherings = {
        key: Gathering(
            wanted.names, wanted.figures, put=lambda rows, key=key: sending.send((key, rows))
        )
        for key, wanted in THEIRS.items()
    }

    def noticing(key: str) -> Noticed | None:
        if (gathering := gatherings.get(key)) is None:
            return None
        decode, add = recording.decoding(key, THEIRS[key].message), gathering.add

        def see(_sequence: int, _log_ns: int, _publish_ns: int, data: bytes) -> None:
            if (message := decode(data)) is not None:
                add(message)

        return see

    with suppress(OSError):
        for _ in recording.raw(lambda _: False, noticing):
            pass
        for gathering in gatherings.values():
            gathering.put()
        sending.send(recording.unreadable)
