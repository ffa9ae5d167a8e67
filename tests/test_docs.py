"""Code in the documentation is code that runs: every block that names a file is part of it."""

import re
import tomllib
from pathlib import Path

import msgspec
import pytest

from services.marine.mounting import Mounting

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
    "your-own-vehicle": ["examples/point_vehicle/driver.py"],
    "your-own-service": [
        "examples/depth_alarm/depth_alarm.py",
        "examples/depth_alarm/alarm_service.py",
    ],
    "library": [
        "examples/library/ramp_plot.py",
        "examples/library/pd_control.py",
        "examples/library/link_monte_carlo.py",
    ],
}


def text(page: str) -> str:
    return (DOCS / f"{page}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("file", "block"), NAMED)
def test_a_block_that_names_a_file_is_part_of_it(file: str, block: str) -> None:
    assert block in (ROOT / file).read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("page", "file"), [(page, file) for page, files in WHOLE.items() for file in files]
)
def test_a_program_is_shown_whole(page: str, file: str) -> None:
    whole = (ROOT / file).read_text(encoding="utf-8")
    assert f"```python {file}\n{whole}```" in text(page)


def test_the_mounting_that_is_shown_is_one() -> None:
    (block,) = re.findall(r"```toml\n(.*?)```", text("your-own-vehicle"), flags=re.DOTALL)
    mounting = msgspec.convert(tomllib.loads(block)["vehicle"]["mounting"], Mounting)
    assert mounting.imu.position == (0.12, 0.0, -0.03)
    assert [row[0] for row in mounting.imu.rotation] == [0.0, -1.0, 0.0]  # x points to port


@pytest.mark.parametrize("page", [ROOT / "README.md", *PAGES], ids=lambda page: page.stem)
def test_a_link_leads_to_a_file(page: Path) -> None:
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", page.read_text(encoding="utf-8"))
    assert [link for link in links if not (page.parent / link).exists()] == []
