"""A stick log whose manoeuvres make a vehicle's numbers visible, and how much water it needs.

On the axis in question the stick is a force, and the drone holds the others: heave in the mode
heading_hold, yaw in depth_hold, surge and sway in stabilised. Each manoeuvre is a force one way,
the same the other way for twice as long, and the first again, so that the drone comes back; then a
pause in which it coasts. It is done with two forces, which tells linear from quadratic drag.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple, get_args

from messages.pilot import FlightMode
from messages.units import Vec6
from services.control.allocation import Allocation
from services.control.axis.plant import Plant, plant_of
from services.marine.vehicle import Vehicle
from services.reference.settings import Settings, StickForce
from services.runtime.config.errors import LindyError

PlanAxis = Literal["heave", "yaw", "surge", "sway"]
AXES: tuple[PlanAxis, ...] = get_args(PlanAxis)
ROW: dict[PlanAxis, int] = {"surge": 0, "sway": 1, "heave": 2, "yaw": 5}
MODE: dict[PlanAxis, FlightMode] = {
    "heave": "heading_hold",
    "yaw": "depth_hold",
    "surge": "stabilised",
    "sway": "stabilised",
}
STRENGTHS = (1.0, 0.55)  # [-] of the strongest manoeuvre
LEAST_S, MOST_S = 0.8, 6.0  # [s] of a force beyond its ramp
PAUSE_S = 2.0  # [s] of coasting
BACK_S = 3.0  # [s] more than the way back to the middle depth takes
SETTLE_S = 3.0  # [s] at the depth before the first manoeuvre
ROOM = 0.7  # [-] of the thrusters: the rest is for holding the other axes
MARGIN = 1.4  # [-] the vehicle is not yet known
CLEAR = 0.5  # [m] between hull and surface
STEP_S = 0.01  # [s] of the prediction


class PlanRow(NamedTuple):
    at: float  # [s]
    axis: PlanAxis | None
    stick: float  # [-] of that axis
    event: str


class Manoeuvres(NamedTuple):
    """What to fly."""

    rows: tuple[PlanRow, ...]
    seconds: float
    depth: float  # [m] around which it happens
    up: float  # [m] shallower than that, at most
    down: float  # [m] deeper
    ahead: float  # [m] each way, forward and back
    sideways: float  # [m] each way


def plan(
    vehicle: Vehicle,
    reference: Settings,
    axes: Sequence[PlanAxis],
    depth: float,
    strength: float = 1.0,
) -> Manoeuvres:
    """
    Args:
        depth: [m] of the origin, in the middle of the manoeuvres.
        strength: [-] of full stick.

    Raises:
        LindyError: the manoeuvres do not fit between the surface and the depth limit, or an axis
            has no thrust.
    """
    rows = [PlanRow(0.0, None, 0.0, ""), PlanRow(1.0, None, 0.0, f"goto depth={depth:g}")]
    at = 1.0 + _descent(depth, reference) + SETTLE_S
    reach: dict[PlanAxis, tuple[float, float]] = {}
    for axis in axes:
        force = _force(reference, axis)
        most = strength * _unsaturated(vehicle, axis, force.full)
        plant = plant_of(vehicle, ROW[axis])
        floats = vehicle.net_buoyancy if axis == "heave" else 0.0
        for share in STRENGTHS:
            stick = round(share * most, 3)
            seconds = _pulse(plant, stick, force)
            steps = [(stick, seconds), (-stick, 2 * seconds), (stick, seconds), (0.0, PAUSE_S)]
            rows.append(PlanRow(round(at, 2), None, 0.0, f"mode {MODE[axis]}"))
            at += 0.2
            low, high = _excursion(plant, force, steps, floats)
            before = reach.get(axis, (0.0, 0.0))
            reach[axis] = min(before[0], low), max(before[1], high)
            for value, lasts in steps:
                rows.append(PlanRow(round(at, 2), axis, value, ""))
                at += lasts
            if axis == "heave":
                rows.append(PlanRow(round(at, 2), None, 0.0, "mode stabilised"))
                at += 2.0
                rows.append(PlanRow(round(at, 2), None, 0.0, f"goto depth={depth:g}"))
                at += _descent(max(-low, high), reference) + BACK_S
    rows.append(PlanRow(round(at, 2), None, 0.0, "mode stabilised"))
    rows.append(PlanRow(round(at + 1.0, 2), None, 0.0, ""))
    low, high = reach.get("heave", (-0.2, 0.2))
    found = Manoeuvres(
        tuple(rows), at + 1.0, depth, -MARGIN * low, MARGIN * high,
        *[MARGIN * max(map(abs, reach.get(axis, (0.0, 0.3)))) for axis in ("surge", "sway")],
    )  # fmt: skip
    least = found.up + vehicle.size[2] + CLEAR
    if depth < least:
        raise LindyError(
            f"--depth is {depth:g}, but the manoeuvres go up to {found.up:.1f} m above it and the "
            f"drone must stay under water; expected at least {least:.1f} m, or a smaller --strength"
        )
    most = reference.failsafe.depth_limit - found.down
    if depth > most:
        raise LindyError(
            f"--depth is {depth:g}, but the manoeuvres go down to {found.down:.1f} m below it and "
            f"reference.failsafe.depth_limit is {reference.failsafe.depth_limit:g} m; expected at "
            f"most {most:.1f} m, or a smaller --strength"
        )
    return found


def as_csv(found: Manoeuvres, vehicle: Vehicle) -> str:
    """The stick log."""
    lines = [
        f"# Manoeuvres to identify {vehicle.name}: {told(found)}",
        "t,surge,sway,heave,yaw,event",
    ]
    for row in found.rows:
        sticks = [
            f"{row.stick if row.axis == name else 0.0:g}"
            for name in ("surge", "sway", "heave", "yaw")
        ]
        lines.append(",".join([f"{row.at:g}", *sticks, row.event]))
    return "\n".join(lines) + "\n"


def told(found: Manoeuvres) -> str:
    """How much water and time it needs."""
    return (
        f"{found.seconds:.0f} s; depths {found.depth - found.up:.1f} to "
        f"{found.depth + found.down:.1f} m; {found.ahead:.1f} m forward and back, "
        f"{found.sideways:.1f} m to each side"
    )


def _force(reference: Settings, axis: PlanAxis) -> StickForce:
    """Of the full stick."""
    h = reference.horizontal
    match axis:
        case "heave":
            return reference.heave_force
        case "yaw":
            return reference.yaw_moment
        case "surge":
            return StickForce(h.max_surge, h.max_rate, h.max_rate_change)
        case "sway":
            return StickForce(h.max_sway, h.max_rate, h.max_rate_change)


def _unsaturated(vehicle: Vehicle, axis: PlanAxis, full: float) -> float:
    """[-] The share of full stick that leaves the thrusters room for holding the other axes."""
    most = 0.0
    for tenths in range(1, 11):
        wrench = [0.0] * 6
        wrench[ROW[axis]] = tenths / 10 * full / ROOM
        x, y, z, k, m, n = wrench
        both: list[Vec6] = [(x, y, z, k, m, n), (-x, -y, -z, -k, -m, -n)]
        if axis not in Allocation(vehicle).axes:
            raise LindyError(f"--axes: the thrusters of {vehicle.name} cannot drive {axis}")
        if any(Allocation(vehicle).allocate(w).saturated for w in both):
            break
        most = tenths / 10
    if most == 0.0:
        raise LindyError(f"--axes: {axis} saturates the thrusters at a tenth of full stick already")
    return most


def _pulse(plant: Plant, stick: float, force: StickForce) -> float:
    """[s] Of the first force: its ramp, and the time in which it gives its speed."""
    push, speed = stick * force.full, 0.0
    low, high = 0.0, push / max(plant.linear, 1e-9)
    for _ in range(60):
        speed = (low + high) / 2
        low, high = (speed, high) if plant.drag(speed) < push else (low, speed)
    ramp = push / force.max_rate + force.max_rate / force.max_rate_change
    rises = 1.4 * plant.inertia * speed / push
    return round(ramp + min(MOST_S, max(LEAST_S, rises)), 2)


def _descent(way: float, reference: Settings) -> float:
    """[s] For a way [m] of goto."""
    heave = reference.heave
    return round(way / heave.max_velocity + 2.0 * heave.max_velocity / heave.max_acceleration, 1)


def _excursion(
    plant: Plant, force: StickForce, steps: Sequence[tuple[float, float]], floats: float
) -> tuple[float, float]:
    """[m, rad] Least and most of the position."""
    x = v = f = low = high = 0.0
    for stick, seconds in steps:
        for _ in range(round(seconds / STEP_S)):
            most = force.max_rate * STEP_S
            f += max(-most, min(most, stick * force.full - f))
            v += STEP_S * (f - floats - plant.drag(v)) / plant.inertia
            x += STEP_S * v
            low, high = min(low, x), max(high, x)
    return low, high
