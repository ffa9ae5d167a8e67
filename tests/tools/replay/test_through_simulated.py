"""A dive of `lindy simulate`: today's code on its recorded inputs publishes the same bytes."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from services.runtime.config.errors import LindyError
from services.runtime.hosts.registry import Registry
from tools.recordings.recording import Raw, always
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


def test_what_came_before_the_recording_is_counted_by_input(
    good: ReplaySource, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As if the recorder had been started after the pilot's first request and ten samples."""
    whole = [raw for raw in good.raw() if not raw.key.startswith("control/")]
    late = {"pilot/request": 1, "sensor/imu": 10, "state": 3, "health/estimation": 2}
    left = [raw for raw in whole if raw.sequence >= late.get(raw.key, 0)]

    def recorded_late(
        _: ReplaySource, wants: Callable[[str], bool] = always, until_ns: float = math.inf
    ) -> Iterator[Raw]:
        return (raw for raw in left if wants(raw.key) and raw.log_ns <= until_ns)

    monkeypatch.setattr(ReplaySource, "raw", recorded_late)
    assert through(good, ["reference"]).remarks == []  # what it lacks was lost on the link
    monkeypatch.setattr(ReplaySource, "cut", True)
    assert through(good, ["reference"]).remarks == [
        "the recording begins after some messages: 1 of pilot/request, 3 of state; differences may "
        "come from that"
    ]
    assert through(good, ["estimation"]).remarks == [
        "the recording begins after some messages: 10 of sensor/imu; differences may come from that"
    ]


@pytest.mark.parametrize("name", [n for n in Registry.read() if n not in POSSIBLE])
def test_who_cannot_is_told_why(good: ReplaySource, name: str) -> None:
    if name in good.processes:
        with pytest.raises(LindyError, match="cannot, because"):
            through(good, [name])
    assert name in CANNOT
