"""The topside of one drone, as one of several that follow each other in one program."""

import time
from collections.abc import Callable, Collection
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import msgspec

from messages import topics
from messages.fly import DroneList, FlyAnswer, FlyRequest
from messages.identity import SideIdentity
from messages.link import Clock
from services.reference.settings import Settings as ReferenceSettings
from services.runtime.config.errors import LindyError
from services.runtime.config.identity import identity_now
from services.runtime.config.running import RUNNING
from services.runtime.hosts.registry import PILOTS, Registry
from services.runtime.hosts.stack_file import code_of
from services.runtime.launch.local_stack import SLOW, LocalStack, local_stack
from services.runtime.launch.process_plan import HOME
from services.runtime.node.ports import Latest, Publisher
from tools.fleet.change import left_behind
from tools.fleet.others import others_named
from tools.fleet.reachable import misfit
from tools.live.display import Display
from tools.live.dive_folder import point_latest
from tools.live.keep_running import ALIVE_S
from tools.live.monitor_loop import followed_by
from tools.live.outcome import Outcome
from tools.live.piloted_dive import PilotedDive
from tools.live.stop_signals import StopSignals
from tools.start import Planned, require_room

LINK_MONITOR = "link_monitor"
ANSWER_S = 3.0  # [s] for a drone that is there


def with_pilots_alone(services: Registry) -> Registry:
    """Each service that may command in a process of its own, so that it can be ended, and begun,
    while the others go on."""
    alone = {
        name: msgspec.structs.replace(spec, process=name) if _commands(services, name) else spec
        for name, spec in services.items()
    }
    return services.only(alone)


def _commands(services: Registry, name: str) -> bool:
    """Of a user's module nobody knows, so it is taken to command."""
    spec = services[name]
    return spec.module is not None or code_of(name, spec) in PILOTS


@dataclass(slots=True)
class FlownTopside:
    """Made by `opened`. It is used by one thread at a time."""

    plan: Planned
    local: LocalStack
    dive: PilotedDive
    outcome: Outcome
    there: Callable[[], list[str]]  # names of the drones that can be reached
    pilots: list[str]  # processes that command
    slow: list[str]  # processes that are not needed to fly
    ours: SideIdentity  # what this side is, to compare a drone with
    _answers: Publisher[FlyAnswer]
    _drones: Publisher[DroneList]
    _clock: Latest[Clock]
    _pings: bool  # there is a link monitor
    _exits: ExitStack

    @property
    def drone(self) -> str:
        return self.local.stack.drone_name

    def start(self, look: Callable[[], bool]) -> None:
        """Start everything.

        Raises:
            LindyError: a service cannot start.
        """
        self.local.start_services()
        self.local.wait_alive(ALIVE_S, look)
        self.dive.begin()

    def prepare(
        self, theirs: Callable[[], SideIdentity | None], goes_on: Callable[[], bool]
    ) -> None:
        """Start everything but the pilot and what is slow, and wait until it is alive and the drone
        has answered: until then both sides cannot know each other's clock.

        Args:
            theirs: what the drone says of itself; None: nothing yet.
            goes_on: False: nobody needs it any more.

        Raises:
            LindyError: a service cannot start, the drone does not answer, or it does not fit.
        """

        def look() -> bool:
            self.local.pump()
            return goes_on()

        self._require_fit(theirs())  # before anything is started, unless it has only just come
        self.local.start_services(resting={*self.pilots, *self.slow})
        self.local.wait_alive(ALIVE_S, look)
        deadline = time.monotonic() + ANSWER_S
        while not (self.met and (theirs() is not None or not self._pings)) and look():
            if time.monotonic() > deadline:
                what = "say which Lindy it runs" if self.met else "answer"
                raise LindyError(f"{self.drone} does not {what} within {ANSWER_S:g} s")
        self._require_fit(theirs())

    def _require_fit(self, theirs: SideIdentity | None) -> None:
        """What the link monitor compares: a drone that does not fit could not be armed."""
        if self._pings and theirs is not None and (why := misfit(self.drone, self.ours, theirs)):
            raise LindyError(why)

    @property
    def met(self) -> bool:
        """Does the drone answer pings? Without a link monitor there are none."""
        clock = self._clock.newest(time.monotonic_ns())
        return not self._pings or (clock is not None and clock.offset_ns is not None)

    def take_over(self) -> None:
        """It is the one that is flown now: its pilot is alive."""
        self.local.note.shown = True
        self.local.begin(self.slow)
        point_latest(self.local.stack.out_dir)
        self.dive.begin()

    def leave(self, next_folder: Path) -> None:
        """Another one is flown now, and found from this one's folder. `end` follows, and may take
        its time."""
        self.local.replaced = True
        self.local.note.leave(next_folder)

    def forget(self) -> None:
        """At the end of all flights."""
        (self.local.stack.out_dir / RUNNING).unlink(missing_ok=True)

    def answer(self, answer: FlyAnswer) -> None:
        self._answers.put(answer)

    def tell(self, drones: DroneList) -> None:
        self._drones.put(drones)

    def left(self, *, released: bool) -> str:
        """What becomes of its drone without its pilot."""
        settings = self.local.stack.section("reference", ReferenceSettings).failsafe
        status = self.dive.status
        return left_behind(self.drone, status, settings.pilot_patience, released=released)

    def end(self) -> None:
        self._exits.close()


def opened(
    plan: Planned,
    stop: StopSignals,
    shown: Display,
    hear: Callable[[FlyRequest, int], None],
    *,
    announced: bool,
) -> FlownTopside:
    """A flight with a running hub, and without services yet.

    Args:
        hear: an order to fly another drone.
        announced: in run.json, so that `lindy ask` finds it.

    Raises:
        LindyError: it cannot be started.
    """
    require_room(plan.stack, plan.here)
    ours, outcome = identity_now(plan.stack, HOME), Outcome(plan.stack)
    with ExitStack() as exits:
        local = exits.enter_context(
            local_stack(
                plan.stack,
                plan.here,
                other_side=plan.other_side,
                credentials=plan.credentials,
            )
        )
        local.note.shown, local.note.changes = announced, True
        exits.enter_context(followed_by(outcome, local))
        there = exits.enter_context(others_named(local))
        answers = local.node.publisher(topics.FLY_ANSWER)
        local.node.each(topics.FLY_REQUEST, hear)
        dive = PilotedDive(local, plan.pilot, plan.seconds, stop, shown)
        return FlownTopside(
            plan=plan,
            local=local,
            dive=dive,
            outcome=outcome,
            there=there,
            pilots=_processes(local, lambda name: _commands(plan.here, name)),
            slow=_processes(local, lambda name: name in SLOW),
            ours=ours,
            _answers=answers,
            _drones=local.node.publisher(topics.FLY_DRONES),
            _clock=local.node.latest(topics.CLOCK),
            _pings=any(code_of(name, spec) == LINK_MONITOR for name, spec in plan.here.items()),
            _exits=exits.pop_all(),
        )
    raise AssertionError("no context suppresses errors")


def _processes(local: LocalStack, wanted: Callable[[str], bool]) -> list[str]:
    def has_one(names: Collection[str]) -> bool:
        return any(map(wanted, names))

    return [process for process, names in local.plan.processes.items() if has_one(names)]
