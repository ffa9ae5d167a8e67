"""Simulated dives as rough as real ones, drawn by a seed, judged by the simulator's truth.

No sensor is broken in them and no thruster fails: an estimator that distrusts its IMU or its
gyroscope is wrong, and so is a failsafe, unless the link caused it. What is drawn: a hull that its
file does not quite describe, sensors, how the IMU is mounted, current, waves, vibration, sticks.
Each vehicle that is shipped meets each link that can be flown once in `ALL_PAIRS` seeds in a row.
"""

import shutil
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from math import cos, degrees, exp, pi, radians, sin, sqrt
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from lindy.api import DEPLOY
from lindy.api.dives import Registry, Stack, VirtualHost
from lindy.api.messages import Reference, Truth, Vec3, VehicleState, VehicleStatus, events, topics
from lindy_research.bench.hull_runs import BUOYANCY, HULLS, HullDifference, file_of, settings
from lindy_research.bench.reality_smoother import rotations
from lindy_research.dives import CHAIN, DEEP, HANDS_OFF, QUICK_START, Floats, Row, Stick, script
from lindy_research.releases import FULL, LEAST, MOST, QUIET_S
from services.recorder.io.parts import part_path
from services.runtime.hosts.loop import rare_collections
from services.simulator.waves import WaveLine, Waves, lines_of

VEHICLES = tuple(BUOYANCY)
UNFLOWN = "acoustic"  # over it no stick position arrives in time
LINKS = tuple(sorted({path.stem for path in (DEPLOY / "links").glob("*.toml")} - {UNFLOWN}))
ALL_PAIRS = len(VEHICLES) * len(LINKS)
# A hull that accelerates twice as much as its file says, and one that nobody has trimmed: as a
# BlueROV2 it floats with 28° of pitch.
CASES = {
    "light": HULLS["mass −30 %, damping ×½, thrust +20 %, lag ×2"][0],
    "leaning": HULLS["buoyancy ±, centre of gravity 5 mm off"][0],
}

SECONDS = 60.0  # [s] of moves, unless told otherwise
DOWN = 3.0  # [m] the first move goes down by so much
PRESSURE_STD = (100.0, 200.0, 500.0)  # [Pa] 1, 2, 5 mbar
MOST_CURRENT = 0.4  # [m/s]
MOST_MOUNTING = radians(2.0)  # [rad]
CALM_S = 12.0  # [s] before waves that do not wait for power-on
LONGEST_START = 90.0  # [s] until armed
MOVING, TURNING = 0.01, 0.02  # [m/s], [rad/s] a slower reference rests
SETTLED_S = 3.0  # [s] after arming, before the estimates are judged
BY_LINK = ("link_lost", "pilot_lost")  # failsafes that the link may cause
INCONSISTENT = events.INCONSISTENT_IMU.name
ABOUT_SENSORS = (events.DANGER, events.SENSOR)
NOISY = events.NOISY(topics.IMU.key).name
RECORDER = "recorder"
SECOND = 1_000_000_000  # [ns]


class Circumstances(NamedTuple):
    """What a seed draws."""

    vehicle: str
    link: str
    hull: HullDifference
    pressure_std: float  # [Pa]
    misalignment: Vec3  # [rad] of the IMU, a rotation vector, body axes
    current: tuple[float, float]  # [m/s] north, east
    waves: Waves | None
    vibration: bool

    @property
    def words(self) -> str:
        hull, waves = self.hull, self.waves
        sea = "calm"
        if waves is not None:
            sea = f"waves {waves.height:.2f} m {waves.period:.1f} s"
            sea += "" if waves.begins else " from the start"
        return (
            f"{self.vehicle}, {self.link}, mass ×{hull.mass:.2f}, damping ×{hull.damping:.2f}, "
            f"thrust ×{hull.thrust:.2f}, {self.pressure_std / 100.0:.0f} mbar, "
            f"IMU {degrees(float(np.linalg.norm(self.misalignment))):.1f}° off, "
            f"current {float(np.hypot(*self.current)):.2f} m/s, {sea}"
            + (", vibration" if self.vibration else "")
        )


class Move(NamedTuple):
    """Sticks of one kind, let go at their end."""

    kind: str
    rows: tuple[Row, ...]  # from when on [s after the move's begin] which sticks
    seconds: float


class Stop(NamedTuple):
    """From the furthest point after a release to where it settles."""

    kind: str  # of the move
    t: float  # [s] after arming
    bounce: float | None  # [m] of heave; None: the reference did not move there
    overshoot: float | None  # [rad] of yaw; None: the same
    orbit: float  # [m] 2σ of the water's own motion up and down at this depth; 0: calm


class Errors(NamedTuple):
    """Of the estimates, over the dive from `SETTLED_S` after arming on.

    The tilt's are against the axes that the IMU really has: nobody can learn from an IMU alone how
    it is mounted. NEES: mean squared error over stated variance, 1 of an honest filter
    (Bar-Shalom, Li and Kirubarajan 2001, §5.4).
    """

    depth: float  # [m] rms, less its median
    depth_offset: float  # [m] its median: of the air pressure that was learnt at the start
    depth_rate: float  # [m/s] rms
    roll: float  # [rad] rms
    pitch: float  # [rad] rms
    nees_depth: float  # [-] the offset included
    nees_rate: float  # [-]
    nees_tilt: float  # [-] mean of roll and pitch
    attitude: float  # [-] share of the states whose attitude is valid


class RoughDive(NamedTuple):
    """What came of a seed."""

    seed: int
    circumstances: Circumstances
    armed: bool  # the rest is empty if not
    counts: dict[str, int]  # events of the estimator about its sensors
    failsafes: tuple[str, ...]  # that acted while armed, not by the link
    stops: tuple[Stop, ...]
    errors: Errors | None


def drawn(seed: int, case: str | None = None) -> Circumstances:
    """The circumstances of a seed; `case`: a name in CASES, whose hull takes the drawn one's
    place."""
    rng = np.random.default_rng([seed, 23])
    vehicle = VEHICLES[seed % len(VEHICLES)]
    hull = HullDifference(
        mass=float(rng.uniform(0.7, 1.3)),
        damping=float(rng.uniform(0.7, 1.6)),
        thrust=float(rng.uniform(0.9, 1.15)),
        # One heavier than its water sinks before it is armed.
        buoyancy=float(rng.uniform(0.0, 1.0)),
    )
    axis = rng.standard_normal(3)
    x, y, z = (rng.uniform(0.0, MOST_MOUNTING) * axis / np.linalg.norm(axis)).tolist()
    speed, towards = rng.uniform(0.0, MOST_CURRENT), rng.uniform(-pi, pi)
    waves = Waves(
        height=float(rng.uniform(0.1, 0.4)),
        period=float(rng.uniform(4.0, 8.0)),
        heading=float(rng.uniform(-pi, pi)),
        begins=float(rng.choice([0.0, CALM_S])),
    )
    return Circumstances(
        vehicle=vehicle,
        link=LINKS[seed // len(VEHICLES) % len(LINKS)],
        hull=hull if case is None else CASES[case],
        pressure_std=float(rng.choice(PRESSURE_STD)),
        misalignment=(x, y, z),
        current=(float(speed * cos(towards)), float(speed * sin(towards))),
        waves=waves if rng.random() < 1 / 3 else None,
        vibration=bool(rng.random() < 1 / 2),
    )


def overrides(c: Circumstances) -> list[str]:
    """The settings that give the simulator these circumstances. The drone is told of the pressure
    sensor's noise only, as by a data sheet."""
    mounting = msgspec.to_builtins(file_of(c.vehicle).mounting)
    mounting["imu"]["rotation"] = (_turned(c.misalignment) @ mounting["imu"]["rotation"]).tolist()
    found = {
        f"simulator.mounting.{sensor}.{key}": value
        for sensor, mount in mounting.items()
        for key, value in mount.items()
    }
    north, east = c.current
    found |= {
        "simulator.current": f"{{north={north}, east={east}, std=0.05, time_constant=20.0}}",
        "simulator.pressure_std": c.pressure_std,
        "estimation.depth.pressure_std": c.pressure_std,
    }
    if c.waves is not None:
        for key, value in msgspec.structs.asdict(c.waves).items():
            found[f"simulator.waves.{key}"] = str(value).lower()
    if c.vibration:
        found["simulator.vibration"] = "{}"
    given = [f"{key}={_toml(value)}" for key, value in found.items()]
    return [DEEP, QUICK_START, *settings(c.vehicle, c.hull), *given]


def _turned(vector: Vec3) -> Floats:
    (matrix,) = rotations(np.array([vector]))
    return matrix


def _toml(value: object) -> str:
    return str(value).replace("(", "[").replace(")", "]")


# The sticks.


def moves(seed: int, vehicle: str, seconds: float) -> list[tuple[float, Move]]:
    """When each begins [s after arming], with `QUIET_S` of hands off after each. The first goes
    down; none leaves the water."""
    rng = np.random.default_rng([seed, 29])
    down = DOWN / FULL[vehicle]
    first: Stick = (0.0, 0.0, 1.0, 0.0)
    found = [(1.0, Move("pure", ((0.0, first),), down))]
    t, depth = 1.0 + down + QUIET_S, DOWN
    while t < seconds:
        move = KINDS[int(rng.integers(len(KINDS)))](rng)
        gained = FULL[vehicle] * _heave_seconds(move)
        if not LEAST <= depth + gained <= MOST:
            move, gained = _upside_down(move), -gained
        found.append((t, move))
        t, depth = t + move.seconds + QUIET_S, depth + gained
    return found


def _pure(rng: np.random.Generator) -> Move:
    sticks = _on(rng, int(rng.integers(4)))
    return Move("pure", ((0.0, sticks),), float(rng.uniform(1.5, 4.0)))


def _two_axes(rng: np.random.Generator) -> Move:
    a, b = rng.choice(4, 2, replace=False).tolist()
    sticks = _sum(_on(rng, a), _on(rng, b))
    return Move("two axes", ((0.0, sticks),), float(rng.uniform(1.5, 4.0)))


def _slam(rng: np.random.Generator) -> Move:
    """Full sticks, thrown over again and again; in half of them all sticks at once."""
    axes = range(4) if rng.random() < 0.5 else [int(rng.integers(4))]
    sticks = _sum(*(_full(axis, float(rng.choice([-1.0, 1.0]))) for axis in axes))
    step, count = float(rng.uniform(0.8, 1.6)), int(rng.integers(2, 6))
    sides = [sticks if n % 2 == 0 else _times(-1.0, sticks) for n in range(count)]
    rows = tuple((n * step, side) for n, side in enumerate(sides))
    return Move("slam", rows, count * step)


def _taps(rng: np.random.Generator) -> Move:
    sticks = _on(rng, int(rng.integers(4)))
    rows, t = list[Row](), 0.0
    for _ in range(int(rng.integers(2, 6))):
        rows += [(t, sticks), (t + float(rng.uniform(0.1, 0.3)), HANDS_OFF)]
        t = rows[-1][0] + float(rng.uniform(0.2, 0.6))
    return Move("taps", tuple(rows[:-1]), rows[-1][0])


def _smooth(rng: np.random.Generator) -> Move:
    """Half a sine, in 20 steps a second, as of a careful hand."""
    a, b = rng.choice(4, 2, replace=False).tolist()
    peak = _sum(_on(rng, a), _on(rng, b))
    seconds = float(rng.uniform(2.0, 5.0))
    times = np.linspace(0.0, seconds, round(20.0 * seconds), endpoint=False).tolist()
    rows = tuple((t, _times(sin(pi * t / seconds), peak)) for t in times)
    return Move("smooth", rows, seconds)


KINDS = (_pure, _two_axes, _slam, _taps, _smooth)


def _on(rng: np.random.Generator, axis: int) -> Stick:
    return _full(axis, float(rng.choice([-1.0, 1.0])) * float(rng.uniform(0.3, 1.0)))


def _full(axis: int, size: float) -> Stick:
    a, b, c, d = (size if axis == n else 0.0 for n in range(4))
    return a, b, c, d


def _sum(*sticks: Stick) -> Stick:
    a, b, c, d = (sum(parts) for parts in zip(*sticks, strict=True))
    return a, b, c, d


def _times(factor: float, sticks: Stick) -> Stick:
    a, b, c, d = sticks
    return factor * a, factor * b, factor * c, factor * d


def _heave_seconds(move: Move) -> float:
    """[s] of full heave stick downwards."""
    ends = [t for t, _ in move.rows[1:]] + [move.seconds]
    return sum((end - t) * sticks[2] for (t, sticks), end in zip(move.rows, ends, strict=True))


def _upside_down(move: Move) -> Move:
    return move._replace(rows=tuple((t, (a, b, -c, d)) for t, (a, b, c, d) in move.rows))


# The dive.


class Heard:
    """What is kept of a dive."""

    def __init__(self, host: VirtualHost) -> None:
        self.truth: list[Truth] = []
        self.references: list[Reference] = []
        self.states: list[VehicleState] = []
        self.failsafes: Counter[str] = Counter()
        self.armed_ns: int | None = None  # [ns]
        self._host = host
        observer = host.node("observer", ["drone"])
        observer.each(topics.TRUTH, lambda m, _: self.truth.append(m))
        observer.each(topics.REFERENCE, lambda m, _: self.references.append(m))
        observer.each(topics.STATE, lambda m, _: self.states.append(m))
        observer.each(topics.STATUS, lambda m, _: self._see(m))

    def _see(self, status: VehicleStatus) -> None:
        if status.armed and self.armed_ns is None:
            self.armed_ns = self._host.now
        if status.armed and status.failsafe not in ("none", *BY_LINK):
            self.failsafes[status.failsafe] += 1


def fly(
    seed: int, case: str | None = None, seconds: float = SECONDS, out: Path | None = None
) -> RoughDive:
    """One dive of the whole chain on virtual time.

    Args:
        case: as of `drawn`.
        seconds: [s] after arming, within which moves begin.
        out: the recording, an MCAP file; None: none is written.
    """
    c = drawn(seed, case)
    plan = moves(seed, c.vehicle, seconds)
    over = plan[-1][0] + plan[-1][1].seconds + QUIET_S
    with TemporaryDirectory() as folder:
        sticks = Path(folder) / "sticks.csv"
        sticks.write_text(_script(plan))
        stack = Stack(
            vehicle=c.vehicle,
            link=c.link,
            pilot=f"script:{sticks}",
            out=folder,
            seed=seed,
            virtual=True,
            overrides=overrides(c),
        )
        registry = Registry.read()
        with closing(VirtualHost()) as host, rare_collections():
            for name in CHAIN if out is None else (RECORDER, *CHAIN):
                host.add(name, registry[name], stack)
            heard = Heard(host)
            host.run(round(LONGEST_START * SECOND), done=lambda: heard.armed_ns is not None)
            if heard.armed_ns is not None:
                host.run(heard.armed_ns + round(over * SECOND))
            counts = host.nodes["estimation"].counts
        if out is not None:
            shutil.move(part_path(Path(folder), 1), out)
    found = {n: count for n, count in counts.items() if events.row_of(n).severity in ABOUT_SENSORS}
    if heard.armed_ns is None:
        return RoughDive(seed, c, False, found, (), (), None)
    return RoughDive(
        seed=seed,
        circumstances=c,
        armed=True,
        counts=found,
        failsafes=tuple(heard.failsafes),
        stops=tuple(_stops(heard, plan, [] if c.waves is None else lines_of(c.waves, seed))),
        errors=_errors(heard, c),
    )


def _script(plan: list[tuple[float, Move]]) -> str:
    rows = list[Row]()
    for begin, move in plan:
        rows += [(begin + after, sticks) for after, sticks in move.rows]
        rows.append((begin + move.seconds, HANDS_OFF))
    rows.append((3600.0, HANDS_OFF))
    return script(rows)


def _stops(heard: Heard, plan: list[tuple[float, Move]], sea: Sequence[WaveLine]) -> list[Stop]:
    assert heard.armed_ns is not None
    at = np.array([m.stamp_ns for m in heard.truth]) - heard.armed_ns
    depth = np.array([m.position[2] for m in heard.truth])
    heading = np.array([m.heading for m in heard.truth])
    asked_at = np.array([m.stamp_ns for m in heard.references]) - heard.armed_ns
    sinking = np.array([m.depth.velocity for m in heard.references])
    turning = np.array([m.heading.velocity for m in heard.references])
    found = list[Stop]()
    for begin, move in plan:
        t = begin + move.seconds
        quiet, asked = (
            (stamps >= t * SECOND) & (stamps < (t + QUIET_S) * SECOND) for stamps in (at, asked_at)
        )
        bounce = _past(depth[quiet], sinking[asked], MOVING)
        overshoot = _past(heading[quiet], turning[asked], TURNING)
        orbit = _orbit(sea, float(depth[quiet].mean()))
        found.append(Stop(move.kind, t, bounce, overshoot, orbit))
    return found


def _past(way: Floats, asked: Floats, least: float) -> float | None:
    """From the furthest point to where it settles, the mean of the last second, in the direction in
    which the reference moved last: a late link may have swallowed the sticks before.

    Args:
        asked: velocity of the reference; slower than `least` counts as rest.
    """
    moving = np.flatnonzero(np.abs(asked) > least)
    if not moving.size or moving[-1] >= len(asked) - 100:  # it never moved, or still does
        return None
    along = way * np.sign(asked[moving[-1]])
    return float(along.max() - along[-100:].mean())


def _orbit(sea: Sequence[WaveLine], depth: float) -> float:
    """[m] 2σ of how far the water itself goes up and down at a `depth` [m]."""
    sizes = [line.amplitude * exp(-line.wave_number * depth) for line in sea]
    return 2.0 * sqrt(sum(size * size for size in sizes) / 2.0)


def _errors(heard: Heard, c: Circumstances) -> Errors:
    assert heard.armed_ns is not None
    first = heard.armed_ns + round(SETTLED_S * SECOND)
    known = {m.stamp_ns: m for m in heard.truth}
    pairs = [
        (s, known[s.sensor_ns])
        for s in heard.states
        if s.sensor_ns >= first and s.sensor_ns in known
    ]

    def error(name: str, truth: Floats) -> tuple[Floats, Floats]:
        """Of the valid estimates, and over what they say of themselves."""
        each = [getattr(s, name) for s, _ in pairs]
        valid: NDArray[np.bool_] = np.array([e.valid for e in each])
        off = np.array([e.value for e in each])[valid] - truth[valid]
        return off, off / np.array([e.std for e in each])[valid]

    roll, pitch = _tilt(np.array([t.attitude for _, t in pairs]), c.misalignment)
    depth, depth_share = error("depth", np.array([t.position[2] for _, t in pairs]))
    rate, rate_share = error("depth_rate", np.array([t.depth_rate for _, t in pairs]))
    roll_off, roll_share = error("roll", roll)
    pitch_off, pitch_share = error("pitch", pitch)
    offset = float(np.median(depth))
    return Errors(
        depth=rms(depth - offset),
        depth_offset=offset,
        depth_rate=rms(rate),
        roll=rms(roll_off),
        pitch=rms(pitch_off),
        nees_depth=rms(depth_share) ** 2,
        nees_rate=rms(rate_share) ** 2,
        nees_tilt=(rms(roll_share) ** 2 + rms(pitch_share) ** 2) / 2.0,
        attitude=float(np.mean([s.roll.valid for s, _ in pairs])),
    )


def _tilt(q_NB: Floats, misalignment: Vec3) -> tuple[Floats, Floats]:
    """Roll and pitch [rad] of the axes that the IMU has, taken for the body's."""
    w, x, y, z = q_NB.T
    E = _turned(misalignment)
    # The last row of R_NB: down in body axes. In the IMU's, it is that times E.
    down = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1) @ E
    return np.arctan2(down[:, 1], down[:, 2]), -np.arcsin(np.clip(down[:, 0], -1.0, 1.0))


def rms(errors: Floats) -> float:
    return float(np.sqrt(np.mean(errors * errors)))
