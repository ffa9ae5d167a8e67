"""Wires the pilot: sticks at 50 Hz, requests until they are answered, arming and the hand-over."""

from typing import Any

import msgspec
from msgspec.structs import replace

from messages import topics
from messages.pilot import PilotAnswer, PilotCommand, PilotRequest, RequestKind
from messages.vehicle import VehicleStatus
from services.gamepad.core import CENTRED, Reading, Source
from services.gamepad.overruling import overrules
from services.gamepad.sources import open_source
from services.gamepad.wish import Follow, Goto, Mode, Wish
from services.runtime.node import Node
from services.runtime.stack import Stack

PAUSE_NS = 2_000_000_000  # [ns] between two attempts to arm by ourselves


class Progress(msgspec.Struct, frozen=True):
    """How far the dive has come; a restart goes on from here."""

    began_ns: int | None = None  # [ns] when the sticks were handed over
    played: int = 0  # events of the script that have happened
    epoch: int | None = None  # authority epoch we were given; None: not asked for yet
    may_arm: bool = True  # False: a stop or a disarm has ended arming by ourselves


def wire(node: Node, stack: Stack) -> None:
    progress = node.recall(Progress) or Progress()
    source = open_source(node, stack, progress.played)
    by_itself = stack.arm or stack.pilot.startswith("script:")
    pilot = Pilot(node, source, progress, arms=by_itself)
    node.each(topics.STATUS, pilot.on_status)
    node.every(topics.PILOT_COMMAND.hz, pilot.tick)


class Pilot:
    """Says what a source of sticks says, once the drone is armed."""

    def __init__(self, node: Node, source: Source, progress: Progress, *, arms: bool) -> None:
        self._node = node
        self._source = source
        self._progress = progress
        self._arms = arms
        self._arm_after = 0  # [ns]
        self._asked_for_rest = False
        self._arms_next = False  # as soon as the sticks are ours
        self._outdone = False  # another pilot has the sticks
        self._reading = Reading(present=False, at_rest=False)
        self._light = False  # as it was last asked for or seen
        self._command = node.publisher(topics.PILOT_COMMAND)
        self._asking = node.request(
            topics.PILOT_REQUEST,
            topics.PILOT_ANSWER,
            on_answer=self._on_answer,
            on_given_up=self._on_given_up,
            overrules=overrules,
        )
        self._change = node.alarm(self._speak)

    def tick(self, now: int) -> None:
        self._speak(now)

    def on_status(self, status: VehicleStatus, now: int) -> None:
        self._hold_lease(status.epoch, now)
        if not self._waits_for("light"):
            self._light = status.light > 0.0
        if self._progress.began_ns is not None:
            return
        if status.armed:
            self._hand_over(now)
        elif self._arms and self._progress.may_arm and status.mode == "ready":
            self._arm(now)

    def _on_given_up(self, request: PilotRequest, _: int) -> None:
        self._arms_next = self._arms_next and request.kind != "lease"
        self._node.count(f"unanswered:{request.kind}")
        self._node.log("warning", f"the drone did not answer to {request.kind!r}")

    def _on_answer(self, request: PilotRequest, answer: PilotAnswer, now: int) -> None:
        if request.kind == "arm":
            self._arm_after = now + PAUSE_NS
        if answer.epoch is not None:
            self._remember(replace(self._progress, epoch=answer.epoch))
        if request.kind == "lease":
            arms, self._arms_next = self._arms_next and answer.accepted, False
            if arms:
                self._ask("arm", now)
        if not answer.accepted:
            self._node.count(f"refused:{request.kind}")
            self._node.log("warning", f"the drone refuses to {request.kind}: {answer.reason}")

    def _speak(self, now: int) -> None:
        """Read the source and say it. Also called at the very instant a script's row begins."""
        began = self._progress.began_ns
        self._reading = reading = self._source.read(now, began)
        for name in reading.lost:
            self._node.count(name)
        for level, text in reading.notes:
            self._node.log(level, text)
        self._command.put(self._command_of(reading, now))
        for wish in reading.presses:
            self._press(wish, now)
        self._remember(replace(self._progress, played=self._source.played))
        if began is not None:
            self._change.set(self._source.next_ns(now, began))

    def _command_of(self, reading: Reading, now: int) -> PilotCommand:
        acts = reading.present and self._progress.began_ns is not None
        return PilotCommand(
            **(reading.sticks if acts else CENTRED)._asdict(),
            stamp_ns=now,
            pilot="present" if reading.present else "lost",
            source=self._source.name,
            device_age_ms=reading.age_ms,
            epoch=self._progress.epoch or 0,
        )

    def _hold_lease(self, given: int, now: int) -> None:
        """Ask for the sticks once, and again where the drone has forgotten that it gave them to
        us. When it has given them to somebody else, that is said and left so."""
        ours = self._progress.epoch
        if (ours is None or given < ours) and not self._waits_for("lease"):
            self._ask_for(now, "lease")
        elif ours is not None and given > ours and not self._outdone:
            self._node.count("outdone:lease")
            self._node.log("warning", "another pilot has taken the sticks")
        self._outdone = ours is not None and given > ours

    def _hand_over(self, now: int) -> None:
        self._node.log("info", f"armed: {self._source.name} has the sticks")
        self._remember(replace(self._progress, began_ns=now))
        self._speak(now)

    def _arm(self, now: int) -> None:
        """Arm by ourselves, at most once every `PAUSE_NS`, and never with a stick deflected."""
        if self._waits_for("arm") or now < self._arm_after or not self._has_sticks:
            return
        if self._reading.at_rest:
            self._ask("arm", now)
        elif self._reading.present and not self._asked_for_rest:
            self._asked_for_rest = True
            self._node.log("info", "ready: let go of the sticks to arm")

    def _press(self, wish: Wish, now: int) -> None:
        """What the pilot asked for; a stop or a disarm also ends arming by ourselves."""
        if wish == "arm" and not self._reading.at_rest:
            self._node.count("refused_here:arm")
            self._node.log("warning", "not arming: let go of the sticks first")
            return
        if wish == "arm" and not self._has_sticks:
            self._arms_next = True
            if not self._waits_for("lease"):
                self._ask_for(now, "lease")
            return
        if wish in ("stop", "disarm"):
            self._arms_next = False
            self._remember(replace(self._progress, may_arm=False))
        self._ask(wish, now)

    def _ask(self, wish: Wish, now: int) -> None:
        match wish:
            case Goto(depth, heading):
                self._ask_for(now, "goto", depth=depth, heading=heading)
            case Follow(course):
                self._ask_for(now, "follow", course=course)
            case Mode(hold):
                self._ask_for(now, "mode", hold=hold)
            case "light":
                self._light = not self._light
                self._ask_for(now, "light", value=float(self._light))
            case _:
                self._ask_for(now, wish)

    def _ask_for(self, now: int, kind: RequestKind, **more: Any) -> None:
        epoch = self._progress.epoch or 0
        self._asking.ask(PilotRequest(stamp_ns=now, id="", kind=kind, epoch=epoch, **more), now)

    @property
    def _has_sticks(self) -> bool:
        return self._progress.epoch is not None and not self._outdone

    def _waits_for(self, kind: RequestKind) -> bool:
        return any(request.kind == kind for request in self._asking.pending)

    def _remember(self, progress: Progress) -> None:
        if progress != self._progress:
            self._progress = progress
            self._node.remember(progress)
