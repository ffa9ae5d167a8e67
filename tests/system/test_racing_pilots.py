"""Many pilots and one drone, over links that delay, lose and reorder, on virtual time: whatever
they do, exactly one epoch actuates at every instant, and it is the epoch of one pilot.

The pilots, the repetition of their requests, the drone's authority and its actuator gate are the
real ones; the network between them is drawn at random.
"""

import heapq
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from random import Random

import pytest

from messages.control import ThrusterCommand
from messages.events import Outbox
from messages.pilot import TTL_MS, PilotAnswer, PilotCommand, PilotRequest, RequestKind
from messages.vehicle import VehicleStatus
from services.marine.vehicle import Thruster
from services.piloting.pilot import Effects, Pilot, Progress
from services.piloting.sticks import StickReading, Sticks
from services.reference.guidance.authority import ControlAuthority
from services.runtime.node.requests import AnswerBook, Requests
from services.vehicle.actuator_gate import ActuatorGate

pytestmark = pytest.mark.slow

MS, S = 10**6, 10**9  # [ns]
TICK = 100 * MS  # [ns] between two steps of everything
ASKED: tuple[RequestKind, ...] = ("lease", "force", "offer", "release")


@dataclass
class Network:
    """Delivers late, in any order, or never."""

    random: Random
    delay: int = field(init=False)  # [ns] at most
    loss: float = field(init=False)
    now: int = 0  # [ns]
    _on_the_way: list[tuple[int, int, Callable[[], None]]] = field(default_factory=list)  # type: ignore[type-arg]
    _number: "count[int]" = field(default_factory=count)

    def __post_init__(self) -> None:
        self.delay = self.random.choice((0, 50, 300, 900)) * MS
        self.loss = self.random.choice((0.0, 0.1, 0.5))

    def send(self, deliver: Callable[[], None]) -> None:
        if self.random.random() >= self.loss:
            due = self.now + self.random.randint(0, self.delay)
            heapq.heappush(self._on_the_way, (due, next(self._number), deliver))

    def advance(self, until: int) -> None:
        while self._on_the_way and self._on_the_way[0][0] <= until:
            self.now, _, deliver = heapq.heappop(self._on_the_way)
            deliver()
        self.now = until


class Topside:
    """A gamepad service without its node."""

    def __init__(self, name: str, race: "Race") -> None:
        self.name, self.race = name, race
        self.requests = Requests[PilotRequest](name)
        self.pilot = Pilot(Progress(), Outbox(), arms=False, asked=self._waiting)
        self.gone_until = 0  # [ns]
        self.asked_at: list[int] = []  # [ns] by itself

    @property
    def gone(self) -> bool:
        return self.race.net.now < self.gone_until

    def step(self) -> None:
        now, net, drone = self.race.net.now, self.race.net, self.race.drone
        if self.gone:
            return
        reading = StickReading(Sticks(heave=1.0), at_rest=False)
        effects = self.pilot.read(reading, self.name, 0, now)
        command = effects.command
        assert command is not None
        net.send(lambda: drone.command(self, command))
        for late in self.requests.given_up(now):
            self.pilot.given_up(late, now)
        for again in self.requests.repeats(now):
            self._send(again)

    def ask(self, kind: RequestKind) -> None:
        """A person asks, as with `lindy ask`."""
        epoch = self.pilot.progress.epoch or 0
        request = PilotRequest(stamp_ns=0, id="", kind=kind, source=self.name, epoch=epoch)
        self._send(self.requests.ask(request, self.race.net.now))

    def status(self, status: VehicleStatus) -> None:
        if not self.gone:
            self._do(self.pilot.status(status, self.race.net.now))

    def answer(self, answer: PilotAnswer) -> None:
        now = self.race.net.now
        if not self.gone and (request := self.requests.answered(answer)) is not None:
            self._do(self.pilot.answered(request, answer, now))

    def _waiting(self) -> set[RequestKind]:
        return {pending.request.kind for pending in self.requests.pending}

    def _do(self, effects: Effects) -> None:
        for request in effects.requests:
            assert request.kind == "lease"
            self.asked_at.append(self.race.net.now)
            self._send(self.requests.ask(request, self.race.net.now))

    def _send(self, request: PilotRequest) -> None:
        self.race.net.send(lambda: self.race.drone.request(self, request))


class Drone:
    """A reference generator and a thruster driver, with an account of their own to judge by."""

    def __init__(self, race: "Race") -> None:
        self.race = race
        self.authority = ControlAuthority(started_ns=0)
        self.gate = ActuatorGate([Thruster("only", (0, 0, 0), (1, 0, 0), 99.0, 99.0)], Outbox())
        self.owners: dict[int, str] = {}  # epoch → to whom it was granted
        self.acted: list[tuple[int, str]] = []  # (epoch, pilot), each change
        self.moved = 0  # steps with thrust
        self._newest: tuple[PilotCommand, str] | None = None
        self._sender: Topside | None = None
        self._book = AnswerBook(self._decide)

    def command(self, sender: Topside, command: PilotCommand) -> None:
        now = self.race.net.now
        stale = now > command.stamp_ns + TTL_MS * MS
        older = self._newest is not None and command.stamp_ns < self._newest[0].stamp_ns
        if stale or older or not self.authority.admits(command.epoch, now):
            return
        self.authority.heard(command.epoch, now)
        self._newest = command, sender.name
        if command.epoch == 0:
            return
        assert self.owners[command.epoch] == sender.name
        if not self.acted or self.acted[-1] != (command.epoch, sender.name):
            self.acted.append((command.epoch, sender.name))

    def request(self, sender: Topside, request: PilotRequest) -> None:
        self._sender = sender
        answer, _ = self._book.answer(request, self.race.net.now)
        for topside in self.race.topsides:
            self.race.net.send(lambda to=topside: to.answer(answer))

    def _decide(self, request: PilotRequest, now: int) -> PilotAnswer:
        assert self._sender is not None
        if not (reason := self.authority.refusal(request, now)):
            self.authority.grant(request, now)
        given = self.authority.lease.epoch if request.kind in ("lease", "force") else None
        epoch = None if reason else given
        if epoch is not None:
            assert epoch >= max(self.owners, default=0), "epochs grow"
            assert self.owners.setdefault(epoch, self._sender.name) == self._sender.name
        return PilotAnswer(
            stamp_ns=now, id=request.id, accepted=not reason, reason=reason, epoch=epoch
        )

    def step(self) -> None:
        now = self.race.net.now
        fresh = self._newest and now <= self._newest[0].stamp_ns + TTL_MS * MS
        who = self._newest[1] if fresh and self._newest else None
        moves = who is not None and self.authority.lease.acting > 0
        self.gate.obey(
            ThrusterCommand(
                stamp_ns=now, sensor_ns=None, pilot_ns=None, armed=True,
                thrust=(1.0 + self.race.index(who) if moves and who else 0.0,),
                epoch=self.authority.lease.acting,
            ),
            now,
        )  # fmt: skip
        (thrust,) = self.gate.output(now)
        in_force = self.gate.command
        assert in_force is not None
        if thrust > 0.0:
            self.moved += 1
            assert self.race.index(self.owners[in_force.epoch]) == thrust - 1.0

    def restart(self, remembers: bool) -> None:
        """… of the reference; the driver goes on."""
        now = self.race.net.now
        kept = self.authority.lease
        self.authority = (
            ControlAuthority(kept, now) if remembers else ControlAuthority(started_ns=now)
        )
        self._book, self._newest = AnswerBook(self._decide), None

    def status(self) -> VehicleStatus:
        now = self.race.net.now
        return VehicleStatus(
            stamp_ns=now, activity="piloted", armed=True, pilot=self.authority.holder(now),
            epoch=self.authority.lease.epoch,
        )  # fmt: skip


class Race:
    def __init__(self, seed: int, pilots: int, *, events: bool = True) -> None:
        self.random = Random(seed)
        self.net = Network(self.random)
        self.topsides = [Topside(f"pilot {k}", self) for k in range(pilots)]
        self.drone = Drone(self)
        self._events = events

    def index(self, name: str) -> int:
        return int(name.split()[1])

    def run(self, seconds: float) -> "Race":
        for k in range(round(seconds * S / TICK)):
            self.net.advance(k * TICK)
            if self._events and self.random.random() < 0.05:
                self._something_happens()
            for topside in self.topsides:
                topside.step()
            self.drone.step()
            if k % 2 == 0:
                status = self.drone.status()
                for topside in self.topsides:
                    self.net.send(lambda to=topside, what=status: to.status(what))
        return self

    def _something_happens(self) -> None:
        who, chance = self.random.choice(self.topsides), self.random.random()
        if chance < 0.6:
            who.ask(self.random.choice(ASKED))
        elif chance < 0.8:
            who.gone_until = self.net.now + round(self.random.expovariate(0.2) * S)
        else:
            self.drone.restart(remembers=self.random.random() < 0.5)


def check(race: Race) -> None:
    epochs = [epoch for epoch, _ in race.drone.acted]
    assert epochs == sorted(epochs), "no epoch acts again after a newer one"
    assert len(set(epochs)) == len(epochs)
    for topside in race.topsides:
        gaps = [b - a for a, b in zip(topside.asked_at, topside.asked_at[1:], strict=False)]
        assert all(gap >= S for gap in gaps), "at most one request per second"


@pytest.mark.parametrize(("pilots", "runs"), [(2, 75), (5, 25)])
def test_exactly_one_epoch_actuates_in_many_runs(pilots: int, runs: int) -> None:
    grants = moved = 0
    for seed in range(runs):
        race = Race(seed, pilots).run(30.0)
        check(race)
        grants += len(race.drone.owners)
        moved += race.drone.moved
    assert grants > 3 * runs, "control changed hands"
    assert moved > 50 * runs, "and the drone was moved"


@pytest.mark.parametrize("pilots", [2, 5])
def test_left_alone_one_pilot_has_control_and_the_others_wait(pilots: int) -> None:
    for seed in range(20):
        race = Race(seed, pilots, events=False).run(20.0)
        check(race)
        assert len(race.drone.owners) == 1
        assert all(len(topside.asked_at) <= 1 for topside in race.topsides)
