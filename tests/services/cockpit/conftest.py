"""A browser for all tests of the page, and a page whose drone is in the state that a test says."""

from collections.abc import Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

from tests.support.docs.chromium import Browser, chromium

if TYPE_CHECKING:
    from tests.support.page_screen import Served


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    program = chromium()
    if program is None:
        pytest.skip("no Chromium on the path (.ci/run installs it)")
    with Browser(program) as opened:
        yield opened


@pytest.fixture(autouse=True)
def no_page_left(request: pytest.FixtureRequest) -> Iterator[None]:
    """A page that a failed test leaves open would draw on, and hold up all later ones."""
    if "browser" not in request.fixturenames:
        yield
        return
    browser: Browser = request.getfixturevalue("browser")
    before = list(browser.pages)
    yield
    for page in [page for page in browser.pages if page not in before]:
        page.close()


@pytest.fixture
def exits() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


@pytest.fixture
def served(exits: ExitStack) -> "Served":
    from tests.support.page_screen import Served

    return Served(exits)
