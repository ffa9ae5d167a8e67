"""Code in the documentation is code that runs: every block that names a file is part of it."""

import re
import sys
import textwrap
import tomllib
from functools import cache
from pathlib import Path
from types import FrameType

import msgspec
import pytest

from services.marine.mounting import Mounting
from services.marine.outputs import Output, checked
from tests.support.dive import Dive

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
NAMED = [
    pytest.param(*found, id=f"{page.stem}-{found[0]}-{number}")
    for page in PAGES
    for number, found in enumerate(
        re.findall(r"```\w+ (\S+)\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    )
]
WHOLE = {  # shown from the first line to the last
    "your-own-service": [
        "examples/depth_alarm/depth_alarm.py",
        "examples/depth_alarm/alarm_service.py",
    ],
}


def text(page: str) -> str:
    return (DOCS / f"{page}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("file", "block"), NAMED)
def test_a_block_that_names_a_file_is_part_of_it(file: str, block: str) -> None:
    whole = (ROOT / file).read_text(encoding="utf-8")
    assert block in whole or textwrap.indent(block, "    ") in whole  # of a function within one


@pytest.mark.parametrize(
    ("page", "file"), [(page, file) for page, files in WHOLE.items() for file in files]
)
def test_a_program_is_shown_whole(page: str, file: str) -> None:
    whole = (ROOT / file).read_text(encoding="utf-8")
    assert f"```python {file}\n{whole}```" in text(page)


def test_the_mounting_and_the_outputs_that_are_shown_are_some() -> None:
    blocks = re.findall(r"```toml\n(.*?)```", text("vehicle-file"), flags=re.DOTALL)
    mounted, fitted = (tomllib.loads(block)["vehicle"] for block in blocks)
    outputs = msgspec.convert(fitted["output"], tuple[Output, ...])
    checked(outputs, 8)
    assert [output.kind for output in outputs] == ["dimmer", "switch", "gripper"]
    mounting = msgspec.convert(mounted["mounting"], Mounting)
    assert mounting.imu.position == (0.12, 0.0, -0.03)
    assert [row[0] for row in mounting.imu.rotation] == [0.0, -1.0, 0.0]  # x points to port


def test_every_page_is_in_the_menu_once() -> None:
    """A page that is not there is reached by a link at best."""
    menu = re.findall(r"(\S+\.md)$", (ROOT / "mkdocs.yml").read_text("utf-8"), re.MULTILINE)
    assert sorted(menu) == [page.name for page in PAGES]


@pytest.mark.parametrize("page", [ROOT / "README.md", *PAGES], ids=lambda page: page.stem)
def test_a_link_leads_to_a_file(page: Path) -> None:
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", page.read_text(encoding="utf-8"))
    assert [link for link in links if not (page.parent / link).exists()] == []


# docs/architecture.md names files. They are there, and are called in the order it says.

WAYS = ("The way of a stick", "The way of a sample")
ONCE_S = 0.011  # [s] in which each is gone
NOT_IN_A_SCRIPT = {"services/gamepad/io/pad.py", "services/gamepad/core.py"}  # of a real pad


def files_of(section: str) -> list[str]:
    _, _, after = text("architecture").partition(f"## {section}\n")
    return re.findall(r"services/[\w/]+\.py", after.partition("\n## ")[0])


def test_every_file_and_folder_of_the_architecture_is_there() -> None:
    named = re.findall(r"`?((?:messages|services|deploy|tools|docs)/[\w/.]*)", text("architecture"))
    assert [path for path in named if not (ROOT / path).exists()] == []


def test_the_tree_shows_every_room() -> None:
    _, _, after = text("architecture").partition("messages/    ")
    tree = after.partition("```")[0]
    shown = re.findall(r"^ +(\w+)/ ", tree, flags=re.MULTILINE)
    rooms = [
        path.parent.name
        for package in ("services", "tools")
        for path in (ROOT / package).glob("**/__init__.py")
        if len(path.relative_to(ROOT / package).parts) in (2, 3) and path.parent.name != "io"
    ]
    assert sorted(shown) == sorted(rooms)


@cache
def called() -> list[str]:
    """The files of all functions that are called in `ONCE_S` while the sticks move, in order."""
    rows = [f"{k / 10},0.{k % 7},0.{k % 3},0.{k % 5},0.{k % 2}" for k in range(100)]
    dive = Dive("\n".join(rows), still_s=1.0, virtual=True)
    dive.run(8.0)
    files: list[str] = []

    def note(frame: FrameType, event: str, _: object) -> None:
        path = Path(frame.f_code.co_filename)
        if event == "call" and path.is_relative_to(ROOT):
            files.append(path.relative_to(ROOT).as_posix())

    sys.setprofile(note)
    try:
        dive.run(ONCE_S)
    finally:
        sys.setprofile(None)
    return files


@pytest.mark.parametrize("way", WAYS)
def test_files_of_a_way_are_called_in_its_order(way: str) -> None:
    steps = [file for file in files_of(way) if file not in NOT_IN_A_SCRIPT]
    rest = iter(called())
    assert len(steps) > 20
    assert [step for step in steps if step not in rest] == []
