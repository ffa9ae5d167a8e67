"""Extended Kalman filter of the horizontal motion and the current.

States; all but the position north and east *as the compass has them*, in axes that do not turn with
the vehicle, because there the accelerometer's step is linear and needs no Coriolis terms:

     0, 1   position [m], NED
     2, 3   velocity over the ground [m/s]
     4, 5   current: velocity of the water over the ground [m/s]
     6, 7   lean [m/s²]: gravity component in the accelerometer, due to the tilt error
     8      deviation A [rad]: the part of the heading error that is the same at every heading
     9, 10  share by which the damping in surge and sway exceeds the vehicle file's [-]
    11, 12  deviation B and C [rad]: heading error A + B sin ψ + C cos ψ (compass_deviation.py)

All but position and velocity are first-order Gauss-Markov processes. The accelerometer drives the
velocity. The model's acceleration from thrust and drag is a second measurement of the same
acceleration, and the only one of the current: drag depends on the velocity through the water.

DVL, accelerometer and drag all turn with the compass' error, so none of them says anything of it.
Only the position is turned, where the velocity is added up. With the velocity in NED, every
velocity measured would be one of the heading as well, as wrong as the estimate it is linearised at:
the filter would learn a heading that nobody measured, and turn the position about its origin
(Huang, Mourikis and Roumeliotis 2010 on this inconsistency).

Pure functions from estimate to estimate (Bar-Shalom, Li and Kirubarajan 2001, section 10.3).
"""

from math import cos, hypot, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.units import Quaternion, Vec3
from services.estimation.horizontal.hull_model import ExpectedAcceleration, HullModel
from services.marine.attitude import to_body

Floats = NDArray[np.float64]
Pair = tuple[float, float]  # north and east, or surge and sway where it says so
SIZE = 13
EYE = np.eye(SIZE)
POSITION, VELOCITY, CURRENT, LEAN = slice(0, 2), slice(2, 4), slice(4, 6), slice(6, 8)
DAMPING, IRON, DEVIATION = slice(9, 11), slice(11, 13), [8, 11, 12]  # of them A, B, C
DEVIATIONS = np.ix_(DEVIATION, DEVIATION)
# Noise of each second, in the accelerometer and in what moves the vehicle.
ACCELERATION_NOISE = 0.01  # [m/s²/√Hz] white noise of the accelerometer, with vibration
MOTION_NOISE = 0.3  # [m/s²/√Hz] unknown motion while the IMU is silent
MODEL_NOISE = 0.1  # [m/s²/√Hz] forces not modelled: tether, waves, other wakes
# 1σ and correlation time of each Gauss-Markov process. A lasting acceleration tilts the attitude
# estimate and so hides itself: only changes of it are seen, within the time of the lean.
CURRENT_STD, CURRENT_TIME = 0.5, 1800.0  # [m/s], [s] by tide and change of place
LEAN_STD, LEAN_TIME = 0.2, 10.0  # [m/s²], [s]
HEADING_TIME = 100.0  # [s] of deviation A
DAMPING_SHARE = 0.2  # [-] relative to the vehicle file
DAMPING_TIME = 600.0  # [s] drag is not quite quadratic: the share changes with speed
IRON_STD, IRON_TIME = 0.0685, 7200.0  # [rad], [s] of B and C each: own iron, error of tilt; a dive
MOST_IRON = 0.98  # [-] of the heading's std, at most
# [s] of each state; position and velocity have none.
TIMES: Floats = np.array(
    [np.inf] * 4
    + [CURRENT_TIME] * 2
    + [LEAN_TIME] * 2
    + [HEADING_TIME]
    + [DAMPING_TIME] * 2
    + [IRON_TIME] * 2
)
UNMEASURED = 1.0  # [m/s] std of the velocity before any measurement
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))  # north, east, down
AGAIN = 10.0  # consecutive intervals with the same linearisation error: one DVL period
START_STD = 0.01  # [m] of the initial position


class HorizontalEstimate(NamedTuple):
    x: Floats  # (13,) mean of the states
    P: Floats  # (13, 13) their covariance


class Interval(NamedTuple):
    """The data of one filter step. Means over the interval, unless it says end."""

    seconds: float
    acceleration: Pair | None  # [m/s²] north and east by the compass, lean included; None: silent
    attitude: Quaternion  # q_NB, end; yaw is from north as the compass has it
    heading_std: float  # [rad] end
    yaw_rate: float  # [rad/s]
    force: Pair | None  # [N] of the thrusters in surge and sway; None: unknown
    depth_rate: float  # [m/s] end
    depth_rate_std: float  # [m/s] end


class Innovation(NamedTuple):
    """The innovation of a measurement of n numbers."""

    off: Floats  # (n,) measured minus expected
    H: Floats  # (n, 13) Jacobian of the measurement
    R: Floats  # (n, n) covariance of its noise


def initial(heading_std: float) -> HorizontalEstimate:
    """At rest at zero; only the position is known, as the origin."""
    std = _steady_std(heading_std)
    std[POSITION], std[VELOCITY] = START_STD, UNMEASURED
    return HorizontalEstimate(np.zeros(SIZE), np.diag(std * std))


def predicted(estimate: HorizontalEstimate, interval: Interval) -> HorizontalEstimate:
    """The estimate one interval later."""
    dt, x, gained = interval.seconds, estimate.x, np.zeros(2)  # [m/s]
    keep = np.exp(-dt / TIMES)
    F, q = np.diag(keep), MOTION_NOISE**2
    if interval.acceleration is not None:
        q = ACCELERATION_NOISE**2
        gained = dt * (interval.acceleration - x[LEAN])
        F[VELOCITY, LEAN] = -dt * np.eye(2)
    # In a turn the compass' error changes, and with it where its north is.
    sine, cosine = card(interval)
    by_iron = interval.yaw_rate * dt * np.array((cosine, -sine))  # [-] of B and C
    back = rotation(-float(by_iron @ x[IRON]))
    # The position moves by the mean velocity, turned to true north.
    turn = rotation(heading_error(estimate, interval)) @ back
    moved = turn @ (dt * x[VELOCITY] + 0.5 * dt * gained)
    F[POSITION, VELOCITY], F[POSITION, LEAN] = dt * turn, 0.5 * dt * (turn @ F[VELOCITY, LEAN])
    _set_deviation(F[POSITION], quarter(moved), interval)
    F[POSITION, IRON] -= np.outer(quarter(moved), by_iron)
    after = keep * x
    after[POSITION] += moved
    after[VELOCITY] += gained
    for part in (VELOCITY, CURRENT):
        after[part] = back @ after[part]
        F[part] = back @ F[part]
        F[part, IRON] = -np.outer(quarter(after[part]), by_iron)
    std = _steady_std(interval.heading_std)
    Q = np.diag(std * std * (1.0 - keep * keep))
    for p, v in ((0, 2), (1, 3)):
        Q[p, p], Q[v, v] = q * dt**3 / 3.0, q * dt
        Q[p, v] = Q[v, p] = q * dt**2 / 2.0
    return HorizontalEstimate(after, F @ estimate.P @ F.T + Q)


def corrected(estimate: HorizontalEstimate, seen: Innovation) -> HorizontalEstimate:
    """The estimate after a measurement."""
    return weighed(estimate, seen)[1]


def weighed(estimate: HorizontalEstimate, seen: Innovation) -> tuple[float, HorizontalEstimate]:
    """Normalised innovation squared of a measurement, and the estimate after it; Joseph's form
    keeps P symmetric and positive.

    The damping is a considered parameter, not estimated (Schmidt 1966): its variance limits how
    well drag determines the current. Estimated from an uncertain velocity, the damping would become
    too large, with too small a variance."""
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
    """Normalised innovation squared; its mean is n if the filter is consistent."""
    return float(seen.off @ np.linalg.solve(covariance(estimate, seen), seen.off))


# Measurement models.


def fix(estimate: HorizontalEstimate, place: Pair, std: float) -> Innovation:
    """A position [m] with the std [m] of each component."""
    H = np.zeros((2, SIZE))
    H[0, 0] = H[1, 1] = 1.0
    return Innovation(np.subtract(place, estimate.x[POSITION]), H, std * std * np.eye(2))


def velocity(
    estimate: HorizontalEstimate, interval: Interval, measured: Vec3, std: float
) -> Innovation:
    """Surge and sway of a velocity [m/s] over the ground in FRD, with the std of each component, at
    the end of the interval: the first two rows of R_BN v, where the depth rate is the third of v.
    The third row would measure the depth rate."""
    R_BN = body_axes(interval)[:2]
    H = np.zeros((2, SIZE))
    H[:, VELOCITY], down = R_BN[:, :2], R_BN[:, 2]
    R = std * std * np.eye(2) + interval.depth_rate_std**2 * np.outer(down, down)
    return Innovation(measured[:2] - R_BN @ (*estimate.x[VELOCITY], interval.depth_rate), H, R)


def balance(estimate: HorizontalEstimate, interval: Interval, hull: HullModel) -> Innovation:
    """Accelerometer minus the model's acceleration by thrust and drag, surge and sway, over the
    interval.

    Raises:
        ValueError: the interval has no acceleration or no force.
    """
    if interval.acceleration is None or interval.force is None:
        raise ValueError("an interval without acceleration or force has no balance")
    R_BN = body_axes(interval)
    level = R_BN[:2, :2]
    north, east = estimate.x[VELOCITY] - estimate.x[CURRENT]
    surge, sway, _ = (R_BN @ (north, east, interval.depth_rate)).tolist()
    share, side = estimate.x[DAMPING].tolist()
    expected = hull.expected((surge, sway), interval.yaw_rate, interval.force, (share, side))
    by_water = np.array(expected.by_velocity) @ level
    H = np.zeros((2, SIZE))
    H[:, VELOCITY], H[:, CURRENT], H[:, LEAN] = by_water, -by_water, level
    H[0, 9], H[1, 10] = expected.by_damping
    off = level @ (interval.acceleration - estimate.x[LEAN]) - expected.acceleration
    R = MODEL_NOISE**2 / interval.seconds + _curvature_noise(estimate, level, expected)
    return Innovation(off, H, np.diag(R))


def felt(estimate: HorizontalEstimate, interval: Interval) -> tuple[float, float]:
    """[m/s²] Surge and sway of the vehicle's acceleration by the accelerometer; 0 without one."""
    if interval.acceleration is None:
        return 0.0, 0.0
    level = body_axes(interval)[:2, :2]
    surge, sway = (level @ (interval.acceleration - estimate.x[LEAN])).tolist()
    return surge, sway


def _curvature_noise(
    estimate: HorizontalEstimate, level: Floats, expected: ExpectedAcceleration
) -> Floats:
    """[m²/s⁴] (2,) Noise of linearising drag: the second-order terms in velocity and damping
    (Bar-Shalom, Li and Kirubarajan 2001, section 10.3.2)."""
    W = np.zeros((2, SIZE))
    W[:, VELOCITY], W[:, CURRENT] = level, -level
    water: Floats = np.diag(W @ estimate.P @ W.T)  # [m²/s²] variances of surge and sway
    own = np.multiply(expected.curvature, np.sqrt(water * np.max(water)))
    slopes = np.diag(expected.by_velocity)
    return AGAIN * 3.0 * own**2 + slopes**2 * water * np.diag(estimate.P)[DAMPING]


def body_axes(interval: Interval) -> Floats:
    """(3, 3) R_BN at the end of the interval, by the compass' north."""
    return np.array([to_body(interval.attitude, axis) for axis in AXES]).T


def card(interval: Interval) -> tuple[float, float]:
    """Factors of deviation B and C at the end of the interval: sin ψ and cos ψ. That of A is 1."""
    w, x, y, z = interval.attitude
    east, north = 2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)  # of the forward axis
    level = max(hypot(north, east), 1e-9)
    return east / level, north / level


def heading_error(estimate: HorizontalEstimate, interval: Interval) -> float:
    """[rad] True minus measured heading, at the end of the interval."""
    a, b, c = estimate.x[DEVIATION].tolist()
    sine, cosine = card(interval)
    return a + b * sine + c * cosine


def heading_std(estimate: HorizontalEstimate, interval: Interval) -> float:
    """[rad] Standard deviation of the heading error."""
    here = np.array((1.0, *card(interval)))
    return sqrt(here @ estimate.P[DEVIATIONS] @ here)


def _set_deviation(J: Floats, slope: Floats, interval: Interval) -> None:
    """Set the deviation's columns of a Jacobian from its `slope` by the heading error."""
    sine, cosine = card(interval)
    J[:, DEVIATION[0]], J[:, DEVIATION[1]], J[:, DEVIATION[2]] = slope, sine * slope, cosine * slope


def turned(v: Pair, angle: float) -> Pair:
    """A horizontal vector, rotated clockwise by an angle [rad]."""
    c, s = cos(angle), sin(angle)
    return v[0] * c - v[1] * s, v[0] * s + v[1] * c


def rotation(angle: float) -> Floats:
    """(2, 2) That of `turned`."""
    c, s = cos(angle), sin(angle)
    return np.array(((c, -s), (s, c)))


def quarter(v: Floats) -> Floats:
    """(2,) A horizontal vector a quarter turn clockwise: how it changes as it is turned."""
    return np.array((-v[1], v[0]))


# Restarts.


def moved_to(estimate: HorizontalEstimate, place: Pair, std: float) -> HorizontalEstimate:
    """Replace the position [m]."""
    return _replaced(estimate, POSITION, np.array(place), std)


def changed_to(
    estimate: HorizontalEstimate, interval: Interval, measured: Vec3, std: float
) -> HorizontalEstimate:
    """Replace the velocity by this one [m/s], FRD, at the end of the interval."""
    north, east, _ = (body_axes(interval).T @ measured).tolist()
    return _replaced(estimate, VELOCITY, np.array((north, east)), std)


def is_sound(estimate: HorizontalEstimate) -> bool:
    """False if a number is not finite or a variance is not positive; then restart."""
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


def _steady_std(heading_std: float) -> Floats:
    """Steady-state std of the Gauss-Markov processes; 0 for position and velocity."""
    iron = min(IRON_STD, MOST_IRON * heading_std)
    rest = sqrt(heading_std**2 - iron**2)
    known = [0.0] * 4 + [CURRENT_STD] * 2 + [LEAN_STD] * 2
    return np.array([*known, rest, DAMPING_SHARE, DAMPING_SHARE, iron, iron])
