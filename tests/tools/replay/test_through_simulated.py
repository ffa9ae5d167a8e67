"""A dive of `lindy simulate`: today's code on its recorded inputs publishes the same bytes."""

from pathlib import Path

import pytest

from services.runtime.config.errors import LindyError
from services.runtime.hosts.registry import Registry
from tools.replay.differences import in_words
from tools.replay.source import ReplaySource, open_source
from tools.replay.through import CANNOT, POSSIBLE, through

SECONDS = 8.0


def first_of(source: ReplaySource) -> tuple[int, int]:
    """[ns] Begin and end of what is compared: power-on, arming and all axes."""
    begin, _ = source.span
    return begin, begin + round(SECONDS * 1e9)


@pytest.fixture(scope="module")
def good(whole_dive: Path) -> ReplaySource:
    return open_source(whole_dive)


@pytest.fixture(scope="module")
def bad(severe_dive: Path) -> ReplaySource:
    return open_source(severe_dive)


@pytest.mark.parametrize("name", POSSIBLE)
def test_the_same_input_is_the_same_output(good: ReplaySource, name: str) -> None:
    found = through(good, [name], span=first_of(good))
    assert [in_words(one, found.begin_ns) for one in found.differences] == []
    assert sum(found.compared.values()) > SECONDS * 5
    assert f"health/{name}" in found.compared


@pytest.mark.parametrize("name", ["estimation", "reference", "control"])
def test_on_board_a_bad_link_changes_nothing(bad: ReplaySource, name: str) -> None:
    found = through(bad, [name], span=first_of(bad))
    assert [in_words(one, found.begin_ns) for one in found.differences] == []


def test_only_a_window_is_compared(good: ReplaySource) -> None:
    first, _ = good.span
    found = through(good, ["control"], span=(first + 5 * 10**9, first + 6 * 10**9))
    assert found.differences == []
    assert 100 <= found.compared["control/wrench"] <= 102


def test_of_a_part_of_a_recording_it_is_said_what_differences_may_come_from(
    good: ReplaySource, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert through(good, ["reference"], span=first_of(good)).remarks == []
    monkeypatch.setattr(ReplaySource, "cut", True)
    (said,) = through(good, ["reference"], span=first_of(good)).remarks
    assert said.startswith("it is a part of a recording")


@pytest.mark.parametrize("name", [n for n in Registry.read() if n not in POSSIBLE])
def test_who_cannot_is_told_why(good: ReplaySource, name: str) -> None:
    if name in good.processes:
        with pytest.raises(LindyError, match="cannot, because"):
            through(good, [name])
    assert name in CANNOT
