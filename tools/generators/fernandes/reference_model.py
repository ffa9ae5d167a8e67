"""The reference model of Fernandes et al. 2015: speed up, cruise, slow down, along one coordinate.

Basic version (1)-(48) and advanced version (49)-(79) are one: the basic version is the advanced
one from rest to rest. Two things differ from the print:

- T1 = (ξ_a − e^−ξ_a) τ11 and T4 = (ξ_d − e^−ξ_d) τ31, for which (27), (28) and (41) were derived;
  the printed (39), (42) miss the end by up to 2e-5 m in 50 m. `model_as_printed` keeps the print.
- The cruise speed, "numerically determined" there, is the larger root of a quadratic.

What remains by design are small steps, in the acceleration a_m e^−ξ at t1 and t4 and θ0 a_m at t2
and t5, in the velocity (1 − θ_a) θ0 |v_m − v_i| at t2, θ_d θ0 |v_m − v_f| at t5 and a_m τ e^−2ξ at
t1 and t4, in the position a_m τ² e^−2ξ at t1 and t4 (τ: τ11, τ31; a_m: d_m for the slowing down).
"""

from bisect import bisect_right
from dataclasses import dataclass
from itertools import accumulate
from math import exp, isfinite, log

from services.reference.trajectory.minimum_jerk import Sample
from tools.generators.fernandes.model_cruise import cruise_speed
from tools.generators.fernandes.model_phases import Cruise, Pull, Settle, SpeedChange
from tools.generators.fernandes.model_request import MotionRequest

Five = tuple[float, float, float, float, float]
Phases = tuple[Pull, Settle, Cruise, Pull, Settle]


@dataclass(frozen=True, slots=True)
class ReferenceModel:
    """The motion, a `Profile`. Signs are those of the motion: all P are negative backwards."""

    length: float  # where it ends
    v_i: float  # initial velocity
    v_f: float  # final velocity
    v_m: float  # cruise velocity
    v_c: float  # cruise speed the length allows, > 0
    a_m: float  # acceleration of the speeding up
    d_m: float  # acceleration of the slowing down
    phases: Phases
    t: Five  # [s] t1 … t5, ends of the phases
    P: Five  # P1 … P5, positions there; P5 = length

    @property
    def duration(self) -> float:
        """[s] From start to arrival, t5."""
        return self.t[4]

    def at(self, t: float) -> Sample:
        """Position, velocity, acceleration, jerk at `t` [s]; constant velocity outside 0 … t5.

        Raises:
            ValueError: `t` is not finite.
        """
        if not isfinite(t):
            raise ValueError(f"time is {t}, expected a finite number of seconds")
        if t < 0:
            return Sample(self.v_i * t, self.v_i, 0.0, 0.0)
        ended = bisect_right(self.t, t)
        if ended == len(self.t):
            return Sample(self.length + self.v_f * (t - self.duration), self.v_f, 0.0, 0.0)
        begin, start = (self.t[ended - 1], self.P[ended - 1]) if ended else (0.0, 0.0)
        here = self.phases[ended].at(t - begin)
        return here._replace(position=start + here.position)


def plan(request: MotionRequest) -> ReferenceModel:
    """The motion for a request.

    Raises:
        ValueError: a value is not allowed, or the length is too short to change from the initial
            to the final speed; the sentence says what would do.
    """
    request.check()
    up, down = speed_changes(request)
    return model(request, up, down, cruise_speed(request, up, down))


def speed_changes(request: MotionRequest) -> tuple[SpeedChange, SpeedChange]:
    """How this request speeds up and slows down."""
    r, speed = request, abs(request.cruise)
    return (
        speed_change(speed / r.accel_time, r.theta_a, r.xi_a, r.theta_0, r.xi_a - exp(-r.xi_a)),
        speed_change(speed / r.decel_time, 1 - r.theta_d, r.xi_d, r.theta_0, r.xi_d - exp(-r.xi_d)),
    )


def speed_change(
    rate: float, share: float, xi: float, theta_0: float, pull_in_taus: float
) -> SpeedChange:
    """From (65)-(72), with T1 or T4 = pull_in_taus · τ."""
    tau = share / (xi - 1)
    pull, settle = pull_in_taus * tau, -log(theta_0) * (1 - share)
    gain = pull * pull / 2 - tau * pull + tau * tau * (1 - exp(-xi))
    bend = gain - (1 - share) ** 2 * (1 - theta_0)
    return SpeedChange(rate, share, xi, theta_0, pull, settle, pull - bend, settle + bend)


def model(request: MotionRequest, up: SpeedChange, down: SpeedChange, v_c: float) -> ReferenceModel:
    """Speed up, cruise, slow down, so that the length comes out, (73)-(79)."""
    sign = request.direction
    v_i, v_m, v_f = abs(request.initial), min(abs(request.cruise), v_c), abs(request.final)
    left = abs(request.length) - up.distance(v_i, v_m) - down.distance(v_m, v_f)
    cruise = Cruise(max(0.0, left) / v_m, sign * v_m)  # below 0 by rounding only
    speeding_up, slowing_down = (
        up.phases(sign * v_i, sign * v_m),
        down.phases(sign * v_m, sign * v_f),
    )
    return assembled(request, v_c, (*speeding_up, cruise, *slowing_down))


def assembled(request: MotionRequest, v_c: float, phases: Phases) -> ReferenceModel:
    """Times and positions from the phases, (44)-(48)."""
    sign = request.direction
    return ReferenceModel(
        length=sign * abs(request.length),
        v_i=sign * abs(request.initial),
        v_f=sign * abs(request.final),
        v_m=phases[2].v,
        v_c=v_c,
        a_m=sign * abs(request.cruise) / request.accel_time,
        d_m=-sign * abs(request.cruise) / request.decel_time,
        phases=phases,
        t=_sums([phase.duration for phase in phases]),
        P=_sums([phase.length for phase in phases]),
    )


def _sums(values: list[float]) -> Five:
    one, two, three, four, five = accumulate(values)
    return one, two, three, four, five
