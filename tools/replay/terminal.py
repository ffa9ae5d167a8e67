"""Keys and a status line of a replay, where there is a terminal."""

import os
import select
import sys
import termios
import tty
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from typing import Literal

Key = Literal["pause", "back", "on", "back_far", "on_far", "quit"]
KEYS: dict[bytes, Key] = {
    b" ": "pause",
    b"\x1b[D": "back",
    b"\x1b[C": "on",
    b"\x1b[B": "back_far",
    b"\x1b[A": "on_far",
    b"\x1bOD": "back",
    b"\x1bOC": "on",
    b"\x1bOB": "back_far",
    b"\x1bOA": "on_far",
    b"q": "quit",
}
HELP = "space: pause, arrows: 5 s and 30 s, q: end"
CLEAR = "\r\x1b[K"  # the whole line


def keys_in(typed: bytes) -> list[Key]:
    """The keys that were pressed; what means nothing is passed over."""
    found: list[Key] = []
    while typed:
        key = next((code for code in KEYS if typed.startswith(code)), None)
        if key is not None:
            found.append(KEYS[key])
        typed = typed[len(key or b"x") :]
    return found


class Terminal:
    """Made by `terminal`."""

    def __init__(self, stdin: int | None, *, shows: bool) -> None:
        """
        Args:
            stdin: descriptor on which keys come one by one; None: there are none.
            shows: is stdout a terminal?
        """
        self._stdin, self._shows = stdin, shows

    @property
    def interactive(self) -> bool:
        return self._stdin is not None

    def wait(self, seconds: float) -> Sequence[Key]:
        """Wait for keys, at most so long."""
        if self._stdin is None:
            select.select([], [], [], max(0.0, seconds))
            return []
        ready, _, _ = select.select([self._stdin], [], [], max(0.0, seconds))
        if not ready:
            return []
        typed = os.read(self._stdin, 64)
        if not typed:  # it was closed
            self._stdin = None
        return keys_in(typed)

    def status(self, line: str) -> None:
        if self._shows:
            print(f"{CLEAR}{line}", end="", flush=True)

    def end(self) -> None:
        if self._shows:
            print(flush=True)


@contextmanager
def terminal() -> Generator[Terminal]:
    """Keys are read one by one until the end, then the terminal is as it was before."""
    shows = sys.stdout.isatty()
    if not sys.stdin.isatty():
        yield Terminal(None, shows=shows)
        return
    stdin = sys.stdin.fileno()
    before = termios.tcgetattr(stdin)
    try:
        tty.setcbreak(stdin)  # Ctrl-C is still a signal
        yield Terminal(stdin, shows=shows)
    finally:
        termios.tcsetattr(stdin, termios.TCSADRAIN, before)
