"""The files of one dive: `dive.mcap`, and `dive.part2.mcap` … where recording was interrupted,
because the recorder was restarted or the disk failed for a while."""

import re
from pathlib import Path

FIRST = "dive.mcap"
LATER = re.compile(r"dive\.part(\d+)\.mcap")


def part_path(folder: Path, number: int) -> Path:
    """Path of part 1, 2, …"""
    return folder / (FIRST if number == 1 else f"dive.part{number}.mcap")


def free_part(folder: Path, number: int) -> int:
    """The first number from this one whose file is not there yet."""
    while part_path(folder, number).exists():
        number += 1
    return number


def parts_in(folder: Path) -> list[Path]:
    """The existing parts, in the order they were recorded; none where the folder is gone."""
    first = folder / FIRST
    names = folder.iterdir() if folder.is_dir() else ()
    later = {int(m[1]): path for path in names if (m := LATER.fullmatch(path.name))}
    return [*([first] if first.is_file() else []), *(later[number] for number in sorted(later))]
