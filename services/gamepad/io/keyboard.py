"""The keyboard as a pad, in a window of its own, which shows the head-up numbers.

While the window does not have the focus, all keys count as released and the pilot counts as
present. When the window is closed, the pilot is lost.

A key that is held down while the window gets the focus, or is opened, does nothing until it was let
go: the system repeats it as if it was pressed in this window.
"""

import pygame

from messages import events
from messages.events import Outbox
from services.gamepad.core import StickGain
from services.gamepad.io.pad import HELD, URGENT
from services.gamepad.io.window import PilotWindow, open_window
from services.piloting.keys import KEYS, Key
from services.piloting.pilot_intents import Press
from services.piloting.sticks import Holds, StickReading, Sticks
from services.vehicle_view.view import VehicleView

HELD_NS = 300_000_000  # [ns] after the focus came: keys that were held before are repeated by then
NAMES = {
    "ShiftLeft": "LSHIFT",
    "ShiftRight": "RSHIFT",
    "Enter": "RETURN",
}  # SDL's, where they differ


def scancode(code: str) -> int:
    """A key of the table, as SDL counts the places on the keyboard."""
    name = NAMES.get(code, code.removeprefix("Key").removeprefix("Arrow").upper())
    return getattr(pygame, f"KSCAN_{name}")


def label(key: Key) -> str:
    """How its first key is called."""
    code = key.codes[0].removeprefix("Key")
    return code.removeprefix("Arrow") if code.startswith("Arrow") else code.removesuffix("Left")


HERE = tuple(key for key in KEYS if key.kind != "page")
CODES = {key.action: frozenset(map(scancode, key.codes)) for key in HERE}
HELP = tuple(
    (label(key), f"{key.sentence} (hold)" if key.kind == "hold" else key.sentence) for key in HERE
)
PRESSES: dict[int, Press] = {
    code: press
    for press in ("stop", "light", "light_2", "laser")
    for code in CODES[press]
}  # fmt: skip
ALONE = pygame.KMOD_CTRL | pygame.KMOD_ALT | pygame.KMOD_META  # with them keys are the system's


class Keyboard:
    """Keys that are down, from the window's own key events."""

    played = 0
    name = "keyboard"

    def __init__(self, gain: StickGain, outbox: Outbox) -> None:
        """
        Raises:
            LindyError: there is no display.
        """
        self.window = PilotWindow(open_window(), HELP)
        self.window.draw(VehicleView())
        self._gain, self._outbox = gain, outbox
        self._holds = Holds()
        self._down: set[int] = set()  # scancodes
        self._held: set[int] = set()  # since before the window had the focus
        self._focused_at: int | None = None  # [ns]
        self._closed_at: int | None = None  # [ns]

    def read(self, now: int, began: int | None) -> StickReading:  # noqa: ARG002 - only a script needs it
        """Read SDL's events. Call only from the thread that made the window."""
        presses: list[Press] = []
        for event in pygame.event.get():
            if event.type == pygame.QUIT and self._closed_at is None:
                self._closed_at = now
                self._outbox.tell(events.CLOSED_KEYBOARD())
            if event.type == pygame.WINDOWEXPOSED:
                pygame.display.flip()  # show it again after another window covered it
            if event.type == pygame.WINDOWFOCUSGAINED:
                self._focused_at = now
            presses += self._key(event, now)
        if self._closed_at is not None:
            age_ms = (now - self._closed_at) / 1e6
            return StickReading(present=False, at_rest=False, age_ms=age_ms)
        sticks = self._sticks()
        held = self._holds.read({press for press in HELD if self._any(press)}, HELD, now)
        return StickReading(sticks=sticks, at_rest=sticks.at_rest, presses=(*presses, *held))

    def next_ns(self, now: int, began: int) -> int | None:  # noqa: ARG002
        return None

    def close(self) -> None:
        pygame.font.quit()
        pygame.display.quit()

    def _key(self, event: pygame.event.Event, now: int) -> list[Press]:
        """Update the set of keys that are down; returns the requests of a key press."""
        if event.type == pygame.KEYDOWN:
            return self._pressed(event, now)
        if event.type == pygame.KEYUP:
            self._down.discard(event.scancode)
            self._held.discard(event.scancode)
        elif event.type == pygame.WINDOWFOCUSLOST:
            self._down.clear()  # another window will get their release
            self._held.clear()
        return []

    def _pressed(self, event: pygame.event.Event, now: int) -> list[Press]:
        code, press = event.scancode, PRESSES.get(event.scancode)
        if event.mod & ALONE and press not in URGENT:
            self._down.clear()  # the system may take the release as well
        elif self._is_held(code, now):
            self._held.add(code)
        else:
            self._down.add(code)
            return [press] if press else []
        return []

    def _is_held(self, code: int, now: int) -> bool:
        """Was it down before this window had the focus? A stop is never held back."""
        if PRESSES.get(code) in URGENT:
            return False
        focused = self._focused_at
        return code in self._held or (focused is not None and now < focused + HELD_NS)

    def _sticks(self) -> Sticks:
        gain = self._gain.level(slow=self._any("slow"), boost=self._any("boost"))
        return Sticks(
            surge=gain * (self._any("ahead") - self._any("back")),
            sway=gain * (self._any("starboard") - self._any("port")),
            heave=gain * (self._any("sink") - self._any("rise")),
            yaw=gain * (self._any("turn_starboard") - self._any("turn_port")),
            tilt=self._any("tilt_up") - self._any("tilt_down"),
            gripper=self._any("gripper_open") - self._any("gripper_close"),
        )

    def _any(self, action: str) -> float:
        return float(not self._down.isdisjoint(CODES[action]))
