"""What happened: by name for the counters, and in words for people."""

from typing import Literal

Level = Literal["info", "warning"]


class Events:
    """Whoever reads it empties it."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.lines: list[tuple[Level, str]] = []

    def note(self, what: str | None) -> None:
        if what is not None:
            self.names.append(what)

    def say(self, text: str) -> None:
        self.lines.append(("info", text))

    def warn(self, text: str) -> None:
        self.lines.append(("warning", text))
