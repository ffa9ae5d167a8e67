"""`lindy profile`: one motion of the reference model of Fernandes et al. 2015, from the shell."""

import json
from math import ceil, exp, isfinite

from services.runtime.config.errors import LindyError

MOST_ROWS = 10_000_000


def profile(
    *,
    length: float,
    cruise: float,
    accel_time: float,
    decel_time: float,
    initial: float = 0.0,
    final: float = 0.0,
    epsilon: float = 0.05,
    theta_a: float = 0.8,
    theta_d: float = 0.2,
    theta_0: float = exp(-100 / 9),
    xi: float = 15.0,
    dt: float | None = None,
) -> int:
    """Print one motion of the reference model.

    Speed up, cruise, slow down: its numbers (JSON), or its samples (CSV).

    Example: lindy profile --length 50 --cruise 0.3 --accel-time 20 --decel-time 20 --dt 0.1

    Without --dt: v_m, v_c, a_m, d_m, the ends of the five phases in time (t) and position (P).
    With --dt: t,p,v,a from the start to the first sample at or after the arrival.

    Args:
        length: [m] or [rad]; negative goes backwards.
        cruise: per s; negative goes backwards. Lower where the length does not allow it.
        accel_time: [s] from 0 to cruise.
        decel_time: [s] from cruise to 0.
        initial: per s, 0 to cruise.
        final: per s, 0 to cruise.
        epsilon: least fraction of the length at constant speed, 0 to 0.1.
        theta_a: speed fraction at which the acceleration fades out, 0.6 to below 1.
        theta_d: speed fraction at which the deceleration fades out, above 0 to 0.4.
        theta_0: where the exponentials are cut off, 1e-6 to 1e-3.
        xi: steepness of the start of both, 10 to 15.
        dt: [s] between samples.
    """
    from tools.generators.fernandes import MotionRequest, plan

    request = MotionRequest(
        length=length,
        cruise=cruise,
        accel_time=accel_time,
        decel_time=decel_time,
        initial=initial,
        final=final,
        epsilon=epsilon,
        theta_a=theta_a,
        theta_d=theta_d,
        theta_0=theta_0,
        xi_a=xi,
        xi_d=xi,
    )
    try:
        motion = plan(request)
    except ValueError as error:
        raise LindyError(str(error)) from error
    if dt is None:
        shown = {name: getattr(motion, name) for name in ("v_m", "v_c", "a_m", "d_m", "t", "P")}
        print(json.dumps(shown, allow_nan=False))
        return 0
    steps = rows(motion.duration, dt)
    print("t,p,v,a")
    for k in range(steps + 1):
        here = motion.at(k * dt)
        print(f"{k * dt!r},{here.position!r},{here.velocity!r},{here.acceleration!r}")
    return 0


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
