"""Who comes to a hub from another machine, and who leaves, in the hub's log."""

import contextlib
import sys
from collections import Counter
from collections.abc import Sequence


class CallerLog:
    """Says for each the first, tenth, hundredth … time, because who is not admitted may try for
    hours."""

    def __init__(self, admitted: Sequence[str]) -> None:
        self._admitted = frozenset(admitted)
        self._times: Counter[tuple[str, bool]] = Counter()

    def see(self, name: str, connected: bool) -> None:
        """Somebody has connected or left. Called on Zenoh's thread."""
        self._times[name, connected] += 1
        times = self._times[name, connected]
        if str(times).rstrip("0") != "1":
            return
        again = "" if times == 1 else f" ({times} times)"
        text = f"{name} {'connected' if connected else 'left'}{again}"
        if name in self._admitted:
            line = f"info hub: {text}"
        else:
            line = f"warning hub: {text}; it is not admitted, and can neither hear nor say anything"
        with contextlib.suppress(OSError):  # a full disk under the log
            print(line, file=sys.stderr, flush=True)
