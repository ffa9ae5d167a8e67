"""Who comes to a hub from another machine, and who leaves, in the words of its log."""

import contextlib
import sys
from collections import Counter
from collections.abc import Sequence


class Callers:
    """Says in the hub's log who connects and who leaves: for each, the first, tenth, hundredth …
    time, because who is not admitted may try for hours."""

    def __init__(self, admitted: Sequence[str]) -> None:
        self._admitted = frozenset(admitted)
        self._times: Counter[tuple[str, bool]] = Counter()

    def see(self, name: str, connected: bool) -> None:
        self._times[name, connected] += 1
        times = self._times[name, connected]
        if str(times).rstrip("0") == "1":
            with contextlib.suppress(OSError):  # a full disk under the log
                print(self._in_words(name, connected, times), file=sys.stderr, flush=True)

    def _in_words(self, name: str, connected: bool, times: int) -> str:
        again = "" if times == 1 else f" ({times} times)"
        if name in self._admitted:
            return f"info hub: {name} {'connected' if connected else 'left'}{again}"
        return (
            f"warning hub: {name} {'connected' if connected else 'left'}{again}; it is not admitted"
            f", and can neither hear nor say anything"
        )
