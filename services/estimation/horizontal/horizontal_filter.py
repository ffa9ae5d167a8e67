"""Extended Kalman filter of the horizontal motion and of the water it happens in.

States, all in NED because the accelerometer's step is linear there and a turning body needs no
Coriolis terms:

     0, 1   position [m]
     2, 3   velocity over the ground [m/s]
     4, 5   current: velocity of the water over the ground [m/s]
     6, 7   lean [m/s²]: what the error of tilt lets gravity add to the accelerometer
     8      deviation A [rad]: what of the heading's error is the same at every heading
     9, 10  share by which the damping in surge and sway is larger than the vehicle file says [-]
    11, 12  deviation B and C [rad]: the error of heading is A + B sin ψ + C cos ψ (deviation.py)

All but position and velocity are first-order Gauss-Markov processes. The accelerometer moves the
velocity. What the vehicle's model expects of thrust and drag is one more measurement of the same
acceleration, and the only thing that tells the current: drag depends on the velocity through the
water.

Pure functions from belief to belief (Bar-Shalom, Li and Kirubarajan 2001, section 10.3).
"""

from functools import cache
from math import cos, hypot, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.units import Quaternion, Vec3
from services.estimation.horizontal.horizontal_settings import HorizontalSettings
from services.estimation.horizontal.hull_model import ExpectedAcceleration, HullModel
from services.marine.attitude import to_body

Floats = NDArray[np.float64]
Pair = tuple[float, float]  # north and east, or surge and sway where it says so
SIZE = 13
EYE = np.eye(SIZE)
POSITION, VELOCITY, CURRENT, LEAN = slice(0, 2), slice(2, 4), slice(4, 6), slice(6, 8)
DAMPING, DEVIATION = slice(9, 11), [8, 11, 12]  # A, B, C
DEVIATIONS = np.ix_(DEVIATION, DEVIATION)
MOST_IRON = 0.98  # [-] of the spread of the heading, at most
DAMPING_TIME = 600.0  # [s] drag is not quite quadratic: at another speed it is another share
UNMEASURED = 1.0  # [m/s] spread of the velocity before anybody has measured it
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))  # north, east, down
AGAIN = 10.0  # legs in a row that are bent in the same way; a DVL speaks once in so many
START_STD = 0.01  # [m] of the position from which it is counted


class HorizontalEstimate(NamedTuple):
    x: Floats  # (13,) mean of the states
    P: Floats  # (13, 13) their covariance


class Interval(NamedTuple):
    """What is known of a short time without DVL and USBL. Means, unless it says end."""

    seconds: float
    acceleration: Pair | None  # [m/s²] north and east by the compass, lean included; None: silent
    attitude: Quaternion  # q_NB, end; yaw is from north as the compass has it
    heading_std: float  # [rad] end
    yaw_rate: float  # [rad/s]
    force: Pair | None  # [N] of the thrusters in surge and sway; None: unknown
    depth_rate: float  # [m/s] end
    depth_rate_std: float  # [m/s] end


class Innovation(NamedTuple):
    """A measurement of n numbers beside what was expected."""

    off: Floats  # (n,) measured minus expected
    H: Floats  # (n, 13) Jacobian of the measurement
    R: Floats  # (n, n) covariance of its noise


def begun(settings: HorizontalSettings, heading_std: float) -> HorizontalEstimate:
    """At rest at zero, and nothing known but the position, from which counting begins."""
    std = _steady_std(settings, heading_std)
    std[POSITION], std[VELOCITY] = START_STD, UNMEASURED
    return HorizontalEstimate(np.zeros(SIZE), np.diag(std * std))


def predicted(
    estimate: HorizontalEstimate, interval: Interval, settings: HorizontalSettings
) -> HorizontalEstimate:
    """The belief one leg later."""
    dt, push = interval.seconds, np.zeros(SIZE)
    keep = np.exp(-dt / _times(settings))
    F = np.diag(keep)
    F[0, 2] = F[1, 3] = dt
    if interval.acceleration is None:
        q = settings.motion_noise**2
    else:
        q = settings.acceleration_noise**2
        F[0, 6] = F[1, 7] = -0.5 * dt * dt
        F[2, 6] = F[3, 7] = -dt
        a, b = turned(interval.acceleration, heading_error(estimate, interval))
        push[:4] = 0.5 * dt * dt * a, 0.5 * dt * dt * b, dt * a, dt * b
        _turn(F[:4], np.array((-push[1], push[0], -push[3], push[2])), interval)
    std = _steady_std(settings, interval.heading_std)
    Q = np.diag(std * std * (1.0 - keep * keep))
    for p, v in ((0, 2), (1, 3)):
        Q[p, p], Q[v, v] = q * dt**3 / 3.0, q * dt
        Q[p, v] = Q[v, p] = q * dt**2 / 2.0
    fading = F.copy()
    fading[:4, DEVIATION] = 0.0  # the push has it already
    return HorizontalEstimate(fading @ estimate.x + push, F @ estimate.P @ F.T + Q)


def corrected(estimate: HorizontalEstimate, seen: Innovation) -> HorizontalEstimate:
    """The belief after a measurement."""
    return weighed(estimate, seen)[1]


def weighed(estimate: HorizontalEstimate, seen: Innovation) -> tuple[float, HorizontalEstimate]:
    """How surprising a measurement is, and the belief after it; Joseph's form keeps P symmetric and
    positive.

    The damping is considered, not learnt (Schmidt 1966): its spread limits what drag tells of the
    current, but a filter that learns it from a velocity which it does not know well is drawn to
    too much damping, and sure of it."""
    HP = seen.H @ estimate.P
    both = np.linalg.solve(HP @ seen.H.T + seen.R, np.column_stack((seen.off, HP)))
    K = both[:, 1:].T
    K[DAMPING] = 0.0
    A = EYE - K @ seen.H
    after = HorizontalEstimate(estimate.x + K @ seen.off, A @ estimate.P @ A.T + K @ seen.R @ K.T)
    return float(seen.off @ both[:, 0]), after


def covariance(estimate: HorizontalEstimate, seen: Innovation) -> Floats:
    """(n, n) Of the innovation."""
    return seen.H @ estimate.P @ seen.H.T + seen.R


def surprise(estimate: HorizontalEstimate, seen: Innovation) -> float:
    """Normalised innovation squared: n on average, if all is as the filter believes."""
    return float(seen.off @ np.linalg.solve(covariance(estimate, seen), seen.off))


# What is measured.


def fix(estimate: HorizontalEstimate, place: Pair, std: float) -> Innovation:
    """A position [m] with the spread [m] of each component."""
    H = np.zeros((2, SIZE))
    H[0, 0] = H[1, 1] = 1.0
    return Innovation(np.subtract(place, estimate.x[POSITION]), H, std * std * np.eye(2))


def velocity(
    estimate: HorizontalEstimate, interval: Interval, measured: Vec3, std: float
) -> Innovation:
    """Surge and sway of a velocity [m/s] over the ground in FRD, with the spread of each
    component, at the end of the leg: the first two rows of R_BN(heading + error, pitch, roll) v_N,
    where the depth rate is the third of v_N. The third row would measure the depth rate."""
    R_BN = true_rotation(estimate, interval)[:2]
    north, east = estimate.x[VELOCITY]
    H = np.zeros((2, SIZE))
    H[:, VELOCITY] = R_BN[:, :2]
    _turn(H, R_BN[:, :2] @ (east, -north), interval)
    down = R_BN[:, 2]
    R = std * std * np.eye(2) + interval.depth_rate_std**2 * np.outer(down, down)
    return Innovation(measured[:2] - R_BN @ (north, east, interval.depth_rate), H, R)


def balance(
    estimate: HorizontalEstimate, interval: Interval, hull: HullModel, settings: HorizontalSettings
) -> Innovation:
    """The accelerometer beside what thrust and drag should do, in surge and sway, over the leg.

    Raises:
        ValueError: the leg knows no acceleration or no force.
    """
    if interval.acceleration is None or interval.force is None:
        raise ValueError("a leg without acceleration or force has no balance")
    R_BN = true_rotation(estimate, interval)
    level = R_BN[:2, :2]
    north, east = estimate.x[VELOCITY] - estimate.x[CURRENT]
    surge, sway, _ = (R_BN @ (north, east, interval.depth_rate)).tolist()
    share, side = estimate.x[DAMPING].tolist()
    expected = hull.expected((surge, sway), interval.yaw_rate, interval.force, (share, side))
    by_water = np.array(expected.by_velocity) @ level
    H = np.zeros((2, SIZE))
    H[:, VELOCITY], H[:, CURRENT], H[:, LEAN] = by_water, -by_water, level
    lean_north, lean_east = estimate.x[LEAN]
    aside = by_water @ (east, -north) + level @ (lean_east, -lean_north)
    _turn(H, aside, interval)
    H[0, 9], H[1, 10] = expected.by_damping
    true_acceleration = turned(interval.acceleration, heading_error(estimate, interval))
    off = level @ (true_acceleration - estimate.x[LEAN]) - expected.acceleration
    R = settings.model_noise**2 / interval.seconds + _bend(
        estimate, interval, level, expected, (east, -north)
    )
    return Innovation(off, H, np.diag(R))


def _bend(
    estimate: HorizontalEstimate,
    interval: Interval,
    level: Floats,
    expected: ExpectedAcceleration,
    aside: Pair,
) -> Floats:
    """[m²/s⁴] (2,) Drag is no straight line: what the spreads of velocity and damping bend it by
    counts as noise (second-order terms, Bar-Shalom, Li and Kirubarajan 2001, section 10.3.2)."""
    W = np.zeros((2, SIZE))
    W[:, VELOCITY], W[:, CURRENT] = level, -level
    _turn(W, level @ aside, interval)
    water: Floats = np.diag(W @ estimate.P @ W.T)  # [m²/s²] variances of surge and sway
    own = np.multiply(expected.curvature, np.sqrt(water * np.max(water)))
    slopes = np.diag(expected.by_velocity)
    return AGAIN * 3.0 * own**2 + slopes**2 * water * np.diag(estimate.P)[DAMPING]


def true_rotation(estimate: HorizontalEstimate, interval: Interval) -> Floats:
    """(3, 3) R_BN at the end of the leg, the error of heading taken off."""
    R_BN = np.array([to_body(interval.attitude, axis) for axis in AXES]).T
    error = heading_error(estimate, interval)
    c, s = cos(error), sin(error)
    north, east = R_BN[:, 0].copy(), R_BN[:, 1].copy()
    R_BN[:, 0], R_BN[:, 1] = c * north - s * east, s * north + c * east
    return R_BN


def card(interval: Interval) -> tuple[float, float]:
    """What deviation B and C count for at the end of the leg: sin ψ and cos ψ. A counts for 1."""
    w, x, y, z = interval.attitude
    east, north = 2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)  # of the forward axis
    level = max(hypot(north, east), 1e-9)
    return east / level, north / level


def heading_error(estimate: HorizontalEstimate, interval: Interval) -> float:
    """[rad] True minus measured, at the end of the leg."""
    a, b, c = estimate.x[DEVIATION].tolist()
    sine, cosine = card(interval)
    return a + b * sine + c * cosine


def heading_spread(estimate: HorizontalEstimate, interval: Interval) -> float:
    """[rad] Of the same."""
    here = np.array((1.0, *card(interval)))
    return sqrt(here @ estimate.P[DEVIATIONS] @ here)


def _turn(J: Floats, aside: Floats, interval: Interval) -> None:
    """Fill the columns of the deviation, from the slope by the heading's error."""
    sine, cosine = card(interval)
    J[:, DEVIATION[0]], J[:, DEVIATION[1]], J[:, DEVIATION[2]] = aside, sine * aside, cosine * aside


def turned(v: Pair, angle: float) -> Pair:
    """A horizontal vector, turned clockwise by an angle [rad]."""
    c, s = cos(angle), sin(angle)
    return v[0] * c - v[1] * s, v[0] * s + v[1] * c


# Starting anew.


def moved_to(estimate: HorizontalEstimate, place: Pair, std: float) -> HorizontalEstimate:
    """Forget the position, believe this one [m]."""
    return _replaced(estimate, POSITION, np.array(place), std)


def changed_to(
    estimate: HorizontalEstimate, interval: Interval, measured: Vec3, std: float
) -> HorizontalEstimate:
    """Forget the velocity, believe this one [m/s], FRD, at the end of the leg. Its direction is as
    wrong as the heading."""
    north, east, _ = (true_rotation(estimate, interval).T @ measured).tolist()
    x, P = _replaced(estimate, VELOCITY, np.array((north, east)), std)
    aside = np.outer((-east, north), (1.0, *card(interval)))
    with_others = aside @ P[DEVIATION]
    P[VELOCITY, :], P[:, VELOCITY] = with_others, with_others.T
    P[VELOCITY, VELOCITY] = std * std * np.eye(2) + with_others[:, DEVIATION] @ aside.T
    return HorizontalEstimate(x, P)


def is_sound(estimate: HorizontalEstimate) -> bool:
    """False when a number is not finite or a variance is not positive: start anew then."""
    variances = np.diag(estimate.P)
    return bool(
        np.isfinite(estimate.x).all()
        and np.isfinite(estimate.P).all()
        and (variances > 0.0).all()
        and (variances < 1e12).all()
    )


def _replaced(
    estimate: HorizontalEstimate, states: slice, values: Floats, std: float
) -> HorizontalEstimate:
    x, P = estimate.x.copy(), estimate.P.copy()
    x[states] = values
    P[states, :] = P[:, states] = 0.0
    P[states, states] = std * std * np.eye(2)
    return HorizontalEstimate(x, P)


@cache
def _times(settings: HorizontalSettings) -> Floats:
    """[s] of the Gauss-Markov processes; position and velocity do not fade."""
    current, lean = settings.current_time, settings.lean_time
    never = np.inf
    return np.array(
        [never] * 4
        + [current] * 2
        + [lean] * 2
        + [settings.heading_time]
        + [DAMPING_TIME] * 2
        + [settings.iron_time] * 2
    )


def _steady_std(settings: HorizontalSettings, heading_std: float) -> Floats:
    """In the long run, when nothing is measured; position and velocity have none."""
    current, lean, damping = settings.current_std, settings.lean_std, settings.damping_share
    iron = min(settings.iron_std, MOST_IRON * heading_std)
    rest = sqrt(heading_std**2 - iron**2)
    return np.array([0.0] * 4 + [current] * 2 + [lean] * 2 + [rest] + [damping] * 2 + [iron] * 2)
