"""What is drawn on a terminal that changes its size."""

from io import StringIO

from rich.console import Console
from rich.text import Text

from tools.live.display import drawn_anew

CLEARED = "\x1b[2J\x1b[H"


def test_a_terminal_of_another_size_is_cleared_once_before_it_is_drawn_on() -> None:
    console = Console(file=StringIO(), force_terminal=True, width=80, height=24)
    file = console.file
    assert isinstance(file, StringIO)
    with drawn_anew(console) as draw:

        def drawn(width: int, height: int) -> str:
            console.size = (width, height)
            begin = len(file.getvalue())
            draw(lambda size: Text(f"{size.width} x {size.height}"))
            return file.getvalue()[begin:]

        for width, height, cleared in (
            (80, 24, 0),
            (80, 24, 0),
            (200, 50, 1),
            (200, 50, 0),
            (80, 50, 1),
        ):
            said = drawn(width, height)
            assert f"{width} x {height}" in said
            assert said.count(CLEARED) == cleared
            assert said.rindex(f"{width} x {height}") > said.rfind(CLEARED)
