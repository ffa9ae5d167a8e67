"""Subtitles of a film in the SubRip format (.srt): what the pilot saw beside the picture."""

from dataclasses import dataclass, field

STEP_NS = 500_000_000  # [ns] between two lines at most
LAST_NS = 500_000_000  # [ns] that the last one is shown


@dataclass(slots=True)
class Subtitles:
    """Lines with their times since the film began; equal ones that follow each other are one."""

    _lines: list[tuple[int, str]] = field(default_factory=list[tuple[int, str]])
    _due: int = 0  # [ns]
    _end: int = 0  # [ns]

    def add(self, at_ns: int, line: str) -> None:
        """A picture's line, [ns] since the film began."""
        self._end = at_ns
        if at_ns < self._due:
            return
        self._due = at_ns + STEP_NS
        if not self._lines or line != self._lines[-1][1]:
            self._lines.append((at_ns, line))

    def text(self) -> str:
        """The file."""
        ends = [at for at, _ in self._lines[1:]] + [self._end + LAST_NS]
        return "\n".join(
            f"{number}\n{_time(begin)} --> {_time(end)}\n{line}\n"
            for number, ((begin, line), end) in enumerate(zip(self._lines, ends, strict=True), 1)
        )


def _time(ns: int) -> str:
    seconds, ms = divmod(round(ns / 1e6), 1000)
    minutes, s = divmod(seconds, 60)
    hours, m = divmod(minutes, 60)
    return f"{hours:02d}:{m:02d}:{s:02d},{ms:03d}"
