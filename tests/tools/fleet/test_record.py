"""`lindy record`: a recording like any other of every drone that speaks, and of no other name."""

import json
import re
import time
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.message import Message
from messages.topic import AnyTopic
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.spaces import here_key, namespace
from services.runtime.config.identity import identity_of
from services.runtime.config.stack import Stack
from tests.support.synthetic import due, said, said_by
from tools.__main__ import main
from tools.fleet import record as recording_of_all
from tools.fleet.gaps import SILENT_NS, Gaps
from tools.fleet.record import Arrivals, FleetRecorder
from tools.log.cut import cut
from tools.recordings.recording import open_recording

TICK_NS = 10_000_000


class Network:
    """What comes from drones, without a network."""

    def __init__(self, folder: Path, *only: str) -> None:
        self.arrivals = Arrivals()
        self.recorder = FleetRecorder("tcp/127.0.0.1:1", folder, only)
        self.sent: dict[str, int] = {}

    def announce(self, *names: str) -> None:
        for name in names:
            self.arrivals.tokens.append((here_key(namespace(name), "drone", "1"), True))

    def say(self, name: str, topic: AnyTopic, message: Message) -> None:
        payload = msgspec.msgpack.encode(message)
        key = f"{namespace(name)}/{topic.key}"
        self.arrivals.store(Envelope(key, payload, topic.encoding))

    def introduce(self, name: str, vehicle: str = "pioneer") -> None:
        identity = identity_of(Stack(), "drone", 1)
        identity = msgspec.structs.replace(identity, vehicle=vehicle)
        self.say(name, topics.IDENTITY.of("drone"), identity)

    def fly(self, name: str, seconds: float = 1.0) -> None:
        streams = said_by("drone", name)
        for tick in range(round(100 * seconds)):
            for number in due(streams, tick):
                stream = streams[number]
                if stream.topic.key.endswith("identity/drone"):
                    continue
                self.sent[name] = self.sent.get(name, 0) + 1
                row = stream.topic.key.split("/", 3)[3]
                topic = topics.find(row)
                assert topic is not None
                message = said(stream, self.sent[name], tick * TICK_NS)
                key = stream.topic.key
                payload = msgspec.msgpack.encode(message)
                self.arrivals.store(Envelope(key, payload, topic.encoding))

    def end(self) -> list[str]:
        self.recorder.look(self.arrivals)
        self.recorder.close()
        return self.recorder.summary()


def test_two_drones_are_two_recordings_of_which_a_part_can_be_cut(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    network = Network(tmp_path)
    network.announce("rov1", "rov2")
    for name in ("rov1", "rov2"):
        network.introduce(name)
        network.fly(name)
        network.fly(name)
    first, second = network.end()
    assert first.startswith("rov1: ")
    assert second.startswith("rov2: ")
    assert not network.recorder.lost
    recording = open_recording(tmp_path / "rov1")
    about = recording.metadata("dive")
    assert (about["drone"], about["vehicle"]) == ("rov1", "pioneer")
    states = [entry for entry in recording if entry.key == topics.STATE.key]
    assert 180 <= len(states) <= 200  # those before its first status have no file yet
    assert main(["log", "info", str(tmp_path / "rov1")]) == 0
    assert "rov1 · pioneer" in capsys.readouterr().out
    part = tmp_path / "part.mcap"
    assert cut(tmp_path / "rov1", out=part, topics=("state",)) == 0
    assert {entry.key for entry in open_recording(part)} == {"state"}


def test_only_drones_that_speak_get_a_file_and_only_those_that_are_wanted(tmp_path: Path) -> None:
    network = Network(tmp_path, "rov1")
    network.announce(*(f"ghost{k}" for k in range(1000)), "rov1", "rov2")
    for name in ("rov1", "rov2"):
        network.introduce(name)
        network.fly(name, 0.3)
    network.end()
    assert [path.name for path in tmp_path.iterdir()] == ["rov1"]


@pytest.mark.parametrize("vehicle", ["/dev/stdin", "../../secret", "nobodys_boat", "", "pioneer "])
def test_what_a_stranger_calls_itself_opens_nothing_of_this_machine(
    tmp_path: Path, vehicle: str
) -> None:
    out = tmp_path / "out"
    network = Network(out)
    for name in ("..", ".", ".hidden", "rov1"):
        network.announce(name)
        network.introduce(name, vehicle)
        network.fly(name, 0.3)
    network.end()
    assert sorted(path.name for path in out.iterdir()) == ["_.hidden", "rov1"]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    recording = open_recording(out / "rov1")
    assert recording.metadata("dive")["vehicle"] == vehicle
    assert sum(1 for _ in recording) > 50


def test_what_comes_too_fast_or_cannot_be_read_is_counted_in_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording_of_all, "KEPT", 100)
    network = Network(tmp_path)
    network.announce("rov1")
    network.introduce("rov1")
    network.fly("rov1", 0.2)
    network.recorder.look(network.arrivals)
    network.arrivals.store(Envelope(f"{namespace('rov1')}/state", b"\xc1", topics.STATE.encoding))
    network.fly("rov1", 1.0)
    network.end()
    losses = open_recording(tmp_path / "rov1").metadata("losses")
    assert losses["malformed:state"] == "1"
    assert int(losses["overflowed"]) > 100
    assert network.recorder.lost


@given(st.lists(st.integers(0, 3 * SILENT_NS), min_size=1, max_size=30), st.integers(0, 9))
def test_gaps_are_the_long_silences_however_often_somebody_looks(
    steps: list[int], looks: int
) -> None:
    gaps, now, said, noticed = Gaps(0), 0, list[int](), 0
    for step in steps[:-1]:
        noticed += sum(gaps.look(now + step * k // 10) for k in range(looks))
        now += step
        said.append(gaps.hear(now))
    gaps.look(now + steps[-1])
    long = [step for step in steps if step > SILENT_NS]
    assert (gaps.count, gaps.total_ns) == (len(long), sum(long))
    assert [gap for gap in said if gap] == [step for step in steps[:-1] if step > SILENT_NS]
    assert noticed <= len(long)
    assert bool(gaps.words) == bool(long)


@given(st.lists(st.tuples(st.integers(0, 3 * SILENT_NS), st.booleans()), max_size=30))
def test_silence_is_a_gap_unless_the_drone_said_that_it_ends(
    steps: list[tuple[int, bool]],
) -> None:
    """Each step: how long nothing comes, and then a message, or that it ends."""
    gaps, now, expected, left = Gaps(0), 0, list[int](), None
    for step, leaves in steps:
        now += step
        gaps.look(now)
        if left is None and step > SILENT_NS:
            expected.append(step)
        if leaves:
            gaps.leave(now)
            left = now
        else:
            gaps.hear(now)
            left = left if left is not None and now - left <= SILENT_NS else None
        assert gaps.left_ns == left
    assert gaps.count == len(expected)
    assert gaps.total_ns == sum(expected)


def test_a_drone_that_ended_is_no_gap_and_no_loss_until_it_is_back_and_silent(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = time.monotonic_ns()
    monkeypatch.setattr(time, "monotonic_ns", lambda: now)
    network = Network(tmp_path)
    network.announce("rov1")
    network.introduce("rov1")
    network.fly("rov1", 0.3)
    network.arrivals.leave("rov1")
    network.arrivals.leave("rov2")  # nobody whom it records
    network.recorder.look(network.arrivals)
    network.recorder.notice_silence(now := now + 10 * SILENT_NS)
    said = capsys.readouterr().out.partition("\n")[2]
    assert re.fullmatch(r"rov1 left at \d\d:\d\d:\d\d UTC\n", said)
    assert not network.recorder.lost
    assert said.strip().removeprefix("rov1 ") in network.recorder.summary()[0]
    network.fly("rov1", 0.1)
    network.recorder.look(network.arrivals)
    network.recorder.notice_silence(now + 2 * SILENT_NS)
    lines = capsys.readouterr().out.splitlines()
    assert lines == ["rov1 is there again", "rov1 is not heard any more: nothing came for 3 s"]
    assert network.recorder.lost
    assert "left at" not in network.end()[0]


def test_a_drone_that_falls_silent_is_said_counted_and_a_loss(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = time.monotonic_ns()
    monkeypatch.setattr(time, "monotonic_ns", lambda: now)
    network = Network(tmp_path)
    network.announce("rov1", "rov2")
    for name in ("rov1", "rov2"):
        network.introduce(name)
        network.fly(name, 0.3)
    network.recorder.look(network.arrivals)
    network.recorder.notice_silence(now := now + SILENT_NS)
    assert "heard" not in capsys.readouterr().out
    assert not network.recorder.lost
    network.fly("rov2", 0.1)
    network.recorder.look(network.arrivals)
    for _ in range(2):
        network.recorder.notice_silence(now := now + 1_000_000_000)
    said = capsys.readouterr().out
    assert said.splitlines() == ["rov1 is not heard any more: nothing came for 3 s"]
    network.fly("rov1", 0.1)
    network.fly("rov2", 0.1)
    first, second = network.end()
    assert capsys.readouterr().out == "rov1 is heard again after 5 s\n"
    assert first.endswith(f"{tmp_path / 'rov1'}, 1 gap, 5 s in all")
    assert second.endswith(str(tmp_path / "rov2"))
    assert network.recorder.lost


def test_an_earlier_recording_is_never_written_over(tmp_path: Path) -> None:
    for _ in range(2):
        network = Network(tmp_path)
        network.announce("rov1")
        network.introduce("rov1")
        network.fly("rov1", 0.2)
        network.end()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rov1", "rov1-2"]


def test_a_file_where_a_recording_would_be_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "rov1").write_text("mine")
    network = Network(tmp_path)
    network.announce("rov1")
    network.introduce("rov1")
    network.fly("rov1", 0.2)
    network.end()
    said = capsys.readouterr().out
    assert said == f"rov1 is not recorded: {tmp_path / 'rov1'}: file exists\n"
    assert (tmp_path / "rov1").read_text() == "mine"
    assert network.recorder.lost


def test_where_nobody_was_heard_one_sentence_says_so(tmp_path: Path) -> None:
    network = Network(tmp_path)
    assert network.end() == ["no drone was heard"]
    assert network.recorder.lost
    assert json.dumps([*tmp_path.iterdir()]) == "[]"


def test_a_wanted_drone_that_was_never_heard_is_named_beside_those_that_were(
    tmp_path: Path,
) -> None:
    network = Network(tmp_path, "rov1", "rov9", "rov8")
    network.announce("rov9", "rov2", "rov1", "ghost")  # a name alone is no drone
    for name in ("rov1", "rov2", "ghost"):
        if name != "ghost":
            network.introduce(name)
        network.fly(name, 0.3)
    recorded, missing = network.end()
    assert recorded.startswith("rov1: ")
    assert missing == "never heard: rov8, rov9; heard, and not asked for: rov2"
    assert network.recorder.lost


@given(
    st.sets(st.sampled_from(["rov1", "rov2", "rov3"])),
    st.sets(st.sampled_from(["rov1", "rov2", "rov3"])),
)
def test_a_drone_that_is_missing_is_a_loss_and_one_that_is_not_wanted_is_none(
    tmp_path_factory: pytest.TempPathFactory, wanted: set[str], there: set[str]
) -> None:
    network = Network(tmp_path_factory.mktemp("fleet"), *wanted)
    for name in sorted(there):
        network.announce(name)
        network.introduce(name)
        network.fly(name, 0.3)
    said = "\n".join(network.end())
    assert network.recorder.lost == (not (wanted <= there if wanted else there))
    never = said.partition("never heard: ")[2].partition(";")[0]
    assert {name for name in never.split(", ") if name} == wanted - there
    assert set(network.recorder.recordings) == (wanted & there if wanted else there)


def test_twenty_other_drones_are_not_all_listed(tmp_path: Path) -> None:
    network = Network(tmp_path, "rov99")
    for k in range(20):
        network.announce(f"rov{k:02}")
        network.introduce(f"rov{k:02}")
        network.fly(f"rov{k:02}", 0.2)
    (said,) = network.end()
    assert said.endswith("rov08, rov09 and 10 more")


@pytest.mark.parametrize(
    ("count", "words"), [(0, ""), (1, "1 gap, 4 s in all"), (3, "3 gaps, 12 s in all")]
)
def test_gaps_in_words(count: int, words: str) -> None:
    gaps = Gaps(0)
    for k in range(count):
        gaps.hear((k + 1) * 4_000_000_000)
    assert gaps.words == words
