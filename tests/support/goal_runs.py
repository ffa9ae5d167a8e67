"""What the control loop is held to, one function each: a dive of the whole chain, and what came
of it in metres, radians and seconds. Depths and headings are the simulator's truth, so that errors
of the sensors count; a constant offset of a sensor does not.
"""

from collections.abc import Sequence
from typing import NamedTuple, cast, get_args

import numpy as np
from numpy.typing import NDArray

from messages.pilot import FlightMode
from messages.simulator import FaultKind
from tests.support.sortie import DEEP, HANDS_OFF, Sortie, SortieRow, SortieSticks

# Random sticks.
HEAVE, YAW = (-1.0, -0.6, -0.3, 0.3, 0.6, 1.0), (-1.0, -0.5, 0.5, 1.0)
QUIET_S = 5.0  # [s] hands off after every move
STOPPING = 140  # samples of 10 ms: 1.4 s, after which the reference rests at the latest
LEAST, MOST = 1.5, 20.0  # [m] the pilot turns round here
FULL_HEAVE = 0.5  # [m/s] more than any vehicle's

DVL = ("simulator.dvl.rate=4.0", "simulator.dvl.std=0.01", "simulator.dvl.reach=100.0")
NEAR_FLOOR = "simulator.floor_depth=25"  # [m] in reach of every DVL
FLIGHT_MODES = cast(tuple[FlightMode, ...], get_args(FlightMode))
FULL = {"pioneer": 0.5, "bluerov2_heavy": 0.4, "minerva": 0.2}  # [m/s] at full heave stick
FLOOR = 2.0  # [m] where the floor is pushed
ROOM = 5.0  # [m] under the surface, to rise while the depth is not held


class ReleaseResult(NamedTuple):
    """A stick let go. Overshoot: from the furthest point to where it settles."""

    axis: str  # heave or yaw
    t: float  # [s] after arming
    horizontal: str  # surge and sway sticks: "centred" all the time, "kept" or "released" now
    overshoot: float  # [m] or [rad]
    by_estimate: float  # [m] or [rad] the same of a vehicle that would follow its estimate exactly


def random_sticks(
    seed: int, seconds: float
) -> tuple[list[SortieRow], list[tuple[float, SortieSticks, str]]]:
    """Moves of 1.5 to 4 s with five quiet seconds after each, in half of which surge and sway go
    on. The second list: when a move ended, its sticks, and what surge and sway did then."""
    rng = np.random.default_rng([seed, 7])
    rows: list[SortieRow] = []
    ends: list[tuple[float, SortieSticks, str]] = []
    t, depth = 1.0, 0.0
    while t < seconds:
        wait = float(rng.uniform(1.5, 4.0)) if rows else 4.0
        heave = float(rng.choice(HEAVE)) if rows else 1.0
        if not LEAST <= depth + FULL_HEAVE * heave * wait <= MOST:
            heave = -heave
        depth += FULL_HEAVE * heave * wait
        yaw = float(rng.choice(YAW))
        surge, sway = rng.uniform(-1.0, 1.0, 2).round(2).tolist()
        horizontal = str(rng.choice(["centred", "kept", "released"]))
        if horizontal == "centred":
            surge = sway = 0.0
        rows.append((t, (surge, sway, heave, yaw)))
        t += wait
        rows.append((t, (surge, sway, 0.0, 0.0) if horizontal == "kept" else HANDS_OFF))
        ends.append((t, (surge, sway, heave, yaw), horizontal))
        t += QUIET_S
    return rows, ends


def releases(
    seed: int, seconds: float = 60.0, vehicle: str = "pioneer", overrides: Sequence[str] = ()
) -> list[ReleaseResult]:
    """Every release of a dive with random sticks."""
    rows, ends = random_sticks(seed, seconds)
    over = ends[-1][0] + QUIET_S
    sortie = Sortie(rows, vehicle=vehicle, seed=seed, overrides=(DEEP, *overrides)).until(over)
    found: list[ReleaseResult] = []
    for t, (_, _, heave, yaw), horizontal in ends:
        quiet = sortie.columns(t, t + QUIET_S)
        off_depth, off_heading = sortie.estimate_errors(quiet, t)
        for axis, column, off, stick in (
            ("heave", quiet.depth, off_depth, heave),
            ("yaw", quiet.heading, off_heading, yaw),
        ):
            sign = np.sign(stick)
            past = _past(column * sign)
            found.append(ReleaseResult(axis, t, horizontal, past, _past(off[STOPPING:] * -sign)))
    return found


def _past(way: NDArray[np.float64]) -> float:
    """From the furthest point to where it settles, the mean of the last second."""
    return float(way.max()) - float(way[-100:].mean())


def buoyancy_step(seed: int, force: float, overrides: Sequence[str] = ()) -> float:
    """[m] Furthest from where the Pioneer was, in the 8 s after `force` [N] of buoyancy came."""
    rows: list[SortieRow] = [(1.0, (0.0, 0.0, 0.8, 0.0)), (6.0, HANDS_OFF)]
    sortie = Sortie(rows, seed=seed, overrides=(DEEP, *overrides)).until(14.0)
    sortie.become(f"vehicle.net_buoyancy={1.0 + force}")
    sortie.until(22.0)
    before = sortie.columns(11.0, 14.0).depth.mean()
    return float(np.abs(sortie.columns(14.0).depth - before).max())


class Push(NamedTuple):
    unsaturated: float  # [s] after the release, until every thruster is off its limit for good
    rebound: float  # [m] up from the floor, and at most from there
    steady: float  # [s] after the release, until the reference has come back to the vehicle


def floor_push(vehicle: str, seed: int, overrides: Sequence[str] = ()) -> Push:
    """Ten seconds of full heave stick on the sea floor, then hands off."""
    let_go = 1.0 + FLOOR / FULL[vehicle] + 2.0 + 10.0
    rows: list[SortieRow] = [(1.0, (0.0, 0.0, 1.0, 0.0)), (let_go, HANDS_OFF)]
    place = f"simulator.floor_depth={FLOOR}"
    sortie = Sortie(rows, vehicle=vehicle, seed=seed, overrides=(place, *overrides))
    sortie.until(let_go + 12.0)
    pushed, after = sortie.columns(let_go - 1.0, let_go), sortie.columns(let_go)
    error = after.wanted_depth - after.depth
    full = np.array([m.saturated for m in sortie.wrenches[-len(after.depth) :]])
    return Push(
        unsaturated=_last(full),
        rebound=float(pushed.depth.mean() - after.depth.min()),
        steady=_last(np.abs(error - error[-100:].mean()) > 0.05),
    )


def _last(true: NDArray[np.bool_]) -> float:
    """[s] When it was true for the last time."""
    return 0.01 * float(np.max(np.flatnonzero(true), initial=-1) + 1)


class HoldResult(NamedTuple):
    place: float  # [m] furthest from the mean place
    saturated: bool


def place_held(
    vehicle: str,
    north: float,
    seed: int,
    *,
    after: float = 60.0,
    seconds: float = 40.0,
    overrides: Sequence[str] = (NEAR_FLOOR,),
) -> HoldResult:
    """Station keeping in a current `north` [m/s]; measured from `after` [s] on."""
    rows: list[SortieRow] = [(1.0, (0.0, 0.0, 0.8, 0.0)), (6.0, HANDS_OFF)]
    current = f"simulator.current.north={north}"
    sortie = Sortie(rows, vehicle=vehicle, seed=seed, overrides=(current, *overrides))
    sortie.until(15.0).hold("station_keeping")
    sortie.until(15.0 + after + seconds)
    seen = sortie.columns(15.0 + after)
    held = sortie.references[-1].north is not None
    away = np.hypot(seen.north - seen.north.mean(), seen.east - seen.east.mean())
    return HoldResult(
        place=float(away.max()) if held else float("inf"),
        saturated=any(m.saturated for m in sortie.wrenches[-round(100 * seconds) :]),
    )


class Bump(NamedTuple):
    depth: float  # [m]
    heading: float  # [rad]


def mode_changes(
    vehicle: str, seed: int, changes: int = 8, overrides: Sequence[str] = (NEAR_FLOOR,)
) -> Bump:
    """The worst that a random sequence of modes does, hands off, to an axis held afterwards: how
    far its true error is, two seconds long, from what it was at the change."""
    rng = np.random.default_rng([seed, 11])
    down = ROOM / FULL[vehicle]
    rows: list[SortieRow] = [(1.0, (0.0, 0.0, 1.0, 0.0)), (1.0 + down, HANDS_OFF)]
    sortie = Sortie(rows, vehicle=vehicle, seed=seed, overrides=overrides).until(9.0 + down)
    worst = Bump(0.0, 0.0)
    for _ in range(changes):
        begin, now = len(sortie.references), sortie.flight_mode
        others: list[FlightMode] = [hold for hold in FLIGHT_MODES if hold != now]
        sortie.hold(others[int(rng.integers(len(others)))])
        sortie.until(sortie.t + float(rng.uniform(2.0, 3.0)))
        if sortie.flight_mode != now:  # a vehicle without a place refuses to keep one
            bump = _bump(sortie, begin)
            worst = Bump(max(worst.depth, bump.depth), max(worst.heading, bump.heading))
    return worst


def _bump(sortie: Sortie, begin: int) -> Bump:
    """Of the two seconds from this reference on."""
    known = {m.stamp_ns: m for m in sortie.truth}
    pairs = [(r, known[r.sensor_ns]) for r in sortie.references[begin:] if r.sensor_ns in known]
    depth = [r.depth.position - t.position[2] for r, t in pairs[:200] if r.heave_force is None]
    heading = [r.heading.position - t.heading for r, t in pairs[:200] if r.yaw_moment is None]
    return Bump(_spread(depth), _spread(heading))


def _spread(error: list[float]) -> float:
    """Furthest from the first."""
    return max((abs(e - error[0]) for e in error), default=0.0)


class Away(NamedTuple):
    depth: float  # [m] furthest
    heading: float  # [rad] furthest
    left: float  # [rad] of the heading in the end


def dead_thruster(part: str, seed: int) -> Away:
    """From depth and heading of a BlueROV2 that loses a thruster while it runs ahead."""
    rows: list[SortieRow] = [
        (1.0, (0.0, 0.0, 1.0, 0.0)),
        (8.0, HANDS_OFF),
        (16.0, (0.6, 0.0, 0.0, 0.0)),
        (26.0, HANDS_OFF),
    ]
    sortie = Sortie(rows, vehicle="bluerov2_heavy", seed=seed).until(20.0)
    sortie.set_faults(part, "dead")
    sortie.until(32.0)
    before, after = sortie.columns(18.0, 20.0), sortie.columns(20.0)
    turned = np.abs(after.heading - before.heading.mean())
    return Away(
        depth=float(np.abs(after.depth - before.depth.mean()).max()),
        heading=float(turned.max()),
        left=float(turned[-100:].mean()),
    )


def lost_sensor(part: str, fault: FaultKind, seed: int) -> float:
    """[N] By which the thrust of the Pioneer changes at most from its mean, hands off, in the 15 s
    after a sensor is lost."""
    rows: list[SortieRow] = [(1.0, (0.0, 0.0, 1.0, 0.0)), (6.0, HANDS_OFF)]
    sortie = Sortie(rows, seed=seed).until(16.0)
    sortie.set_faults(part, fault)
    sortie.until(31.0)
    before, after = sortie.columns(12.0, 16.0).thrust, sortie.columns(16.0).thrust
    return float(np.abs(after - before.mean(axis=0)).max())
