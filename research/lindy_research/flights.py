"""Dives for the benches: flown once on virtual time by the real chain, from gamepad to simulator.

What is kept is the truth. Sensors are then drawn anew from it for each seed
(services/simulator/sensors.py), as often as a bench likes, without flying again.
"""

import tempfile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from lindy.api.dives import Registry, Stack, VirtualHost
from lindy.api.messages import Actuation, Reference, Truth, VehicleState, topics
from lindy_research.dives import CHAIN, DEEP, LONGEST_START, Floats, Row, Stick

Script = tuple[Row, ...]

HZ = 100.0  # [1/s] of the truth
DT = 1.0 / HZ  # [s]
LEAST, MOST = 2.0, 20.0  # [m] the pilot turns round here
HEAVE = (-1.0, -0.6, 0.0, 0.0, 0.6, 1.0)
FULL_HEAVE = 0.5  # [m/s]


@dataclass(frozen=True, eq=False)
class TruthLog:
    """The truth at HZ from power-on; body axes are FRD. `armed` and `calibrated` are rows."""

    attitude: Floats  # [-] n × 4: q_NB as w, x, y, z
    velocity: Floats  # [m/s] n × 3
    acceleration: Floats  # [m/s²] n × 3: dν/dt in the turning body frame
    rate: Floats  # [rad/s] n × 3
    heading: Floats  # [rad] accumulated
    pitch: Floats  # [rad]
    depth: Floats  # [m]
    depth_rate: Floats  # [m/s]
    thrust: Floats  # [N] n × thrusters, as reported
    asked: Floats  # [m/s²] of the depth reference; 0 while disarmed
    calibrated: int  # first row of which the estimator knew where it is
    armed: int  # first row with thrust

    @property
    def t(self) -> Floats:
        """[s] since power-on."""
        return np.arange(1.0, len(self.heading) + 1.0) * DT

    def actuation(self, row: int, stamp_ns: int) -> Actuation:
        """What the thrusters reported in a row, with this stamp."""
        return Actuation(
            stamp_ns=stamp_ns, thrust=tuple(self.thrust[row].tolist()), actuated_ns=None,
            sensor_ns=None, pilot_ns=None, stale=False, power=0.0,
        )  # fmt: skip

    @property
    def motion(self) -> tuple[Floats, Floats, Floats, Floats]:
        """What an IMU is asked to measure: attitude, velocity, rate, acceleration."""
        return self.attitude, self.velocity, self.rate, self.acceleration


@lru_cache(maxsize=8)
def flown(script: Script, seconds: float) -> TruthLog:
    """A dive that ends `seconds` after arming. The same arguments give the same dive.

    Raises:
        RuntimeError: the drone does not arm.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "script.csv"
        rows = [f"{t:.2f},{','.join(map(str, sticks))}" for t, sticks in script if t <= seconds]
        path.write_text("\n".join(["t,surge,sway,heave,yaw", *rows, f"{seconds + 1.0},0,0,0,0\n"]))
        stack = Stack(pilot=f"script:{path}", out=folder, link="perfect", overrides=[DEEP])
        return _fly(stack, seconds)


def _fly(stack: Stack, seconds: float) -> TruthLog:
    host, rows = VirtualHost(), Registry.read()
    for name in CHAIN:
        host.add(name, rows[name], stack)
    truth: list[Truth] = []
    thrust: list[Actuation] = []
    asked: dict[int, float] = {}  # by the sample's stamp
    running: list[int] = []  # [ns]

    def hear_reference(reference: Reference, _: int) -> None:
        if reference.armed and reference.sensor_ns is not None:
            asked[reference.sensor_ns] = reference.depth.acceleration

    def hear_state(state: VehicleState, _: int) -> None:
        if state.phase == "running" and not running:
            running.append(state.sensor_ns)

    observer = host.node("observer", ["drone"])
    observer.each(topics.TRUTH, lambda message, _: truth.append(message))
    observer.each(topics.ACTUATION, lambda message, _: thrust.append(message))
    observer.each(topics.REFERENCE, hear_reference)
    observer.each(topics.STATE, hear_state)
    host.run(round(LONGEST_START * 1e9), done=lambda: bool(asked))
    if not asked:
        raise RuntimeError(f"the drone is not armed after {LONGEST_START:.0f} s")
    host.run(host.now + round(seconds * 1e9))
    stamps = [message.stamp_ns for message in truth]
    velocity = np.array([message.velocity for message in truth])
    newest = np.searchsorted([message.stamp_ns for message in thrust], stamps, side="right") - 1
    reported = np.array([message.thrust for message in thrust])
    acceleration: Floats = np.gradient(velocity, DT, axis=0)
    return TruthLog(
        attitude=np.array([message.attitude for message in truth]),
        velocity=velocity,
        acceleration=acceleration,
        rate=np.array([message.angular_rate for message in truth]),
        heading=np.array([message.heading for message in truth]),
        pitch=np.array([message.pitch for message in truth]),
        depth=np.array([message.position[2] for message in truth]),
        depth_rate=np.array([message.depth_rate for message in truth]),
        thrust=reported[np.maximum(newest, 0)],
        asked=np.array([asked.get(stamp, 0.0) for stamp in stamps]),
        calibrated=stamps.index(running[0]),
        armed=stamps.index(min(asked)),
    )


def busy(seconds: float, seed: int = 0) -> Script:
    """A pilot who never rests: every two to five seconds other sticks, so that the vehicle turns
    with up to 50 °/s and pitches with every change of surge and heave. Begins at once."""
    rng = np.random.default_rng([seed, 99])
    rows: list[tuple[float, Stick]] = []
    t, depth = 0.0, 0.0
    while t < seconds:
        wait = float(rng.uniform(2.0, 5.0))
        surge, yaw = rng.uniform(-1.0, 1.0, 2).round(2).tolist()
        heave = float(rng.choice(HEAVE))
        # Straight down first, and never out of the water.
        if not LEAST <= depth + FULL_HEAVE * heave * wait <= MOST:
            heave = 1.0 if depth < (LEAST + MOST) / 2 else -1.0
        rows.append((t, (surge, 0.0, heave, 0.85 * yaw)))
        t, depth = t + wait, depth + FULL_HEAVE * heave * wait
    return tuple(rows)
