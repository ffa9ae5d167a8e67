"""Requests: repeated with the same id until answered, then never again."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.pilot import Course, PilotAnswer, RequestKind
from services.gamepad.requests import GIVE_UP_NS, REPEAT_NS, Requests

TICK = 20_000_000  # [ns]


def test_an_unanswered_request_is_repeated_every_200_ms_with_its_id_and_a_new_stamp():
    requests = Requests("gamepad")
    first = requests.ask("stop", 0)
    sent = [r for now in range(TICK, 1_000_000_001, TICK) for r in requests.repeats(now)]
    assert [r.stamp_ns for r in sent] == [n * REPEAT_NS for n in range(1, 6)]
    assert {(r.id, r.kind) for r in sent} == {(first.id, "stop")}


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 240))
def test_an_answer_ends_the_repetition_and_a_second_answer_means_nothing(ticks: int):
    requests = Requests("gamepad")
    asked = requests.ask("arm", 0)
    for n in range(1, ticks):
        requests.repeats(n * TICK)
    answer = PilotAnswer(stamp_ns=ticks * TICK, id=asked.id, accepted=True)
    assert requests.answered(answer) == asked
    assert requests.answered(answer) is None
    assert not requests.waits_for("arm")
    assert requests.repeats(10**12) == requests.given_up(10**12) == []


def test_another_pilots_answer_changes_nothing():
    requests = Requests("gamepad")
    requests.ask("arm", 0)
    stranger = PilotAnswer(stamp_ns=1, id="console-0-0", accepted=True)
    assert requests.answered(stranger) is None
    assert requests.waits_for("arm")


def test_after_five_seconds_a_request_is_given_up_once():
    requests = Requests("gamepad")
    asked = requests.ask("light", 7, 1.0)
    assert requests.given_up(7 + GIVE_UP_NS - 1) == []
    assert requests.given_up(7 + GIVE_UP_NS) == [asked]
    assert requests.given_up(8 + GIVE_UP_NS) == requests.repeats(8 + GIVE_UP_NS) == []


@pytest.mark.parametrize("kind", ["stop", "disarm"])
def test_a_stop_or_a_disarm_withdraws_an_arm_that_is_still_being_repeated(kind: str):
    requests = Requests("gamepad")
    requests.ask("light", 0, 1.0)
    requests.ask("arm", 0)
    requests.ask(kind, 1)  # type: ignore[arg-type]
    assert [r.kind for r in requests.repeats(1 + REPEAT_NS)] == ["light", kind]


@pytest.mark.parametrize("later", ["stop", "disarm", "goto", "follow"])
@pytest.mark.parametrize("earlier", ["goto", "follow"])
def test_where_to_go_is_not_repeated_after_a_newer_word(earlier: RequestKind, later: RequestKind):
    requests = Requests("gamepad")
    requests.ask("stop", 0)
    requests.ask(earlier, 1, depth=3.0)
    newer = requests.ask(later, 2)
    assert [r.id for r in requests.repeats(2 + REPEAT_NS)][1:] == [newer.id]


@pytest.mark.parametrize("later", ["arm", "light"])
def test_a_light_or_an_arm_overrules_nothing(later: RequestKind):
    requests = Requests("gamepad")
    kinds: list[RequestKind] = ["stop", "goto", later]
    for now, kind in enumerate(kinds):
        requests.ask(kind, now)
    assert [r.kind for r in requests.repeats(2 + REPEAT_NS)] == kinds


def test_a_repetition_says_all_that_was_asked():
    requests = Requests("gamepad")
    course = Course(waypoints=((0.0, 0.0), (9.0, 0.0)))
    asked = [
        requests.ask("light", 0, 0.5),
        requests.ask("follow", 0, course=course),
    ]
    again = requests.repeats(REPEAT_NS)
    assert [(r.id, r.value, r.course) for r in again] == [
        (asked[0].id, 0.5, None),
        (asked[1].id, None, course),
    ]
    asked = requests.ask("goto", REPEAT_NS, depth=3.0, heading=-1.0)
    again = requests.repeats(2 * REPEAT_NS)[-1]
    assert (again.id, again.depth, again.heading) == (asked.id, 3.0, -1.0)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(0, 5), max_size=20), st.integers(0, 10**12))
def test_no_two_requests_share_an_id_within_a_run_or_across_a_restart(
    waits: list[int], restart_after: int
):
    now, ids = 0, list[str]()
    for run in range(2):
        requests = Requests("gamepad")
        for wait in waits:
            now += wait
            ids.append(requests.ask("light", now, 0.0).id)
        now += run + 1 + restart_after
    assert len(set(ids)) == len(ids)
