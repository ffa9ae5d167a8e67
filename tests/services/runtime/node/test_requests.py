"""Requests: repeated with the same id until answered, then never again; decided once."""

from collections.abc import Iterator
from itertools import count

from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from messages import topics
from messages.pilot import Course, PilotAnswer, PilotRequest, RequestKind
from services.piloting.pilot_intents import overrules
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.requests import KEPT, REPEAT_NS, AnswerBook, Requests

TICK = 20_000_000  # [ns]
S = 1_000_000_000  # [ns]


def request(kind: RequestKind, id_: str = "") -> PilotRequest:
    return PilotRequest(stamp_ns=0, id=id_, kind=kind)


def gamepad() -> Requests[PilotRequest]:
    return Requests("gamepad", overrules)


def test_an_unanswered_request_is_repeated_whole_every_200_ms_with_its_id_and_a_new_stamp():
    requests, course = gamepad(), Course(waypoints=((0.0, 0.0), (9.0, 0.0)))
    follow = PilotRequest(stamp_ns=0, id="", kind="follow", course=course, epoch=3)
    first = requests.ask(follow, 0)
    sent = [r for now in range(TICK, 1_000_000_001, TICK) for r in requests.repeats(now)]
    assert sent == [replace(first, stamp_ns=n * 200_000_000) for n in range(1, 6)]
    assert replace(first, id="") == follow


@given(st.integers(1, 240))
def test_an_answer_ends_the_repetition_and_a_second_answer_means_nothing(ticks: int):
    requests = gamepad()
    asked = requests.ask(request("arm"), 0)
    for n in range(1, ticks):
        requests.repeats(n * TICK)
    answer = PilotAnswer(stamp_ns=ticks * TICK, id=asked.id, accepted=True)
    assert requests.answered(answer) == asked
    assert requests.answered(answer) is None
    assert requests.pending == []
    assert requests.due() is None
    assert requests.repeats(10**12) == requests.given_up(10**12) == []


def test_a_newer_request_withdraws_what_it_overrules_and_nothing_else():
    requests = gamepad()
    kinds: list[RequestKind] = ["light", "arm", "goto", "stop"]
    for now, kind in enumerate(kinds):
        requests.ask(request(kind), now)
    assert [r.kind for r in requests.repeats(4 + REPEAT_NS)] == ["light", "stop"]
    requests.ask(request("arm"), 5)
    assert [p.request.kind for p in requests.pending] == ["light", "stop", "arm"]


@given(st.lists(st.integers(0, 5), max_size=20), st.integers(0, 10**12))
def test_no_two_requests_share_an_id_even_after_a_restart(waits: list[int], restart_after: int):
    now, ids = 0, list[str]()
    for run in range(2):
        requests = gamepad()
        for wait in waits:
            now += wait
            ids.append(requests.ask(request("light"), now).id)
        now += run + 1 + restart_after
    assert len(set(ids)) == len(ids)


# The answering end.


def counting_book(counter: Iterator[int]) -> AnswerBook[PilotRequest, PilotAnswer]:
    """The n-th decision is told in the reason."""

    def decide(asked: PilotRequest, now: int) -> PilotAnswer:
        return PilotAnswer(stamp_ns=now, id=asked.id, accepted=False, reason=str(next(counter)))

    return AnswerBook(decide)


@given(st.lists(st.integers(0, KEPT - 1), max_size=200))
def test_each_id_is_decided_once_and_answered_every_time_with_a_new_stamp(asked: list[int]):
    book, first = counting_book(count()), dict[int, str]()
    for now, number in enumerate(asked):
        answer, is_new = book.answer(request("stop", str(number)), now)
        assert is_new == (number not in first)
        assert answer.reason == first.setdefault(number, answer.reason)
        assert (answer.id, answer.stamp_ns) == (str(number), now)
    assert sorted(map(int, first.values())) == list(range(len(first)))


def test_only_the_newest_answers_are_kept():
    book = counting_book(count())
    for number in range(KEPT + 1):
        book.answer(request("stop", str(number)), 0)
    assert book.answer(request("stop", "1"), 0)[1] is False
    assert book.answer(request("stop", "0"), 0)[1] is True


# Both ends on a bus that loses messages.


@given(st.integers(0, 30), st.integers(0, 30))
def test_what_is_asked_is_done_at_most_once_whatever_is_lost(lost_asks: int, lost_answers: int):
    host, done, told = VirtualHost(), list[str](), list[str]()
    drone, pilot = host.node("drone", ["drone"]), host.node("pilot", ["topside"])
    left = {"asks": lost_asks, "answers": lost_answers}

    def decide(asked: PilotRequest, now: int) -> PilotAnswer:
        done.append(asked.id)
        return PilotAnswer(stamp_ns=now, id=asked.id, accepted=True)

    def carry(source: str, target: str, key: str, name: str) -> None:
        def hand_over(envelope: object) -> None:
            if left[name] > 0:
                left[name] -= 1
            else:
                host.side(target).forward(envelope)  # type: ignore[arg-type]

        host.side(source).hear(key, hand_over)

    carry("topside", "drone", topics.PILOT_REQUEST.key, "asks")
    carry("drone", "topside", topics.PILOT_ANSWER.key, "answers")
    drone.answers(topics.PILOT_REQUEST, topics.PILOT_ANSWER, decide)
    asking = pilot.request(
        topics.PILOT_REQUEST,
        topics.PILOT_ANSWER,
        on_answer=lambda asked, answer, _: told.append(f"{asked.kind} {answer.accepted}"),
        on_given_up=lambda asked, _: told.append(f"{asked.kind} given up"),
    )
    asking.ask(request("arm"), host.now)
    host.run(20 * S)
    assert len(done) == (1 if lost_asks < 25 else 0)
    assert told == ["arm True" if lost_asks + lost_answers < 25 else "arm given up"]
    assert asking.pending == []
