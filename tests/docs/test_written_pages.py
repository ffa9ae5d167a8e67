"""Each page of docs/ that `make docs` writes says what the code says today."""

import pytest

from tests.support.docs.written import FOLDER, PAGES


@pytest.mark.parametrize("name", PAGES)
def test_the_page_is_up_to_date(name: str) -> None:
    written = (FOLDER / f"{name}.md").read_text(encoding="utf-8")
    assert written == PAGES[name](), "make docs"
