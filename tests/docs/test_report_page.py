"""The page about report.json says what the report has."""

import re
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import fields

from tests.support.docs.report_page import page, parts
from tools.report.report import Report

PAGE = Path(__file__).parents[2] / "docs" / "report.md"


def test_the_page_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "make docs"


@given(st.sampled_from(sorted(parts(Report), key=lambda kind: kind.__name__)))
def test_every_key_of_every_part_is_on_it(kind: Any) -> None:
    text = PAGE.read_text(encoding="utf-8")
    (body,) = re.findall(rf"^## {kind.__name__}\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    assert {field.name for field in fields(kind)} == set(
        re.findall(r"^- `(\w+)`", body, re.MULTILINE)
    )
