"""The whole chain on busy computers: late wake-ups and stalls cost little of what a punctual dive
is worth."""

from collections import defaultdict
from math import pi, radians, remainder
from pathlib import Path

import numpy as np
import pytest

from messages import topics
from messages.reference import Reference
from messages.state import VehicleState
from messages.vehicle import Truth
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from tests.support.hindered_host import HinderedHost
from tests.support.jitter import Jitter, Lateness

pytestmark = pytest.mark.slow

S = 1_000_000_000  # [ns]
# The simulator is not among them: it plays the sensors and the thrusters, whose clockwork does
# not hang on a busy computer.
BUSY = ("estimation", "reference", "control", "tether", "gamepad")
CHAIN = ("simulator", *BUSY)
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


class Dive:
    """The chain on virtual time, and an observer on board."""

    def __init__(self, folder: Path, seed: int, jitter: Jitter | None) -> None:
        """None: on the host without jitter."""
        script = folder / "script.csv"
        script.write_text(SCRIPT)
        stack = Stack(
            pilot=f"script:{script}",
            out=str(folder),
            link="tether",
            seed=seed,
            overrides=["simulator.floor_depth=20", "estimation.calibration.still_time=3"],
        )
        late = {
            name: Lateness(jitter, np.random.default_rng([seed, k]))
            for k, name in enumerate(BUSY)
            if jitter is not None
        }
        self.host, rows = HinderedHost(lateness=late), Registry.read()
        for name in CHAIN:
            self.host.add(name, rows[name], stack)
        self.truth: dict[int, Truth] = {}
        self.states: list[VehicleState] = []
        self.references: list[Reference] = []
        port = self.host.node("observer", ["drone"])
        port.each(topics.TRUTH, lambda m, _: self.truth.update({m.stamp_ns: m}))
        port.each(topics.STATE, lambda m, _: self.states.append(m))
        port.each(topics.REFERENCE, lambda m, _: self.references.append(m))

    def fly(self) -> "Dive":
        self.host.run(60 * S, done=lambda: bool(self.references) and self.references[-1].armed)
        self.host.run(self.host.now + round(FLOWN * S))
        return self

    def counted(self, what: str) -> int:
        return sum(node.counts[what] for node in self.host.nodes.values())

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


def test_a_busy_computer_costs_little(tmp_path: Path) -> None:
    """Pooled over the seeds. At rest the heading stands wherever in the thrusters' dead-band it
    came to, with or without jitter, so there it has a bound and no comparison."""
    punctual, busy = defaultdict[str, list[float]](list), defaultdict[str, list[float]](list)
    for seed in range(SEEDS):
        for found, jitter in ((punctual, None), (busy, JITTER)):
            dive = Dive(tmp_path, seed, jitter).fly()
            for name, errors in dive.errors().items():
                found[name] += errors
            assert (dive.counted("skipped:state") > 0) == (jitter is not None)
            assert dive.counted("unusable:sensor/imu") == 0
    for found in (punctual, busy):
        assert max(map(abs, found.pop("heading at rest"))) <= STANDING
    ratios = {name: _rms(busy[name]) / _rms(punctual[name]) for name in punctual}
    assert max(ratios.values()) <= MOST, ratios
    assert busy.keys() == punctual.keys()
