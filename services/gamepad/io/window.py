"""A pilot's window: the head-up numbers, and below them what each key does. Drawing only."""

from collections.abc import Sequence

import pygame

from services.gamepad.io import sdl
from services.runtime.config.errors import LindyError
from services.vehicle_view.head_up import NumbersRow
from services.vehicle_view.words import Tone

SIZE = (720, 650)  # [px]
PAPER, INK, LABEL = (8, 14, 22), (255, 255, 255), (160, 180, 200)
TONES: dict[Tone, tuple[int, int, int]] = {
    "plain": INK, "warning": (255, 205, 60), "alarm": INK,
}  # fmt: skip
ALARM = (185, 20, 30)  # behind an alarm
MARGIN = 18  # [px]
LABELS, SMALL, BIG = 22, 30, 86  # [px] height of the letters
SAID_ROWS = 5  # of the last row of numbers, which is the one with sentences
LAST, LONGEST = "\uffff", 500  # sign that pygame can draw; signs of a text
INSTEAD = "use a pad or --pilot script:FILE"
FOCUS = "The keys do nothing now: click into this window"


def drawable(text: str) -> str:
    """Text that any letters can draw: anybody on the bus may have sent it."""
    return "".join(sign if sign.isprintable() and sign <= LAST else "?" for sign in text[:LONGEST])


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
        self._fonts = {size: pygame.font.Font(None, size) for size in (LABELS, SMALL, BIG)}
        self._surface, self._keys = surface, keys

    def draw(self, rows: Sequence[NumbersRow], *, focused: bool = True) -> None:
        self._surface.fill(PAPER)
        top = MARGIN
        for row in rows[:-1]:
            top = self._cells(row, top)
        top = self._sentences(rows[-1], top) if rows else top
        self._help(top, focused)
        pygame.display.flip()

    def _cells(self, row: NumbersRow, top: int) -> int:
        """Returns where the next row begins."""
        width = (self._surface.get_width() - 2 * MARGIN) // len(row.cells)
        size = BIG if row.size == "big" else SMALL
        labelled = LABELS if any(cell.label for cell in row.cells) else 0
        for n, cell in enumerate(row.cells):
            left = MARGIN + n * width
            height = labelled + size * 3 // 4
            if cell.tone == "alarm":
                box = (left - MARGIN // 2, top - 4, width - MARGIN // 2, height + 6)
                pygame.draw.rect(self._surface, ALARM, box, border_radius=4)
            self._write(
                cell.label, LABELS, LABEL if cell.tone != "alarm" else INK, left, top, width
            )
            self._write(cell.text, size, TONES[cell.tone], left, top + labelled, width - MARGIN)
        return top + labelled + size * 3 // 4 + MARGIN // 2

    def _sentences(self, row: NumbersRow, top: int) -> int:
        """Always as high, so that nothing below it moves."""
        height = SAID_ROWS * SMALL + 8
        (cell,) = row.cells
        width = self._surface.get_width() - 2 * MARGIN
        if cell.tone == "alarm":
            box = (MARGIN // 2, top, width + MARGIN, height)
            pygame.draw.rect(self._surface, ALARM, box, border_radius=4)
        for n, line in enumerate(self._wrapped(cell.text, width)):
            self._write(line, SMALL, TONES[cell.tone], MARGIN, top + 6 + n * SMALL, width)
        return top + height + MARGIN // 2

    def _help(self, top: int, focused: bool) -> None:
        pygame.draw.line(self._surface, LABEL, (MARGIN, top), (SIZE[0] - MARGIN, top))
        top += MARGIN // 2
        if not focused:
            self._write(FOCUS, SMALL, TONES["warning"], MARGIN, top, SIZE[0])
            return
        columns, rows = 3, -(-len(self._keys) // 3)
        width = (SIZE[0] - 2 * MARGIN) // columns
        for n, (key, meaning) in enumerate(self._keys):
            left, row = MARGIN + n // rows * width, top + n % rows * LABELS
            self._write(key, LABELS, INK, left, row, width * 2 // 5 - 4)
            self._write(meaning, LABELS, LABEL, left + width * 2 // 5, row, width * 3 // 5 - 4)

    def _wrapped(self, text: str, width: int) -> list[str]:
        """In rows that are no wider; what does not fit into `SAID_ROWS` is cut."""
        lines = [""]
        for word in drawable(text).split():
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
