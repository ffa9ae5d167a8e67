"""The whole chain on virtual time: what a pilot may rely on, whatever he does with the sticks."""

import hashlib
from collections import Counter
from pathlib import Path

import pytest

from messages import topics
from messages.control import ThrusterCommand
from messages.reference import Reference
from messages.state import VehicleState
from messages.vehicle import Truth, VehicleStatus
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost

SECOND = 1_000_000_000
CHAIN = ("simulator", "estimation", "reference", "control", "tether", "gamepad")
HANDS_OFF = "t,surge,sway,heave,yaw\n"


class Dive:
    """The chain with a pilot's script, and an observer on board."""

    def __init__(self, folder: Path, script: str, **choices: object) -> None:
        path = folder / "script.csv"
        path.write_text(HANDS_OFF + script)
        self.rows = Registry.read()
        self.stack = Stack(
            pilot=f"script:{path}",
            out=str(folder),
            overrides=["estimation.calibration.still_time=3"],  # [s] less to wait for
            **choices,  # type: ignore[arg-type]
        )
        self.host = VirtualHost()
        for name in CHAIN:
            self.host.add(name, self.rows[name], self.stack)
        self.truth: list[Truth] = []
        self.states: list[VehicleState] = []
        self.references: list[Reference] = []
        self.commands: list[ThrusterCommand] = []
        self.statuses: list[VehicleStatus] = []
        observer = self.host.node("observer", ["drone"])
        observer.each(topics.TRUTH, lambda m, _: self.truth.append(m))
        observer.each(topics.STATE, lambda m, _: self.states.append(m))
        observer.each(topics.REFERENCE, lambda m, _: self.references.append(m))
        observer.each(topics.THRUSTERS, lambda m, _: self.commands.append(m))
        observer.each(topics.STATUS, lambda m, _: self.statuses.append(m))

    def run(self, seconds: float) -> "Dive":
        self.host.run(self.host.now + round(seconds * SECOND))
        return self

    def until_armed(self) -> "Dive":
        self.host.run(60 * SECOND, done=lambda: bool(self.statuses) and self.statuses[-1].armed)
        assert self.statuses[-1].armed
        return self

    def restart(self, name: str, dead_for: float) -> None:
        self.host.kill(name)
        self.run(dead_for)
        self.host.add(name, self.rows[name], self.stack)

    @property
    def counts(self) -> Counter[str]:
        total: Counter[str] = Counter()
        for node in self.host.nodes.values():
            total.update(node.counts)
        return total


def depth_after_release(dive: Dive, seconds: float) -> list[float]:
    start = len(dive.truth)
    dive.run(seconds)
    return [truth.position[2] for truth in dive.truth[start:]]


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3))]
)
def test_the_drone_stops_where_the_stick_was_let_go(tmp_path: Path, seed: int) -> None:
    dive = Dive(tmp_path, "0,0,0,0,0\n1,0,0,1,0\n7,0,0,0,0\n30,0,0,0,0", seed=seed)
    dive.until_armed().run(7.0)
    let_go = dive.truth[-1].position[2]
    depths = depth_after_release(dive, 10.0)
    final = dive.references[-1].depth.position
    assert final - let_go < 0.75  # it is on its way down at 0.5 m/s
    assert max(depths) - final <= 0.10
    assert max(abs(depth - final) for depth in depths[-500:]) <= 0.05


def test_a_pilot_who_vanishes_leaves_the_drone_holding_its_depth(tmp_path: Path) -> None:
    dive = Dive(tmp_path, "0,0,0,0,0\n1,0.5,0,0.6,0\n60,0,0,0,0").until_armed().run(4.0)
    dive.host.kill("gamepad")
    dive.run(6.0)
    assert dive.statuses[-1].failsafe == "pilot_lost"
    depths = depth_after_release(dive, 5.0)
    assert max(depths) - min(depths) < 0.10
    assert dive.references[-1].surge_force == 0.0


def test_dead_control_means_thrusters_stop_within_their_time_to_live(tmp_path: Path) -> None:
    dive = Dive(tmp_path, "0,0,0,0,0\n1,1,0,0,0\n60,0,0,0,0").until_armed().run(4.0)
    dive.host.kill("control")
    dive.run(1.2)
    assert dive.host.nodes["simulator"].counts["stale:control/thrusters"] == 1


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(tmp_path: Path) -> None:
    def digest(seed: int) -> str:
        dive = Dive(tmp_path, "0,0,0,0,0\n1,0.5,0,1,0.3\n3,0,0,0,0", seed=seed)
        sha = hashlib.sha256()
        for side in ("drone", "topside"):
            dive.host.side(side).hear("**", lambda e: sha.update(e.key.encode() + e.payload))
        dive.run(8.0)
        return sha.hexdigest()

    assert digest(1) == digest(1)
    assert digest(1) != digest(2)
