"""Messages as rows of tables: named columns for everything inside them.

The columns follow the schema that the recording carries, not the types of this version of Lindy, so
that a recording of an older one becomes the same tables. `depth.value` is the value in the depth;
the numbers of a vector have names; what has no fixed length, such as a list of words, is JSON.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, cast

import msgspec
from mcap.records import Channel, Schema

from messages.components import COMPONENTS
from services.recorder.foxglove.channel import is_view
from tools.recordings.mcap_records import Raw, Wants, always
from tools.recordings.recording import Recording

Kind = str  # of a column, as JSON schemas have it: number, integer, boolean, string
Row = list[Any]
Tree = dict[str, Any]
DECODE = msgspec.json.Decoder(Tree).decode
Put = Callable[[Any, Row], None]  # appends a value's cells to a row
PLAIN = ("number", "integer", "boolean", "string")
PER_THRUSTER = "thrust"  # a field with one number for each thruster


class TableColumn(NamedTuple):
    name: str
    kind: Kind


class FlattenedRow(NamedTuple):
    key: str
    columns: list[TableColumn]  # of all rows of this key, the same list
    message: Raw
    row: Row


class FlattenedRows:
    """Every message of a recording but those for Foxglove, which were computed from the rest.

    Attributes:
        unread: messages that are no row, by the reason.
    """

    def __init__(
        self, recording: Recording, wants: Wants = always, thrusters: Sequence[str] = ()
    ) -> None:
        """
        Args:
            thrusters: names, in the order of the vehicle file; empty: not known.
        """
        self.unread = Counter[str]()
        self._recording, self._wants, self._thrusters = recording, wants, thrusters
        self._flattenings: dict[str, Flattening] = {}  # by key

    def __iter__(self) -> Iterator[FlattenedRow]:
        def wanted(key: str) -> bool:
            return not is_view(key) and self._wants(key)

        for file in self._recording.files:
            schemas: dict[int, Schema] = {}
            channels: dict[int, Channel] = {}
            for record in self._recording.records(file, wanted):
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Raw):
                    if (channel := channels.get(record.channel_id)) is None:
                        self.unread["of an unknown topic"] += 1
                    elif channel.message_encoding != "json":
                        said = f"{channel.topic}: it is {channel.message_encoding}, not JSON"
                        self.unread[said] += 1
                    else:
                        yield from self._row(record, channel, schemas.get(channel.schema_id))

    def _row(self, message: Raw, channel: Channel, schema: Schema | None) -> Iterator[FlattenedRow]:
        key = channel.topic
        try:
            tree = DECODE(message.data)
            if (flattening := self._flattenings.get(key)) is None:
                known = {} if schema is None or not schema.data else DECODE(schema.data)
                name = "" if schema is None else schema.name
                flattening = Flattening(known, name, self._thrusters, tree)
                self._flattenings[key] = flattening
            row = flattening.row(tree)
        except (ValueError, RecursionError) as error:  # also what msgspec raises
            self.unread[f"{key}: {error}"] += 1
            return
        yield FlattenedRow(key, flattening.columns, message, row)


class Flattening:
    """Rows of one topic."""

    def __init__(self, schema: Tree, name: str, thrusters: Sequence[str], first: Tree) -> None:
        """
        Args:
            schema: JSON schema of the messages.
            name: of the message type.
            thrusters: names, in the order of the vehicle file; empty: not known.
            first: message, which says how long a vector without names is.
        """
        self.columns: list[TableColumn] = []
        self._thrusters = thrusters
        self._put = self._object(schema, COMPONENTS.get(name, {}), "", first)

    def row(self, message: Tree) -> Row:
        """
        Raises:
            ValueError: a vector has another length than it had at first, or a value another form.
        """
        row: Row = []
        self._put(message, row)
        return row

    def _object(
        self, schema: Tree, names: Mapping[str, Sequence[str]], prefix: str, first: Any
    ) -> Put:
        fields: list[tuple[str, Put | None]] = []
        begin = len(self.columns)
        there: Tree = cast(Tree, first) if isinstance(first, dict) else {}
        for field, inner in cast(dict[str, Tree], schema.get("properties", {})).items():
            value = there.get(field)
            fields.append((field, self._field(inner, field, f"{prefix}{field}", names, value)))
        width = len(self.columns) - begin

        def put(value: Any, row: Row) -> None:
            if value is None:
                row += [None] * width
                return
            if not isinstance(value, dict):
                raise ValueError(f"{prefix.rstrip('.') or 'the message'} has no fields")
            value = cast(Tree, value)
            for field, inner in fields:
                if inner is None:
                    row.append(value.get(field))
                else:
                    inner(value.get(field), row)

        return put

    def _field(
        self, schema: Tree, field: str, name: str, names: Mapping[str, Sequence[str]], first: Any
    ) -> Put | None:
        """None: it is one cell as it is."""
        kind = schema.get("type")
        if kind == "object" and schema.get("properties"):  # a map by name has none
            return self._object(schema, {}, f"{name}.", first)
        if kind == "array" and _kind(schema.get("items", {})) in ("number", "integer"):
            parts = self._parts(field, names, first)
            if parts:
                return self._vector(name, parts, _kind(schema["items"]))
        self.columns.append(TableColumn(name, _kind(schema)))
        return None if kind in PLAIN else _as_json

    def _parts(self, field: str, names: Mapping[str, Sequence[str]], first: Any) -> Sequence[str]:
        """Names of a vector's numbers; empty: neither names nor a length are known."""
        if field in names:
            return names[field]
        length = len(cast(list[Any], first)) if isinstance(first, list) else 0
        if field == PER_THRUSTER and len(self._thrusters) == length:
            return self._thrusters
        return [str(number) for number in range(1, length + 1)]

    def _vector(self, name: str, parts: Sequence[str], kind: Kind) -> Put:
        self.columns += [TableColumn(f"{name}.{part}", kind) for part in parts]
        width, nothing = len(parts), [None] * len(parts)

        def put(value: Any, row: Row) -> None:
            if value is None:
                row += nothing
            elif not isinstance(value, list):
                raise ValueError(f"{name} is no list")
            elif len(cast(Row, value)) != width:
                raise ValueError(f"{name} has {len(cast(Row, value))} numbers, not {width}")
            else:
                row += value

        return put


def _as_json(value: Any, row: Row) -> None:
    """Words as they are."""
    plain = value is None or isinstance(value, str)
    row.append(value if plain else msgspec.json.encode(value).decode())


def _kind(schema: Tree) -> Kind:
    kind = schema.get("type")
    return kind if kind in ("number", "integer", "boolean") else "string"
