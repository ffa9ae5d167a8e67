"""The whole chain on busy computers: late wake-ups and stalls cost little of what a punctual dive
is worth."""

from collections import defaultdict
from math import pi, radians, remainder

import numpy as np
import pytest

from messages import topics
from messages.vehicle import Truth
from tests.support.dive import Dive
from tests.support.hindered_host import Jitter, Lateness

pytestmark = pytest.mark.slow

# The simulator is not among them: it plays the sensors and the thrusters, whose clockwork does
# not hang on a busy computer.
BUSY = ("estimation", "reference", "control", "tether", "gamepad")
JITTER = Jitter(delay=0.02, stall=0.1, stall_every=3.5)
SEEDS = 2
MOST = 1.5  # times the error of the punctual dives
STANDING = radians(1.0)  # the dead-band of the thrusters leaves the heading alone within this
# Down, turn, ahead in a curve, up, turn back, down again: no axis is spared.
SCRIPT = """t,surge,sway,heave,yaw
1,0,0,0.8,0
8,0,0,0,0.5
12,0.4,0,0,0.2
18,0,0,-0.6,0
22,0,0,0,-0.8
26,0,0,1,0
32,0,0,0,0
40,0,0,0,0
"""
FLOWN = 40.0  # [s]


class BusyDive(Dive):
    """The chain on virtual time, and an observer on board."""

    def __init__(self, seed: int, jitter: Jitter | None) -> None:
        """None: on the host without jitter."""
        late = {
            name: Lateness(jitter, np.random.default_rng([seed, k]))
            for k, name in enumerate(BUSY)
            if jitter is not None
        }
        place = ["simulator.floor_depth=20"]
        super().__init__(SCRIPT, seed=seed, lateness=late, link="tether", overrides=place)
        self.truth: dict[int, Truth] = {}
        self.ears().each(topics.TRUTH, lambda m, _: self.truth.update({m.stamp_ns: m}))
        self.states, self.references = self.heard(topics.STATE), self.heard(topics.REFERENCE)
        self.until_armed().run(FLOWN)

    def errors(self) -> dict[str, list[float]]:
        """[m] and [rad] Estimates against the truth, and the truth against the reference while it
        moves; the heading also while it does not."""
        running = [s for s in self.states if s.phase == "running" and s.sensor_ns in self.truth]
        # The control heading counts from where it was at the end of calibration.
        began = running[0].heading.value - self.truth[running[0].sensor_ns].heading
        found: dict[str, list[float]] = defaultdict(list)
        for s in running:
            true = self.truth[s.sensor_ns]
            found["depth estimate"].append(s.depth.value - true.position[2])
            found["heading estimate"].append(_turn(s.heading.value - true.heading - began))
        for r in self.references:
            if not r.armed or r.sensor_ns is None:
                continue
            true = self.truth[r.sensor_ns]
            if r.depth.velocity != 0.0:
                found["depth tracking"].append(true.position[2] - r.depth.position)
            kind = "heading at rest" if r.heading.velocity == 0.0 else "heading tracking"
            found[kind].append(_turn(true.heading + began - r.heading.position))
        return found


def _turn(angle: float) -> float:
    return remainder(angle, 2.0 * pi)


def _rms(errors: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))


def test_a_busy_computer_costs_little() -> None:
    """Pooled over the seeds. At rest the heading stands wherever in the thrusters' dead-band it
    came to, with or without jitter, so there it has a bound and no comparison."""
    punctual, busy = defaultdict[str, list[float]](list), defaultdict[str, list[float]](list)
    for seed in range(SEEDS):
        for found, jitter in ((punctual, None), (busy, JITTER)):
            dive = BusyDive(seed, jitter)
            for name, errors in dive.errors().items():
                found[name] += errors
            assert (dive.counts["skipped:state"] > 0) == (jitter is not None)
            assert dive.counts["unusable:sensor/imu"] == 0
    for found in (punctual, busy):
        assert max(map(abs, found.pop("heading at rest"))) <= STANDING
    ratios = {name: _rms(busy[name]) / _rms(punctual[name]) for name in punctual}
    assert max(ratios.values()) <= MOST, ratios
    assert busy.keys() == punctual.keys()
