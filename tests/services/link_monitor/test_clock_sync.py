"""Whatever the link does to the pings, the true offset lies inside the stated bound."""

from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.events import Outbox
from messages.link import Clock, ClockPong
from services.link_monitor.core import DRIFT, ClockSync
from services.runtime.config.settings import DEPLOY
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import Skew, VirtualHost
from tests.support.told import told

SECOND = 1_000_000_000
delays = st.lists(
    st.tuples(st.integers(0, 2 * SECOND), st.integers(0, 2 * SECOND), st.integers(0, 10_000_000)),
    min_size=1,
    max_size=40,
)
offsets = st.integers(-(10**15), 10**15)
drifts = st.floats(-DRIFT, DRIFT)


def trip(
    t1: int, down: int, up: int, turn: int, offset: int, drift: float
) -> tuple[ClockPong, int]:
    """The pong of a ping sent at t1 and when it is back, both clocks as they are."""

    def drone(topside_ns: int) -> int:
        return topside_ns + offset + round(drift * topside_ns)

    heard, said = t1 + down, t1 + down + turn
    pong = ClockPong(stamp_ns=drone(said), ping_ns=t1, heard_ns=drone(heard))
    return pong, said + up


@settings(max_examples=200)
@given(delays=delays, offset=offsets, drift=drifts)
def test_the_true_offset_is_always_inside_the_bound(
    delays: list[tuple[int, int, int]], offset: int, drift: float
) -> None:
    """And round trips that are forgotten would have told nothing."""
    sync, bands, now = ClockSync(Outbox()), list[tuple[int, int, int]](), 0
    for k, (down, up, turn) in enumerate(delays):
        pong, back = trip(k * SECOND // 5, down, up, turn, offset, drift)
        now = max(now, back)
        sync.heard(pong, now)
        clock = sync.clock(now)
        assert clock.offset_ns is not None
        assert clock.bound_ns is not None
        assert abs(clock.offset_ns - offset - drift * now) <= clock.bound_ns + 2  # integer stamps
        bands.append((pong.ping_ns, pong.stamp_ns - now, pong.heard_ns - pong.ping_ns))
        least = max(low - DRIFT * (now - sent) for sent, low, _ in bands)
        most = min(high + DRIFT * (now - sent) for sent, _, high in bands)
        assert clock.offset_ns == round((least + most) / 2)
        assert clock.bound_ns == max(0, round((most - least) / 2)) + 2
        assert clock.rtt_min_ms == min(high - low for _, low, high in bands) / 1e6
    assert told(sync.outbox) == []


@given(jump=st.integers(2 * SECOND, 3600 * SECOND), back=st.booleans())
def test_a_clock_that_is_set_is_noticed_counted_and_learnt_anew(jump: int, back: bool) -> None:
    sync, offset = ClockSync(Outbox()), 10**12
    for k in range(20):
        if k == 10:
            offset += -jump if back else jump
        pong, arrival = trip(k * SECOND // 5, 5_000_000, 5_000_000, 0, offset, 0.0)
        sync.heard(pong, arrival)
    clock = sync.clock(4 * SECOND)
    assert told(sync.outbox) == ["jumped:clock"]
    assert clock.offset_ns == pytest.approx(offset, abs=6_000_000)


def test_a_pong_that_cannot_be_is_not_believed() -> None:
    sync = ClockSync(Outbox())
    sync.heard(ClockPong(stamp_ns=500, ping_ns=0, heard_ns=100), 10)
    assert told(sync.outbox) == ["impossible:clock/pong"]
    assert sync.clock(20).offset_ns is None


def test_drift_is_told_once_it_can_be() -> None:
    sync, drift = ClockSync(Outbox()), None
    for k in range(600):
        pong, back = trip(k * SECOND // 5, 1_000_000, 1_000_000, 0, 10**9, 40e-6)
        sync.heard(pong, back)
        drift = sync.clock(back).drift_ppm
        assert (drift is None) == (k < 100)
    assert drift == pytest.approx(40.0, abs=1.0)


def test_an_answer_that_stays_away_leaves_no_round_trip_but_the_offset() -> None:
    sync = ClockSync(Outbox())
    pong, back = trip(0, 1_000_000, 1_000_000, 0, 10**9, 0.0)
    sync.heard(pong, back)
    assert sync.clock(back).rtt_ms == pytest.approx(2.0)
    later = sync.clock(back + 5 * SECOND)
    assert later.rtt_ms is None
    assert later.offset_ns == pytest.approx(10**9, abs=2)
    assert later.bound_ns is not None
    assert later.bound_ns >= 1_000_000 + DRIFT * 5 * SECOND - 2


# Over every link profile the truth lies inside the bound, and the bound is worth having.


PROFILES = sorted(path.stem for path in (DEPLOY / "links").glob("*.toml"))
AHEAD = 3_600 * SECOND  # [ns] the drone was started an hour earlier
CRYSTAL = 50e-6  # [-] what a plain crystal is off by
NAMES = ("tether", "link_monitor")


class Told(NamedTuple):
    """A word of the link monitor."""

    error: int  # [ns] from the true offset
    bound: int  # [ns]
    rtt_min: float  # [ns]


def told_over(profile: str, drift: float, seed: int, seconds: int) -> list[Told]:
    """What the link monitor says five times a second, from its first answer on."""
    skew = Skew(AHEAD, drift)
    host, stack = VirtualHost({"drone": skew}), Stack(link=profile, apart=True, seed=seed)
    every = Registry.read()
    host.add_all(every.only({name: every[name] for name in NAMES}).apart(), stack)
    said: list[Told] = []

    def hear(clock: Clock, now: int) -> None:
        if clock.offset_ns is not None and clock.bound_ns is not None:
            error = abs(clock.offset_ns - (skew.shows(now) - now))
            said.append(Told(error, clock.bound_ns, (clock.rtt_min_ms or 0.0) * 1e6))

    host.node("ears", ["topside"]).each(topics.CLOCK, hear)
    host.run(seconds * SECOND)
    return said


@pytest.mark.parametrize(
    ("drift", "seed", "seconds"),
    [
        (CRYSTAL, 7, 15),
        *(pytest.param(drift, 1, 60, marks=pytest.mark.slow) for drift in (CRYSTAL, -CRYSTAL)),
    ],
)
@pytest.mark.parametrize("profile", PROFILES)
def test_the_truth_is_inside_the_bound(profile: str, drift: float, seed: int, seconds: int) -> None:
    words = told_over(profile, drift, seed, seconds)
    assert len(words) > 0.7 * seconds * topics.CLOCK.hz
    inside = sum(word.error <= word.bound for word in words)
    assert inside >= 0.99 * len(words)
    for word in words:
        # No wider than the best round trip allows, however long ago that was.
        assert word.bound <= word.rtt_min / 2 + DRIFT * seconds * SECOND + 2
