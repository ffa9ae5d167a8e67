"""The help of a verb: sentences as wide as the terminal, whatever the width of the source."""

import re
from typing import Any

from cyclopts.help import DefaultFormatter, InlineText
from rich.text import Text

KEPT = re.compile(r"^(Example:| |- )", re.MULTILINE)  # what stands in lines of its own


class FlowingHelp(DefaultFormatter):
    """As usual, but for the paragraphs of the description."""

    def render_description(self, console: Any, options: Any, description: Any) -> None:
        if isinstance(description, InlineText) and isinstance(description.primary_renderable, Text):
            text = Text(flowing(description.primary_renderable.plain))
            description = InlineText(text, force_empty_end=True)
        super().render_description(console, options, description)


def flowing(text: str) -> str:
    """Each paragraph in one line, but for examples and lists."""
    paragraphs = text.split("\n\n")
    return "\n\n".join(p if KEPT.search(p) else " ".join(p.split("\n")) for p in paragraphs)
