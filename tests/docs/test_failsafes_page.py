"""The page about the failsafes says what the table says."""

from pathlib import Path

from services.reference.failsafe.table import table
from services.reference.settings import FailsafeSettings
from tests.support.docs.failsafes_page import page

PAGE = Path(__file__).parents[2] / "docs" / "failsafes.md"


def test_the_failsafes_page_is_up_to_date() -> None:
    """`make docs` writes it."""
    assert PAGE.read_text(encoding="utf-8") == page()


def test_every_row_and_every_stage_is_on_it() -> None:
    lines = page().splitlines()
    for row in table(FailsafeSettings()):
        (line,) = [line for line in lines if line.startswith(f"| `{row.name}` |")]
        assert row.condition.sentence in line
        assert row.condition.noticed.to_do in line
        assert all(stage.reaction in line for stage in row.stages)
