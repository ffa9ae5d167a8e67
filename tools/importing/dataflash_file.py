"""DataFlash logs of ArduSub (.bin), by pymavlink's formats of their messages."""

import contextlib
import io
import mmap
from array import array
from collections.abc import Iterator
from heapq import merge
from itertools import chain, pairwise, repeat
from pathlib import Path
from struct import calcsize, unpack
from typing import Any

from messages.units import Ns
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from tools.importing.log_file import LogRow, LogSource, Wanted, began_by_file, getter, refuse_other

HEAD = b"\xa3\x95"
FMT = (128, "FMT", 89, "BBnNZ", "Type,Length,Name,Format,Columns")  # says what the others are
GPS_EPOCH_S, LEAP_S = 315_964_800, 18  # [s] of GPS time, and its seconds ahead of UTC since 2017
WEEK_S = 604_800
FIRMWARE = "ArduSub"
OTHERS = ("ArduCopter", "ArduPlane", "ArduRover", "Copter", "Plane", "Rover", "Blimp")
APART_NS = 1_000_000_000  # [ns] messages are out of order by less
SLACK = 528  # [bytes] some boards write whole pages: so much at the end may be nothing


def is_dataflash(path: Path) -> bool:
    """By its name, and where it has that of a telemetry log by its beginning."""
    if path.suffix.lower() == ".tlog" and path.is_file():
        with path.open("rb") as file:
            return file.read(len(HEAD)) == HEAD
    return path.suffix.lower() == ".bin"


class DataflashFile:
    """One log. A message of one of several sensors is called as `BARO[1]`."""

    default_map = "ardusub"
    getter = staticmethod(getter)

    def __init__(self, path: Path) -> None:
        """
        Raises:
            LindyError: pymavlink is not installed, or it is no such log.
        """
        self.remarks: list[str] = []
        self._path = path
        refuse_other(path, HEAD, "a DataFlash log")
        try:
            from pymavlink.DFReader import (  # pyright: ignore[reportMissingTypeStubs]
                DFFormat,
                DFMessage,
            )
        except ModuleNotFoundError:
            raise LindyError(
                f"logs of ArduSub need pymavlink, which is missing: {how_to_install('import')}"
            ) from None
        self._kind: Any = DFFormat
        self._made: Any = DFMessage
        with path.open("rb") as file:
            self._data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        self._formats: dict[int, Any] = {FMT[0]: DFFormat(*FMT)}
        self._at_bytes: dict[int, array[int]] = {}  # places of messages, by number of the format
        self._indexed()
        self._places = self._by_source()
        self._require_submarine()
        self._utc_ns = self._utc_of_start()

    def sources(self) -> dict[str, LogSource]:
        return {name: LogSource(name, len(at)) for name, (_, at) in self._places.items()}

    def rows(self, wanted: Wanted) -> Iterator[LogRow]:
        """A message whose time is beyond those of the two beside it has a damaged one."""
        before: LogRow | None = None
        left_out = 0
        for row, after in pairwise(chain(self._all(wanted), [None])):
            assert row is not None
            if before is not None and after is not None:
                least, most = sorted((before.arrival_ns, after.arrival_ns))
                if not least - APART_NS <= row.arrival_ns <= most + APART_NS:
                    left_out += 1
                    continue
            yield row
            before = row
        remark = f"messages with a damaged time, left out: {left_out}"
        if left_out and remark not in self.remarks:  # it is read more than once
            self.remarks.append(remark)

    def _all(self, wanted: Wanted) -> Iterator[LogRow]:
        named = [
            zip(places, repeat(name), repeat(kind), strict=False)
            for name, (kind, places) in self._places.items()
            if name in wanted
        ]
        for place, name, kind in merge(*named):
            fields = self._message(kind, place)
            yield LogRow(name, fields, self._utc_ns + int(fields.TimeUS) * 1000)

    def _indexed(self) -> None:
        """Find every whole message, whatever is damaged between them."""
        data, end = self._data, 0
        skipped, at = 0, 0
        while at + 3 <= len(data):
            kind = data[at + 2]
            form = self._formats.get(kind) if data[at : at + 2] == HEAD else None
            if form is None or not self._is_followed(at + form.len):
                after = data.find(HEAD, at + 1)
                after = len(data) if after < 0 else after
                skipped += after - at if after < len(data) else 0
                at = after
                continue
            if at + form.len > len(data):
                break
            self._at_bytes.setdefault(kind, array("Q")).append(at)
            if form.name in ("FMT", "FMTU"):
                self._learn(form, self._message(kind, at))
            at = end = at + form.len
        if skipped:
            self.remarks.append(f"{skipped} bytes between its messages are damaged")
        if (left := len(data) - end) > SLACK:
            self.remarks.append(f"its last {left} bytes are no whole message: it was cut off")

    def _is_followed(self, end: int) -> bool:
        """By another message, or by none any more: else what ends there is damage that looked like
        one."""
        return self._data[end : end + 2] == HEAD or self._data.find(HEAD, end) < 0

    def _learn(self, form: Any, said: Any) -> None:
        """A format, or which of its fields is the number of the sensor."""
        try:
            if form.name == "FMT" and said.Type != FMT[0]:
                with contextlib.redirect_stdout(io.StringIO()):  # of a damaged one it says so
                    new = self._kind(said.Type, said.Name, said.Length, said.Format, said.Columns)
                whole = 3 + calcsize(new.msg_struct) == new.len
                if whole and len(new.columns) == len(new.msg_fmts):
                    self._formats[said.Type] = new
            elif form.name == "FMTU" and said.FmtType in self._formats:
                self._formats[said.FmtType].set_unit_ids(said.UnitIds, {})
        except Exception:  # of whatever kind: pymavlink does not say
            self.remarks.append(f"one of its {form.name} is damaged")

    def _by_source(self) -> "dict[str, tuple[int, array[int]]]":
        """Number of the format and places [bytes] of every whole message, by name."""
        found: dict[str, tuple[int, array[int]]] = {}
        for kind, places in self._at_bytes.items():
            form = self._formats[kind]
            if "TimeUS" not in form.columns:
                continue
            if form.instance_field is None or form.instance_len != 1:
                found[form.name] = (kind, places)
                continue
            inside = 3 + form.instance_ofs
            for at in places:
                name = f"{form.name}[{self._data[at + inside]}]"
                found.setdefault(name, (kind, array("Q")))[1].append(at)
        return found

    def _message(self, kind: int, at: int) -> Any:
        """The message at a place."""
        form = self._formats[kind]
        numbers = unpack(form.msg_struct, self._data[at + 3 : at + form.len])
        return self._made(form, numbers, True, None)

    def _require_submarine(self) -> None:
        kind, places = self._places.get("MSG", (0, array("Q")))
        texts = [str(getattr(self._message(kind, at), "Message", "")) for at in places[:100]]
        named = [text for text in texts if text.startswith((FIRMWARE, *OTHERS))]
        if named and not named[0].startswith(FIRMWARE):
            raise LindyError(
                f"{self._path} is of {named[0]}; expected a log of {FIRMWARE}: another vehicle's "
                f"axes, modes and sensors are not those of the map"
            )

    def _utc_of_start(self) -> Ns:
        """[ns] UTC when the board's clock began."""
        for name in ("GPS[0]", "GPS"):
            kind, places = self._places.get(name, (0, array("Q")))
            for place in places:
                fields = self._message(kind, place)
                if getattr(fields, "GWk", 0) > 0:
                    seconds = GPS_EPOCH_S + int(fields.GWk) * WEEK_S - LEAP_S
                    return seconds * 10**9 + int(fields.GMS) * 10**6 - int(fields.TimeUS) * 1000
        last = max(
            (self._message(k, at[-1]).TimeUS for k, at in self._places.values() if at), default=0
        )
        began, remark = began_by_file(self._path, int(last) * 1000)
        self.remarks.append(remark)
        return began
