"""Damaged inputs against everything that reads from outside, for a time:

    python -m tests.long.fuzz [SECONDS] [TARGET …]

Each target (tests/fuzz/targets.py) has its share of the time. What breaks its law is made small,
written into `.fuzz/`, and printed; the exit status is then 1. Mend it, then move
the file into the corpus and give it a line in its README.md.
"""

import sys
import traceback
from hashlib import sha256
from pathlib import Path
from random import SystemRandom
from time import monotonic

from hypothesis import HealthCheck, Phase, given, seed, settings

from tests.fuzz.mutations import mutated
from tests.fuzz.targets import TARGETS, Target, TooMuch, obey

SECONDS = 240.0
ROUND = 200  # inputs between two looks at the time
SMALLEST_S = 60.0  # [s] to make one small
FOUND = Path(".fuzz")


class Searched:
    """A target for a time."""

    def __init__(self, target: Target) -> None:
        self._target, self._inputs = target, tuple(target.corpus().values())
        self._found: tuple[bytes, BaseException] | None = None
        self.tried = 0

    def find(self, until: float) -> tuple[bytes, BaseException] | None:
        """A small input that breaks the law, and how; None: none was found."""
        while monotonic() < until and self._found is None:
            self._round(until)
        return self._found and self._smallest(*self._found)

    def _round(self, until: float) -> None:
        @seed(SystemRandom().getrandbits(64))
        @settings(
            max_examples=ROUND, database=None, deadline=None, derandomize=False,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),  # pyright: ignore[reportArgumentType]
        )  # fmt: skip
        @given(mutated(self._inputs))
        def law(data: bytes) -> None:
            if self._found is None and monotonic() < until:
                self.tried += 1
                if (error := self._broken(data)) is not None:
                    self._found = data, error

        law()

    def _broken(self, data: bytes) -> BaseException | None:
        try:
            obey(self._target, data)
        except (Exception, TooMuch) as error:
            return error
        return None

    def _smallest(self, data: bytes, error: BaseException) -> tuple[bytes, BaseException]:
        """Without the bytes that it does not need to break at the same place."""
        until, size = monotonic() + SMALLEST_S, max(1, len(data) // 2)
        while size and monotonic() < until:
            at = 0
            while at < len(data) and monotonic() < until:
                shorter = data[:at] + data[at + size :]
                found = self._broken(shorter)
                if found is not None and place(found) == place(error):
                    data, error = shorter, found
                else:
                    at += size
            size //= 2
        return data, error


def place(error: BaseException) -> tuple[str, str, int | None]:
    """What broke where."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    return type(error).__name__, last.filename, last.lineno


def main(words: list[str]) -> int:
    seconds = float(words[0]) if words else SECONDS
    names, status = words[1:] or [*TARGETS], 0
    for name in names:
        searched = Searched(TARGETS[name])
        found = searched.find(monotonic() + seconds / len(names))
        print(
            f"{name:<15} {searched.tried:6} inputs, {'none' if found is None else 'FOUND'}",
            flush=True,
        )
        if found is None:
            continue
        data, error = found
        status = 1
        FOUND.mkdir(exist_ok=True)
        path = FOUND / f"{name.replace(' ', '_')}-{sha256(data).hexdigest()[:8]}"
        path.write_bytes(data)
        traceback.print_exception(error, limit=-6)
        print(f"    {len(data)} bytes in {path}: {data[:100]!r}", flush=True)
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
