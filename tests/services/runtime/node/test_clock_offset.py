"""Two machines, two clocks: stamps are local wherever they are read, and nothing old passes."""

from collections import Counter

import msgspec
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.events import Outbox
from messages.link import Clock
from messages.pilot import PilotCommand
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import Skew, VirtualHost
from services.runtime.node.clock_offset import ClockOffset
from services.runtime.node.gate import Gate
from services.runtime.node.ports import Inbox, Latest
from tests.support.messages import example

MS, SECOND = 1_000_000, 1_000_000_000
GATEWAY = ServiceSpec(sides=["topside", "drone"], gateway=True)


def joined(clocks: dict[str, Skew] | None, link: str = "tether") -> VirtualHost:
    host, stack = VirtualHost(clocks), Stack(link=link)
    host.add("tether", GATEWAY, stack)
    every = Registry.read()
    monitor = every.only({"link_monitor": every["link_monitor"]})
    host.add_all(monitor if clocks is None else monitor.apart(), stack)
    return host


def told(clock_offset: ClockOffset, ahead: int, bound: int, now: int = 0) -> None:
    """The link monitor's word on the drone's clock, heard on board."""
    clock = example(Clock, offset_ns=ahead, bound_ns=bound)
    clock_offset.learn(clock, now)


def envelope(message: PilotCommand) -> Envelope:
    topic = topics.PILOT_COMMAND
    return Envelope(topic.key, msgspec.msgpack.encode(message), topic.encoding)


@given(error=st.integers(-200, 200), better=st.integers(-200, 200), earlier=st.integers(0, 100))
@settings(max_examples=100, deadline=None)
def test_better_knowledge_of_the_clock_lets_no_older_message_pass_a_newer_one(
    error: int, better: int, earlier: int
) -> None:
    """`error` and `better` [ms] are what the clock is taken to be wrong by, before and after."""
    clock_offset, counts = ClockOffset("drone"), Counter[str]()
    gate = Gate(topics.PILOT_COMMAND, Outbox(counts), clock_offset)
    told(clock_offset, error * MS, abs(error) * MS, SECOND)
    newest = gate.admit(envelope(command(SECOND)), SECOND + 20 * MS)
    told(clock_offset, better * MS, abs(better) * MS, SECOND)
    older = gate.admit(envelope(command(SECOND - earlier * MS)), SECOND + 40 * MS)
    assert newest is None or older is None
    assert counts["lost:pilot/command"] == 0
    assert gate.admit(envelope(command(SECOND + 20 * MS, 1000.0)), SECOND + 40 * MS) is not None


@given(error=st.integers(-300, 300), better=st.integers(-300, 300), age=st.integers(0, 1000))
@settings(max_examples=200, deadline=None)
def test_better_knowledge_of_the_clock_lengthens_no_life(error: int, better: int, age: int) -> None:
    clock_offset, counts = ClockOffset("drone"), Counter[str]()
    gate = Gate(topics.PILOT_COMMAND, Outbox(counts), clock_offset)
    inbox = Inbox("pilot/command", 8, lambda: 0, Outbox(counts))
    newest = Latest(topics.PILOT_COMMAND, inbox, gate, Outbox(counts))
    told(clock_offset, error * MS, abs(error) * MS, SECOND)
    inbox.store(envelope(command(SECOND)))
    newest.newest(SECOND)
    told(clock_offset, better * MS, abs(better) * MS, SECOND)
    assert newest.fresh(SECOND + age * MS) is None or age <= 300


def command(now: int, ttl_ms: float = 300.0) -> PilotCommand:
    return PilotCommand(stamp_ns=now, surge=0.0, sway=0.0, heave=0.0, yaw=0.0, ttl_ms=ttl_ms)


@given(ahead=st.integers(-(10**14), 10**14), drift=st.floats(-9e-5, 9e-5))
@settings(max_examples=10, deadline=None)
def test_a_command_arrives_with_its_stamp_in_the_drones_own_time(ahead: int, drift: float) -> None:
    skew = Skew(ahead, drift)
    host = joined({"drone": skew})
    pilot, drone = host.node("pilot", ["topside"]), host.node("drone", ["drone"])
    heard: list[tuple[int, int]] = []
    publisher = pilot.publisher(topics.PILOT_COMMAND)
    pilot.every(50.0, lambda now: publisher.put(command(now)))
    drone.each(topics.PILOT_COMMAND, lambda m, now: heard.append((m.stamp_ns, now)))
    host.run(3 * SECOND)
    assert len(heard) > 100
    for stamp, now in heard:
        # The profile takes 1 ms and a bit; what the clocks may be off by is the round trip.
        assert -3 * MS <= now - stamp <= 8 * MS
    assert drone.counts["unsynchronised:pilot/command"] > 0  # before the first answer


@given(ahead=st.integers(-(10**14), 10**14), lag=st.integers(0, 400))
@settings(max_examples=20, deadline=None)
def test_a_command_is_never_older_than_its_time_to_live_when_it_acts(ahead: int, lag: int) -> None:
    """`lag` [ms] is how old it was when it entered the link."""
    host = joined({"drone": Skew(ahead)})
    pilot, drone = host.node("pilot", ["topside"]), host.node("drone", ["drone"])
    publisher = pilot.publisher(topics.PILOT_COMMAND)
    acted: list[int] = []

    def speak(now: int) -> None:
        publisher.put(command(now - lag * MS if now > 2 * SECOND else now))

    pilot.every(50.0, speak)
    newest = drone.latest(topics.PILOT_COMMAND)

    def act(_: int) -> None:
        message = newest.fresh(ahead + host.now)
        if message is not None:
            acted.append(host.now)
            spoken = (message.seq + 1) * 20 * MS
            true_stamp = spoken - lag * MS if spoken > 2 * SECOND else spoken
            assert host.now - true_stamp <= 300 * MS

    drone.every(100.0, act)
    host.run(4 * SECOND)
    assert bool([now for now in acted if now > 3 * SECOND]) == (lag < 290) or 285 <= lag <= 305
