"""Which telemetry is thinned out on a narrow link."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.link import LinkStatus
from messages.topic import Qos
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from services.tether.core import (
    LEAST,
    Link,
    TelemetryRateControl,
    limits,
    load_kbit,
)
from services.tether.io.profile_file import named
from services.tether.link_model import RANK

MS = 1_000_000  # [ns]
S = 1000 * MS
FAST = [t for t in topics.ALL if t.way is topics.UP and t.hz >= 50]
loads = st.fixed_dictionaries(
    {"": st.floats(0.0, 100.0)} | {t.key: st.floats(0.0, 1000.0) for t in FAST}
)
budgets = st.floats(0.0, 5000.0)


@given(loads, budgets)
def test_rates_fit_the_budget_or_are_at_their_floors(
    offered: dict[str, float], budget: float
) -> None:
    rates = limits(budget, offered)
    least = {t.key: LEAST * t.floor_hz for t in FAST}
    possible = max(budget, load_kbit(least, offered))
    assert load_kbit(rates, offered) <= possible * (1.0 + 1e-6) + 1e-6
    for topic in FAST:
        assert LEAST * topic.floor_hz <= rates.get(topic.key, topic.hz) <= topic.hz


@given(loads, budgets)
def test_the_state_yields_last_the_truth_first(offered: dict[str, float], budget: float) -> None:
    rates = limits(budget, offered)
    shares = [rates.get(t.key, t.hz) for t in sorted(FAST, key=lambda t: t.weight)]
    assert shares == sorted(shares)
    if rates.get(topics.STATE.key, 100.0) < 0.99 * topics.STATE.floor_hz:
        assert all(
            rates[t.key] <= 1.01 * LEAST * t.floor_hz
            for t in FAST
            if t is not topics.STATE and offered[t.key] > 1.0
        )


def test_no_event_and_nothing_that_is_slow_by_nature_is_ever_thinned_out() -> None:
    weighed = [topic for topic in topics.ALL if topic.weight > 0.0]
    assert weighed == FAST
    assert all(topic.qos is not Qos.EVENT for topic in weighed)


@given(st.lists(st.floats(50.0, 5000.0), min_size=1, max_size=20))
def test_rates_follow_what_the_link_carries_and_then_stay(capacities: list[float]) -> None:
    control, now = TelemetryRateControl(), 0
    for carries in capacities:
        changes = 0
        for _ in range(50):
            for topic in FAST:
                for _ in range(20):
                    control.admits(topic.key, 300, now)
            now += S // 5
            changes += control.judge(carries, now)
        assert changes <= 3


@given(st.floats(50.0, 2000.0), st.integers(1, 30), st.integers(100, 600))
def test_messages_of_once_a_second_move_no_rate(carries: float, slow: int, size: int) -> None:
    """`slow` of them arrive in one period of five, and none in the others."""
    control, changed = TelemetryRateControl(), list[int]()
    for period in range(100):
        now = period * (S // 5)
        for topic in FAST:
            for _ in range(20):
                control.admits(topic.key, 300, now)
        for _ in range(slow if period % 5 == 0 else 0):
            control.admits("health/control", size, now)
        if control.judge(carries, now + S // 5):
            changed.append(period)
    assert all(period < 15 for period in changed)


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


def test_thinning_out_keeps_the_state_fresh_on_a_narrow_link(tmp_path: Path) -> None:
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


LIFE = 400 * MS


def state_delays(link: Link[tuple[str, int]], until: int) -> list[int]:
    """[ns] Of every state that arrives by `until`."""
    delays = list[int]()
    while (due := link.up.due()) is not None and due <= until:
        while (arrival := link.up.leave(due)) is not None:
            if arrival.item[0] == topics.STATE.key:
                delays.append(due - arrival.item[1])
    return delays


def test_the_picture_has_its_room_first_and_the_state_its_floor() -> None:
    def flown(video_bytes: int) -> tuple[list[int], Link[tuple[str, int]]]:
        link: Link[tuple[str, int]] = Link("congested", named("congested").profile, 1)
        states = list[int]()
        for tick in range(2000):
            now = tick * 10 * MS
            states.extend(state_delays(link, now))
            if tick % 20 == 0:
                link.judge(now)
            for topic in (topics.STATE, topics.TRUTH, topics.WRENCH, topics.REFERENCE):
                if link.admits_up(topic.key, 300, now):
                    link.up.enter((topic.key, now), now, 300, RANK[topic.qos])
            if video_bytes and tick % 4 == 0 and link.admits_up(topics.VIDEO.key, 600, now):
                for _ in range(video_bytes // 600):
                    link.up.enter((topics.VIDEO.key, now), now, 600, RANK[Qos.BULK], LIFE)
        return states, link

    alone, link = flown(0)
    beside, shared = flown(6000)  # 1200 kbit/s on a link of 384
    floor = round(20 * topics.STATE.floor_hz)
    assert len(alone) > 2 * floor
    assert floor - 2 <= len(beside) <= floor + 5
    telemetry = sum(shared.thinned[key] * 400 * 8e-3 for key in ("state", "reference"))
    assert shared.up.carried_bytes * 8e-3 / 20.0 > 0.9 * 384.0  # the rest of it is the picture's
    assert telemetry < 0.15 * 384.0
    assert link.thinned[topics.STATE.key] > shared.thinned[topics.STATE.key]
    # Behind one part that is on the wire already: 700 bytes take 14.6 ms.
    assert float(np.percentile(beside, 99)) <= float(np.percentile(alone, 99)) + 15 * MS
