"""A link that gets worse is told within a second; a steady one is left in peace."""

from collections.abc import Sequence
from random import Random

from hypothesis import given, settings
from hypothesis import strategies as st

from services.link_monitor.core import LinkAlarm

MS, SECOND = 1_000_000, 1_000_000_000
PING = SECOND // 5


def sound(rtts_ms: Sequence[float | None]) -> list[tuple[int, str]]:
    """The alarm's text every 50 ms, for pings that take this long (None: never come back)."""
    alarm, texts = LinkAlarm(), list[tuple[int, str]]()
    back = sorted(
        (k * PING + round(rtt * MS), rtt) for k, rtt in enumerate(rtts_ms) if rtt is not None
    )
    for now in range(0, len(rtts_ms) * PING, 50 * MS):
        while back and back[0][0] <= now:
            alarm.answered(back.pop(0)[1])
        if now % PING == 0:
            alarm.sent(now)
        texts.append((now, alarm.text(now)))
    return texts


@given(rtt=st.floats(0.1, 400.0), jitter=st.floats(0.0, 40.0), random=st.randoms())
@settings(max_examples=50, deadline=None)
def test_a_link_as_it_always_is_raises_no_alarm(rtt: float, jitter: float, random: Random) -> None:
    pings: list[float | None] = [rtt + jitter * random.random() for _ in range(60)]
    assert {text for now, text in sound(pings) if now > rtt * MS + PING} == {""}


@given(before=st.floats(0.1, 100.0), rise=st.floats(2.0, 50.0))
@settings(max_examples=50, deadline=None)
def test_a_rise_is_told_within_a_second_beyond_the_new_delay(before: float, rise: float) -> None:
    after = before * rise + 60.0
    texts = sound([before] * 50 + [after] * 50)
    limit = 50 * PING + SECOND
    assert all(text == "" for now, text in texts if now < 50 * PING)
    told = next(now for now, text in texts if text)
    assert told <= limit


def test_silence_is_told_and_its_end_too() -> None:
    texts = sound([20.0] * 20 + [None] * 20 + [20.0] * 20)
    told = [now for now, text in texts if text]
    assert 20 * PING + 500 * MS <= told[0] <= 20 * PING + SECOND
    assert told[-1] <= 40 * PING + 100 * MS


def test_before_the_first_answer_nothing_is_known_and_that_is_said() -> None:
    assert sound([None] * 20)[-1][1] == "no answer from the drone yet"
