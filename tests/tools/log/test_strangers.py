"""Recordings that somebody has altered: every verb says so, and none is led astray."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mcap.records import Attachment, Channel, Metadata, Schema
from mcap.writer import Writer

from tests.support.recorded import Alter, ShortDive, rewritten
from tools.__main__ import GROUPS, LOG, main
from tools.log.check import Account, unrecorded_in
from tools.recordings.mcap_copy import new_mcap
from tools.recordings.mcap_records import Raw, records

Tree = dict[str, Any]
Edit = Callable[[str, Tree], Tree]  # a message of a key
CLEAR = "\x1b[2J\x1b]0;owned\x07"  # an order to a terminal


def as_it_is(_: str, tree: Tree) -> Tree:
    return tree


def forged(
    source: Path,
    out: Path,
    edit: Edit = as_it_is,
    *,
    metadata: dict[str, Tree] | None = None,
    named: str = "",
) -> Path:
    """
    Args:
        metadata: more of it, by the name.
        named: stands behind the names of attachments and in that of one more topic.
    """
    keys = dict[int, str]()
    with new_mcap(out) as copy:
        copy.next_file()
        for record in records(source):
            if isinstance(record, Channel):
                keys[record.id] = record.topic
            elif isinstance(record, Attachment):
                record.name += named
            elif isinstance(record, Raw):
                tree = edit(keys[record.channel_id], json.loads(record.data))
                data = json.dumps(tree, separators=(",", ":")).encode()
                record = record._replace(data=data)
            copy.add(record)
        for name, entries in (metadata or {}).items():
            copy.metadata(Metadata(name, entries))
        if named:
            copy.add(Schema(id=9999, data=b"{}", encoding="jsonschema", name=named))
            copy.add(Channel(9999, named, "json", {}, 9999))
            copy.add(Raw("", b"{}", 1, 1, channel_id=9999))
    return out


def test_a_topic_that_is_missing_as_a_whole_is_noticed() -> None:
    own = {"state": Account(before=10, sent=5990, recorded=5990),
           "sensor/imu": Account(before=0, sent=6000, recorded=6000),
           "health/estimation": Account(before=0, sent=60, recorded=60),
           "health/gamepad": Account(before=0, sent=60, recorded=60),
           "pilot/command": Account(before=0, sent=3000, recorded=3000)}  # fmt: skip
    services, sent = {"estimation"}, 12_060
    assert unrecorded_in(own, services, sent, "drone") == []
    assert unrecorded_in(own, services, sent + 100, "drone") == []
    del own["state"]
    assert unrecorded_in(own, services, sent, "drone") == [
        "the services of the drone's side have sent 12060 messages, and the topics here are of "
        "6060: whole topics are missing"
    ]


def orders(_: str, tree: Tree) -> Tree:
    """In every field whose words the sender chooses."""
    free = {"text", "source", "note", "words", "reason", "name", "version", "vehicle", "commit"}
    return {
        key: f"{said}{CLEAR}" if key in free and isinstance(said, str) else said
        for key, said in tree.items()
    }


VERBS_OF_A_FILE: dict[tuple[str, ...], tuple[str, ...]] = {  # what each needs besides
    ("log", "info"): (), ("log", "check"): (), ("calibrate", "noise"): (),
    ("log", "export", "--as", "csv"): ("--out", "csv"),
    ("log", "export", "--as", "parquet"): ("--out", "parquet"),
    ("log", "cut"): ("--out", "cut.mcap", "--from", "0.2"),
    ("log", "recover"): ("--out", "whole.mcap"),
    ("log", "export", "--as", "sticks"): ("--out", "sticks.csv"),
    ("log", "film"): ("--out", "film.mp4"), ("log", "snapshots"): ("--out", "pictures"),
    ("log", "compare"): ("FORGED",),
    ("log", "export", "--as", "rosbag"): ("--out", "bag"),
    ("review",): ("--out", "page.html"), ("replay",): ("--through", "control", "--diff"),
    ("import",): ("--out", "imported"), ("log", "export", "--as", "trace"): ("--out", "trace.csv"),
    ("calibrate", "gyroscope"): ("--vehicle", "pioneer"),
    ("identify",): ("--vehicle", "pioneer"), ("simulate", "--from"): ("--no-files",),
}  # fmt: skip


def test_every_verb_of_recordings_is_among_them() -> None:
    assert {words[1] for words in VERBS_OF_A_FILE if words[0] == "log"} == {*LOG}
    assert {words[0] for words in VERBS_OF_A_FILE} >= {*GROUPS["Recordings"]}


@pytest.fixture(scope="module")
def hostile(clean_dive: ShortDive, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Recordings with orders to a terminal everywhere: in names too, which makes a verb refuse the
    file, and not in names, where each goes on."""
    files = dict[str, Path]()
    for how, name in (("names too", CLEAR), ("not in names", "")):
        dive = {"vehicle": f"pioneer{name}", "drone": f"x{CLEAR}", "side": "drone"}
        dive |= dict.fromkeys(("pilot", "link", "seed", "overrides"), CLEAR)
        about = {"dive": dict[str, Any](dive)}
        about |= {"recovered": {"found": CLEAR}, "losses": {CLEAR: "3"}, "cut": {"topics": CLEAR}}
        out = tmp_path_factory.mktemp("hostile") / f"forged{name}.mcap"
        source = clean_dive.folder / "dive.mcap"
        files[how] = forged(source, out, orders, metadata=about, named=name)
    return files


SOME = {
    ("log", "info"),
    ("log", "check"),
    ("log", "export", "--as", "csv"),
    ("review",),
    ("import",),
}


@pytest.mark.parametrize(
    ("words", "how"),
    [
        pytest.param(words, how, marks=() if words in SOME else pytest.mark.slow)
        for words in VERBS_OF_A_FILE
        for how in ("names too", "not in names")
    ],
)
def test_no_verb_prints_what_a_terminal_would_obey(
    hostile: dict[str, Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    how: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / hostile[how].name
    path.symlink_to(hostile[how])
    more = [str(path) if word == "FORGED" else word for word in VERBS_OF_A_FILE[words]]
    status = main([*words, str(path), *more])
    said = capsys.readouterr()
    assert status in (0, 1, 3), said.err
    assert "in Lindy itself" not in said.err
    assert "is not expected" not in said.err
    assert "needs a value" not in said.err
    assert not {"\x1b", "\x07"} & {*said.out, *said.err}


NONSENSE: list[dict[str, Tree]] = [
    {
        "losses": {"lost state": "many"}, "cut": {"origin_ns": "9" * 5000},
        "dive": {"overrides": "no list"}, "hash": {"parts": "x", "sha256": "y"},
    },
    {"losses": {"lost state": "9" * 5000}, "cut": {"origin_ns": "²"}},
]  # fmt: skip


@pytest.mark.parametrize("metadata", NONSENSE, ids=["one", "other"])
def test_metadata_of_no_sense_is_no_error_of_lindy(
    clean_dive: ShortDive,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    metadata: dict[str, Tree],
) -> None:
    source = clean_dive.folder / "dive.mcap"
    path = forged(source, tmp_path / "forged.mcap", metadata=metadata)
    for verb in ("info", "check"):
        assert main(["log", verb, str(path)]) in (0, 3)
        assert "in Lindy itself" not in capsys.readouterr().err


def test_what_is_nested_without_end_is_one_message_left_out(
    clean_dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, path = clean_dive.folder / "dive.mcap", tmp_path / "deep.mcap"
    deep = b'{"a":' * 100_000 + b"1" + b"}" * 100_000
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("VehicleStatus", "jsonschema", b"{}")
        channel = writer.register_channel("vehicle/status", "json", schema)
        writer.add_message(channel, 1, deep, 1, 0)
        for record in records(source):
            if isinstance(record, Metadata):
                writer.add_metadata(record.name, record.metadata)
        writer.add_attachment(0, 0, "dive.json", "application/json", b"[" * 100_000)
        writer.finish()
    for verb in ("info", "check", "export --as csv", "export --as sticks", "compare"):
        words = [str(path), str(path)] if verb == "compare" else [str(path)]
        assert main(["log", *verb.split(), *words]) in (0, 1, 3)
        assert "in Lindy itself" not in capsys.readouterr().err


@pytest.mark.parametrize("entries", [{"seed": "x"}, {"overrides": "no list"}])
def test_a_replay_says_what_makes_no_sense_in_a_recording(
    clean_dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str], entries: Tree
) -> None:
    source = clean_dive.folder / "dive.mcap"
    path = forged(source, tmp_path / "forged.mcap", metadata={"dive": entries}, named="-2")
    assert main(["replay", str(path), "--through", "control", "--diff"]) == 1
    assert "does not say with which seed and settings it was flown" in capsys.readouterr().err


# What no message of ours holds, as JSON.
STRANGE = ["1e309", "-1e308", "NaN", "9" * 400, '"x"', "null", "[]", "{}", "[[[1]]]", "-0.5"]


def with_strange_fields(_: str, message: Raw) -> Raw:
    """Every third message: all fields but stamp and number."""
    if message.sequence % 3:
        return message
    tree = json.loads(message.data)
    kept = {name: json.dumps(tree[name]) for name in ("stamp_ns", "seq") if name in tree}
    strange = {
        name: STRANGE[(message.sequence + place) % len(STRANGE)]
        for place, name in enumerate(tree)
        if name not in kept
    }
    said = ",".join(f'"{name}":{text}' for name, text in (kept | strange).items())
    return message._replace(data=f"{{{said}}}".encode())


def years_later(_: str, message: Raw) -> Raw:
    return message._replace(log_ns=message.log_ns + message.sequence % 2 * 10**18)


def at_no_time(_: str, message: Raw) -> Raw:
    return message._replace(log_ns=2**64 - 1) if message.sequence % 100 == 7 else message


def test_it_is_compared_as_far_as_it_can_be_read_and_the_rest_is_counted(
    dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    strange = rewritten(dive, tmp_path / "strange.mcap", with_strange_fields)
    assert main(["log", "compare", str(strange), str(dive.folder)]) == 3
    assert "messages could not be read" in capsys.readouterr().out
    assert main(["replay", str(strange), "--through", "control", "--diff"]) == 1
    out, err = capsys.readouterr()
    assert "messages could not be read" in out + err
    assert "an error in Lindy itself" not in out + err


@pytest.mark.parametrize(
    ("alter", "words"),
    [
        (years_later, ("replay", "--through", "control", "--diff")),
        (at_no_time, ("review",)),
    ],
)
def test_nobody_walks_through_the_years_between_two_messages(
    dive: ShortDive,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    alter: Alter,
    words: tuple[str, ...],
) -> None:
    path = rewritten(dive, tmp_path / "far.mcap", alter)
    assert main([words[0], str(path), *words[1:]]) == 1
    assert f"{path}: its messages are" in (said := capsys.readouterr().err)
    assert said.endswith("some have a wrong time\n")


@pytest.mark.parametrize("words", [("replay", "--through", "control", "--diff"), ("review",)])
def test_what_is_wrong_in_its_vehicle_file_is_said_of_the_recording(
    dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    def no_mass(name: str, data: bytes) -> bytes:
        if name == "dive.json":  # whoever altered the file altered its checksum
            return re.sub(rb'"sha256": "\w*"', b'"sha256": ""', data)
        return data.replace(b"\nmass = ", b"\nmass = nan # ") if name.endswith(".toml") else data

    path = rewritten(dive, tmp_path / "wrong.mcap", attached=no_mass)
    assert main([words[0], str(path), *words[1:]]) == 1
    assert f"lindy: {path}: my_drone.toml:" in capsys.readouterr().err
