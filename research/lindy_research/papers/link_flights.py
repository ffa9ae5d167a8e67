"""One pilot's sticks over any link, flown by the real stack on virtual time."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lindy.api.dives import Registry, Stack, VirtualHost
from lindy.api.messages import (
    Direction,
    LinkRequest,
    PilotCommand,
    Reference,
    VehicleStatus,
    topics,
)
from services.runtime.bus.envelope import Envelope

Floats = NDArray[np.float64]
Stick = Sequence[tuple[float, float]]  # from this time [s] on, this much of a full heave stick
SERVICES = ("simulator", "estimation", "reference", "control", "tether", "gamepad")
SHORT = "estimation.calibration.still_time=1.5"  # [s] less to wait for
LONGEST_START = 20.0  # [s] until it is armed, or something is wrong
SEED = 0


class Followed(NamedTuple):
    """What became of the sticks. Times [s] since they were handed over."""

    t: Floats  # [s] of each reference
    depth: Floats  # [m] of the reference, from where it began, positive down
    age: Floats  # [s] of the command behind each reference; infinite: none
    seen: Floats  # [s] age of the newest state of the drone that the pilot has, at t


class Said(NamedTuple):
    """A telemetry message that enters the link."""

    at: int  # [ns] also its stamp: computing takes no virtual time
    size: int  # [B]
    is_state: bool


@dataclass
class LinkRunLog:
    """What is kept of a flight."""

    references: list[Reference] = field(default_factory=list[Reference])
    commands: list[PilotCommand] = field(default_factory=list[PilotCommand])
    seen: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])  # [ns] when, stamp
    telemetry: list[Said] = field(default_factory=list[Said])
    armed: bool = False

    def on_status(self, status: VehicleStatus, _: int) -> None:
        self.armed = self.armed or status.armed

    def on_telemetry(self, envelope: Envelope, now: int) -> None:
        topic = topics.find(envelope.key)
        if topic is not None and topic.way is Direction.UP:
            self.telemetry.append(Said(now, len(envelope.payload), topic is topics.STATE))


class LinkRun(NamedTuple):
    """What the stack made of the sticks, and what was said from their handing-over on."""

    followed: Followed
    begin: int  # [ns] when the sticks were handed over
    commands: list[PilotCommand]
    telemetry: list[Said]


@cache
def flown(link: str, stick: Stick, seconds: float) -> LinkRun:
    """A flight of `seconds`. The link is changed to `link` in the moment in which the sticks are
    handed over, so its outages count from there."""
    with TemporaryDirectory() as folder:
        notes, begin = _notes(Path(folder), link, stick, seconds)
    commands = [command for command in notes.commands if command.stamp_ns >= begin]
    telemetry = [said for said in notes.telemetry if said.at >= begin]
    return LinkRun(_lindy(notes, begin), begin, commands, telemetry)


def _notes(folder: Path, link: str, stick: Stick, seconds: float) -> tuple[LinkRunLog, int]:
    """The whole chain; also when [ns] the sticks were handed over."""
    script = folder / "sticks.csv"
    rows = "".join(f"{t:g},0,0,{heave:g},0\n" for t, heave in stick)
    script.write_text(f"t,surge,sway,heave,yaw\n{rows}{seconds:g},0,0,0,0\n", encoding="utf-8")
    stack = Stack(pilot=f"script:{script}", out=str(folder), seed=SEED, overrides=[SHORT])
    host, services, notes = VirtualHost(), Registry.read(), LinkRunLog()
    for name in SERVICES:
        host.add(name, services[name], stack)
    drone, pilot = host.node("eyes", ["drone"]), host.node("ears", ["topside"])
    drone.each(topics.REFERENCE, lambda m, _: notes.references.append(m))
    pilot.each(topics.PILOT_COMMAND, lambda m, _: notes.commands.append(m))
    pilot.each(topics.STATUS, notes.on_status)
    pilot.each(topics.STATE, lambda m, now: notes.seen.append((now, m.stamp_ns)))
    host.side("drone").hear("**", lambda e: notes.on_telemetry(e, host.now))
    host.run(round(LONGEST_START * 1e9), done=lambda: notes.armed)
    if not notes.armed:
        raise RuntimeError(f"the drone is not armed after {LONGEST_START:.0f} s")
    begin = host.now
    hand = host.node("hand", ["topside"]).publisher(topics.LINK_REQUEST)
    hand.put(LinkRequest(stamp_ns=begin, id="link", kind="profile", profile=link))
    host.run(begin + round(seconds * 1e9))
    return notes, begin


def _lindy(notes: LinkRunLog, begin: int) -> Followed:
    kept = [r for r in notes.references if r.stamp_ns >= begin and r.armed]
    start = kept[0].depth.position
    t = np.array([r.stamp_ns - begin for r in kept]) / 1e9
    depth = np.array([r.depth.position - start for r in kept])
    age = [np.inf if r.pilot_ns is None else (r.stamp_ns - r.pilot_ns) / 1e9 for r in kept]
    return Followed(t, depth, np.array(age), newest_seen(notes.seen, begin, t))


def newest_seen(states: list[tuple[int, int]], begin: int, t: Floats) -> Floats:
    """[s] Age of the newest state at each t.

    Args:
        states: when [ns] each arrived, and its stamp [ns].
    """
    arrived, stamps = (np.array(states, dtype=np.int64) - begin).T / 1e9
    newest = np.maximum.accumulate(stamps)
    return t - newest[np.maximum(0, np.searchsorted(arrived, t, side="right") - 1)]
