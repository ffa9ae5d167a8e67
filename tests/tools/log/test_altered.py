"""Recordings in which somebody has altered messages: taken or refused by a sentence, and said."""

import json
from pathlib import Path

import pytest

from tools.__main__ import main
from tools.recordings.mcap_records import StoredMessage

from .conftest import Alter, ShortDive, rewritten

# What no message of ours holds, as JSON.
STRANGE = ["1e309", "-1e308", "NaN", "9" * 400, '"x"', "null", "[]", "{}", "[[[1]]]", "-0.5"]


def with_strange_fields(_: str, message: StoredMessage) -> StoredMessage:
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


def years_later(_: str, message: StoredMessage) -> StoredMessage:
    return message._replace(log_ns=message.log_ns + message.sequence % 2 * 10**18)


def at_no_time(_: str, message: StoredMessage) -> StoredMessage:
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


@pytest.mark.parametrize("alter", [years_later, at_no_time])
@pytest.mark.parametrize(
    "words", [("replay", "--through", "control", "--diff"), ("review", "--quick")]
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


@pytest.mark.parametrize(
    "words", [("replay", "--through", "control", "--diff"), ("review", "--quick")]
)
def test_what_is_wrong_in_its_vehicle_file_is_said_of_the_recording(
    dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    def no_mass(name: str, data: bytes) -> bytes:
        return data.replace(b"\nmass = ", b"\nmass = nan # ") if name.endswith(".toml") else data

    path = rewritten(dive, tmp_path / "wrong.mcap", attached=no_mass)
    assert main([words[0], str(path), *words[1:]]) == 1
    assert f"lindy: {path}: my_drone.toml:" in capsys.readouterr().err


@pytest.mark.parametrize("data", [b"", b"\x89MCAP0", b"\x89MCAP0\r\n"])
@pytest.mark.parametrize(
    "verb",
    ["log export --as sticks --out x.csv", "log film --out x.mp4",
     "log snapshots --out x", "log check",
     "log export --as csv", "identify", "simulate --from"],
)  # fmt: skip
def test_a_recording_that_had_only_begun_is_not_something_else(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    verb: str,
    data: bytes,
) -> None:
    """Such as one in which nobody flew, or one that Lindy did not record."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "empty.mcap"
    path.write_bytes(data)
    assert main([*verb.split(), str(path)]) == 1
    assert capsys.readouterr().err.startswith(f"lindy: {path} holds no messages; ")
