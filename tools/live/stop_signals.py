"""Ctrl-C, SIGTERM, a closed terminal: they end a dive cleanly, and its report is written whole."""

import atexit
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType

from services.runtime.os import system
from tools.exit_status import INTERRUPTED

PRESSED = (signal.SIGINT, signal.SIGTERM)
SIGNALS = (*PRESSED, *system.HANG_UP)
APART_S = 0.5  # [s] signals that come closer are one: `uv run` hands on what also came by itself
HANGS_S = 2.0  # [s] a dive in this process that has not ended by then hangs
SURE_S = 10.0  # [s] for which the question whether an armed drone is to be left stands
WRITING = "the report is being written; once more, and it is broken off"


class StopSignals:
    """Active inside its `with` block.

    The first signal asks for the dive's end, and further ones change nothing; of a dive in this
    process, one that comes `HANGS_S` later ends it at once: code of the user's may hang. While the
    report is being written, one is answered with a sentence, and the next one breaks it off.

    Ctrl-C at a terminal while the pilot here has an armed drone only asks: it is easily pressed.

    Attributes:
        armed: what ends with the dive, such as `armed at 2.0 m`; empty: nothing is armed.
        question: to be shown to the user, who takes it away; empty: none.
    """

    def __init__(
        self, clock: Callable[[], float] = time.monotonic, *, in_process: bool = False
    ) -> None:
        """`in_process`: the dive is flown by this process itself."""
        self.asked = False
        self.armed: Callable[[], str] = str
        self.question = ""
        self._sure_s: float | None = None  # [s] when the question was asked
        self._in_process, self._asked_s = in_process, 0.0
        self._again = False  # asked more than once
        self._reporting = False
        self._told_s: float | None = None  # [s] when a signal was answered
        self._clock = clock

    def __enter__(self) -> "StopSignals":
        self._terminal = [output for output in (1, 2) if os.isatty(output)]  # asked while it is one
        self._before = {number: signal.signal(number, self._ask) for number in PRESSED}
        for number in system.HANG_UP:
            if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup leaves it
                self._before[number] = signal.signal(number, self._hang_up)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def report(self, write: Callable[[], int], kept: str = "the recording is whole") -> int:
        """Write the report of a dive that is over. Returns the exit status of `write`, or
        `INTERRUPTED`.

        Args:
            kept: what is left if the report is broken off.
        """
        self._reporting = True
        if self._again:  # answered only now: during the dive a screen may be in the way
            self._tell()
        try:
            status = write()
            self._reporting = False  # everything is written: nothing is left to break off
        except BrokenOffError:
            print(f"lindy: the report was broken off; {kept}", file=sys.stderr, flush=True)
            return INTERRUPTED
        finally:
            self._reporting = False
            atexit.register(_ignore)  # the program is about to end with the status of the dive
        return status

    def _ask(self, number: int, *_: object) -> None:
        now = self._clock()
        if not self.asked and number == signal.SIGINT and self._only_asks(now):
            return
        if not self.asked:
            self._asked_s = now
        self._again, self.asked = self.asked, True
        if not self._reporting:
            if self._in_process and now - self._asked_s >= HANGS_S:
                raise KeyboardInterrupt
            return
        if self._told_s is None:
            self._tell()
        elif now - self._told_s >= APART_S:
            self._reporting = False  # broken off once only
            raise BrokenOffError

    def _only_asks(self, now: float) -> bool:
        what = "" if self._reporting or not self._terminal else self.armed()
        since_s = None if self._sure_s is None else now - self._sure_s
        if not what or (since_s is not None and APART_S <= since_s <= SURE_S):
            return False
        if since_s is None or since_s > SURE_S:
            self._sure_s, self.question = now, f"{what}: Ctrl-C again to disarm and end"
        return True

    def _hang_up(self, *_: object) -> None:
        """Nobody can read any more, and every print would fail. A report is not broken off by it:
        nobody has pressed anything."""
        self.asked = True
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for output in self._terminal:
            os.dup2(nowhere, output)
        os.close(nowhere)

    def _tell(self) -> None:
        self._told_s = self._clock()
        with suppress(OSError):  # a signal may come in the middle of a print: not through a buffer
            os.write(2, f"lindy: {WRITING}\n".encode())


def _ignore() -> None:
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


class BrokenOffError(BaseException):
    """Not an `Exception`: what catches any failure of a report must not catch this."""
