"""A table holds every message of its topic, to the last digit, in named columns."""

import csv
import errno
import io
import json
import tomllib
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer

from messages import topics
from messages.components import COMPONENTS
from services.recorder.foxglove.channel import is_view
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import DEPLOY
from tests.support.recorded import ShortDive
from tools.__main__ import main
from tools.log.export import CsvTable, RowTable, line_of, thruster_names, write_tables
from tools.log.flatten import TableColumn
from tools.recordings.recording import open_recording

cells = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(st.characters(codec="utf-8")),
    st.sampled_from(["null", 'a "b", c', "a,null,b", "\\", "two\nlines", ""]),
)


@pytest.fixture(scope="module")
def tables(dive: ShortDive, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("tables") / "csv"
    assert main(["log", "export", "--as", "csv", str(dive.folder), "--out", str(out)]) == 0
    return out


def cell(value: Any) -> str:
    """As a reader of CSV finds it."""
    if value is None:
        return ""
    return value if isinstance(value, str) else json.dumps(value)


def value_at(message: dict[str, Any], column: str, names: dict[str, Any]) -> Any:
    """The value in a message that a column is named after; `names`: of its vectors' numbers."""
    field, *parts = column.split(".")
    found: Any = message.get(field)
    for part in parts:
        if field in names:
            found = None if found is None else found[list(names[field]).index(part)]
        else:
            found = None if found is None else found.get(part)
    return found


def messages(dive: ShortDive) -> dict[str, list[tuple[int, int, dict[str, Any]]]]:
    """(arrival, stamp, message) by topic, as a foreign reader finds them; what was computed from
    them for Foxglove has no table."""
    found: dict[str, list[tuple[int, int, dict[str, Any]]]] = {}
    with (dive.folder / "dive.mcap").open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            row = (message.log_time, message.publish_time, json.loads(message.data))
            if not is_view(channel.topic):
                found.setdefault(channel.topic, []).append(row)
    return found


@given(st.lists(cells, min_size=2))  # as every table has: a line of nothing is no row
def test_a_line_read_by_others_is_the_row(row: list[Any]) -> None:
    text = line_of(row).decode() + "\n"
    (found,) = list(csv.reader(io.StringIO(text, newline="")))
    assert len(found) == len(row)
    for there, value in zip(found, row, strict=True):
        if isinstance(value, float):
            assert float(there) == value
        else:
            assert there == cell(value)


def test_the_tables_are_the_messages(dive: ShortDive, tables: Path) -> None:
    recorded = messages(dive)
    thrusters = thruster_names(open_recording(dive.folder))
    assert {path.stem for path in tables.iterdir()} == {key.replace("/", "_") for key in recorded}
    for key, rows in recorded.items():
        path = tables / f"{key.replace('/', '_')}.csv"
        with path.open(newline="") as stream:
            reader = csv.DictReader(stream)
            found = list(reader)
            columns = list(reader.fieldnames or [])[3:]
        topic = topics.find(key)
        assert topic is not None
        names = {"thrust": thrusters, **COMPONENTS.get(topic.message.__name__, {})}
        assert len(found) == len(rows)
        for row, (log_ns, publish_ns, message) in list(zip(found, rows, strict=True))[::7]:
            assert (int(row["log_ns"]), int(row["publish_ns"])) == (log_ns, publish_ns)
            for column in columns:
                value = value_at(message, column, names)
                if isinstance(value, list | dict):
                    assert json.loads(row[column]) == value
                elif isinstance(value, float):
                    assert float(row[column]) == value
                else:
                    assert row[column] == cell(value)


def test_vectors_have_the_names_of_what_they_are(tables: Path) -> None:
    heads = {path.stem: path.read_text().partition("\n")[0] for path in tables.iterdir()}
    assert '"wanted.surge","wanted.sway","wanted.heave","wanted.roll"' in heads["control_wrench"]
    assert '"position.north","position.east","position.down"' in heads["simulator_truth"]
    assert '"depth.value","depth.std","depth.valid"' in heads["state"]
    vehicle = tomllib.loads((DEPLOY / "vehicles" / "pioneer.toml").read_text())["vehicle"]
    names = [f'"thrust.{thruster["name"]}"' for thruster in vehicle["thruster"]]
    assert ",".join(names) in heads["control_thrusters"]
    assert ',"outputs",' in heads["vehicle_status"]  # by name, of no fixed length: one cell
    assert '"counts"' in heads["health_control"]


def test_every_vector_of_every_message_has_names() -> None:
    """Of the right number: a new one is not forgotten."""
    found: dict[str, dict[str, int]] = {}
    for topic in topics.ALL:
        info = msgspec.inspect.type_info(topic.message)
        assert isinstance(info, msgspec.inspect.StructType)
        for field in info.fields:
            kinds = getattr(field.type, "types", (field.type,))  # of a union: one may be None
            for each in (k for k in kinds if isinstance(k, msgspec.inspect.TupleType)):
                size = len(each.item_types)
                found.setdefault(topic.message.__name__, {})[field.encode_name] = size
    assert found == {
        kind: {field: len(names) for field, names in fields.items()}
        for kind, fields in COMPONENTS.items()
    }


def test_parquet_has_the_same_rows_with_types(
    dive: ShortDive, tables: Path, tmp_path: Path
) -> None:
    parquet: Any = pytest.importorskip("pyarrow.parquet", reason="the tables extra is missing")
    out = tmp_path / "parquet"
    assert main(["log", "export", "--as", "parquet", str(dive.folder), "--out", str(out)]) == 0
    for path in tables.iterdir():
        table = parquet.read_table(out / f"{path.stem}.parquet")
        with path.open(newline="") as stream:
            rows: list[list[str]] = list(csv.reader(stream))
        assert rows[0] == table.column_names
        assert len(rows) - 1 == table.num_rows
        middle: int = table.num_rows // 2
        for name, there in zip(rows[0], rows[1 + middle], strict=True):
            value: Any = table.column(name)[middle].as_py()
            same = float(there) == value if isinstance(value, float) else there == cell(value)
            assert same, (path, name)
    stored = parquet.ParquetFile(out / "state.parquet").metadata.row_group(0)
    codecs = {stored.column(number).compression for number in range(stored.num_columns)}
    assert codecs == {"SNAPPY"}  # which MATLAB reads
    state = parquet.read_table(out / "state.parquet").schema
    kinds = [str(state.field(name).type) for name in ("stamp_ns", "depth.value", "depth.valid")]
    assert kinds == ["int64", "double", "bool"]


def test_a_folder_that_holds_files_is_left_alone(
    dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = tmp_path / "tables" / "state.csv"
    mine.parent.mkdir()
    mine.write_text("mine")
    assert main(["log", "export", "--as", "csv", str(dive.folder), "--out", str(mine.parent)]) == 0
    assert f"written to {tmp_path}/tables-2" in capsys.readouterr().out
    assert mine.read_text() == "mine"


def foreign(path: Path, payloads: list[bytes], encoding: str = "json") -> Path:
    """A file of another program, whose schema this version of Lindy has never seen."""
    schema = {
        "type": "object",
        "properties": {
            "kind": {"type": "string"},
            "at": {"type": "object", "properties": {"x": {"type": "number"}}},
            "list": {"type": "array", "items": {"type": "number"}},
        },
    }
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        number = writer.register_schema("Other", "jsonschema", json.dumps(schema).encode())
        channel = writer.register_channel("/of/others", encoding, number)
        for n, payload in enumerate(payloads):
            writer.add_message(channel, n, payload, n)
        writer.finish()
    return path


def test_tables_on_a_full_disk_are_said_not_to_be_whole(dive: ShortDive, tmp_path: Path) -> None:
    made = list[Path]()

    def new(path: Path, columns: list[TableColumn]) -> RowTable:
        made.append(path)
        if len(made) == 3:
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        return CsvTable(path, columns)

    with pytest.raises(LindyError, match=r"the disk is full; the tables in .* are not whole"):
        write_tables(dive.folder, tmp_path / "tables", "csv", new)


def test_an_older_or_a_foreign_schema_becomes_a_table_and_what_does_not_fit_is_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    payloads = [
        b'{"kind": "a", "at": {"x": 1.5}, "list": [1, 2]}',
        b'{"kind": "b", "at": null, "list": null}',
        b'{"kind": "one field fewer"}',
        b'{"kind": "c", "list": [1, 2, 3]}',
        b"not JSON",
    ]
    path = foreign(tmp_path / "other.mcap", payloads)
    assert main(["log", "export", "--as", "csv", str(path)]) == 3
    text = (tmp_path / "other-csv" / "of_others.csv").read_text().splitlines()
    assert text[0] == '"t_s","log_ns","publish_ns","kind","at.x","list.1","list.2"'
    assert text[1:] == [
        '0.0,0,0,"a",1.5,1,2',
        '1e-9,1,1,"b",,,',
        '2e-9,2,2,"one field fewer",,,',
    ]
    said = capsys.readouterr().out
    assert "1 message left out: /of/others: list has 3 numbers, not 2" in said
