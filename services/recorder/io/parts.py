"""The files of one dive: `dive.mcap`, and `dive.part2.mcap` … when recording had to begin anew,
because the recorder was restarted or the disk failed for a while."""

import re
from pathlib import Path

FIRST = "dive.mcap"
LATER = re.compile(r"dive\.part(\d+)\.mcap")


def part_path(folder: Path, number: int) -> Path:
    """Path of part 1, 2, …"""
    return folder / (FIRST if number == 1 else f"dive.part{number}.mcap")


def parts_in(folder: Path) -> list[Path]:
    """The parts there are, in the order they were recorded."""
    first = folder / FIRST
    later = {int(m[1]): path for path in folder.iterdir() if (m := LATER.fullmatch(path.name))}
    return [*([first] if first.is_file() else []), *(later[number] for number in sorted(later))]


def remove_later_parts(folder: Path) -> None:
    """Remove what an earlier dive left besides its `dive.mcap`."""
    for path in parts_in(folder):
        if path.name != FIRST:
            path.unlink()
