"""The keyboard as a pad, in a window of its own, which shows the head-up numbers.

While the window does not have the focus, all keys count as released and the pilot counts as
present. When the window is closed, the pilot is lost.

A key that is held down while the window gets the focus, or is opened, does nothing until it was let
go: the system repeats it as if it was pressed in this window.
"""

from collections.abc import Sequence

import pygame

from messages import events
from messages.events import Outbox
from services.gamepad.core import StickGain
from services.gamepad.io.pad import URGENT
from services.gamepad.io.window import PilotWindow, open_window
from services.piloting.pilot_intents import Press
from services.piloting.sticks import StickReading, Sticks
from services.vehicle_view.head_up import NumbersRow, head_up
from services.vehicle_view.view import VehicleView

HELP = (
    ("W  S", "forward, back"),
    ("A  D", "port, starboard"),
    ("arrows up, down", "rise, sink"),
    ("arrows left, right", "turn"),
    ("R  F", "camera up, down"),
    ("Shift, Ctrl", "boost, slow"),
    ("Enter, Backspace", "arm or resume, disarm"),
    ("Space", "STOP"),
    ("L", "light on, off"),
)

HELD_NS = 300_000_000  # [ns] after the focus came: keys that were held before are repeated by then
REQUESTS: dict[int, Press] = {
    pygame.K_RETURN: "arm",
    pygame.K_BACKSPACE: "disarm",
    pygame.K_SPACE: "stop",
    pygame.K_l: "light",
}


class Keyboard:
    """Keys that are down, from the window's own key events."""

    played = 0
    name = "keyboard"

    def __init__(self, gain: StickGain, outbox: Outbox) -> None:
        """
        Raises:
            LindyError: there is no display.
        """
        surface = open_window("keyboard")
        self._window = PilotWindow(surface, HELP)
        self.show(head_up(VehicleView()))
        self._gain, self._outbox = gain, outbox
        self._down: set[int] = set()
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
        return StickReading(sticks=sticks, at_rest=sticks.at_rest, presses=tuple(presses))

    def next_ns(self, now: int, began: int) -> int | None:  # noqa: ARG002
        return None

    def show(self, rows: Sequence[NumbersRow]) -> None:
        """Draw the head-up numbers, and what each key does."""
        self._window.draw(rows, focused=pygame.key.get_focused())

    def close(self) -> None:
        pygame.font.quit()
        pygame.display.quit()

    def _key(self, event: pygame.event.Event, now: int) -> list[Press]:
        """Update the set of keys that are down; returns the requests of a key press."""
        if event.type == pygame.KEYDOWN and self._is_held(event.key, now):
            self._held.add(event.key)
        elif event.type == pygame.KEYDOWN:
            self._down.add(event.key)
            return [REQUESTS[event.key]] if event.key in REQUESTS else []
        if event.type == pygame.KEYUP:
            self._down.discard(event.key)
            self._held.discard(event.key)
        elif event.type == pygame.WINDOWFOCUSLOST:
            self._down.clear()  # another window will get their release
            self._held.clear()
        return []

    def _is_held(self, key: int, now: int) -> bool:
        """Was it down before this window had the focus? A stop is never held back."""
        if REQUESTS.get(key) in URGENT:
            return False
        focused = self._focused_at
        return key in self._held or (focused is not None and now < focused + HELD_NS)

    def _sticks(self) -> Sticks:
        gain = self._gain.level(
            slow=self._any(pygame.K_LCTRL, pygame.K_RCTRL),
            boost=self._any(pygame.K_LSHIFT, pygame.K_RSHIFT),
        )
        return Sticks(
            surge=gain * (self._any(pygame.K_w) - self._any(pygame.K_s)),
            sway=gain * (self._any(pygame.K_d) - self._any(pygame.K_a)),
            heave=gain * (self._any(pygame.K_DOWN) - self._any(pygame.K_UP)),
            yaw=gain * (self._any(pygame.K_RIGHT) - self._any(pygame.K_LEFT)),
            tilt=self._any(pygame.K_r) - self._any(pygame.K_f),
        )

    def _any(self, *keys: int) -> float:
        return float(not self._down.isdisjoint(keys))
