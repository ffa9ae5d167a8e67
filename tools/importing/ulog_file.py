"""Logs of PX4 (.ulg), by the library pyulog."""

import io
from collections.abc import Iterator, Mapping
from contextlib import redirect_stdout
from heapq import merge
from pathlib import Path
from typing import Any

import numpy as np

from messages.units import Ns
from services.runtime.config.errors import LindyError
from tools.importing.log_file import (
    ULOG,
    LogFile,
    LogRow,
    LogSource,
    Wanted,
    cell,
    column_rows,
    library,
)

MOST_AGAIN = 100_000  # reads of what was read; it looks for the next message byte by byte


class ForwardFile(io.BufferedReader):
    """Where the end of a log is damaged, pyulog reads the same bytes for ever."""

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path))
        self._farthest = self._again = 0

    def read(self, size: int | None = -1, /) -> bytes:
        """
        Raises:
            EOFError: it gets no further.
        """
        found = super().read(size)
        self._again += 1
        if (at := self.tell()) > self._farthest:
            self._farthest, self._again = at, 0
        elif self._again > MOST_AGAIN:
            raise EOFError("it cannot be read to its end")
        return found


class UlogFile(LogFile):
    """One log. A topic of one of several sensors is called as `sensor_baro[1]`, but for the first;
    columns are called as pyulog does, such as `gyro_rad[0]`."""

    default_map = "px4"
    getter = staticmethod(cell)

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        own = self.own_part(ULOG, "a log of PX4")
        pyulog = library("pyulog", "logs of PX4")
        try:
            with ForwardFile(own) as file, redirect_stdout(io.StringIO()):  # it prints
                self._log: Any = pyulog.ULog(file)
        except Exception as error:  # of whatever kind: where bytes are wrong, pyulog does not say
            raise LindyError(f"{path} is damaged: {error or 'a message cannot be read'}") from None
        self._topics: dict[str, Mapping[str, Any]] = {
            each.name + (f"[{each.multi_id}]" if each.multi_id else ""): each.data
            for each in self._log.data_list
            if "timestamp" in each.data  # all have it, but in a damaged log
        }
        if self._log.file_corruption:
            self.say("a part of it is damaged, and left out")
        if lost := sum(each.duration for each in self._log.dropouts):
            times = len(self._log.dropouts)
            self.say(f"its logger was too slow {times} times, for {lost / 1e3:.2f} s")
        kinds = self._topics.get("vehicle_status", {}).get("system_type", np.zeros(0))
        kind = kinds[-1] if len(kinds) else self._log.initial_parameters.get("MAV_TYPE")
        if kind is not None:
            self.require_submarine(int(kind))
        last_ns = int(self._log.last_timestamp) * 1000
        self._utc_ns = self.utc_of_start(self._said_by_gps(), last_ns)

    def sources(self) -> dict[str, LogSource]:
        return {
            name: LogSource(name, len(columns["timestamp"]), frozenset(columns))
            for name, columns in self._topics.items()
        }

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        topics: list[Iterator[LogRow]] = []
        for name in wanted:
            columns = self._topics[name]
            at_ns = columns["timestamp"].astype(np.int64) * 1000 + self._utc_ns
            topics.append(column_rows(name, columns, at_ns, wanted))
        yield from merge(*topics, key=lambda row: row.arrival_ns)

    def _said_by_gps(self) -> Iterator[Ns]:
        """[ns] UTC when the board's clock began."""
        for name in ("vehicle_gps_position", "sensor_gps"):
            columns = self._topics.get(name, {})
            utc = columns.get("time_utc_usec", np.zeros(0))
            for k in np.flatnonzero(utc).tolist():
                yield (int(utc[k]) - int(columns["timestamp"][k])) * 1000
