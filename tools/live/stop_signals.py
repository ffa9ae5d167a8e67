"""Ctrl-C, SIGTERM, a closed terminal: they end a dive cleanly, and its report is written whole."""

import atexit
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress

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
        self._clock, self._sure_s = clock, -SURE_S  # [s] when the question was asked
        # [s] after the first one, another one ends at once what goes on; None: none does.
        self._patience_s = HANGS_S if in_process else None
        self._first_s: float | None = None  # [s] when the first one came
        self._again = False  # another one came, and was not answered
        self._reporting = False

    def __enter__(self) -> "StopSignals":
        self._terminal = [output for output in (1, 2) if os.isatty(output)]  # asked while it is one
        self._before = {number: signal.signal(number, self._ask) for number in PRESSED}
        for number in system.HANG_UP:
            if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup leaves it
                self._before[number] = signal.signal(number, self._hang_up)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def report(self, write: Callable[[], int], kept: str = "the recording is whole") -> int:
        """Write the report of a dive that is over. Returns the exit status of `write`, or
        `INTERRUPTED`.

        Args:
            kept: what is left if the report is broken off.
        """
        self._first_s, self._patience_s, self._reporting = None, APART_S, True
        if self._again:  # answered only now: during the dive a screen may be in the way
            self._answer(self._clock())
        try:
            return write()
        except KeyboardInterrupt:
            print(f"lindy: the report was broken off; {kept}", file=sys.stderr, flush=True)
            return INTERRUPTED
        finally:
            self._patience_s, self._reporting = None, False  # nothing is left to break off
            atexit.register(_ignore)  # the program is about to end with the status of the dive

    def _ask(self, number: int, *_: object) -> None:
        now = self._clock()
        if not self.asked and number == signal.SIGINT and self._only_asks(now):
            return
        self.asked = True
        if self._first_s is None:
            self._answer(now)
        elif self._patience_s is not None and now - self._first_s >= self._patience_s:
            self._patience_s = None  # broken off once only
            raise KeyboardInterrupt
        else:
            self._again = True

    def _answer(self, now: float) -> None:
        """The first one, of the dive or of its report."""
        self._first_s = now
        if self._reporting:
            with suppress(OSError):  # in the middle of a print: not through a buffer
                os.write(2, f"lindy: {WRITING}\n".encode())

    def _only_asks(self, now: float) -> bool:
        what = "" if self._reporting or not self._terminal else self.armed()
        if not what or APART_S <= now - self._sure_s <= SURE_S:
            return False
        if now - self._sure_s > SURE_S:
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


def _ignore() -> None:
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
