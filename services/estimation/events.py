"""Events: names to count and texts to log."""

from typing import Literal

Level = Literal["info", "warning"]


class Events:
    """The reader empties both lists."""

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
