"""Telemetry fits the link: what is thinned out, what never is, and how it comes back."""

from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.link import LinkRequest, LinkStatus
from messages.topic import Qos
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from services.tether.telemetry_rate_control import (
    LADDER,
    WORST,
    RateLadder,
    TelemetryRateControl,
    limits,
    load_kbit,
)

MS = 1_000_000  # [ns]
S = 1000 * MS
FAST = [t for t in topics.ALL if t.way is topics.UP and t.hz >= 50]
OFFERED = {topic.key: 200.0 for topic in FAST} | {"": 30.0}  # [kbit/s]


def test_every_step_down_the_ladder_asks_for_less_and_truth_goes_first() -> None:
    loads = [load_kbit(level, OFFERED) for level in range(len(LADDER))]
    assert loads == sorted(loads, reverse=True)
    assert len(set(loads)) == len(loads)
    assert limits(0) == {}
    assert set(limits(1)) == {topics.TRUTH.key}
    for level in range(1, len(LADDER)):
        rates = [limits(level).get(topic.key, topic.hz) for topic in FAST]
        truth = limits(level)[topics.TRUTH.key]
        state = limits(level).get(topics.STATE.key, topics.STATE.hz)
        assert truth == min(rates)
        assert state == max(rates)


def test_no_event_and_nothing_that_is_slow_by_nature_is_ever_thinned_out() -> None:
    for key in limits(WORST):
        topic = topics.find(key)
        assert topic is not None
        assert topic.qos is not Qos.EVENT
        assert topic.hz >= 50
        assert topic.way is topics.UP


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, 80_000), st.integers(0, 3), st.floats(0.0, 2000.0)), max_size=200
    )
)
def test_the_level_stays_on_the_ladder_and_changes_at_most_once_a_look(
    looks: list[tuple[int, int, float]],
) -> None:
    tiers = RateLadder()
    for k, (standing, lost, carried) in enumerate(looks):
        before = tiers.level
        changed = tiers.judge(standing, lost, carried, OFFERED, k * S // 5)
        assert changed == (tiers.level != before)
        assert 0 <= tiers.level <= WORST
        assert tiers.level >= before - 1  # back up one step at a time


def test_room_brings_everything_back_and_lasting_overload_makes_trials_rare() -> None:
    tiers, now = RateLadder(), 0
    tiers.judge(60_000, 5, 400.0, OFFERED, now)
    assert load_kbit(tiers.level, OFFERED) < 400.0
    worst, changes = tiers.level, Counter[int]()
    for _ in range(5 * 600):  # the link stays as narrow: 400 kbit/s
        now += S // 5
        overloaded = load_kbit(tiers.level, OFFERED) > 400.0
        if tiers.judge(30_000 if overloaded else 0, int(overloaded), 400.0, OFFERED, now):
            changes[now // (100 * S)] += 1
    assert changes[5] <= 4 <= changes[0] + 4
    assert tiers.level >= worst - 2
    for _ in range(5 * 300):  # now it is wide
        now += S // 5
        tiers.judge(0, 0, load_kbit(tiers.level, OFFERED), OFFERED, now)
    assert tiers.level == 0


@settings(max_examples=50, deadline=None)
@given(st.floats(1.0, 50.0), st.lists(st.integers(0, 5 * MS), min_size=300, max_size=300))
def test_a_thinned_topic_keeps_its_rate_through_jitter(hz: float, jitter: list[int]) -> None:
    thinner = TelemetryRateControl({"state": hz})
    passed = sum(thinner.admits("state", 100, k * 10 * MS + j) for k, j in enumerate(jitter))
    assert passed == pytest.approx(3.0 * hz, abs=2.0)
    assert all(thinner.admits("vehicle/status", 100, k) for k in range(100))


class Overload:
    """A drone that says all fast topics at full rate, over a link that cannot carry them."""

    def __init__(self, folder: Path, profile: str) -> None:
        path = folder / "narrow.toml"
        path.write_text(profile)
        self.host = VirtualHost()
        row = ServiceSpec(sides=["topside", "drone"], gateway=True)
        self.tether = self.host.add("tether", row, Stack(link=str(path)))
        self.statuses: list[LinkStatus] = []
        self.delays: dict[str, list[int]] = {}
        pilot, drone = self.host.node("pilot", ["topside"]), self.host.side("drone")
        pilot.each(topics.LINK, lambda m, _: self.statuses.append(m))
        self.request = pilot.publisher(topics.LINK_REQUEST)
        events = (topics.STATUS, topics.PILOT_ANSWER)
        for topic in (*FAST, *events):
            self.delays[topic.key] = []
            self.host.side("topside").hear(topic.key, self._arrived)
        clock = self.host.node("clock", ["drone"])
        clock.every(100.0, lambda now: [self._say(drone, t.key, now) for t in FAST])  # type: ignore[func-returns-value]
        clock.every(5.0, lambda now: [self._say(drone, t.key, now) for t in events])  # type: ignore[func-returns-value]

    def _say(self, side: object, key: str, now: int) -> None:
        payload = now.to_bytes(8, "little") + bytes(200)
        side.forward(Envelope(key, payload, "x"))  # type: ignore[attr-defined]

    def _arrived(self, envelope: Envelope) -> None:
        sent = int.from_bytes(envelope.payload[:8], "little")
        self.delays[envelope.key].append(self.host.now - sent)

    def run(self, seconds: float) -> "Overload":
        self.host.run(self.host.now + round(seconds * S))
        return self

    def p99_ms(self, key: str) -> float:
        ordered = sorted(self.delays[key])
        return ordered[len(ordered) * 99 // 100] / MS


NARROW = "thin = {thin}\n[up]\ndelay_ms = 10.0\nrate_kbit = 300.0\n"


def test_thinning_out_keeps_the_state_fresh_where_it_would_be_seconds_old(
    tmp_path: Path,
) -> None:
    with_tiers = Overload(tmp_path, NARROW.format(thin="true")).run(3.0)
    without = Overload(tmp_path, NARROW.format(thin="false")).run(3.0)
    for run in (with_tiers, without):
        for delays in run.delays.values():
            delays.clear()
        run.run(10.0)
    state, event = topics.STATE.key, topics.STATUS.key
    assert with_tiers.p99_ms(state) < 100.0
    assert without.p99_ms(state) > 1000.0
    for run in (with_tiers, without):  # events go before telemetry, however much of it there is
        assert run.p99_ms(event) < 100.0
        assert len(run.delays[event]) == 50
    status = with_tiers.statuses[-1]
    assert status.up_link.tiers[topics.TRUTH.key] <= 5.0
    assert without.statuses[-1].up_link.tiers == {}
    assert with_tiers.tether.counts["thinned:simulator/truth"] > 900
    assert with_tiers.tether.counts["thinned:vehicle/status"] == 0


def test_telemetry_comes_back_when_the_link_is_wide_again(tmp_path: Path) -> None:
    run = Overload(tmp_path, NARROW.format(thin="true")).run(5.0)
    assert run.statuses[-1].up_link.tiers
    run.request.put(
        LinkRequest(stamp_ns=run.host.now, id="x", kind="set", settings=("up.rate_kbit=9000",))
    )
    run.run(180.0)
    assert run.statuses[-1].up_link.tiers == {}
    assert run.statuses[-1].changes == 1
