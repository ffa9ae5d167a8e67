"""What the control loop is held to, beside its limits: dives of the whole chain on virtual time.

A few seeds each, so that it takes a minute; research/long/stops.py flies a hundred.
"""

from collections.abc import Iterable
from functools import partial
from math import degrees

from lindy_research.bench.table import Figure
from messages.simulator import FaultKind
from tests.support.goal_runs import (
    DVL,
    NEAR_FLOOR,
    ReleaseResult,
    buoyancy_step,
    dead_thruster,
    floor_push,
    lost_sensor,
    mode_changes,
    place_held,
    releases,
    still,
)
from tools.sweep.all_cores import in_order

SEEDS = range(3)
FINE = ("simulator.pressure_std=100", "estimation.depth.pressure_std=100")  # [Pa]
MINERVA_CURRENT = -1.0  # [m/s] from ahead; 455 of her 480 N with the umbilical's share
BLUEROV_CURRENT = -0.6  # [m/s] from ahead; 59 of 86 N
LOST: tuple[tuple[str, str, FaultKind, float], ...] = (  # the last is the limit [N]
    ("pressure sensor silent", "sensor/pressure", "silent", 3.5),
    ("pressure sensor frozen", "sensor/pressure", "frozen", 3.5),
    ("compass frozen", "sensor/magnetometer", "frozen", 3.5),
    ("IMU frozen", "sensor/imu", "frozen", 12.0),
)
BY_HEAD, BY_SIDE = "front_starboard", "vertical_front_port"  # thrusters that die


def figures() -> list[Figure]:
    return [
        *_stops(),
        *_disturbed(),
        *_on_the_floor(),
        *_places(),
        *_at_rest(),
        *_modes(),
        *_broken(),
    ]


def _stops() -> Iterable[Figure]:
    found = [release for dive in in_order(_coarse, SEEDS) for release in dive]
    note = f"worst of {len(SEEDS)} dives, random sticks; "
    alone = note + "surge and sway centred"
    yield _mm("bounce back at release", _worst(found, "heave", "centred"), 30.0, alone)
    yield _deg("heading overshoot at release", _worst(found, "yaw", "centred"), 1.0, alone)
    fine = [release for dive in in_order(_fine, SEEDS[:2]) for release in dive]
    heave = max(r.overshoot for r in fine if r.axis == "heave")
    yield _mm("bounce back, sensor of 1 mbar", heave, 30.0, "all sticks, 2 dives")
    beside = "surge or sway let go at once or kept: it pitches by up to 20°; not judged"
    sides = ("kept", "released")
    heave = max(_worst(found, "heave", side) for side in sides)
    yaw = max(_worst(found, "yaw", side) for side in sides)
    yield _mm("bounce back, all sticks", heave, 30.0, beside, judged=False)
    yield _deg("heading overshoot, all sticks", yaw, 1.0, beside, judged=False)


def _coarse(seed: int) -> list[ReleaseResult]:
    return releases(seed, 45.0)


def _fine(seed: int) -> list[ReleaseResult]:
    return releases(seed, 45.0, overrides=FINE)


def _worst(found: list[ReleaseResult], axis: str, side: str) -> float:
    sizes = [r.overshoot for r in found if r.axis == axis and r.horizontal == side]
    return max(sizes, default=0.0)


def _disturbed() -> Iterable[Figure]:
    worst = max(buoyancy_step(seed, force) for seed in SEEDS[:2] for force in (-10.0, 10.0))
    note = "worst of 4 dives, noise of a 5 mbar sensor in it"
    yield _mm("±10 N of buoyancy, furthest", worst, 50.0, note)


def _on_the_floor() -> Iterable[Figure]:
    for vehicle in ("pioneer", "bluerov2_heavy", "minerva"):
        push = floor_push(vehicle, 0)
        name = f"{vehicle}: 10 s on the sea floor"
        yield _mm(f"{name}, rebound", push.rebound, 50.0, "")
        note = f"the reference has come to the vehicle after {push.steady:.1f} s"
        yield _figure(f"{name}, off the limit", push.unsaturated, 1.0, "s", note)


def _places() -> Iterable[Figure]:
    minerva = place_held("minerva", MINERVA_CURRENT, 0, after=60.0, seconds=20.0)
    note = "DVL and USBL, bow into the current, once settled; 455 of 480 N"
    yield _figure("minerva: place in 1 m/s", minerva.place, 0.3, "m", note)
    rov = place_held("bluerov2_heavy", BLUEROV_CURRENT, 0, after=30.0, overrides=(NEAR_FLOOR, *DVL))
    note = "with a DVL of 4 Hz; 1 m/s would take 155 N of the 86 N there are"
    yield _figure("bluerov2_heavy: place in 0.6 m/s", rov.place, 0.3, "m", note)


def _at_rest() -> Iterable[Figure]:
    for vehicle in ("pioneer", "bluerov2_heavy"):
        held = still(vehicle, 0, 40.0)
        name, note = f"{vehicle}: thruster starts at rest", "of the busiest; dead-band and noise"
        yield Figure(section="control", name=name, unit="1/min", ours=held.starts, note=note)
        yield _mm(f"{vehicle}: depth at rest, furthest", held.depth, 50.0, "noise of the sensor")
        yield _deg(
            f"{vehicle}: heading at rest, range",
            held.heading,
            1.0,
            "what dead-bands and sensors leave",
        )


def _modes() -> Iterable[Figure]:
    for vehicle in ("pioneer", "minerva"):
        bumps = in_order(partial(mode_changes, vehicle), SEEDS)
        note = "3 random sequences of 8, noise in it"
        yield _mm(f"{vehicle}: mode change, depth", max(b.depth for b in bumps), 20.0, note)
        yield _deg(f"{vehicle}: mode change, heading", max(b.heading for b in bumps), 0.5, note)


def _broken() -> Iterable[Figure]:
    for part in (BY_HEAD, BY_SIDE):
        away = dead_thruster(part, 0)
        name = f"bluerov2_heavy: {part} dies under way"
        yield _mm(f"{name}, depth", away.depth, 50.0, "furthest in 12 s")
        note = f"furthest in 12 s; {degrees(away.left):.1f}° in the end"
        yield Figure(
            section="control", name=f"{name}, heading", unit="deg", ours=degrees(away.heading),
            note=note,
        )  # fmt: skip
    note = "largest change of any thruster in 15 s, hands off; a tenth of its strength"
    for name, part, fault, limit in LOST:
        yield _figure(name, lost_sensor(part, fault, 0), limit, "N", note)


def _mm(name: str, metres: float, limit: float, note: str, *, judged: bool = True) -> Figure:
    return _figure(name, 1e3 * metres, limit, "mm", note, judged=judged)


def _deg(name: str, radians: float, limit: float, note: str, *, judged: bool = True) -> Figure:
    return _figure(name, degrees(radians), limit, "deg", note, judged=judged)


def _figure(
    name: str, ours: float, limit: float, unit: str, note: str, *, judged: bool = True
) -> Figure:
    return Figure(
        section="control",
        name=name,
        unit=unit,
        ours=ours,
        baseline_name="limit",
        baseline=limit,
        goal=1.0 if judged else None,
        note=note,
    )
