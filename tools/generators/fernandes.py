"""The reference model of Fernandes et al. 2015: speed up, cruise, slow down, along one coordinate.

Basic version (1)-(48) and advanced version (49)-(79) are one: the basic version is the advanced
one from rest to rest. Two things differ from the print:

- T1 = (ξ_a − e^−ξ_a) τ11 and T4 = (ξ_d − e^−ξ_d) τ31, for which (27), (28) and (41) were derived;
  the printed (39), (42) miss the end by up to 2e-5 m in 50 m. `model_as_printed` keeps the print.
- The cruise speed, "numerically determined" there, is the larger root of a quadratic.

What remains by design are small steps, in the acceleration a_m e^−ξ at t1 and t4 and θ0 a_m at t2
and t5, in the velocity (1 − θ_a) θ0 |v_m − v_i| at t2, θ_d θ0 |v_m − v_f| at t5 and a_m τ e^−2ξ at
t1 and t4, in the position a_m τ² e^−2ξ at t1 and t4 (τ: τ11, τ31; a_m: d_m for the slowing down).

Any position unit, seconds, signs of the real motion. A change of speed is a `Pull`, in which the
acceleration fades in, and a `Settle`, in which it fades out. Between two there is a `Cruise`.
"""

from bisect import bisect_right
from dataclasses import dataclass
from itertools import accumulate
from math import copysign, exp, isfinite, log, sqrt
from typing import NamedTuple

from services.reference.trajectory.minimum_jerk import Sample

SMALLEST, LARGEST = 1e-9, 1e9  # of every length, speed and time: beyond, floats lose the motion
MARGIN = 1e-5  # relative; a limit that is quoted is still feasible after rounding to 6 digits


@dataclass(frozen=True, slots=True)
class MotionRequest:
    """One motion along a line (Table 1). Metres or radians; a motion backwards has a negative
    cruise velocity (as in the paper), a negative length, or both.

    Speeds between 0 and `cruise` have its sign.
    """

    length: float  # L, ≠ 0
    cruise: float  # V_d, per s, ≠ 0; reached where the length allows it
    accel_time: float  # T_a [s] > 0 from 0 to cruise, at least
    decel_time: float  # T_d [s] > 0 from cruise to 0, at least
    initial: float = 0.0  # V_i, per s, 0 to cruise
    final: float = 0.0  # V_f, per s, 0 to cruise
    epsilon: float = 0.05  # ε_L [-] 0 to 0.1, least fraction of the length at constant speed
    theta_a: float = 0.8  # θ_a [-] 0.6 to < 1, speed fraction at which the acceleration fades out
    theta_d: float = 0.2  # θ_d [-] > 0 to 0.4, the same for the deceleration
    theta_0: float = exp(-100 / 9)  # θ_0 [-] 1e-6 to 1e-3, where the exponentials are cut off
    xi_a: float = 15.0  # ξ_a [-] 10 to 15, steepness of the start of the acceleration
    xi_d: float = 15.0  # ξ_d [-] 10 to 15, the same for the deceleration

    @property
    def direction(self) -> float:
        """1 forwards, −1 backwards."""
        return -1.0 if self.length < 0 or self.cruise < 0 else 1.0

    def check(self) -> None:
        """Raises ValueError: a value is not allowed."""
        size, time = "a size of 1e-9 to 1e9", "1e-9 to 1e9 s, more than 0"
        speed = f"0 to the cruise velocity {self.cruise:g}"
        for name, good, allowed in (
            ("length", SMALLEST <= abs(self.length) <= LARGEST, size),
            ("cruise", SMALLEST <= abs(self.cruise) <= LARGEST, size),
            ("accel_time", SMALLEST <= self.accel_time <= LARGEST, time),
            ("decel_time", SMALLEST <= self.decel_time <= LARGEST, time),
            ("initial", self._is_speed(self.initial), speed),
            ("final", self._is_speed(self.final), speed),
            ("epsilon", 0 <= self.epsilon <= 0.1, "0 to 0.1"),
            ("theta_a", 0.6 <= self.theta_a < 1, "0.6 to less than 1"),
            ("theta_d", 0 < self.theta_d <= 0.4, "more than 0 to 0.4"),
            ("theta_0", 1e-6 <= self.theta_0 <= 1e-3, "1e-6 to 1e-3"),
            ("xi_a", 10 <= self.xi_a <= 15, "10 to 15"),
            ("xi_d", 10 <= self.xi_d <= 15, "10 to 15"),
        ):
            if not good:
                raise ValueError(f"{name} is {getattr(self, name):g}, expected {allowed}")

    def _is_speed(self, value: float) -> bool:
        along = copysign(1.0, value) == copysign(1.0, self.cruise)
        return value == 0 or (along and abs(value) <= abs(self.cruise))


class Pull(NamedTuple):
    """The acceleration grows from 0 towards `a`; first subphase, (49)-(51) and (55)-(57)."""

    duration: float  # [s] ≥ 0
    v0: float  # speed at its start
    a: float  # acceleration it tends to
    tau: float  # [s] time constant
    left: float  # [-] e^−ξ, the share of `a` that is still missing at the end

    @property
    def length(self) -> float:
        """Distance covered, (69) and (71)."""
        t, tau = self.duration, self.tau
        return self.v0 * t + self.a * (t * t / 2 - tau * t + tau * tau * (1 - self.left))

    def at(self, t: float) -> Sample:
        tau, fade = self.tau, exp(-t / self.tau)
        grown = 1 - fade
        return Sample(
            self.v0 * t + self.a * (t * t / 2 - tau * t + tau * tau * grown),
            self.v0 + self.a * (t - tau * grown),
            self.a * grown,
            self.a * fade / tau,
        )


class Settle(NamedTuple):
    """The speed bends into `v1` exponentially; second subphase, (49)-(51) and (55)-(57)."""

    duration: float  # [s] ≥ 0
    v1: float  # speed it tends to
    gap: float  # v1 minus the speed at its start
    tau: float  # [s] time constant
    left: float  # [-] θ0, the share of `gap` that is still missing at the end

    @property
    def length(self) -> float:
        """Distance covered, (70) and (72)."""
        return self.v1 * self.duration - self.gap * self.tau * (1 - self.left)

    def at(self, t: float) -> Sample:
        fade = exp(-t / self.tau)
        a = self.gap * fade / self.tau
        return Sample(
            self.v1 * t - self.gap * self.tau * (1 - fade),
            self.v1 - self.gap * fade,
            a,
            -a / self.tau,
        )


class Cruise(NamedTuple):
    """Constant speed, (52)-(54)."""

    duration: float  # [s] ≥ 0
    v: float

    @property
    def length(self) -> float:
        return self.v * self.duration

    def at(self, t: float) -> Sample:
        return Sample(self.v * t, self.v, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class SpeedChange:
    """How a speed changes with `rate`: durations and distances are linear and quadratic in it.

    Changing from u to w takes (pull + settle) |w − u| / rate and covers
    |w − u| / rate · (weight_from u + weight_to w). Speeding up from 0 the weight_to is κ_a of (27),
    slowing to 0 the weight_from is κ_d of (28).
    """

    rate: float  # per s², > 0
    share: float  # [-] of the speed change made by the pull: θ_a, or 1 − θ_d
    xi: float  # [-] ξ, steepness of the start of the pull
    theta_0: float  # [-] θ0, where the settling is cut off
    pull: float  # duration of the pull in units of |w − u| / rate
    settle: float  # the same for the settling
    weight_from: float
    weight_to: float

    def distance(self, u: float, w: float) -> float:
        """Distance from speed u ≥ 0 to speed w ≥ 0."""
        return abs(w - u) / self.rate * (self.weight_from * u + self.weight_to * w)

    def phases(self, u: float, w: float) -> tuple[Pull, Settle]:
        """The two pieces from velocity u to velocity w; of no duration when u = w."""
        unit = abs(w - u) / self.rate  # [s]
        a = self.rate if w > u else -self.rate
        tau_pull, tau_settle = self.share * unit / (self.xi - 1), (1 - self.share) * unit
        return (
            Pull(self.pull * unit, u, a, tau_pull, exp(-self.xi)),
            Settle(self.settle * unit, w, (w - u) * (1 - self.share), tau_settle, self.theta_0),
        )


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


def cruise_speed(request: MotionRequest, up: SpeedChange, down: SpeedChange) -> float:
    """v_c > 0: all of the length but ε_L is used up by speeding up to v_c and slowing down again.
    Speeding up from v_i to x and slowing down from x to v_f covers a distance that is quadratic in
    x, where Fernandes et al. 2015 search x on a grid.

    Raises:
        ValueError: even without speeding up above the initial and final speed it is not enough.
    """
    v_i, v_f = abs(request.initial), abs(request.final)
    usable = abs(request.length) * (1 - request.epsilon)
    needed = (up if v_f > v_i else down).distance(v_i, v_f)
    if needed > usable:
        raise ValueError(
            f"a length of {abs(request.length):g} is too short to get from a speed of {v_i:g} to "
            f"{v_f:g}: expected at least {needed / (1 - request.epsilon) * (1 + MARGIN):.6g}"
        )
    root = _larger_root(
        up.weight_to / up.rate + down.weight_from / down.rate,
        (up.weight_from - up.weight_to) * v_i / up.rate
        + (down.weight_to - down.weight_from) * v_f / down.rate,
        -up.weight_from * v_i * v_i / up.rate - down.weight_to * v_f * v_f / down.rate - usable,
    )
    return max(root, v_i, v_f)


def _larger_root(q2: float, q1: float, q0: float) -> float:
    """Of q2 x² + q1 x + q0 = 0, without loss of digits, for q2 > 0 > q0 (so it is positive)."""
    root = sqrt(q1 * q1 - 4 * q2 * q0)
    return -2 * q0 / (q1 + root) if q1 > 0 else (root - q1) / (2 * q2)
