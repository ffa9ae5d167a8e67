"""Freshness in whole dives on virtual time, with one clock and with two: whatever the link does to
the pilot's commands, on board only those act that are whole, in order and within their life."""

from collections import Counter
from itertools import pairwise
from typing import Any, Literal, NamedTuple, Self

import msgspec
import pytest
from hypothesis import HealthCheck, Phase, event, given, settings
from hypothesis import strategies as st

from messages import topics
from messages.control import ThrusterCommand
from messages.link import LinkRequest
from messages.pilot import TTL_MS, PilotCommand
from messages.reference import Reference
from messages.topic import M, Topic
from messages.vehicle import Actuation
from services.reference.settings import Settings
from services.reference.trajectory.minimum_jerk import Ramp
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import wire_of
from services.runtime.hosts.virtual_host import Skew, VirtualHost
from services.runtime.node.gate import Gate
from services.runtime.node.node import Node
from services.tether.service import NEVER_USED
from tests.support.dive import CHAIN, Dive

Kind = Literal["profile", "set", "down", "up"]
MS, S = 1_000_000, 1_000_000_000  # [ns]
TTL = round(TTL_MS * MS)  # [ns]
AGED = MS // 10  # [ns] what two crystals may gain since the link monitor's newest word came through
COMMAND = topics.PILOT_COMMAND.key
REASONS = ("malformed", "expired", "duplicated", "reordered")

# Link models, as lines of a profile.

DELAYS = (
    "jitter_ms = 40.0",
    'delay = { kind = "table", ms = [0.0, 300.0] }',
    'delay = { kind = "pareto", mean_ms = 90.0, shape = 2.2 }',
)
LOSSES = (
    "",
    "loss = { loss_good = 0.3 }",
    "loss = { to_bad = 0.05, to_good = 0.1 }",
)
RATES = (
    "",
    "rate_kbit = 100.0\noverhead_bytes = 60\nqueue = { limit_bytes = 9000 }",
    'rate_kbit = 60.0\noverhead_bytes = 60\nqueue = { limit_bytes = 6000, policy = "drop_oldest" }',
)
OUTAGES = ("", "outages = { windows = [{ start_s = 1.0, seconds = 0.6 }], repeat_s = 2.5 }")


@st.composite
def legs(draw: st.DrawFn) -> str:
    lines = (
        f"delay_ms = {draw(st.integers(0, 250))}",
        draw(st.sampled_from(DELAYS)),
        draw(st.sampled_from(LOSSES)),
        draw(st.sampled_from(RATES)),
        f"late = {{ share = {draw(st.sampled_from([0.0, 0.1, 0.3]))}, ms = 90.0 }}",
        f"duplicate = {draw(st.sampled_from([0.0, 0.2]))}",
        f"corrupt = {draw(st.sampled_from([0.0, 0.2]))}",
        draw(st.sampled_from(OUTAGES)),
    )
    return "\n".join(lines)


profiles = st.tuples(legs(), legs()).map(lambda way: f"[down]\n{way[0]}\n\n[up]\n{way[1]}\n")
changes: st.SearchStrategy[tuple[Kind, *tuple[str, ...]]] = st.sampled_from(
    [("down",), ("up",), ("set", "down.delay_ms=20", "down.corrupt=0.3")]
)
travel = st.sampled_from([-1.0, -0.5, 0.0, 0.3, 1.0])
sticks = st.lists(st.tuples(travel, travel, travel, travel), min_size=3, max_size=8)


class Judged(NamedTuple):
    """One envelope at the door of `reference`."""

    at: int  # [ns] host's clock
    payload: bytes
    admitted: PilotCommand | None  # stamps in the drone's clock


class Acted(NamedTuple):
    """A reference, and when [ns] by the host's clock."""

    at: int
    reference: Reference


class Watched(Gate[M]):
    """A gate whose every judgement is written down."""

    book: list[Judged]
    host: VirtualHost

    def admit(self, envelope: Envelope, now: int) -> M | None:
        message = super().admit(envelope, now)
        if envelope.key == COMMAND:
            assert message is None or isinstance(message, PilotCommand)
            self.book.append(Judged(self.host.now, envelope.payload, message))
        return message


class Flight(Dive):
    """The chain with a pilot who never rests, and observers in both realms."""

    def __init__(
        self, moves: list[tuple[float, float, float, float]], clock: Skew | None = None
    ) -> None:
        """
        Args:
            clock: of the drone, where it is a machine of its own.
        """
        self.clock = clock
        self.judged: list[Judged] = []
        self.sent: dict[int, PilotCommand] = {}  # by seq
        self.acted: list[Acted] = []
        self.thrust: list[tuple[int, ThrusterCommand]] = []
        self.moving: list[tuple[int, Actuation]] = []
        rows = [moves[k % len(moves)] for k in range(40)]
        lines = [f"{k * 0.3:.1f},{','.join(map(str, row))}" for k, row in enumerate(rows)]
        super().__init__(
            "\n".join([*lines, "100,0,0,0,0"]), (*CHAIN, "link_monitor"), still_s=1.5,
            wires={"reference": self._wire_watched}, clocks={"drone": clock} if clock else None,
        )  # fmt: skip
        pilot, drone = self.ears("topside"), self.ears("drone")
        self.answers = self.heard(topics.LINK_ANSWER, "topside")
        pilot.each(topics.PILOT_COMMAND, lambda m, _: self.sent.update({m.seq: m}))
        drone.each(topics.REFERENCE, lambda m, _: self.acted.append(Acted(self.host.now, m)))
        drone.each(topics.THRUSTERS, lambda m, _: self.thrust.append((self.host.now, m)))
        drone.each(topics.ACTUATION, lambda m, _: self.moving.append((self.host.now, m)))
        self._requests = self.host.node("hand", ["topside"]).publisher(topics.LINK_REQUEST)

    def _wire_watched(self, node: Node, stack: Stack) -> None:
        def gate(topic: Topic[M], *, onlooker: bool = False) -> Gate[M]:
            watched = Watched(topic, node.outbox, node._clock_offset, onlooker=onlooker)  # pyright: ignore[reportPrivateUsage]
            watched.book, watched.host = self.judged, self.host
            return watched

        node.gate = gate
        wire_of("reference")(node, stack)

    def ask(self, kind: Kind, *settings: str, profile: str | None = None) -> None:
        now, id_ = self.host.now, f"{self.host.now} {kind}"
        self._requests.put(
            LinkRequest(stamp_ns=now, id=id_, kind=kind, profile=profile, settings=settings)
        )

    def over(self, profile: str) -> None:
        """Another link from now on."""
        path = self.folder / f"link{self.host.now}.toml"
        path.write_text(profile)
        self.ask("profile", profile=str(path))

    def through(self, first: str, then: tuple[Kind, *tuple[str, ...]], second: str) -> Self:
        """Fly over one link, change it twice; at the end control dies for most of a second."""
        self.until_armed()
        self.run(0.5)
        assert self.acted[-1].reference.pilot_ns is not None
        self.over(first)
        self.run(2.5)
        self.ask(*then)
        self.run(0.8)
        self.ask("up")
        self.over(second)
        self.run(2.5)
        assert [answer.accepted for answer in self.answers] == [True] * 4
        self.host.kill("control")
        self.run(0.7)
        self.start("control")
        self.run(0.3)
        return self

    @property
    def slack(self) -> int:
        return 0 if self.clock is None else AGED


def raw(payload: bytes) -> PilotCommand | None:
    """The command as it was said, with the pilot's own stamp; None when it came damaged."""
    if payload[:1] == bytes([NEVER_USED]):
        return None
    return msgspec.msgpack.decode(payload, type=PilotCommand)


def by_stamp(flight: Flight) -> dict[int, PilotCommand]:
    """Commands as they were said, by the stamp they have on board."""
    known: dict[int, PilotCommand] = {}
    for judged in flight.judged:
        said = raw(judged.payload)
        if judged.admitted is not None and said is not None:
            known[judged.admitted.stamp_ns] = said
    return known


def reason_of(at: int, said: PilotCommand | None, newest: int, slack: int) -> str:
    """Why a command must not be let in at `at` [ns], after one that was sent at `newest` [ns]."""
    if said is None:
        return "malformed"
    if at - said.stamp_ns > TTL + slack:
        return "expired"
    if said.stamp_ns <= newest:
        return "duplicated" if said.stamp_ns == newest else "reordered"
    return ""


def check_the_door(flight: Flight) -> None:
    """Nothing damaged, old, repeated or out of order is let in. With one clock everything else is,
    and every refusal is counted under its own reason."""
    newest, reasons = -1, Counter[str]()
    for at, payload, admitted in flight.judged:
        said = raw(payload)
        reason = reason_of(at, said, newest, flight.slack)
        reasons[reason] += 1
        assert not (reason and admitted), reason
        assert admitted or reason or flight.clock, "a good command was refused"
        if admitted is not None and said is not None:
            assert said == flight.sent[said.seq]
            newest = said.stamp_ns
    for reason in REASONS:
        event(f"{reason}: {reasons[reason] > 0}")
        if flight.clock is None:
            assert flight.host.nodes["reference"].counts[f"{reason}:{COMMAND}"] == reasons[reason]


def check_what_acts(flight: Flight) -> None:
    """Behind every reference and every thruster command is a fresh command, or none."""
    known, before = by_stamp(flight), 0
    for at, reference in flight.acted:
        if reference.pilot_ns is not None:
            sent = known[reference.pilot_ns].stamp_ns
            assert at - sent <= TTL + flight.slack
            assert sent >= before, "an older command took over"
            before = sent
    for at, command in flight.thrust:
        if command.pilot_ns is not None:
            assert at - known[command.pilot_ns].stamp_ns <= TTL + flight.slack


def check_the_motion(flight: Flight) -> None:
    """The reference moves exactly as the fresh commands say, comes to rest without them, and stays
    there until the script's pilot resumes."""
    heave = flight.stack.section("reference", Settings).heave
    ramp, known = Ramp(heave.limits), by_stamp(flight)
    resumed, waits = resumptions(flight), False
    for _, reference in flight.acted:
        assert reference.sensor_ns is not None
        t = reference.sensor_ns / S
        while resumed and resumed[0] < reference.stamp_ns:
            resumed.pop(0)
            waits = False
        if not reference.armed:
            ramp.rest(0.0, t)
        assert abs(reference.depth.velocity - ramp.at(t).velocity) < 1e-6
        command = None if reference.pilot_ns is None else known[reference.pilot_ns]
        there = command is not None and command.pilot == "present"
        waits = reference.armed and (waits or not there)
        acts = there and reference.armed and not waits
        ramp.aim(command.heave * heave.max_velocity if acts and command else 0.0, t)


def resumptions(flight: Flight) -> list[int]:
    """[ns] When the pilot had resumed, by the drone's clock."""
    pairs = pairwise(flight.statuses)
    return [b.stamp_ns for a, b in pairs if a.failsafe != "none" and b.failsafe == "none"]


def check_the_thrusters(flight: Flight) -> None:
    """They push only within the life of their command; soon after its end they stand still."""
    commands, heard, stale = iter(flight.thrust), 0, 0
    upcoming = next(commands, None)
    stale_since: int | None = None
    for at, actuation in flight.moving:
        while upcoming is not None and upcoming[0] <= at:
            heard, upcoming = upcoming[0], next(commands, None)
        if actuation.actuated_ns is None:
            assert not any(actuation.thrust)
        elif not actuation.stale:
            assert at - heard <= 200 * MS + flight.slack
            stale_since = None
        else:
            stale += 1
            stale_since = at if stale_since is None else stale_since
            if at - stale_since > 400 * MS:  # five times what a thruster needs to slow down
                assert all(abs(force) < 0.5 for force in actuation.thrust)
    assert stale > 0  # control was dead for long enough


flights = settings(
    max_examples=8,
    deadline=None,
    derandomize=True,
    phases=[Phase.generate],  # a flight takes two seconds: a failing one is not made smaller
    suppress_health_check=[HealthCheck.too_slow],
)


def check(flight: Flight, first: str, then: Any, second: str) -> None:
    flight.through(first, then, second)
    check_the_door(flight)
    check_what_acts(flight)
    check_the_motion(flight)
    check_the_thrusters(flight)


@pytest.mark.slow
@flights
@given(moves=sticks, first=profiles, then=changes, second=profiles)
def test_only_fresh_whole_commands_in_order_move_anything(
    moves: list[tuple[float, float, float, float]], first: str, then: Any, second: str
) -> None:
    check(Flight(moves), first, then, second)


@pytest.mark.slow
@flights
@given(
    moves=sticks,
    first=profiles,
    then=changes,
    second=profiles,
    ahead=st.integers(0, 10**13),  # [ns] a machine's clock counts from when it was started
    drift=st.sampled_from([-5e-5, 0.0, 5e-5]),
)
def test_so_it_is_when_each_machine_has_its_own_clock(
    moves: list[tuple[float, float, float, float]],
    first: str,
    then: Any,
    second: str,
    ahead: int,
    drift: float,
) -> None:
    check(Flight(moves, Skew(ahead, drift)), first, then, second)
