"""Two machines, two clocks: stamps are local wherever they are read, and nothing old passes."""

from collections import Counter

import msgspec
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.events import Outbox
from messages.link import Clock
from messages.pilot import PilotCommand
from messages.vehicle import Actuation
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import Skew, VirtualHost
from services.runtime.node.clock_offset import ClockOffset
from services.runtime.node.gate import Gate
from services.runtime.node.ports import Inbox, Latest

MS, SECOND = 1_000_000, 1_000_000_000
DRONE = ServiceSpec(sides=["drone"])
TOPSIDE = ServiceSpec(sides=["topside"])
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
    clock = Clock(
        stamp_ns=0, offset_ns=ahead, bound_ns=bound, drift_ppm=None, rtt_ms=None,
        rtt_min_ms=None, answered_ms=None,
    )  # fmt: skip
    clock_offset.learn(clock, now)


def test_while_the_link_monitor_is_silent_the_clocks_are_known_less_and_less() -> None:
    clock_offset = ClockOffset("drone")
    told(clock_offset, 0, MS, now=SECOND)
    assert clock_offset.bound_ns(SECOND) == MS
    assert clock_offset.bound_ns(61 * SECOND) == MS + 6 * MS


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


def test_a_machine_that_was_started_anew_is_heard_again() -> None:
    clock_offset, counts = ClockOffset("drone"), Counter[str]()
    gate = Gate(topics.PILOT_COMMAND, Outbox(counts), clock_offset)
    told(
        clock_offset, -3600 * SECOND, MS, 10 * SECOND
    )  # the pilot's machine has run for an hour more
    assert gate.admit(envelope(command(3610 * SECOND)), 10 * SECOND) is not None
    told(clock_offset, 11 * SECOND, MS, 12 * SECOND)
    assert gate.admit(envelope(command(SECOND)), 12 * SECOND) is not None


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


def test_one_stamp_goes_down_and_comes_back_as_it_was() -> None:
    host = joined({"drone": Skew(10**13)})
    pilot, drone = host.node("pilot", ["topside"]), host.node("drone", ["drone"])
    commands, actuations = pilot.publisher(topics.PILOT_COMMAND), drone.publisher(topics.ACTUATION)
    sent: list[int] = []
    back: list[int | None] = []

    def speak(now: int) -> None:
        sent.append(now)
        commands.put(command(now))

    def answer(heard: PilotCommand, now: int) -> None:
        actuations.put(
            Actuation(
                stamp_ns=now, thrust=(), actuated_ns=now, sensor_ns=None,
                pilot_ns=heard.stamp_ns, stale=False, power=0.0,
            )
        )  # fmt: skip

    pilot.every(50.0, speak)
    drone.each(topics.PILOT_COMMAND, answer)
    pilot.each(topics.ACTUATION, lambda m, _: back.append(m.pilot_ns))
    host.run(3 * SECOND)
    assert len(back) > 100
    for pilot_ns in back:
        assert pilot_ns is not None
        assert min(abs(pilot_ns - stamp) for stamp in sent) < MS


def test_with_one_clock_nothing_is_moved_or_refused() -> None:
    host = joined(None)
    pilot, drone = host.node("pilot", ["topside"]), host.node("drone", ["drone"])
    publisher = pilot.publisher(topics.PILOT_COMMAND)
    stamps: list[int] = []
    pilot.every(50.0, lambda now: publisher.put(command(now)))
    drone.each(topics.PILOT_COMMAND, lambda m, _: stamps.append(m.stamp_ns))
    host.run(SECOND)
    assert stamps[0] == 20 * MS
    assert not [name for name in drone.counts if name.startswith(("expired", "unsync"))]
