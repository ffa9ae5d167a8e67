"""The pilot as a state machine: which pilot is in control, arming, hand-over and requests.

Pure: stick readings and the drone's messages go in, commands and requests come out.
"""

from collections.abc import Callable, Set
from dataclasses import dataclass, field
from typing import Any

import msgspec
from msgspec.structs import replace

from messages import events
from messages.events import Outbox
from messages.pilot import PilotAnswer, PilotCommand, PilotRequest, RequestKind
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.marine.outputs import LIGHT, OUTPUTS, Output, meant
from services.piloting.pilot_intents import (
    Asked,
    FollowIntent,
    GotoIntent,
    Held,
    Intent,
    ModeIntent,
    OutputIntent,
    PlaceIntent,
)
from services.piloting.sticks import CENTRED, StickReading

PAUSE_NS = 2_000_000_000  # [ns] between two attempts at automatic arming
RESUME_PAUSE_NS = 200_000_000  # [ns] after an answer: until a newer status says how it went
BACK_OFF_NS = 2_000_000_000, 10_000_000_000  # [ns] after a lease; doubles when it was refused
ABSENT = StickReading(present=False, at_rest=False)  # until the source was read
Waiting = Set[RequestKind]  # kinds of the requests that have not been answered yet


class Progress(msgspec.Struct, frozen=True):
    """Checkpoint: how far the dive has come; a restarted service continues from here."""

    began_ns: int | None = None  # [ns] when the sticks were handed over
    played: int = 0  # events of the script that have happened
    epoch: int | None = None  # authority epoch granted to this pilot; None: none yet
    released: bool = False  # the pilot has given control up
    may_arm: bool = True  # False: a stop or a disarm has ended automatic arming
    filming_ns: int | None = None  # [ns] when the film began that runs; None: none does


@dataclass(slots=True)
class Effects:
    """What one event causes, in the order in which it is to be done."""

    command: PilotCommand | None = None  # to be published
    requests: list[PilotRequest] = field(default_factory=list[PilotRequest])
    hand_over: bool = False  # the sticks were just handed over: read and publish them at once

    def add(self, effects: "Effects") -> None:
        """Also what the pilot's state machine does."""
        self.command = effects.command or self.command
        self.requests += effects.requests


@dataclass(slots=True)
class Pilot:
    """Makes commands from stick readings, once the drone is armed and this pilot has control.

    By itself it asks for control only while nobody has it, and not again after another pilot has
    taken it or after it was released; then the person asks, by arming or with `lindy ask take`.
    While a failsafe acts, arming means to resume.
    """

    progress: Progress
    outbox: Outbox
    arms: bool  # automatically, as soon as the drone is ready
    source: str = ""  # name of the pilot, else of the pad, keyboard or script
    resumes: bool = False  # automatically, once a failsafe's conditions have ended: a script
    has: tuple[Output, ...] = OUTPUTS  # outputs of the vehicle
    asked: Callable[[], Waiting] = frozenset  # kinds of the requests that are not answered yet
    _arm_after: Ns = 0  # [ns]
    _arms_next: bool = False  # as soon as this pilot is in control
    _arms_soon: bool = False  # with the next command
    _commanded: int | None = None  # authority epoch of the newest command; None: none yet
    _asked_for_rest: bool = False
    _has_control: bool = False
    _told_of: str = ""  # the pilot in control, whom the log has named
    _take_after: Ns = 0  # [ns]
    _back_off_ns: Ns = BACK_OFF_NS[0]
    _outputs: dict[str, float] = field(default_factory=dict[str, float])  # requested or reported
    in_failsafe: bool = False  # the drone acts by itself, until this pilot resumes
    _changed_ns: Ns = 0  # [ns] when arming began to mean resuming, or ended to
    _resume_after: Ns = 0  # [ns]
    _reading: StickReading = ABSENT

    @property
    def in_control(self) -> bool:
        """As far as this pilot knows."""
        return self._has_control

    def read(self, reading: StickReading, source: str, played: int, now: Ns) -> Effects:
        """The source was read.

        Args:
            source: its name.
            played: events of its script that have happened.
        """
        self._reading, self.source = reading, source
        out = Effects(self._command(now))
        self._commanded = self.progress.epoch
        if self._arms_soon:
            self._arms_soon = False
            self._arm(now, out)
        for intent in reading.presses:
            self._press(intent, out)
        self.progress = replace(self.progress, played=played)
        return out

    def status(self, status: VehicleStatus, now: Ns) -> Effects:
        out = Effects()
        self._hold_lease(status, now, out)
        if self.asked().isdisjoint(("light", "output")):
            self._outputs = dict(status.outputs)
        self.notice_failsafe(status, now)
        if self.resumes and status.resumable and self._has_control:
            self._resume(now, out)
        if self.progress.began_ns is not None or not self._has_control:
            return out
        if status.armed:
            self.progress = replace(self.progress, began_ns=now)
            self.outbox.say("info", f"armed: {self.source} has the sticks")
            out.hand_over = True
        elif self.arms and self.progress.may_arm and status.activity == "ready":
            self._arm(now, out)
        return out

    def notice_failsafe(self, status: VehicleStatus, now: Ns) -> None:
        """Also of a drone that this pilot does not fly: what arming means."""
        if self.in_failsafe != (status.armed and status.failsafe != "none"):
            self.in_failsafe, self._changed_ns = not self.in_failsafe, now

    def answered(self, request: PilotRequest, answer: PilotAnswer, now: Ns) -> Effects:
        out = Effects()
        if request.kind == "arm":
            self._arm_after = now + PAUSE_NS
        elif request.kind == "resume":
            self._resume_after = now + RESUME_PAUSE_NS
        self._learn(request, answer)
        if request.kind == "lease":
            self._space_out(answer.accepted, now)
            arms, self._arms_next = self._arms_next and answer.accepted, False
            if arms:
                out.requests.append(self._request("resume" if self.in_failsafe else "arm"))
        if not answer.accepted:
            self.outbox.tell(events.REFUSED(request.kind, detail=answer.reason))
        elif answer.note:
            self.outbox.say("warning", f"{request.kind}: {answer.note}")
        return out

    def overheard(self, request: PilotRequest, answer: PilotAnswer) -> Effects:
        """Another process on this side, such as `lindy ask`, made a request and was answered."""
        name, epoch = self.source[:128], self.progress.epoch or 0
        if name and (request.source, request.epoch) == (name, epoch):
            self._learn(request, answer)
        return Effects()

    def given_up(self, request: PilotRequest, now: Ns) -> Effects:
        if request.kind == "lease":
            self._arms_next = False
            self._space_out(False, now)
        self.outbox.tell(events.UNANSWERED(request.kind))
        return Effects()

    def _command(self, now: Ns) -> PilotCommand:
        reading = self._reading
        acts = reading.present and self.progress.began_ns is not None
        return PilotCommand(
            **(reading.sticks if acts else CENTRED)._asdict(),
            stamp_ns=now,
            pilot="present" if reading.present else "lost",
            source=self.source[:128],
            device_age_ms=reading.age_ms,
            epoch=self.progress.epoch or 0,
        )

    def _learn(self, request: PilotRequest, answer: PilotAnswer) -> None:
        """Whether the drone has granted control to this pilot, or heard that it gives it up."""
        if answer.epoch is not None:
            self.progress = replace(self.progress, epoch=answer.epoch, released=False)
            self._has_control = True
        elif request.kind == "release" and answer.accepted:
            self.progress = replace(self.progress, released=True)

    def _space_out(self, accepted: bool, now: Ns) -> None:
        """The next automatic request for control comes later after each that was not granted."""
        shortest, longest = BACK_OFF_NS
        self._take_after = now + self._back_off_ns
        self._back_off_ns = shortest if accepted else min(2 * self._back_off_ns, longest)

    def _hold_lease(self, status: VehicleStatus, now: Ns, out: Effects) -> None:
        """Ask for control at the start, and again after the drone has restarted without memory,
        as soon as nobody has it."""
        ours, given = self.progress.epoch, status.epoch
        self._has_control = ours == given and not self.progress.released
        if self._has_control:
            self._told_of = ""
        elif status.pilot:
            asked = self.progress.released or not self.asked().isdisjoint(("lease", "force"))
            # Its own name, while it gives control back or takes it: that is no other pilot.
            if not (asked and status.pilot == self.source[:128]):
                self._tell_of(status.pilot)
        elif (ours is None or given < ours) and not self.progress.released:
            self._take(now, out)

    def _take(self, now: Ns, out: Effects) -> None:
        if "lease" not in self.asked() and now >= self._take_after:
            out.requests.append(self._request("lease"))

    def _tell_of(self, other: str) -> None:
        """Another pilot has control."""
        if other == self._told_of:
            return
        self._told_of = other
        if self.progress.epoch is None:
            self.outbox.say("info", f"{other} has control; waiting until nobody has it")
        else:
            self.outbox.tell(events.OUTDONE_LEASE(detail=other))

    def _arm(self, now: Ns, out: Effects) -> None:
        """Arm automatically, at most once every `PAUSE_NS`, and never with a stick deflected. The
        drone arms only with sticks of this pilot's epoch: they must have been sent before."""
        if "arm" in self.asked() or now < self._arm_after or not self._has_control:
            return
        if self._commanded != self.progress.epoch:
            self._arms_soon = True
        elif self._reading.at_rest:
            out.requests.append(self._request("arm"))
        elif self._reading.present and not self._asked_for_rest:
            self._asked_for_rest = True
            self.outbox.say("info", "ready: let go of the sticks to arm")

    def _resume(self, now: Ns, out: Effects) -> None:
        """As an attentive pilot does: at once, while the script's pilot is there."""
        if "resume" not in self.asked() and now >= self._resume_after and self._reading.present:
            out.requests.append(self._request("resume"))

    def _press(self, intent: Intent, out: Effects) -> None:
        """Make the pilot's request; a stop or a disarm also ends automatic arming. Who arms while a
        failsafe acts wants to resume, unless it was held since before."""
        if isinstance(intent, Held):
            if intent.press == "arm" and intent.began_ns < self._changed_ns:
                self.outbox.tell(events.VOID_HOLD(detail="arm"))
                return
            intent = intent.press
        if intent == "arm" and self.in_failsafe and self._has_control:
            intent = "resume"
        if intent == "arm" and not self._reading.at_rest:
            self.outbox.tell(events.REFUSED_HERE("arm", detail="let go of the sticks first"))
        elif intent in ("arm", "resume") and not self._has_control:
            if not self._arms_next and "lease" not in self.asked():
                out.requests.append(self._request("lease"))
            self._arms_next = True
        else:
            if intent in ("stop", "disarm"):
                self._arms_next = False
                self.progress = replace(self.progress, may_arm=False)
            if (request := self._request_for(intent)) is not None:
                out.requests.append(request)

    def _request_for(self, intent: Asked) -> PilotRequest | None:
        """None: this vehicle has no output for that button."""
        match intent:
            case GotoIntent(depth, heading):
                return self._request("goto", depth=depth, heading=heading)
            case PlaceIntent(north, east):
                return self._request("goto", north=north, east=east)
            case FollowIntent(course):
                return self._request("follow", course=course)
            case ModeIntent(flight_mode):
                return self._request("mode", flight_mode=flight_mode)
            case OutputIntent(name, value):
                return self._output(name, value)
            case "light" | "light_2" | "laser":
                if (named := meant(self.has, intent)) is not None:
                    return self._output(named, None)
                detail = f"{intent}: this vehicle has no such output"
                self.outbox.tell(events.REFUSED_HERE("output", detail=detail))
                return None
            case _:
                return self._request(intent)

    def _output(self, name: str, value: float | None) -> PilotRequest:
        """None: on or off, whichever it is not."""
        on = float(not self._outputs.get(name)) if value is None else value
        self._outputs[name] = on
        if name == LIGHT:
            return self._request("light", value=on)
        return self._request("output", value=on, output=name)

    def _request(self, kind: RequestKind, **more: Any) -> PilotRequest:
        """Without stamp and id: the sender fills them in."""
        return PilotRequest(
            stamp_ns=0,
            id="",
            kind=kind,
            source=self.source[:128],
            epoch=self.progress.epoch or 0,
            **more,
        )
