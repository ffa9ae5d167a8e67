"""A film runs once the recorder has said that it has it, and no wish is carried out late."""

from hypothesis import given
from hypothesis import strategies as st

from messages.video import FilmAnswer, FilmRequest
from services.cockpit.cameras import Filming
from services.cockpit.page_messages import PageWish

S = 1_000_000_000
FILM, SNAPSHOT = (PageWish(seen=0, held_ms=0.0, what=what) for what in ("film", "snapshot"))


def answer(request: FilmRequest, *, accepted: bool) -> FilmAnswer:
    return FilmAnswer(stamp_ns=0, id=request.id, accepted=accepted)


@given(st.lists(st.sampled_from(["film", "snapshot", "yes", "no", "lost"]), max_size=60))
def test_begin_and_end_take_turns_whatever_is_answered(steps: list[str]) -> None:
    filming, now, waiting = Filming("me", light_ns=5), 0, None
    running = False
    for step in steps:
        now += S
        if step in ("film", "snapshot"):
            request = filming.wish(FILM if step == "film" else SNAPSHOT)
            if step == "snapshot":
                assert isinstance(request, FilmRequest)
                assert request.kind == "snapshot"
            elif waiting is not None:
                assert isinstance(request, str)
            else:
                assert isinstance(request, FilmRequest)
                assert request.kind == ("end" if running else "begin")
                assert request.light_ns == 5
                waiting = request
        elif waiting is not None:
            if step == "lost":
                filming.given_up(waiting)
            else:
                filming.answered(waiting, answer(waiting, accepted=step == "yes"), now)
                running = waiting.kind == "begin" and step == "yes"
            waiting = None
        assert (filming.seconds(now) is not None) == running


def test_a_snapshot_counts_once_it_is_recorded() -> None:
    filming = Filming("me", light_ns=5)
    request = filming.wish(SNAPSHOT)
    assert isinstance(request, FilmRequest)
    filming.answered(request, answer(request, accepted=False), 0)
    assert filming.snapshots == 0
    filming.answered(request, answer(request, accepted=True), 0)
    assert filming.snapshots == 1


def test_a_wish_without_a_picture_says_why() -> None:
    assert Filming("me").wish(FILM) == "there is no picture"


def test_a_film_goes_on_in_the_next_process_of_the_service() -> None:
    first = Filming("me", light_ns=5)
    request = first.wish(FILM)
    assert isinstance(request, FilmRequest)
    first.answered(request, answer(request, accepted=True), S)
    after = Filming("me", first.since_ns, light_ns=5)
    assert after.seconds(4 * S) == 3.0
    ends = after.wish(FILM)
    assert isinstance(ends, FilmRequest)
    assert ends.kind == "end"
