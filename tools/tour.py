"""`lindy tour`: a first dive, step by step, beside the dive that goes on."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import degrees
from typing import NamedTuple

from messages import topics
from messages.message import Message
from messages.reference import Reference
from messages.state import VehicleState
from messages.topic import AnyTopic
from messages.units import Ns
from messages.vehicle import Activity, VehicleStatus
from tools.choices import RunningDive

BELOW, SHALLOW = 1.0, 0.7  # [m] to go down to, and to come up to
QUARTER = 80.0  # [deg] of a turn that count as a quarter
STILL = 0.02  # [m/s]
REST_NS = 1_000_000_000  # [ns] at rest before a stop is measured
HEARD: tuple[AnyTopic, ...] = (topics.STATUS, topics.STATE, topics.REFERENCE)
END = "That is a dive. What each stick and button does, and every other mode: docs/flying.md."


class SeenDive(NamedTuple):
    """The newest messages."""

    status: VehicleStatus
    state: VehicleState
    reference: Reference
    now: Ns


def _rests(seen: SeenDive, _: SeenDive) -> bool:
    return seen.reference.depth.velocity == 0.0 and abs(seen.state.depth_rate.value) < STILL


def _beyond(seen: SeenDive) -> str:
    gap = seen.state.depth.value - seen.reference.depth.position
    return f"it stands {abs(100.0 * gap):.1f} cm {'below' if gap > 0 else 'above'} its reference"


def _turned(seen: SeenDive, before: SeenDive) -> bool:
    return abs(degrees(seen.state.heading.value - before.state.heading.value)) > QUARTER


def _heading(seen: SeenDive) -> str:
    return f"heading {degrees(seen.state.heading.value):.0f} deg"


def _doing(*activities: Activity) -> "Done":
    def done(seen: SeenDive, _: SeenDive) -> bool:
        return seen.status.activity in activities

    return done


def _armed(seen: SeenDive, _: SeenDive) -> bool:
    return seen.status.armed


def _disarmed(seen: SeenDive, _: SeenDive) -> bool:
    return not seen.status.armed


def _deep(seen: SeenDive, _: SeenDive) -> bool:
    return seen.state.depth.value > BELOW


def _shallow(seen: SeenDive, _: SeenDive) -> bool:
    return seen.state.depth.value < SHALLOW


def _nothing(_: SeenDive) -> str:
    return ""


Done = Callable[[SeenDive, SeenDive], bool]  # now, and as the step began


class TourStep(NamedTuple):
    task: str
    done: Done
    result: Callable[[SeenDive], str] = _nothing
    keeps_ns: Ns = 0  # [ns] for so long


STEPS = (
    TourStep("Take the sticks and arm: on the page, hold ARM.", _armed),
    TourStep(f"Push the heave stick down until the drone is {BELOW:g} m deep.", _deep),
    TourStep("Let go. It stops where you let go.", _rests, _beyond, REST_NS),
    TourStep("Turn by a quarter with the yaw stick.", _turned, _heading),
    TourStep("Push any stick, and press STOP while it moves.", _doing("stopping")),
    TourStep("Centre the sticks: they are yours again once it stands.", _doing("ready", "piloted")),
    TourStep(
        "Type a depth of 0.5 m on the page, or `lindy ask goto --depth 0.5` in a third terminal.",
        _shallow,
    ),
    TourStep("Hold DISARM. The thrusters rest.", _disarmed),
)


@dataclass(slots=True)
class Tour:
    """Which step it is at, by what was seen. Pure."""

    at: int = 0
    results: list[str] = field(default_factory=list[str])
    _began: SeenDive | None = None
    _since: Ns | None = None  # [ns] it has been as the step wants it

    @property
    def over(self) -> bool:
        return self.at == len(STEPS)

    def see(self, seen: SeenDive) -> None:
        if self.over:
            return
        self._began = self._began or seen
        step = STEPS[self.at]
        if not step.done(seen, self._began):
            self._since = None
            return
        self._since = seen.now if self._since is None else self._since
        if seen.now - self._since >= step.keeps_ns:
            self.results.append(step.result(seen))
            self.at, self._began, self._since = self.at + 1, None, None

    def lines(self) -> list[str]:
        done = [
            f"  ✓ {step.task}{f'  ({result})' if result else ''}"
            for step, result in zip(STEPS, self.results, strict=False)
        ]
        rest = [f"  → {step.task}" for step in STEPS[self.at : self.at + 1]]
        later = [f"    {step.task}" for step in STEPS[self.at + 1 :]]
        return [*done, *rest, *later, *([END] if self.over else [])]


def tour(*, dive: RunningDive = None) -> int:
    """Lead through a first dive, step by step, beside a running dive.

    Start the dive with `lindy dive --cockpit` or with a gamepad; this shows what to do next, and
    ticks it off when the drone has done it. Three minutes.

    Example: lindy tour --dive dives/latest
    """
    from tools.ask import dive_in
    from tools.topic.listening import listen, side_of

    running = dive_in(dive)
    guide, newest = Tour(), dict[str, Message]()

    def take(key: str, message: Message, _size: int, now: Ns) -> None:
        newest[key] = message
        status, state, reference = (newest.get(topic.key) for topic in HEARD)
        if (
            isinstance(status, VehicleStatus)
            and isinstance(state, VehicleState)
            and isinstance(reference, Reference)
        ):
            guide.see(SeenDive(status, state, reference, now))

    side = side_of(running, HEARD, None)
    listen(
        running, side, HEARD, take, guide.lines, count=None, seconds=None, over=lambda: guide.over
    )
    return 0
