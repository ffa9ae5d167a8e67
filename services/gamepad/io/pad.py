"""A game pad through SDL's GameController mapping, plugged in whenever the pilot likes.

An unplugged pad reads as centred sticks, so its absence has its own field: `present=False`. A pad
that is plugged in, again or for the first time, moves nothing until its sticks were centred once,
and until then only its stop and disarm buttons work, because pads send a burst of false events when
they are opened. Arming and disarming have to be held.

`age_ms` is the time since the pad last answered. It grows from the moment the pad is unplugged, or
has stopped answering although it is plugged in (`PadSilence` says how that is known); then the
pilot is lost. It is 0 for still sticks, because a pad only reports changes.

A radio pad that lost its link may come back as a second device while the system still repeats the
last state of the first. So of two devices of one name that which moves is the pilot's, and a new
one takes over as soon as the first is still.
"""

import pygame
from pygame._sdl2 import controller

from messages import events
from messages.events import Outbox
from services.gamepad.core import PadAnswer, PadProfile, PadSilence, held_of, presses_of, sticks_of
from services.gamepad.io import sdl
from services.piloting.pilot_intents import Press
from services.piloting.sticks import CENTRED, Holds, StickReading

# In the order of SDL_GameControllerAxis and SDL_GameControllerButton.
AXES = ("leftx", "lefty", "rightx", "righty", "lefttrigger", "righttrigger")
BUTTONS = (
    "a", "b", "x", "y", "back", "guide", "start", "leftstick", "rightstick",
    "leftshoulder", "rightshoulder", "dpup", "dpdown", "dpleft", "dpright",
)  # fmt: skip
URGENT: frozenset[Press] = frozenset(("stop", "disarm"))  # accepted from a pad at any time
HELD: frozenset[Press] = frozenset(("arm", "disarm"))
STILL_NS = 300_000_000  # [ns] without a change; a hand that moves a stick changes it at each report
FULL = 32767  # SDL's full travel; the other way it is one more, which counts as full


class PadDevice:
    """One pad that SDL has opened."""

    def __init__(self, index: int) -> None:
        """
        Args:
            index: among the devices that there are now.

        Raises:
            pygame.error: it was unplugged again before it could be opened.
        """
        self.pad = controller.Controller(index)
        self.name = str(self.pad.name)
        self.id = self.pad.as_joystick().get_instance_id()  # now: the index counts those there are
        self.controls = controls_of(self.pad)

    def read(self) -> bool:
        """Its controls; whether they changed."""
        before, self.controls = self.controls, controls_of(self.pad)
        return self.controls != before


class Pad:
    """The first pad that SDL knows. Another one is named in the log, and waits."""

    played = 0

    def __init__(self, profile: PadProfile, outbox: Outbox) -> None:
        sdl.start_events()
        pygame.joystick.init()
        controller.init()
        self.name = "gamepad"
        self._profile, self._outbox = profile, outbox
        self._pad: PadDevice | None = None
        self._others: list[PadDevice] = []  # the newest last
        self._is_new = False  # the newest has not been taken yet
        self._silence = PadSilence(profile.silent_after, profile.dead_band)
        self._holds = Holds()
        self._silent = False  # it is plugged in and does not answer
        self._trusted = False  # the sticks were at rest once since the pad was plugged in
        self._answered_at: int | None = None  # [ns]
        self._announced = False  # the log says whether there is a pad

    def read(self, now: int, began: int | None) -> StickReading:  # noqa: ARG002 - only a script needs it
        """Read SDL's events. Call only from the thread that made the pad."""
        happened = pygame.event.get()
        self._notice_loss()
        for event in happened:
            self._notice_arrival(event)
        if self._answered_at is None:
            self._answered_at = now
        if self._pad is None:
            return self._absent(now)
        self._pad.read()
        answering = self._silence.read(self._pad.controls, now)
        if (other := self._pilots_own(now)) is not None:
            self._others = [each for each in (*self._others, self._pad) if each is not other]
            why = "has the sticks now, because the other one is still; centre its sticks once"
            self._take(other, why)
            self._pad, answering = other, self._silence.read(other.controls, now)
        controls = self._pad.controls
        self._answered_at = now - answering.age_ns
        self._notice_silence(self._pad.name, answering)
        if self._silent:
            return self._absent(now)
        sticks = sticks_of(controls, self._profile)
        presses: tuple[Press, ...]
        presses = presses_of(_pressed(happened, self._pad), self._profile)
        if not self._trusted:
            presses = tuple(kind for kind in presses if kind in URGENT)
        counted = HELD if self._trusted else URGENT
        held = self._holds.read(held_of(controls, self._profile), counted, now)
        self._trusted = self._trusted or sticks.at_rest
        return StickReading(
            sticks=sticks if self._trusted else CENTRED,
            at_rest=sticks.at_rest,
            age_ms=answering.age_ns / 1e6,
            presses=(*presses, *held),
        )

    def next_ns(self, now: int, began: int) -> int | None:  # noqa: ARG002
        return None

    def close(self) -> None:
        controller.quit()
        pygame.joystick.quit()
        pygame.display.quit()

    def _absent(self, now: int) -> StickReading:
        if not self._announced:
            self._announced = True
            self._outbox.say("warning", "no pad is plugged in; waiting for one")
        assert self._answered_at is not None
        self._holds = Holds()
        return StickReading(
            present=False,
            at_rest=False,
            age_ms=(now - self._answered_at) / 1e6,
        )

    def _notice_loss(self) -> None:
        for gone in [each for each in self._others if not each.pad.attached()]:
            self._others.remove(gone)
            gone.pad.quit()
        if self._pad is not None and not self._pad.pad.attached():
            self._outbox.tell(events.UNPLUGGED_PAD(detail=self._pad.name))
            self._pad.pad.quit()
            self._pad, self._silent = None, False
            if self._others:
                self._take(self._others.pop(), "is plugged in")

    def _pilots_own(self, now: int) -> PadDevice | None:
        """Another pad that takes over, where the first is still or does not answer: the same one
        that came back, or is moved."""
        moved = [other for other in self._others if other.read()]
        if self._pad is None or not self._others or self._silence.still_ns(now) < STILL_NS:
            return None
        fitting = [each for each in self._others if self._silent or each.name == self._pad.name]
        if self._is_new and self._others[-1] in fitting:
            return self._others[-1]
        in_hand = [each for each in moved if not sticks_of(each.controls, self._profile).at_rest]
        return next((each for each in in_hand if each in fitting), None)

    def _notice_silence(self, name: str, answering: PadAnswer) -> None:
        """A pad that answers again is as one that was plugged in again."""
        if answering.lost and not self._silent:
            silence = f"{name}, no answer for {answering.age_ns / 1e9:.1f} s"
            self._outbox.tell(events.SILENT_PAD(detail=silence))
            self._trusted = False
        elif self._silent and not answering.lost:
            self._outbox.say("info", f"the pad {name} answers again; centre its sticks once")
        self._silent = answering.lost

    def _notice_arrival(self, event: pygame.event.Event) -> None:
        if event.type == pygame.CONTROLLERDEVICEADDED:
            self._open(event.device_index)
        elif event.type == pygame.JOYDEVICEADDED and not controller.is_controller(
            event.device_index
        ):
            self._outbox.say(
                "warning",
                f"SDL does not know the pad {_name(event.device_index)}, so it is ignored; "
                "describe it in the environment variable SDL_GAMECONTROLLERCONFIG",
            )

    def _open(self, index: int) -> None:
        try:
            pad = PadDevice(index)
        except pygame.error as error:  # unplugged again before it could be opened
            self._outbox.say("warning", f"a pad was plugged in and cannot be opened: {error}")
            return
        if self._pad is None:
            self._take(pad, "is plugged in")
            return
        self._others.append(pad)
        self._is_new = True
        first = self._pad.name
        another = f"another pad, {pad.name}, waits until {first} is gone or silent"
        twin = f"a second {pad.name} waits until the first is still"
        self._outbox.say("info", twin if pad.name == first else another)

    def _take(self, pad: PadDevice, why: str) -> None:
        self._pad, self.name = pad, f"gamepad {pad.name}"
        self._silence = PadSilence(self._profile.silent_after, self._profile.dead_band)
        self._trusted = self._silent = self._is_new = False
        self._announced = True
        self._outbox.say("info", f"the pad {pad.name} {why}")


def _pressed(happened: list[pygame.event.Event], device: PadDevice) -> list[str]:
    """Names of the buttons that went down, in order."""
    return [
        BUTTONS[event.button]
        for event in happened
        if event.type == pygame.CONTROLLERBUTTONDOWN
        and event.instance_id == device.id
        and event.button < len(BUTTONS)
    ]


def controls_of(pad: controller.Controller) -> dict[str, float]:
    """The state of a pad, in SDL's names."""
    return {name: pad.get_axis(axis) / FULL for axis, name in enumerate(AXES)} | {
        name: float(pad.get_button(button)) for button, name in enumerate(BUTTONS)
    }


def _name(index: int) -> str:
    try:
        return repr(pygame.joystick.Joystick(index).get_name())
    except pygame.error:  # unplugged again before it could be opened
        return "that was plugged in"
