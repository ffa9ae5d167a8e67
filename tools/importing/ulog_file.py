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
from services.runtime.config.extras import how_to_install
from tools.importing.columns import cell, column_rows, named_columns
from tools.importing.log_file import ULOG, LogRow, LogSource, Wanted, began_by_file, refuse_other

SUBMARINE = 12  # MAV_TYPE
MOST_AGAIN = 100_000  # reads of what was read; it looks for the next message byte by byte
LATEST_NS = 4_102_444_800 * 10**9  # [ns] UTC, the year 2100


def is_ulog(path: Path) -> bool:
    return path.suffix.lower() == ".ulg"


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


class UlogFile:
    """One log. A topic of one of several sensors is called as `sensor_baro[1]`, but for the first;
    columns are called as pyulog does, such as `gyro_rad[0]`."""

    default_map = "px4"
    getter = staticmethod(cell)

    def __init__(self, path: Path) -> None:
        """
        Raises:
            LindyError: pyulog is not installed, it is no such log, or not of a submarine.
        """
        self.remarks: list[str] = []
        self._path = path
        refuse_other(path, ULOG, "a log of PX4")
        try:
            from pyulog import ULog  # pyright: ignore[reportMissingTypeStubs]
        except ModuleNotFoundError:
            raise LindyError(
                f"logs of PX4 need pyulog, which is missing: {how_to_install('import')}"
            ) from None
        try:
            with ForwardFile(path) as file, redirect_stdout(io.StringIO()):  # it prints
                self._log: Any = ULog(file)
        except Exception as error:  # of whatever kind: where bytes are wrong, pyulog does not say
            raise LindyError(f"{path} is damaged: {error or 'a message cannot be read'}") from None
        self._topics: dict[str, Mapping[str, Any]] = {
            each.name + (f"[{each.multi_id}]" if each.multi_id else ""): each.data
            for each in self._log.data_list
            if "timestamp" in each.data  # all have it, but in a damaged log
        }
        if self._log.file_corruption:
            self.remarks.append("a part of it is damaged, and left out")
        if lost := sum(each.duration for each in self._log.dropouts):
            times = len(self._log.dropouts)
            self.remarks.append(f"its logger was too slow {times} times, for {lost / 1e3:.2f} s")
        self._require_submarine()
        self._utc_ns = self._utc_of_start()

    def sources(self) -> dict[str, LogSource]:
        return {
            name: LogSource(name, len(columns["timestamp"]), frozenset(columns))
            for name, columns in self._topics.items()
        }

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        topics: list[Iterator[LogRow]] = []
        for name, several in wanted.items():
            columns, named = self._topics[name], named_columns(several)
            at_ns = columns["timestamp"].astype(np.int64) * 1000 + self._utc_ns
            taken = {column: columns[column] for column in columns if column in named}
            topics.append(column_rows(name, taken, at_ns))
        yield from merge(*topics, key=lambda row: row.arrival_ns)

    def _require_submarine(self) -> None:
        kinds = self._topics.get("vehicle_status", {}).get("system_type", np.zeros(0))
        kind = int(kinds[-1]) if len(kinds) else self._log.initial_parameters.get("MAV_TYPE")
        if kind is not None and kind != SUBMARINE:
            raise LindyError(
                f"{self._path} is of a vehicle of MAVLink's type {kind}; expected {SUBMARINE}, a "
                f"submarine: another vehicle's axes and modes are not those of the map"
            )

    def _utc_of_start(self) -> Ns:
        """[ns] UTC when the board's clock began."""
        for name in ("vehicle_gps_position", "sensor_gps"):
            columns = self._topics.get(name, {})
            utc = columns.get("time_utc_usec", np.zeros(0))
            for first in np.flatnonzero(utc)[:1]:
                began = (int(utc[first]) - int(columns["timestamp"][first])) * 1000
                if 0 <= began < LATEST_NS:  # else it is damaged
                    return began
        began, remark = began_by_file(self._path, int(self._log.last_timestamp) * 1000)
        self.remarks.append(remark)
        return began
