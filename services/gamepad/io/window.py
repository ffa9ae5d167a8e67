"""A pilot's window: what a pilot must see, and below it what each key does."""

from collections.abc import Sequence

import pygame

from services.gamepad.io import sdl
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
