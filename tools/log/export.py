"""`lindy log export`: a recording as tables, one for each topic, and in the words of others."""

import re
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Protocol

import msgspec
from cyclopts import Parameter

from messages import topics
from messages.events import Level
from messages.text import harmless
from messages.units import Ns
from services.marine.vehicle import Vehicle
from services.runtime.config.disk import fresh_folder, reason
from services.runtime.config.errors import EndedByUserError, LindyError
from services.visualizer.core import Collector
from tools.choices import named
from tools.exit_status import DONE, LOST
from tools.fresh import EXISTS, free_name, refuse_existing
from tools.log.cut import Topics, is_chosen, require_known
from tools.log.flatten import FlattenedRows, Row, TableColumn
from tools.packages import require_package
from tools.recordings.dive_file import flown_section
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording
from tools.replay.source import ReplaySource, open_source
from tools.text_table import counted

if TYPE_CHECKING:
    from services.visualizer.io.rerun_writer import RerunWriter
    from services.visualizer.io.rrd_file import RrdFile

# Of every table: [s] since the recording began; [ns] UTC of arrival, and of the message's stamp.
TIMES = [
    TableColumn("t_s", "number"),
    TableColumn("log_ns", "integer"),
    TableColumn("publish_ns", "integer"),
]
BUFFER = 256 * 1024  # [bytes] of a CSV file
BATCH = 20_000  # rows of a Parquet file that are kept until they are written
ENCODE = msgspec.json.Encoder().encode
Kind = Literal["csv", "parquet", "rosbag", "sticks", "trace", "rrd"]
Destination = Annotated[
    Path | None,
    Parameter(
        converter=named,
        help="a new folder, or file of sticks, trace, rrd; default: beside the recording",
    ),
]


class RowTable(Protocol):
    """Where the rows of one topic go."""

    def add(self, row: Row) -> None: ...
    def close(self) -> None: ...


NewTable = Callable[[Path, list[TableColumn]], RowTable]


def export(
    recording: Path,
    /,
    *,
    as_: Annotated[
        Kind,
        Parameter(
            name="--as",
            help="csv or parquet: a table for each topic; rosbag: a bag of ROS 2; sticks: the "
            "pilot's sticks, to fly again; trace: the link's delays, for a profile; rrd: for the "
            "viewer rerun",
        ),
    ],
    out: Destination = None,
    topics: Topics = (),
) -> int:
    """Write tables, a bag of ROS 2, a stick log, a link's trace, or rerun's file.

    RECORDING is a dive's folder or its MCAP file. Times in tables: t_s, seconds since the recording
    began, and log_ns and publish_ns, nanoseconds UTC of arrival and of the message's own stamp.
    Vectors have named columns, such as wanted.surge. Parquet needs the extra `tables`. A bag has
    the messages of the ROS 2 service, at their arrival at the recorder. Exit status 3: a message
    could not be read, or the file is damaged or was not finished.

    Example: lindy log export dives/latest --as csv --topics state 'sensor/*'
             lindy log export dives/latest --as sticks --out again.csv
    """
    if topics and as_ not in ("csv", "parquet"):
        raise LindyError(f"--topics is for tables; --as {as_} writes what it has a form for")
    place = recording if recording.is_dir() else recording.parent
    match as_:
        case "csv":
            return write_tables(recording, out, as_, CsvTable, topics)
        case "parquet":
            require_package("pyarrow", "tables", "Parquet")
            return write_tables(recording, out, as_, ParquetTable, topics)
        case "rosbag":
            from tools.log.rosbag import write_bag

            return write_bag(recording, out or free_name(place, "rosbag"))
        case "sticks":
            from tools.log.sticks import write_sticks

            return write_sticks(recording, out or free_name(place, "sticks", ".csv"))
        case "trace":
            from tools.log.sticks import write_trace

            return write_trace(recording, out or free_name(place, "trace", ".csv"))
        case "rrd":
            return write_rrd(recording, out or free_name(place, "dive", ".rrd"))


def write_tables(
    path: Path, out: Path | None, kind: str, new: NewTable, patterns: Sequence[str] = ()
) -> int:
    """Write the tables, and print what they are. Returns the exit status: 3 when a message could
    not be read, or the recording is damaged or was not finished.

    Args:
        out: folder; None: beside the recording.
        kind: suffix of the files, without its dot.
        patterns: of the topics that are wanted; empty: all.

    Raises:
        LindyError: there is no recording, nothing to write, or the folder cannot be written.
        EndedByUserError: by Ctrl-C, before all of it was written.
    """
    recording = open_recording(path)
    origin = recording.origin_ns()
    if origin is None:
        raise recording.empty(path)
    require_known(patterns, recording.keys() if patterns else (), recording.files[0])
    wanted = out or (path / kind if path.is_dir() else path.with_name(f"{path.stem}-{kind}"))
    rows = FlattenedRows(recording, lambda key: is_chosen(key, patterns), thruster_names(recording))
    try:
        folder = fresh_folder(wanted, lambda found: any(found.iterdir()))
        try:
            with reading(f"writing {kind}", recording.size) as recording.advance:
                written = _fill(rows, folder, kind, new, origin)
        except KeyboardInterrupt:
            said = f"interrupted; the tables in {folder} are not whole"
            raise EndedByUserError(said) from None
    except FileExistsError as error:
        raise LindyError(
            f"cannot write {error.filename or wanted}: {EXISTS.format('--out')}"
        ) from None
    except OSError as error:
        said = f"cannot write {error.filename or wanted}: {reason(error)}"
        if any(wanted.glob(f"*.{kind}")):
            said += f"; the tables in {wanted} are not whole"
        raise LindyError(said) from None
    print(f"{written_words(written)} written to {folder}", flush=True)
    for why, count in rows.unread.items():
        print(harmless(f"{counted(count, 'message')} left out: {why}"), flush=True)
    said = recording.damage
    print(harmless("".join(f"{sentence}\n" for sentence in said)), end="", flush=True)
    return LOST if rows.unread or said else DONE


def written_words(written: Counter[str]) -> str:
    """Of messages by topic."""
    return f"{counted(written.total(), 'message')} of {counted(len(written), 'topic')}"


def _fill(
    rows: FlattenedRows, folder: Path, kind: str, new: NewTable, origin_ns: int
) -> Counter[str]:
    """Messages written, by topic. Each table is begun with the first message of its topic."""
    written = Counter[str]()
    tables: dict[str, RowTable] = {}
    taken: set[str] = set()  # names of files
    try:
        for key, columns, message, row in rows:
            if (table := tables.get(key)) is None:
                plain = re.sub(r"[^A-Za-z0-9_.-]+", "_", key).strip("_.") or "topic"
                name, number = plain, 2
                while name.lower() in taken:
                    name, number = f"{plain}-{number}", number + 1
                taken.add(name.lower())
                table = tables[key] = new(folder / f"{name}.{kind}", TIMES + columns)
            t_s = (message.log_ns - origin_ns) / 1e9
            table.add([t_s, message.log_ns, message.publish_ns, *row])
            written[key] += 1
    finally:
        for table in tables.values():
            table.close()
    return written


def thruster_names(recording: Recording) -> list[str]:
    """In the order of the vehicle file that the recording carries; empty: it is not there, or is
    damaged."""
    with suppress(LindyError):
        if (vehicle := flown_section(recording, "vehicle", Vehicle)) is not None:
            return [thruster.name for thruster in vehicle.thruster]
    return []


class CsvTable:
    """A heading, then a line for each message. Words are in quotes, None is an empty cell, numbers
    are as in the recording, to the last digit."""

    def __init__(self, path: Path, columns: list[TableColumn]) -> None:
        self._file = path.open("xb", buffering=BUFFER)
        self.add([column.name for column in columns])

    def add(self, row: Row) -> None:
        self._file.write(line_of(row) + b"\n")

    def close(self) -> None:
        self._file.close()


def line_of(row: Row) -> bytes:
    """A line of CSV without its end."""
    return b",".join(map(_cell, row))


def _cell(value: Any) -> bytes:
    if value is None:
        return b""
    if isinstance(value, str):
        return f'"{value.replace(chr(34), chr(34) * 2)}"'.encode()
    return ENCODE(value)


class ParquetTable:
    """With the types of the messages' schema."""

    def __init__(self, path: Path, columns: list[TableColumn]) -> None:
        self._pyarrow: Any = import_module("pyarrow")  # it has no types
        parquet: Any = import_module("pyarrow.parquet")
        types = {
            "number": self._pyarrow.float64(),
            "integer": self._pyarrow.int64(),
            "boolean": self._pyarrow.bool_(),
            "string": self._pyarrow.string(),
        }
        self._schema: Any = self._pyarrow.schema([(c.name, types[c.kind]) for c in columns])
        self._file = path.open("xb")
        # Snappy is what every reader of Parquet has; zstd is a seventh smaller.
        self._writer: Any = parquet.ParquetWriter(self._file, self._schema, compression="snappy")
        self._rows: list[Row] = []

    def add(self, row: Row) -> None:
        self._rows.append(row)
        if len(self._rows) >= BATCH:
            self._write()

    def close(self) -> None:
        self._write()
        self._writer.close()
        self._file.close()

    def __del__(self) -> None:
        """What could not be written is not tried again, with a traceback, as it is thrown away."""
        with suppress(AttributeError):  # no file could be opened
            self._writer.is_open = False

    def _write(self) -> None:
        if not self._rows:
            return
        columns = zip(*self._rows, strict=True)
        try:
            arrays = [
                self._pyarrow.array(values, type=kind)
                for values, kind in zip(columns, self._schema.types, strict=True)
            ]
        except (ValueError, TypeError, OverflowError) as error:
            raise LindyError(
                f"{self._file.name}: a message does not fit its own schema: {error}"
            ) from None
        self._writer.write_table(self._pyarrow.Table.from_arrays(arrays, schema=self._schema))
        self._rows.clear()


ELSEWHERE = "make room there, or name a place on another disk by --out"
FRAME_NS = 100_000_000  # [ns] between two places of the vehicle, as in a dive
BATCH_NS = 12_000_000_000  # [ns] that are written at once


def write_rrd(recording: Path, rrd: Path) -> int:
    """Write a file for rerun, and say so. Returns the exit status.

    Raises:
        LindyError: as `draw`, or the file is there already.
    """
    refuse_existing(rrd)
    source = open_source(recording)
    draw(source, rrd)
    print(harmless(f"written {rrd} ({rrd.stat().st_size / 1e6:.1f} MB)"), flush=True)
    return 0


def draw(source: ReplaySource, rrd: Path) -> None:
    """Draw a dive as the visualizer does.

    Args:
        rrd: a new file.

    Raises:
        LindyError: rerun is not installed, the vehicle is not in the recording, or the disk fails;
            then there is no file.
    """
    require_package("rerun", "viewer", "a file for rerun")
    from services.visualizer.io.rerun_writer import RerunWriter
    from services.visualizer.io.rrd_file import RrdFile

    with source.stack() as stack:
        vehicle = stack.section("vehicle", Vehicle)

    def say(level: Level, text: str) -> None:
        if level == "warning":
            raise LindyError(f"{text.partition(';')[0]}; {ELSEWHERE}")

    try:
        file = RrdFile(rrd, lambda _: None, say)
        try:
            _draw(source, RerunWriter(rrd.parent.name, vehicle), file, Collector(vehicle))
        except BaseException:
            file.close()
            rrd.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise LindyError(f"cannot write {rrd}: {reason(error)}; {ELSEWHERE}") from None


def _draw(
    source: ReplaySource, writer: "RerunWriter", file: "RrdFile", collector: Collector
) -> None:
    writer.save(file)
    framed: Ns = 0
    written: Ns | None = None
    now: Ns = 0
    for raw in source.raw():
        topic, message = topics.find(raw.key), source.recording.decode(raw)
        if topic is None or message is None:
            continue
        now = raw.log_ns - source.utc_offset_ns
        written = now if written is None else written
        if now - framed >= FRAME_NS:
            collector.keep_frame()
            framed = now
        if now - written >= BATCH_NS:
            writer.write(collector.drain(now))
            written = now
        collector.hear(topic, raw.key, message, now)
    writer.write(collector.drain(now))
    writer.close()
