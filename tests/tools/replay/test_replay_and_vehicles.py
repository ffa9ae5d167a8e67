"""A recorded command never moves a vehicle: a replay has keys of its own, a mark that every port of
a live dive refuses, and hubs of vehicles let nothing of it through."""

from collections import Counter
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.events import Outbox
from messages.topic import AnyTopic
from services.runtime.bus.access_control import HubSide
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.spaces import namespace
from services.runtime.bus.zenoh_bus import ZenohBus, connected, listening
from services.runtime.config.stack import REPLAY, Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.gate import Gate
from tests.golden.dives import OVERRIDES, SCRIPT, golden
from tests.support.patience import until
from tools.recordings.recording import Raw
from tools.replay.play import Republisher
from tools.replay.source import open_source

CHAIN = ("simulator", "estimation", "reference", "control", "tether", "gamepad")
COMMANDS = ("control/thrusters", "pilot/command", "pilot/request")
MOTION = ("simulator/truth", "state", "reference", "control/thrusters")
ARMED_S, SECONDS = 3.5, 7.0
VEHICLE, IN_REPLAY = namespace("pioneer"), namespace(f"{REPLAY}/pioneer")


class Flown(NamedTuple):
    published: dict[str, list[bytes]]  # by the services, by key
    counts: dict[str, Counter[str]]  # by service
    sent: Counter[str]  # by the replay, on board


def fly(folder: Path, attack: list[Raw], *, marked: bool = True) -> Flown:
    """A simulated dive, with recorded messages played onto the keys of the vehicle itself, on both
    sides, as no replay does."""
    (folder / "script.csv").write_text(SCRIPT)
    script = f"script:{folder / 'script.csv'}"
    stack = Stack(pilot=script, out=str(folder), overrides=OVERRIDES)
    host, services = VirtualHost(), Registry.read()
    for name in CHAIN:
        host.add(name, services[name], stack)
    board, above = host.side("drone"), host.side("topside")
    published: dict[str, list[bytes]] = {key: [] for key in MOTION}
    for key in MOTION:
        board.hear(key, lambda envelope: published[envelope.key].append(envelope.payload))
    sent: Counter[str] = Counter()

    def send(envelope: Envelope) -> None:
        topic = topics.find(envelope.key)
        assert topic is not None
        encoding = envelope.encoding if marked else topic.encoding
        sent[envelope.key] += 1
        for port in (board, above):  # a port does not hear itself
            port.forward(replace(envelope, encoding=encoding, message=None))

    replay = Republisher(open_source(golden("pioneer")).recording, send)
    for k, raw in enumerate(attack):
        host.run(round((ARMED_S + (SECONDS - ARMED_S) * k / len(attack)) * 1e9))
        replay.send(raw, host.now)
        host.settle()
    host.run(round(SECONDS * 1e9))
    return Flown(published, {name: host.nodes[name].counts for name in CHAIN}, sent)


@pytest.fixture(scope="module")
def recorded() -> list[Raw]:
    """Of a dive that was armed: all its commands, and of everything else something."""
    rows = list(open_source(golden("pioneer")).raw())
    begin = rows[0].log_ns + round(4e9)
    return [
        raw
        for k, raw in enumerate(rows)
        if raw.log_ns > begin and (raw.key in COMMANDS or k % 20 == 0)
    ]


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    return fly(tmp_path_factory.mktemp("alone"), [])


@pytest.mark.slow
def test_a_live_dive_accepts_nothing_of_a_replay(
    recorded: list[Raw], alone: Flown, tmp_path: Path
) -> None:
    flown = fly(tmp_path, recorded)
    assert flown.published == alone.published  # not a byte of the dive is another
    assert flown.sent["control/thrusters"] > 30
    assert flown.sent["pilot/command"] > 300
    refused = flown.counts
    assert refused["simulator"]["replayed:control/thrusters"] == flown.sent["control/thrusters"]
    assert refused["reference"]["replayed:pilot/command"] >= flown.sent["pilot/command"]
    assert refused["control"]["replayed:reference"] == flown.sent["reference"]


def test_without_the_mark_it_would_have_been_obeyed(
    recorded: list[Raw], alone: Flown, tmp_path: Path
) -> None:
    flown = fly(tmp_path, recorded, marked=False)
    assert flown.published["simulator/truth"] != alone.published["simulator/truth"]


@given(st.sampled_from(topics.ALL), st.booleans(), st.booleans())
def test_only_an_onlooker_of_a_replay_takes_it(
    topic: AnyTopic, onlooker: bool, in_replay: bool
) -> None:
    counts: Counter[str] = Counter()
    gate = Gate(topic, Outbox(counts), onlooker=onlooker, replay=in_replay)
    gate.admit(Envelope(topic.key, b"", topic.replayed), 0)
    (reason,) = counts
    assert reason.startswith("malformed:" if onlooker and in_replay else "replayed:")
    counts.clear()
    gate.admit(Envelope(topic.key, b"", topic.encoding), 0)
    (reason,) = counts
    assert reason.startswith("wrong_type:" if onlooker and in_replay else "malformed:")


def test_no_vehicle_can_have_the_name_of_a_replay() -> None:
    assert Stack(overrides=['vehicle.name="@replay"']).space == "replay"
    assert Stack(replay=True).space == "@replay/pioneer"
    assert Stack().space == "pioneer"


@pytest.mark.slow
@pytest.mark.parametrize("side", [None, HubSide("drone", VEHICLE)])
def test_a_vehicles_hub_lets_no_replay_through_and_another_does(
    tmp_path: Path, side: HubSide | None
) -> None:
    """The player comes over the private socket, as a service on board, and may say most there."""
    endpoint = f"unixsock-stream/{tmp_path}/hub.sock"
    with ExitStack() as exits:
        exits.enter_context(listening(endpoint, hub_side=side))

        def bus(space: str) -> ZenohBus:
            return ZenohBus(exits.enter_context(connected(endpoint, space)))

        heard, in_replay = list[Envelope](), list[Envelope]()
        bus(VEHICLE).hear("**", heard.append)
        player, listener = bus(IN_REPLAY), bus(IN_REPLAY)
        listener.hear("**", in_replay.append)
        source = open_source(golden("pioneer"))
        raw = next(r for r in source.raw() if r.key in COMMANDS)
        play = Republisher(source.recording, player.forward).send
        last = bus(VEHICLE).say(topics.LOG.of("last"))

        def both() -> None:
            play(raw, 0)
            last(b"")

        until(lambda: heard and (in_replay or side), meanwhile=both)
        assert {envelope.key for envelope in heard} == {"log/last"}
        assert bool(in_replay) == (side is None)
