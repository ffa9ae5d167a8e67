"""Keys and a status line of a replay, where there is a terminal."""

import sys
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from typing import Literal

from services.runtime.os import system

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

    def __init__(self, read: Callable[[float], bytes | None] | None, *, shows: bool) -> None:
        """
        Args:
            read: waits for keys, as `system.keys_of` makes it; None: there are none.
            shows: is stdout a terminal?
        """
        self._read, self._shows = read, shows

    @property
    def interactive(self) -> bool:
        return self._read is not None

    def wait(self, seconds: float) -> Sequence[Key]:
        """Wait for keys, at most so long."""
        if self._read is None:
            time.sleep(max(0.0, seconds))
            return []
        typed = self._read(max(0.0, seconds))
        if typed == b"":  # it was closed
            self._read = None
        return keys_in(typed or b"")

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
    with system.keys_of(sys.stdin.fileno()) as read:
        yield Terminal(read, shows=shows)
