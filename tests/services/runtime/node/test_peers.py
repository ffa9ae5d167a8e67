"""Who else speaks: another Lindy on the other side, and two processes of one name."""

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.events import note
from messages.health import Health
from messages.identity import SideIdentity, difference
from messages.message import Message
from messages.payload import PayloadDecoder
from messages.topic import Direction, Qos, Topic
from services.runtime.config.identity import identity_of, messages_hash
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.loop_stats import Instance
from services.runtime.node.peers import NO_TOPSIDE, PATIENCE_NS, RECENT_NS, Peers
from tests.support.dive import Person
from tests.support.hindered_host import take_name

S = 1_000_000_000  # [ns]
TOPSIDE = SideIdentity(side="topside", instance=1, version="0.1", messages="abc", vehicle="pioneer")
DRONE = msgspec.structs.replace(TOPSIDE, side="drone", instance=2)


# SideIdentity.


class Older(Message, frozen=True, kw_only=True):
    """What another version may say under the same name."""

    side: str = "drone"
    instance: int = 9
    version: str = "0.0.3"


class Newer(SideIdentity, frozen=True, kw_only=True):
    colour: str = "yellow"  # nobody here knows what it means
    parts: tuple[int, ...] = (1, 2)


def test_the_identity_of_an_older_and_of_a_newer_version_is_understood() -> None:
    decoder = PayloadDecoder(topics.IDENTITY)
    newer = Newer(side="drone", version="2.0", messages="xyz")
    for said, version in ((Older(stamp_ns=5), "0.0.3"), (newer, "2.0")):
        heard = decoder.read(
            topics.IDENTITY.key, topics.IDENTITY.encoding, msgspec.msgpack.encode(said)
        )
        assert isinstance(heard, SideIdentity)
        assert heard.version == version
        assert "install the same" in difference(TOPSIDE, heard)
    empty = msgspec.msgpack.encode({})
    assert decoder.read(topics.IDENTITY.key, topics.IDENTITY.encoding, empty) == SideIdentity()


def test_a_difference_says_what_to_do() -> None:
    old = msgspec.structs.replace(DRONE, version="0.0.4", messages="xyz")
    assert difference(TOPSIDE, old) == (
        "the drone runs Lindy 0.0.4, with other messages; the topside runs 0.1: "
        "install the same on both machines"
    )
    file = msgspec.structs.replace(DRONE, vehicle_hash="1")
    assert "[vehicle] of pioneer differs" in difference(TOPSIDE, file)


class Before(Message, frozen=True, kw_only=True):
    depth: float


class After(Message, frozen=True, kw_only=True):
    depth: float
    heading: float = 0.0


class Said(Message, frozen=True, kw_only=True):
    """In other words."""

    depth: float


def row(kind: type[Message], name: str = "", hz: float = 1.0) -> "Topic[Message]":
    kind.__name__ = name or kind.__name__
    return Topic("depth", kind, hz, Qos.LIVE, Direction.UP)


def test_the_hash_of_the_messages_changes_with_a_field_and_a_row_but_not_with_words() -> None:
    before = messages_hash((row(Before, "Depth"),))
    assert before == messages_hash((row(Said, "Depth"),))
    assert before != messages_hash((row(After, "Depth"),))
    assert before != messages_hash((row(Before, "Depth", hz=2.0),))


def test_the_vehicle_is_the_same_whatever_else_is_set() -> None:
    here, same = Stack(), Stack(overrides=["control.depth.kp=3"], pilot="keyboard")
    heavier = Stack(overrides=["vehicle.mass=99"])
    assert difference(identity_of(here, "topside", 1), identity_of(same, "drone", 2)) == ""
    assert "[vehicle]" in difference(
        identity_of(here, "topside", 1), identity_of(heavier, "drone", 2)
    )


# Two of one name.


@given(st.lists(st.integers(1, 5 * S), min_size=1, max_size=20))
def test_one_process_after_another_is_never_two(pauses: list[int]) -> None:
    """However often it restarts: the one before does not speak again."""
    peers, now = Peers(DRONE), 0
    for k, pause in enumerate(pauses, start=1):
        for _ in range(3):
            now += pause
            peers.speaks("reference", k, 100 + k, now)
            assert peers.wrong(now) == ""


@given(st.integers(0, S), st.integers(2, 10))
def test_two_that_go_on_are_named_until_one_ends(offset: int, seconds: int) -> None:
    peers = Peers(DRONE)
    for second in range(seconds):
        peers.speaks("reference", 1, 11, second * S)
        peers.speaks("reference", 2, 22, second * S + offset)
    now = seconds * S
    assert peers.wrong(now) == "two services call themselves reference: pids 11, 22"
    for second in range(seconds, seconds + 5):
        peers.speaks("reference", 1, 11, second * S)
    assert peers.wrong((seconds + 4) * S) == ""


def test_it_forgets_the_other_side_after_a_while_and_misses_it_before() -> None:
    peers = Peers(TOPSIDE)
    peers.expect(0)
    assert peers.wrong(PATIENCE_NS - 1) == ""
    assert "does not say which Lindy" in peers.wrong(PATIENCE_NS)
    peers.identity(msgspec.structs.replace(DRONE, version="9"), PATIENCE_NS)
    assert "Lindy 9" in peers.wrong(PATIENCE_NS)
    peers.identity(msgspec.structs.replace(TOPSIDE, version="8"), PATIENCE_NS)  # another pilot
    assert "Lindy 9" in peers.wrong(PATIENCE_NS)
    assert peers.wrong(PATIENCE_NS + RECENT_NS + 1) == ""


def test_a_drone_that_hears_no_topside_says_how_to_start_one() -> None:
    peers, host = Peers(DRONE), VirtualHost()
    peers.expect(0)
    assert peers.wrong(PATIENCE_NS) == NO_TOPSIDE
    said = list[Health]()
    host.node("ear", ["topside"]).each(topics.HEALTH, lambda health, _: said.append(health))
    host.node("gamepad", ["topside"])
    host.run(2 * S)
    peers.health(said[0], PATIENCE_NS)
    assert "does not say which Lindy" in peers.wrong(PATIENCE_NS)


# In the stack.


def stack_with(instances: dict[str, Instance]) -> tuple[VirtualHost, list[str]]:
    """The drone and its link monitor, and what the pilot is told."""
    host, rows, told = VirtualHost(), Registry.read(), list[str]()
    stack = Stack(virtual=True, overrides=["estimation.calibration.still_time=1"])
    for name, spec in rows.items():
        if name in ("tether", "simulator", "estimation", "reference", "control", "link_monitor"):
            node = host.add(name, spec, stack)
            node.instance = instances.get(name, Instance(7, 7))
    ear = host.node("screen", ["topside"])
    ear.each(topics.LATENCY, lambda budget, _: told.append(note(budget.alarms)))
    return host, told


def test_another_version_on_board_is_on_the_pilots_screen() -> None:
    host, told = stack_with({})
    host.run(2 * S)
    assert told[-1] == ""
    other = msgspec.structs.replace(DRONE, version="0.0.3", messages="old")
    host.node("old_drone", ["drone"]).publisher(topics.IDENTITY.of("drone")).put(other)
    host.run(4 * S)
    assert "(the drone runs Lindy 0.0.3, with other messages" in told[-1]
    assert host.nodes["link_monitor"].counts["alarm:peers"] == 1


def twin_of(host: VirtualHost, name: str) -> None:
    """A second service of that name, in another process."""
    twin = host.node("twin", ["drone"])
    twin.instance = Instance(8, 8)
    take_name(twin, name)


def test_nobody_arms_while_two_services_on_board_have_one_name() -> None:
    """Nor with another Lindy topside."""
    host, told = stack_with({})
    twin_of(host, "control")
    pilot = Person(host)
    host.run(5 * S)
    refused = pilot.ask("arm")
    assert refused == "two services call themselves control: pids 7, 8"
    host.run(host.now + S)
    assert refused in told[-1]  # on his screen, too
    host.kill("twin")
    host.run(host.now + 5 * S)
    assert pilot.ask("arm") == ""
    other = msgspec.structs.replace(TOPSIDE, version="0.0.3", messages="old", instance=99)
    stranger = host.node("old_topside", ["topside"]).publisher(topics.IDENTITY.of("topside"))
    stranger.put(msgspec.structs.replace(other, stamp_ns=host.now))
    host.run(host.now + S)
    assert pilot.ask("arm").startswith("the topside runs Lindy 0.0.3, with other messages; the dr")
    assert pilot.ask("disarm") == "", "only arming is refused"
