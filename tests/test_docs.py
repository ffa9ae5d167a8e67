"""Code in the documentation is code that runs: every block that names a file is part of it."""

import re
import tomllib
from pathlib import Path

import msgspec
import pytest

from services.marine.mounting import Mounting

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "your-own-vehicle.md").read_text(encoding="utf-8")
NAMED = re.findall(r"```\w+ (\S+)\n(.*?)```", PAGE, flags=re.DOTALL)
DRIVER = "examples/point_vehicle/driver.py"


@pytest.mark.parametrize(("file", "block"), NAMED)
def test_a_block_that_names_a_file_is_part_of_it(file: str, block: str) -> None:
    assert block in (ROOT / file).read_text(encoding="utf-8")


def test_the_driver_is_shown_whole() -> None:
    assert (DRIVER, (ROOT / DRIVER).read_text(encoding="utf-8")) in NAMED


def test_the_mounting_that_is_shown_is_one() -> None:
    (block,) = re.findall(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL)
    mounting = msgspec.convert(tomllib.loads(block)["vehicle"]["mounting"], Mounting)
    assert mounting.imu.position == (0.12, 0.0, -0.03)
    assert [row[0] for row in mounting.imu.rotation] == [0.0, -1.0, 0.0]  # x points to port
