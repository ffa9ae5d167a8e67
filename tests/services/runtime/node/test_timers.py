"""Timers: a tick drifts nowhere and loses nothing uncounted, an alarm rings once."""

from hypothesis import given
from hypothesis import strategies as st

from services.runtime.node.ports import MISSABLE, Alarm, Tick

HZ = st.sampled_from([0.5, 1.0, 3.0, 42.0, 50.0, 100.0, 999.0])
STARTS = st.integers(0, 10**15)  # [ns]
LATE = st.floats(0.0, 40.0)  # [periods] after its time that a tick is looked at


def period(hz: float) -> int:
    return round(1e9 / hz)


@given(HZ, STARTS, st.lists(LATE, min_size=1, max_size=50))
def test_a_tick_stays_on_its_grid_and_accounts_for_every_period(
    hz: float, start: int, lateness: list[float]
) -> None:
    rung, skipped = list[int](), 0
    tick = Tick(hz, start, rung.append)
    now = start
    for late in lateness:
        assert tick.due is not None
        now = max(now, tick.due + round(late * period(hz)))
        skipped += tick.ring(now)
        assert tick.due is not None
        assert (tick.due - start) % period(hz) == 0
    assert rung == sorted(rung)
    passed = (tick.due or 0) - start
    assert passed // period(hz) == 1 + len(rung) + skipped


@given(HZ, STARTS, st.integers(0, 10**10))
def test_a_slow_start_is_no_missed_tick(hz: float, made: int, took: int) -> None:
    tick = Tick(hz, made, lambda _: None)
    tick.start(made + took)
    due = made + took + period(hz)
    assert tick.due == due
    assert not tick.ring(due)


@given(HZ, STARTS, st.integers(1, MISSABLE))
def test_a_short_delay_is_caught_up_with_tick_by_tick(hz: float, start: int, behind: int) -> None:
    rung = list[int]()
    tick = Tick(hz, start, rung.append)
    now = start + (1 + behind) * period(hz)
    while tick.due is not None and tick.due <= now:
        assert not tick.ring(now)
    assert rung == [now] * (1 + behind)


@given(HZ, STARTS, st.integers(MISSABLE + 1, 10**6))
def test_after_a_long_stall_one_tick_rings_and_the_others_are_counted(
    hz: float, start: int, missed: int
) -> None:
    rung = list[int]()
    tick = Tick(hz, start, rung.append)
    now = start + (1 + missed) * period(hz)
    assert tick.ring(now) == missed
    assert rung == [now]
    assert tick.due == now + period(hz)


@given(st.lists(st.one_of(st.none(), st.integers(0, 100)), max_size=20), st.integers(0, 100))
def test_an_alarm_rings_once_at_the_last_time_it_was_set_to(
    times: list[int | None], now: int
) -> None:
    rung = list[int]()
    alarm = Alarm(rung.append)
    for at in times:
        alarm.set(at)
    assert alarm.due == (times[-1] if times else None)
    if alarm.due is not None:
        assert alarm.ring(now) == 0
        assert (rung, alarm.due) == ([now], None)


def test_an_alarm_may_be_set_again_by_its_own_handler() -> None:
    rung = list[int]()

    def ring(now: int) -> None:
        rung.append(now)
        alarm.set(now + 5)

    alarm = Alarm(ring)
    alarm.set(1)
    alarm.ring(2)
    assert (rung, alarm.due) == ([2], 7)
