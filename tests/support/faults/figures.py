"""What is seen of a dive to which faults happen, and what is measured of it in a cell."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import msgspec
import numpy as np

from messages import topics
from messages.events import note
from messages.health import LogLine
from messages.link import LatencyBudget
from messages.message import Notice
from messages.pilot import PilotAnswer
from messages.reference import Motion, Reference
from messages.vehicle import Actuation, Truth, VehicleStatus
from services.runtime.node.node import Node
from services.vehicle_view import words
from services.vehicle_view.view import Newest, vehicle_view

# What the simulator says of a fault it was asked for; a real vehicle says nothing.
ITS_OWN = ("simulated fault:", "mended:", "link:")


class ReadText(NamedTuple):
    """Something the pilot could read."""

    at_ns: int  # [ns]
    text: str


@dataclass
class Observed:
    """Messages in the order of their arrival; their stamps are of one clock."""

    truth: list[Truth] = field(default_factory=list[Truth])
    references: list[Reference] = field(default_factory=list[Reference])
    actuations: list[Actuation] = field(default_factory=list[Actuation])
    statuses: list[VehicleStatus] = field(default_factory=list[VehicleStatus])
    said: list[ReadText] = field(default_factory=list[ReadText])
    answers: list[PilotAnswer] = field(default_factory=list[PilotAnswer])
    shown: VehicleStatus | None = None  # the newest that the pilot's side has
    _alarms: tuple[Notice, ...] = ()
    _acting: str = ""

    @property
    def armed(self) -> bool:
        return bool(self.statuses) and self.statuses[-1].armed

    def listen(self, topside: Node, drone: Node) -> None:
        """Topside: what the screen shows, status, link alarm, log lines that are not mere
        information."""
        drone.each(topics.TRUTH, lambda m, _: self.truth.append(m))
        drone.each(topics.REFERENCE, lambda m, _: self.references.append(m))
        drone.each(topics.ACTUATION, lambda m, _: self.actuations.append(m))
        drone.each(topics.STATUS, lambda m, _: self.statuses.append(m))
        topside.each(topics.STATUS, self._show)
        topside.each(topics.LATENCY, self._warn)
        topside.each(topics.LOG, self._read)
        topside.each(topics.PILOT_ANSWER, lambda m, _: self.answers.append(m))

    def forget(self) -> None:
        """What was seen is judged; only what is shown goes on to be."""
        for seen in (self.truth, self.references, self.actuations, self.said, self.answers):
            seen.clear()
        del self.statuses[:-1]

    def tell(self, at_ns: int, text: str) -> None:
        self.said.append(ReadText(at_ns, text))

    def _show(self, status: VehicleStatus, now: int) -> None:
        before, self.shown = self.shown, status
        if status.failsafe != "none" and (before is None or before.failsafe != status.failsafe):
            self.tell(now, f"FAILSAFE {status.failsafe}")
        acting = words.acting(vehicle_view(Newest(status=status), status.stamp_ns))
        if acting and acting != self._acting:
            self.tell(now, acting)
        self._acting = acting
        if status.notices and (before is None or before.notices != status.notices):
            self.tell(now, note(status.notices))

    def _warn(self, budget: LatencyBudget, now: int) -> None:
        if budget.alarms and budget.alarms != self._alarms:
            self.tell(now, f"LINK {note(budget.alarms)}")
        self._alarms = budget.alarms

    def _read(self, line: LogLine, now: int) -> None:
        if line.level != "info" and not line.text.startswith(ITS_OWN):
            self.tell(now, f"{line.service}: {line.text}")


# What is measured, from what was seen. Pure.


SECOND = 1_000_000_000  # [ns]
STEP_NS = 10_000_000  # [ns] of the chain, 100 Hz
GAP_NS = 100_000_000  # [ns] without a reference: it commands no motion
PILOT_TTL_NS = 300_000_000  # [ns] a stick position older than this moves nothing
THRUST_TTL_NS = 200_000_000  # [ns] a thruster command older than this is none
CALM_NS = 500_000_000  # [ns] for which thrust must have been zero
QUIET_N = 0.1  # [N] a stopped thruster, its lag included
NUMBER = re.compile(r"\d+(\.\d+)?")


class Figures(msgspec.Struct, frozen=True, kw_only=True):
    """Of one cell. Times in seconds from the beginning of the fault; None: it did not happen."""

    depth_error: float | None  # [m] largest, while a depth was held
    jerk_ratio: float | None  # [-] largest |jerk| of the armed reference over its limit
    stale: int  # actuations of commands that had expired
    pilot_lost: float | None  # [s] until the drone knows that no pilot speaks
    thrust_zero: float | None  # [s] until the thrusters are stopped for want of commands
    recovered: float | None  # [s] from when on the pilot was in control and stayed so
    asked: bool = False  # a disarm was asked for during the fault, on another dive like this one
    disarmed: float | None = None  # [s] from that request until no thruster turned
    announced: float | None  # [s] until the pilot reads something
    failsafes: tuple[str, ...]  # in their order
    restarted: tuple[str, ...]  # processes
    texts: tuple[str, ...]  # that the pilot read, each once
    still_armed: bool  # at the end


def figures(seen: Observed, begin: int, end: int, *, holds_depth: bool) -> Figures:
    """
    Args:
        begin: [ns] of the fault.
        end: [ns] of what is looked at.
    """
    window = _window(seen, begin, end)
    return Figures(
        depth_error=depth_error(window, begin) if holds_depth else None,
        jerk_ratio=jerk_ratio(window.references),
        stale=sum(map(is_stale, window.actuations)),
        pilot_lost=_first(
            [s.stamp_ns for s in window.statuses if s.failsafe in ("pilot_lost", "link_lost")],
            begin,
        ),
        thrust_zero=_first([a.stamp_ns for a in window.actuations if a.stale], begin),
        recovered=recovered(window, begin, end),
        announced=_first([said.at_ns for said in window.said], begin),
        failsafes=tuple(dict.fromkeys(s.failsafe for s in window.statuses if s.failsafe != "none")),
        restarted=_restarted(window.said),
        texts=_once(window.said),
        still_armed=bool(window.statuses) and window.statuses[-1].armed,
    )


def with_disarm(measured: Figures, seconds: float | None) -> Figures:
    """The same with what came of the request to disarm."""
    return msgspec.structs.replace(measured, asked=True, disarmed=seconds)


def _window(seen: Observed, begin: int, end: int) -> Observed:
    return Observed(
        truth=[m for m in seen.truth if begin <= m.stamp_ns <= end],
        references=[m for m in seen.references if begin <= m.stamp_ns <= end],
        actuations=[m for m in seen.actuations if begin <= m.stamp_ns <= end],
        statuses=[m for m in seen.statuses if begin <= m.stamp_ns <= end],
        said=[said for said in seen.said if begin <= said.at_ns <= end],
    )


def _first(stamps: Sequence[int], begin: int) -> float | None:
    return (stamps[0] - begin) / SECOND if stamps else None


def depth_error(seen: Observed, begin: int) -> float | None:
    """[m] How far the vehicle was from where it should have been: its true depth when the fault
    began, moved on with the velocity of the reference. So a jump of a broken sensor moves nothing,
    as for somebody who watches from outside. None: no depth was held.
    """
    held = [r for r in seen.references if r.armed and r.heave_force is None]
    if not held or not seen.truth:
        return None
    at = np.array([r.stamp_ns for r in seen.references], dtype=float)
    down = np.array([r.depth.velocity for r in seen.references])
    passed = np.diff(at, prepend=begin)
    moved = np.cumsum(np.where(passed > GAP_NS, 0.0, passed) * down) / SECOND
    times = np.array([t.stamp_ns for t in seen.truth], dtype=float)
    depths = np.array([t.position[2] for t in seen.truth])
    wanted = depths[0] + np.interp(times, at, moved)
    is_held = np.interp(times, at, [r.armed and r.heave_force is None for r in seen.references])
    error = np.abs(depths - wanted)[is_held > 0.5]
    return float(error.max()) if error.size else None


def jerk_ratio(references: Sequence[Reference]) -> float | None:
    """[-] Of depth and heading the worse: what the reference says of itself, as in a dive's report,
    and what its accelerations show from one to the next."""
    ratios: list[float] = []
    for before, after in pairwise([r for r in references if r.armed]):
        alike = (before.sensor_ns is None) == (after.sensor_ns is None)
        dt = (_valid_ns(after) - _valid_ns(before)) / SECOND
        for axis in ("depth", "heading"):
            was: Motion = getattr(before, axis)
            now: Motion = getattr(after, axis)
            if not now.jerk_limit or _free(after, axis):
                continue
            ratios.append(abs(now.jerk) / now.jerk_limit)
            if alike and was.jerk_limit == now.jerk_limit and not _free(before, axis) and dt > 0.0:
                shown = abs(now.acceleration - was.acceleration) / dt
                ratios.append(shown / now.jerk_limit)
    return max(ratios, default=None)


def _valid_ns(reference: Reference) -> int:
    """[ns] The instant it is for. From the last one with a sensor's time to the first one without,
    it is not known how far the motion went on."""
    return reference.stamp_ns if reference.sensor_ns is None else reference.sensor_ns


def _free(reference: Reference, axis: str) -> bool:
    """It is not held, and follows what is measured."""
    return (reference.heave_force if axis == "depth" else reference.yaw_moment) is not None


def is_stale(actuation: Actuation) -> bool:
    """Thrusters are driven by a command, or a stick position behind it, beyond its life."""
    if actuation.stale or actuation.actuated_ns is None:
        return False
    if actuation.stamp_ns - actuation.actuated_ns > THRUST_TTL_NS + STEP_NS:
        return True
    pilot = actuation.pilot_ns
    return pilot is not None and actuation.actuated_ns - pilot > PILOT_TTL_NS + STEP_NS


def recovered(seen: Observed, begin: int, end: int) -> float | None:
    """[s] From when on commands of the pilot reach the thrusters, without a failsafe, to the end.

    None: not at the end.
    """
    if not seen.statuses or not seen.actuations:
        return None
    if end - seen.actuations[-1].stamp_ns > THRUST_TTL_NS:
        return None
    bad = [a.stamp_ns for a in seen.actuations if a.stale or not _by_the_pilot(a)]
    stamps = [begin, *(a.stamp_ns for a in seen.actuations)]
    bad += [a for a, b in pairwise(stamps) if b - a > THRUST_TTL_NS]
    unwell = [s.stamp_ns for s in seen.statuses if s.failsafe != "none" or not s.armed]
    acting = _next([a.stamp_ns for a in seen.actuations], max(bad, default=None), begin)
    well = _next([s.stamp_ns for s in seen.statuses], max(unwell, default=None), begin)
    return None if acting is None or well is None else (max(acting, well) - begin) / SECOND


def _next(stamps: Sequence[int], last_bad: int | None, begin: int) -> int | None:
    """[ns] The first stamp after the last bad one; `begin` where there is no bad one."""
    if last_bad is None:
        return begin
    return next((stamp for stamp in stamps if stamp > last_bad), None)


def _by_the_pilot(actuation: Actuation) -> bool:
    pilot = actuation.pilot_ns
    return pilot is not None and actuation.stamp_ns - pilot <= PILOT_TTL_NS + THRUST_TTL_NS


def disarmed(seen: Observed, asked: int, end: int) -> float | None:
    """[s] From the request until no thruster turns, up to the end; None: they still turn, or
    nobody knows."""
    after = [a for a in seen.actuations if asked <= a.stamp_ns <= end]
    turning = [a.stamp_ns for a in after if any(abs(f) > QUIET_N for f in a.thrust)]
    accepted = any(answer.accepted for answer in seen.answers if answer.stamp_ns >= asked)
    is_off = accepted or (bool(seen.statuses) and not seen.statuses[-1].armed)
    if not after or not is_off or end - max(turning, default=asked) < CALM_NS:
        return None
    return (max(turning, default=asked) - asked) / SECOND


def _restarted(said: Sequence[ReadText]) -> tuple[str, ...]:
    words = " is started again"
    names = [text.removeprefix("supervisor: ") for _, text in said if text.endswith(words)]
    return tuple(dict.fromkeys(name.removesuffix(words) for name in names))


def _once(said: Sequence[ReadText]) -> tuple[str, ...]:
    """Texts that differ in numbers alone are the same one."""
    return tuple({NUMBER.sub("#", text): text for _, text in reversed(said)}.values())[::-1]
