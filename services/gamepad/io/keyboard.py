"""The keyboard as a pad, in a window of its own, which shows the head-up numbers.

While the window does not have the focus, all keys count as released and the pilot counts as
present. When the window is closed, the pilot is lost.

A key that is held down while the window gets the focus, or is opened, does nothing until it was let
go: the system repeats it as if it was pressed in this window.

The window shows what a pilot must see, and below it what each key does.
"""

from collections.abc import Sequence

import pygame

from messages import events
from messages.events import Outbox
from services.gamepad.core import StickGain
from services.gamepad.io import sdl
from services.gamepad.io.pad import HELD, URGENT
from services.piloting.keys import KEYS, Key
from services.piloting.pilot_intents import Press
from services.piloting.sticks import Holds, StickReading, Sticks
from services.runtime.config.errors import LindyError
from services.runtime.node.node import Node
from services.vehicle_view.io.ports import LOOK_HZ, VehiclePorts
from services.vehicle_view.view import VehicleView, vehicle_view
from services.vehicle_view.words import Said, Tone, head_up

SIZE = (720, 650)  # [px]
PAPER, INK, LABEL, RED = (8, 14, 22), (255, 255, 255), (160, 180, 200), (185, 20, 30)
TONES: dict[Tone, tuple[int, int, int]] = {
    "plain": INK, "warning": (255, 205, 60), "alarm": INK,
}  # fmt: skip
MARGIN = 18  # [px]
KEY, SMALL, BIG = 22, 30, 86  # [px] height of the letters
BIG_LINES, SAID_ROWS = 2, 5  # the first lines are big; the last one, of sentences, has several rows
LAST, LONGEST = "\uffff", 500  # sign that pygame can draw; signs of a text
INSTEAD = "use a pad or --pilot script:FILE"
FOCUS = "The keys do nothing now: click into this window"
PAUSE_NS = 100_000_000  # [ns] between two pictures


def open_window() -> pygame.Surface:
    """
    Raises:
        LindyError: there is no display.
    """
    if not sdl.has_display():
        raise LindyError(f"the keyboard needs a window and there is no display; {INSTEAD}")
    try:
        pygame.display.init()
        surface = pygame.display.set_mode(SIZE)
    except pygame.error as error:
        raise LindyError(f"cannot open the keyboard's window ({error}); {INSTEAD}") from None
    pygame.display.set_caption("Lindy: keyboard")
    return surface


class PilotWindow:
    """Open and drawn into from one thread only."""

    def __init__(self, surface: pygame.Surface, keys: Sequence[tuple[str, str]]) -> None:
        """`keys`: which does what."""
        pygame.font.init()
        # pygame's own letters, so that none have to be installed.
        self._fonts = {size: pygame.font.Font(None, size) for size in (KEY, SMALL, BIG)}
        self._surface, self._keys = surface, keys
        self._next_ns = 0

    def look(self, node: Node) -> None:
        """Have what a node hears of the vehicle drawn ten times a second.

        To be called after what publishes the sticks: of two timers that are due, the older one is
        served first, so that a picture is drawn in the pause after the sticks were sent.
        """
        ports = VehiclePorts(node)

        def draw(now: int) -> None:
            newest = ports.newest(now)
            if now >= self._next_ns:
                self._next_ns = now + PAUSE_NS
                self.draw(vehicle_view(newest, now), focused=pygame.key.get_focused())

        node.every(LOOK_HZ, draw)

    def draw(self, view: VehicleView, *, focused: bool = True) -> None:
        self._surface.fill(PAPER)
        *lines, sentences = head_up(view)
        top, width = MARGIN, SIZE[0] - 2 * MARGIN
        for n, (text, tone) in enumerate(lines):
            size = BIG if n < BIG_LINES else SMALL
            self._rows([text], tone, size, top, size * 3 // 4 + 6)
            top += size * 3 // 4 + MARGIN // 2
        # Always as high, so that nothing below it moves.
        height = SAID_ROWS * SMALL + 8
        self._rows(self._wrapped(sentences, width), sentences.tone, SMALL, top, height)
        self._help(top + height + MARGIN // 2, focused)
        pygame.display.flip()

    def _rows(self, rows: list[str], tone: Tone, size: int, top: int, height: int) -> None:
        width = SIZE[0] - 2 * MARGIN
        if tone == "alarm":
            box = (MARGIN // 2, top - 4, width + MARGIN, height)
            pygame.draw.rect(self._surface, RED, box, border_radius=4)
        for n, row in enumerate(rows):
            self._write(row, size, TONES[tone], MARGIN, top + n * size, width)

    def _help(self, top: int, focused: bool) -> None:
        pygame.draw.line(self._surface, LABEL, (MARGIN, top), (SIZE[0] - MARGIN, top))
        top += MARGIN // 2
        if not focused:
            self._write(FOCUS, SMALL, TONES["warning"], MARGIN, top, SIZE[0])
            return
        columns, rows = 3, -(-len(self._keys) // 3)
        width = (SIZE[0] - 2 * MARGIN) // columns
        for n, (key, meaning) in enumerate(self._keys):
            left, row = MARGIN + n // rows * width, top + n % rows * KEY
            self._write(key, KEY, INK, left, row, width * 2 // 5 - 4)
            self._write(meaning, KEY, LABEL, left + width * 2 // 5, row, width * 3 // 5 - 4)

    def _wrapped(self, said: Said, width: int) -> list[str]:
        """In rows that are no wider; what does not fit into `SAID_ROWS` is cut."""
        lines = [""]
        for word in drawable(said.text).split():
            longer = f"{lines[-1]} {word}".strip()
            if self._fonts[SMALL].size(longer)[0] <= width:
                lines[-1] = longer
            elif len(lines) < SAID_ROWS:
                lines.append(word)
            else:
                lines[-1] += " …"
                break
        return lines

    def _write(
        self, text: str, size: int, ink: tuple[int, int, int], left: int, top: int, width: int
    ) -> None:
        """Text that would be wider than `width` is made narrower, never cut."""
        try:
            drawn = self._fonts[size].render(drawable(text), True, ink)
        except pygame.error:  # letters that have no width
            return
        if drawn.get_width() > width:
            drawn = pygame.transform.smoothscale(drawn, (width, drawn.get_height()))
        self._surface.blit(drawn, (left, top))


def drawable(text: str) -> str:
    """Text that any letters can draw: anybody on the bus may have sent it."""
    return "".join(sign if sign.isprintable() and sign <= LAST else "?" for sign in text[:LONGEST])


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
