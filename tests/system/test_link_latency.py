"""What the pilot is told of the link while it changes under a flight: where the time goes, alarms,
and which telemetry is thinned out. On virtual time."""

from pathlib import Path
from statistics import median

import numpy as np
import pytest

from messages import topics
from messages.link import LatencyBudget, LinkRequest, Shown
from messages.pilot import PilotCommand
from messages.state import VehicleState
from messages.vehicle import Actuation
from services.runtime.config.settings import DEPLOY
from tests.support.dive import CHAIN, Dive

MS, S = 1_000_000, 1_000_000_000  # [ns]
SCRIPT = "0,0.3,0,0.3,0.2\n4,0,0,-0.3,0\n100,0,0,0,0\n"
SCREEN_MS = 12.0  # [ms] what the screen of these tests takes
DRAWN_HZ = 4.3  # [1/s] pictures, out of step with the drone


class Flight(Dive):
    """The chain with a link monitor and a screen, armed; ears in both realms."""

    def __init__(self, link: str) -> None:
        super().__init__(SCRIPT, (*CHAIN, "link_monitor"), still_s=1.5, link=link)
        self.said: list[tuple[int, LatencyBudget]] = []
        self.links = self.heard(topics.LINK, "topside")
        self.arrivals: dict[str, list[tuple[int, float]]] = {}  # ([ns], age [ms]) by topic
        self.downward_ms: list[float] = []  # of commands, truly
        self.upward_ms: list[float] = []  # of what the screen shows, truly
        pilot, drone = self.ears("topside"), self.ears("drone")
        self._requests = self.host.node("hand", ["topside"]).publisher(topics.LINK_REQUEST)
        self._shown = pilot.publisher(topics.SHOWN.of("screen"))
        self._newest: VehicleState | None = None
        self._acted = 0  # [ns] stamp of the newest command that has acted
        self._drawn = pilot.alarm(self._show)
        self._drawing: VehicleState | None = None
        pilot.each(topics.LATENCY, lambda m, now: self.said.append((now, m)))
        pilot.each(topics.STATE, self._on_state)
        pilot.each(topics.THRUSTERS, lambda m, now: self._arrived("thrusters", m.stamp_ns, now))
        pilot.every(DRAWN_HZ, self._draw)
        drone.each(topics.PILOT_COMMAND, self._on_command, onlooker=True)
        drone.each(topics.ACTUATION, self._on_actuation)
        self.until_armed()

    def ask(self, request: LinkRequest) -> int:
        """Returns when [ns] the link has changed."""
        self._requests.put(request)
        return self.host.now

    def give(self, profile: str) -> int:
        now = self.host.now
        return self.ask(LinkRequest(stamp_ns=now, id=str(now), kind="profile", profile=profile))

    def since(self, moment: int) -> list[LatencyBudget]:
        return [budget for at, budget in self.said if at >= moment]

    def first_alarm(self, since: int) -> int:
        """[ns] after `since`."""
        return next(at for at, budget in self.said if at >= since and budget.alarms) - since

    def ages(self, name: str, since: int, until: int) -> list[float]:
        """[ms] of what arrived in that time."""
        return [age for at, age in self.arrivals.get(name, []) if since <= at < until]

    def _arrived(self, name: str, stamp: int, now: int) -> None:
        self.arrivals.setdefault(name, []).append((now, (now - stamp) / MS))

    def _on_state(self, state: VehicleState, now: int) -> None:
        self._newest = state
        self._arrived("state", state.stamp_ns, now)

    def _on_command(self, command: PilotCommand, now: int) -> None:
        self._arrived("command", command.stamp_ns, now)

    def _on_actuation(self, actuation: Actuation, _: int) -> None:
        """The same command acts twice, for two references; the first time is what counts."""
        done, sent = actuation.actuated_ns, actuation.pilot_ns
        if done is not None and sent is not None and sent > self._acted:
            self._acted = sent
            self.downward_ms.append((done - sent) / MS)

    def _draw(self, now: int) -> None:
        self._drawing = self._newest
        self._drawn.set(now + round(SCREEN_MS * MS))

    def _show(self, now: int) -> None:
        if self._drawing is not None:
            self.upward_ms.append((now - self._drawing.sensor_ns) / MS)
            self._shown.put(Shown(stamp_ns=now, sensor_ns=self._drawing.sensor_ns))


@pytest.mark.slow
@pytest.mark.parametrize("link", ["tether", "wifi_buoy", "remote"])
def test_the_stages_add_up_to_what_truly_passes(link: str) -> None:
    flight = Flight(link)
    flight.run(3.0)  # until the budget's two seconds are all flight
    flight.downward_ms.clear()
    flight.upward_ms.clear()
    begin = flight.host.now + 2 * S
    flight.run(8.0)
    told = flight.since(begin)
    assert len(told) >= 10
    for budget in told:
        assert budget.alarms == ()
        assert budget.down is not None
        assert budget.up is not None
        down, up = (sum(stage.p50_ms for stage in way) for way in (budget.down, budget.up))
        assert down == pytest.approx(budget.stick_to_thruster_ms, rel=0.05)
        assert up == pytest.approx(budget.sensor_to_screen_ms, rel=0.05)
    downs = [budget.stick_to_thruster_ms or 0.0 for budget in told]
    ups = [budget.sensor_to_screen_ms or 0.0 for budget in told]
    # Two seconds are a sample of the flight: its median is about the flight's.
    for medians, truth in ((downs, flight.downward_ms), (ups, flight.upward_ms)):
        low, high = np.percentile(truth, (30, 70))
        assert low <= median(medians) <= high


@pytest.mark.slow
def test_a_link_that_is_gone_is_told_within_a_second_and_leaves_no_number() -> None:
    flight = Flight("wifi_buoy")
    flight.run(4.0)
    cut = flight.ask(LinkRequest(stamp_ns=flight.host.now, id="1", kind="down"))
    flight.run(6.0)
    assert flight.first_alarm(cut) <= S
    silent = flight.since(cut + 2 * S + S // 2)  # the budget is about two seconds
    assert len(silent) >= 6
    for budget in silent:
        assert budget.alarms[0].code == "link.silent"
        assert budget.down is budget.stick_to_thruster_ms is None
        assert budget.up is None
        # What is on the screen grows old, and that is not a number to be proud of.
        assert budget.sensor_to_screen_ms is None or budget.sensor_to_screen_ms > 400.0
    status = flight.links[-1]
    assert (status.up, status.rtt_ms, status.down_link.delay_p50_ms) == (False, None, None)
    joined = flight.ask(LinkRequest(stamp_ns=flight.host.now, id="2", kind="up"))
    flight.run(4.0)
    back = flight.since(joined + S)
    assert not any(budget.alarms for budget in back)
    assert 8.0 <= (back[-1].stick_to_thruster_ms or 0.0) <= 60.0
    assert back[-1].sensor_to_screen_ms is not None


def p99_of(ages: list[float]) -> float:
    """[ms] Infinite where nothing arrived."""
    return float(np.percentile(ages, 99)) if ages else float("inf")


@pytest.mark.slow
def test_thinning_out_keeps_what_matters_fast_and_ends_with_the_cause(tmp_path: Path) -> None:
    text = (DEPLOY / "links" / "congested.toml").read_text(encoding="utf-8")
    full = tmp_path / "full.toml"
    full.write_text(text.replace("[down]", "thin = false\n[down]", 1))
    p99: dict[str, dict[str, float]] = {}
    thinned, in_full = Flight("tether"), Flight("tether")
    for flight, link in ((thinned, "congested"), (in_full, str(full))):
        begin = flight.give(link) + 5 * S
        flight.run(15.0)
        p99[link] = {
            key: p99_of(flight.ages(key, begin, flight.host.now))
            for key in ("command", "thrusters", "state")
        }
    ours, others = p99.values()
    assert ours["command"] <= 1.05 * others["command"]
    assert ours["thrusters"] <= 1.1 * others["thrusters"]  # first through the queue either way
    assert ours["state"] < 150.0 < others["state"]
    assert thinned.links[-1].up_link.tiers["simulator/truth"] < topics.TRUTH.hz
    assert in_full.links[-1].up_link.tiers == {}

    asked = thinned.give("tether")
    thinned.run(3.0)
    assert thinned.links[-1].profile == "tether"
    assert thinned.links[-1].up_link.tiers == {}
    for name in ("state", "thrusters"):
        assert len(thinned.ages(name, asked + S, asked + 2 * S)) in range(99, 102)
