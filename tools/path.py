"""`lindy path`: a path of lines and clothoids through waypoints, and the motion along it; `lindy
profile`: one motion of the reference model of Fernandes et al. 2015."""

import json
from collections.abc import Iterator
from math import ceil, exp, isfinite
from typing import Annotated, Any, Literal

import msgspec
from cyclopts import Parameter

from messages.units import PathQuantity
from services.reference.paths.path import Kind, Path, RoutePoint
from services.reference.paths.turn import SmoothTurn, Turn
from services.reference.trajectory.minimum_jerk import Limits, MotionProfile
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import deploy_file, read
from tools.generators.route import MotionLaw, Route, TwinClothoids, furthest, route, stretch

MOST_ROWS = 10_000_000
Step = Annotated[float | None, Parameter(help="[s] between samples, for the reference")]


class PlannedPathFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The keys of a path file. Only the waypoints are required."""

    waypoints: list[list[float]]  # [m] [north, east] or [north, east, down]
    min_radius: PathQuantity = 5.0  # [m] of every turn
    kind: Kind = "approximating"  # or "interpolating": visit every way-point
    smooth_yaw: bool = False  # turns with a continuous yaw acceleration instead of clothoids
    cruise: PathQuantity = 0.3  # [m/s]
    speeds: list[PathQuantity] = []  # [m/s] of each part, instead of `cruise`
    model: Literal["mjvr", "fernandes"] = "mjvr"  # how the speed changes
    acceleration: PathQuantity = 0.15  # [m/s²] mjvr: at most
    jerk: PathQuantity = 0.3  # [m/s³] mjvr: at most
    accel_time: PathQuantity = 20.0  # [s] fernandes: T_a
    decel_time: PathQuantity = 20.0  # [s] fernandes: T_d
    epsilon: float = 0.05  # [-] fernandes: ε_L
    theta_a: float = 0.8  # [-] fernandes
    theta_d: float = 0.2  # [-] fernandes
    theta_0: float = exp(-100 / 9)  # [-] fernandes
    xi: float = 15.0  # [-] fernandes: ξ_a = ξ_d


def path(file: str, /, *, dt: Step = None) -> int:
    """Print a path (JSON), or the reference along it (CSV).

    FILE is a TOML file or a name in deploy/paths. Keys: waypoints, min_radius, kind, smooth_yaw;
    cruise, speeds; model, acceleration, jerk, accel_time, decel_time, epsilon, theta_a, theta_d,
    theta_0, xi.

    Without --dt: the parts with their lengths, the total, the greatest curvature, the duration.
    With --dt: position, velocity and acceleration, world and body, from the start to the first
    sample at or after the arrival. Angles in rad, distances along the path in the horizontal plane.

    Example: lindy path deploy/paths/fernandes.toml --dt 0.15
    """
    source = deploy_file("paths", file)
    settings = read(source, PlannedPathFile)
    try:
        planned_route = planned(settings)
    except ValueError as error:
        raise LindyError(f"{source}: {error}") from None
    if dt is None:
        print(shown(settings, planned_route))
        return 0
    steps = rows(planned_route.duration, dt)
    print(",".join(RoutePoint._fields))
    for line in samples(planned_route, steps, dt):
        print(line)
    return 0


def planned(file: PlannedPathFile) -> Route:
    """
    Raises:
        ValueError: the file asks for a path that is not possible.
    """
    path = Path.through(file.waypoints, file.min_radius, file.kind, turns_of(file.smooth_yaw))
    return route(path, motion(file), file.speeds or [file.cruise])


def turns_of(smooth_yaw: bool) -> type[Turn]:
    """The shape of the turns."""
    return SmoothTurn if smooth_yaw else TwinClothoids


def motion(file: PlannedPathFile) -> MotionLaw:
    """How the speed changes."""
    limits = Limits(file.jerk, file.acceleration)

    def bounded(length: float, cruise: float, initial: float, final: float) -> MotionProfile:
        return stretch(length, limits, cruise, initial, final)

    if file.model == "mjvr":
        return bounded
    from tools.generators.fernandes import MotionRequest, plan

    def fernandes(length: float, cruise: float, initial: float, final: float) -> MotionProfile:
        return plan(
            MotionRequest(
                length=length,
                cruise=cruise,
                initial=initial,
                final=final,
                accel_time=file.accel_time,
                decel_time=file.decel_time,
                epsilon=file.epsilon,
                theta_a=file.theta_a,
                theta_d=file.theta_d,
                theta_0=file.theta_0,
                xi_a=file.xi,
                xi_d=file.xi,
            )
        )

    return fernandes


def shown(file: PlannedPathFile, route: Route) -> str:
    """The path as JSON: lengths in m, duration in s."""
    parts = [
        {
            "kind": part.kind,
            "length": part.length,
            "start": list(part.at(0.0)[:2]),
            "end": list(part.at(part.length)[:2]),
        }
        for part in route.path.parts
    ]
    about: dict[str, Any] = {
        "lengths": [part.length for part in route.path.parts],
        "total": route.path.length,
        "parts": parts,
        "max_curvature": route.path.max_curvature,
        "duration": route.duration,
        "smooth_yaw": file.smooth_yaw,
        "smooth_yaw_deviation": smooth_yaw_deviation(file),
    }
    return json.dumps(about, allow_nan=False)


def smooth_yaw_deviation(file: PlannedPathFile) -> float | None:
    """[m] How far the path with smooth turns is from the one with clothoids: the price of a C2 yaw
    reference, whichever of the two was asked for. None where only one of them has room."""
    try:
        smooth, clothoids = (
            Path.through(file.waypoints, file.min_radius, file.kind, turns_of(smooth_yaw))
            for smooth_yaw in (True, False)
        )
    except ValueError:
        return None
    return furthest(smooth, clothoids)


def samples(route: Route, steps: int, dt: float) -> Iterator[str]:
    """CSV lines, one per step of `dt` [s] from 0 to the first one at or after the arrival."""
    for k in range(steps + 1):
        yield ",".join(map(repr, route.at(k * dt)))


def rows(duration: float, dt: float) -> int:
    """How many steps of `dt` [s] reach the arrival after `duration` [s].

    Raises:
        LindyError: dt is no step for this motion.
    """
    if not (isfinite(dt) and dt > 0):
        raise LindyError(f"--dt is {dt}, expected more than 0 s")
    steps = duration / dt
    if steps > MOST_ROWS:
        raise LindyError(f"--dt {dt} gives {steps:.3g} rows, expected at most {MOST_ROWS}")
    return ceil(steps)


def profile(
    length: float, cruise: float, accel_time: float, decel_time: float, /, *, dt: Step = None
) -> int:
    """Print one motion of the reference model.

    From rest to rest, with the paper's usual tuning: its numbers (JSON), or its samples (CSV).

    Example: lindy profile 50 0.3 20 20 --dt 0.1

    Without --dt: v_m, v_c, a_m, d_m, the ends of the five phases in time (t) and position (P).
    With --dt: t,p,v,a from the start to the first sample at or after the arrival.

    Args:
        length: [m] or [rad]; negative goes backwards.
        cruise: per s; negative goes backwards. Lower where the length does not allow it.
        accel_time: [s] from 0 to cruise.
        decel_time: [s] from cruise to 0.
    """
    from tools.generators.fernandes import MotionRequest, plan

    try:
        motion = plan(MotionRequest(length, cruise, accel_time, decel_time))
    except ValueError as error:
        raise LindyError(str(error)) from error
    if dt is None:
        named = {name: getattr(motion, name) for name in ("v_m", "v_c", "a_m", "d_m", "t", "P")}
        print(json.dumps(named, allow_nan=False))
        return 0
    steps = rows(motion.duration, dt)
    print("t,p,v,a")
    for k in range(steps + 1):
        here = motion.at(k * dt)
        print(f"{k * dt!r},{here.position!r},{here.velocity!r},{here.acceleration!r}")
    return 0
