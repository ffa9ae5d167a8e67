"""What the health of the services says: who is late, and whether the board is silent."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.health import LATE_MS
from messages.pilot import PilotRequest
from services.reference.failsafe.watch import HEALTH_PATIENCE_NS, RECENT_NS, ConditionWatch
from services.reference.guidance.requests import refusal
from services.reference.settings import FailsafeSettings
from tests.support.said import health, sticks

S = 1_000_000_000  # [ns]
WATCHED = {
    "ardusub": "motion",
    "my_driver": "motion",
    "control": "motion",
    "recorder": "recorder",
    "link_monitor": "clock",
    "supervisor_drone": "keeper",
}


def late(watch: ConditionWatch, now: int) -> bool:
    conditions = watch.holding(None, None, (), now, armed=False, limited=False, above_floor=False)
    return "service_late" in conditions


@given(st.lists(st.sampled_from([None, 0.0, LATE_MS, LATE_MS + 1.0, 500.0]), max_size=30))
def test_a_late_service_is_said_for_ten_seconds_but_not_for_its_first_report(
    reports: list[float | None],
) -> None:
    watch = ConditionWatch(FailsafeSettings(), WATCHED)
    for second, late_ms in enumerate(reports):
        watch.health(health("control", late_ms), second * S)
        were = [
            ms is not None and ms > LATE_MS and k > 0 and (second - k) * S < RECENT_NS
            for k, ms in enumerate(reports[: second + 1])
        ]
        assert late(watch, second * S) == any(were)


@pytest.mark.parametrize("service", [*WATCHED, "gamepad", "visualizer"])
def test_only_services_that_the_motion_depends_on_are_said_to_be_late(service: str) -> None:
    watch = ConditionWatch(FailsafeSettings(), WATCHED)
    for second in range(3):
        watch.health(health(service, 500.0), second * S)
    assert late(watch, 2 * S) == (WATCHED.get(service) == "motion")


@given(st.sampled_from([*WATCHED, "gamepad", "visualizer"]), st.integers(0, 6 * S))
def test_a_service_that_falls_silent_is_said_by_its_role(service: str, silence_ns: int) -> None:
    watch = ConditionWatch(FailsafeSettings(), WATCHED)
    watch.health(health(service, 0.0), 0)
    found = watch.holding(None, None, (), silence_ns, armed=True, limited=False, above_floor=False)
    long, role = silence_ns > HEALTH_PATIENCE_NS, WATCHED.get(service)
    assert ("service_silent" in found) == (long and role in ("motion", "keeper"))
    assert ("recorder_down" in found) == (long and role == "recorder")
    if "service_silent" in found:
        assert found["service_silent"].detail == service


def test_a_silent_board_is_said_while_its_silence_is_counted() -> None:
    watch = ConditionWatch(FailsafeSettings(), WATCHED)
    counts = [0, 0, 1, 2, 3, 3, 3, 3]
    said: list[bool] = []
    for second, count in enumerate(counts):
        watch.health(health("ardusub", **{"silent:board": count}), second * S)
        holding = watch.holding(
            None, None, (), second * S, armed=False, limited=False, above_floor=False
        )
        said.append("board_silent" in holding)
    assert said == [False, False, True, True, True, True, True, False]


@pytest.mark.parametrize("armed", [False, True])
def test_arming_is_refused_while_the_board_does_not_answer(armed: bool) -> None:
    arm = PilotRequest(stamp_ns=0, id="1", kind="arm")
    for board, words in ((True, ""), (False, "the vehicle's board does not answer")):
        found = refusal(
            arm, sticks(), armed=armed, ready=True, stopping=False, acting=False, board=board
        )
        assert found == words
