"""`lindy log csv` and `lindy log parquet`: one table for each topic."""

import re
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, Protocol, cast

import msgspec
from cyclopts import Parameter
from mcap.records import Channel, Schema

from messages.text import harmless
from services.recorder.foxglove.channel import is_view
from services.runtime.config.disk import reason
from services.runtime.config.errors import EndedByUserError, LindyError
from services.runtime.config.settings import parsed_toml
from tools.choices import named
from tools.fresh import EXISTS, fresh_folder
from tools.log.flatten import Flattening, Row, TableColumn
from tools.log.topic_patterns import is_chosen, require_known
from tools.recordings.dive_file import flown_dive
from tools.recordings.mcap_records import StoredMessage
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording

# Of every table: [s] since the recording began; [ns] UTC of arrival, and of the message's stamp.
TIMES = [
    TableColumn("t_s", "number"),
    TableColumn("log_ns", "integer"),
    TableColumn("publish_ns", "integer"),
]
CLEAN, DATA_LOST = 0, 3  # exit statuses
Tree = dict[str, Any]
DECODE = msgspec.json.Decoder(Tree).decode


class RowTable(Protocol):
    """Where the rows of one topic go."""

    def add(self, row: Row) -> None: ...
    def close(self) -> None: ...


Tables = Annotated[
    Path | None,
    Parameter(
        converter=named,
        help="the folder to write to; where it holds files already, a new one beside it; default: "
        "beside the recording",
    ),
]
NewTable = Callable[[Path, list[TableColumn]], RowTable]


class TopicTable:
    """The table of one topic, begun with its first message."""

    def __init__(self, key: str, schema: Schema | None) -> None:
        self.key = key
        self.rows = 0
        self._schema = schema
        self._flattening: Flattening | None = None
        self._table: RowTable | None = None

    def add(self, message: StoredMessage, origin_ns: int, open_table: "OpenTable") -> None:
        """
        Raises:
            ValueError: it is not JSON, or does not fit into the table.
        """
        tree = DECODE(message.data)
        if self._flattening is None or self._table is None:
            self._flattening = open_table.flattening(self._schema, tree)
            self._table = open_table.table(self.key, TIMES + self._flattening.columns)
        row = self._flattening.row(tree)
        t_s = (message.log_ns - origin_ns) / 1e9
        self._table.add([t_s, message.log_ns, message.publish_ns, *row])
        self.rows += 1

    def close(self) -> None:
        if self._table is not None:
            self._table.close()


class OpenTable:
    """Begins tables in a folder."""

    def __init__(self, folder: Path, suffix: str, new: NewTable, thrusters: list[str]) -> None:
        self._folder, self._suffix, self._new = folder, suffix, new
        self._thrusters = thrusters
        self._taken: set[str] = set()

    def flattening(self, schema: Schema | None, first: Tree) -> Flattening:
        known = {} if schema is None or not schema.data else DECODE(schema.data)
        name = "" if schema is None else schema.name
        return Flattening(known, name, self._thrusters, first)

    def table(self, key: str, columns: list[TableColumn]) -> RowTable:
        plain = re.sub(r"[^A-Za-z0-9_.-]+", "_", key).strip("_.") or "topic"
        name, number = plain, 2
        while name.lower() in self._taken:
            name, number = f"{plain}-{number}", number + 1
        self._taken.add(name.lower())
        return self._new(self._folder / f"{name}{self._suffix}", columns)


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
    try:
        folder = fresh_folder(wanted, lambda found: any(found.iterdir()))
        opener = OpenTable(folder, f".{kind}", new, thruster_names(recording))
        try:
            with reading(f"writing {kind}", recording.size) as recording.advance:
                rows, unread = _fill(recording, origin, opener, patterns)
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
    print(f"{sum(rows.values())} messages of {len(rows)} topics written to {folder}", flush=True)
    for why, count in unread.items():
        print(harmless(f"{count} messages left out: {why}"), flush=True)
    said = recording.damage
    print(harmless("".join(f"{sentence}\n" for sentence in said)), end="", flush=True)
    return DATA_LOST if unread or said else CLEAN


def _fill(
    recording: Recording, origin_ns: int, opener: OpenTable, patterns: Sequence[str]
) -> tuple[dict[str, int], Counter[str]]:
    """Rows by topic, and the messages that are in no table, by the reason."""
    tables: dict[str, TopicTable] = {}
    unread = Counter[str]()
    try:
        for file in recording.files:
            _fill_from(recording, file, origin_ns, opener, tables, unread, patterns)
    finally:
        for table in tables.values():
            table.close()
    return {key: table.rows for key, table in tables.items() if table.rows}, unread


def _fill_from(
    recording: Recording,
    file: Path,
    origin_ns: int,
    opener: OpenTable,
    tables: dict[str, TopicTable],
    unread: Counter[str],
    patterns: Sequence[str],
) -> None:
    def wants(key: str) -> bool:
        return not is_view(key) and is_chosen(key, patterns)

    schemas: dict[int, Schema] = {}
    of_channel: dict[int, TopicTable] = {}
    other: dict[int, str] = {}  # channels of which no table is made, and why
    for record in recording.records(file, wants):
        if isinstance(record, StoredMessage):
            table = of_channel.get(record.channel_id)
            if table is None:
                unread[other.get(record.channel_id, "of an unknown topic")] += 1
                continue
            try:
                table.add(record, origin_ns, opener)
            except (ValueError, RecursionError) as error:  # also what msgspec raises
                unread[f"{table.key}: {error}"] += 1
        elif isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            if record.message_encoding != "json":
                other[record.id] = f"{record.topic}: it is {record.message_encoding}, not JSON"
                continue
            table = TopicTable(record.topic, schemas.get(record.schema_id))
            of_channel[record.id] = tables.setdefault(record.topic, table)


def thruster_names(recording: Recording) -> list[str]:
    """In the order of the vehicle file that the recording carries; empty: it is not there."""
    dive = flown_dive(recording)
    if dive is None:
        return []
    file = dive.named("vehicles", dive.stack.vehicle, ".toml")
    name = None if file is None else file.attachment
    data = None if name is None else recording.attachment(name)
    try:
        tree: Tree = {} if data is None else parsed_toml(data.decode())
        body = cast(Tree, tree.get("vehicle", {}))
        return [str(cast(Tree, each)["name"]) for each in body.get("thruster", [])]
    except (ValueError, KeyError, TypeError, AttributeError):
        return []
