"""Each page of docs/ that `make docs` writes says what the code says today."""

from pathlib import Path
from types import ModuleType

import pytest

from tests.support.docs import failsafes_page, report_page, topics_page
from tests.support.faults import page as faults

PAGES = {
    "failsafes": failsafes_page,
    "report": report_page,
    "topics": topics_page,
    "faults": faults,
}


@pytest.mark.parametrize(("name", "written"), PAGES.items(), ids=PAGES)
def test_the_page_is_up_to_date(name: str, written: ModuleType) -> None:
    page = Path(__file__).parents[2] / "docs" / f"{name}.md"
    assert page.read_text(encoding="utf-8") == written.page(), "make docs"
