"""The same screen in Firefox. Skipped where there is none."""

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

pytest.importorskip("websockets", reason="the extra cockpit is not installed")

from tests.support.docs.chromium import Size
from tests.support.firefox import Firefox, firefox
from tests.support.page_screen import ACTING, CONTRAST, SHARE, STATES, UNPRESSED, Served
from tests.support.patience import until

PROGRAM = firefox()
pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(PROGRAM is None, reason="no Firefox on the path"),
]
KEY = "void dispatchEvent(new KeyboardEvent('{}', {{ code: '{}', bubbles: true }}))"


@pytest.fixture
def served() -> Iterator[Served]:
    with ExitStack() as exits:
        yield Served(exits)


@pytest.mark.slow
def test_the_picture_fills_the_screen_and_everything_is_read_and_pressed(served: Served):
    assert PROGRAM is not None
    with Firefox(PROGRAM) as browser:
        for size in (Size(1280, 720), Size(844, 390)):
            page = served.open(browser, size)
            for name, state in STATES.items():
                served.becomes(page, **state)
                assert page.look(UNPRESSED) == "", name
                assert page.look(SHARE) >= 0.9
                assert page.look(CONTRAST)[0] >= 4.5, name
        served.becomes(page, **ACTING)
        page.look(KEY.format("keydown", "Enter"))
        until(lambda: "resume" in [wish.what for wish in served.wishes])
        page.look(KEY.format("keyup", "Enter"))
        page.look(KEY.format("keydown", "Space"))
        until(lambda: "stop" in [wish.what for wish in served.wishes])
