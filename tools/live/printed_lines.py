"""Log lines on stdout, where there is no screen."""

from contextlib import suppress
from threading import Lock

from messages.health import LogLine
from services.vehicle_view.log_lines import LogEntry, LogLines, full


class PrintedLines:
    """A line that is repeated is printed the first, tenth, hundredth … time, and a warning or an
    error also when it comes back after a while."""

    def __init__(self) -> None:
        self._lines = LogLines()
        self._lock = Lock()  # while the drone is changed, two threads look after a topside each

    def line(self, line: LogLine, at_s: float | None) -> None:
        """A log line has arrived, `at_s` [s] after arming."""
        with self._lock:
            if (entry := self._lines.add(line, at_s)) is not None:
                _print(entry)

    def finish(self) -> None:
        """Print the lines that were repeated since they were printed last."""
        for entry in self._lines.unprinted():
            _print(entry)


def _print(entry: LogEntry) -> None:
    with suppress(OSError):  # whoever read it may be gone, and the dive goes on
        print(full(entry), flush=True)
