"""From a force for each thruster to ArduSub's six axes, and what the motors then do.

ArduSub's MANUAL mode mixes six axes linearly into the motors and knows no thrust curve. A force for
each thruster is therefore taken as the wrench it amounts to, and the six axes are those whose
motors, each through its own curve, give that wrench (Gauss-Newton). What pushes only against itself
(a thrust bias) is no wrench and does not come through. Every limit is applied here, so that ArduSub
itself never clips or scales. The factors of its frames are those of ArduSub 4.5 and 4.8, reproduced
from SERVO_OUTPUT_RAW of both for FRAME_CONFIG 0 to 7."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from services.marine.summation import plain_sum
from services.marine.vehicle import CURVES, Thruster, wrench_per_newton

Factors = tuple[float, float, float, float, float, float]
ROLL, PITCH, YAW, THROTTLE, FORWARD, LATERAL = range(6)  # columns of the factors
# Row of a wrench (X, Y, Z, K, M, N) for each column, and its sign: throttle is upwards.
ROW = {ROLL: 3, PITCH: 4, YAW: 5, THROTTLE: 2, FORWARD: 0, LATERAL: 1}
SIGN = {ROLL: 1.0, PITCH: 1.0, YAW: 1.0, THROTTLE: -1.0, FORWARD: 1.0, LATERAL: 1.0}
TILTED = [ROLL, PITCH, THROTTLE], [YAW, FORWARD, LATERAL]


@dataclass(frozen=True, slots=True)
class MotorFrame:
    name: str
    motors: tuple[Factors, ...]  # roll, pitch, yaw, throttle, forward, lateral; up is positive
    coupled: bool = False  # MOT_FV_CPLNG_K limits the forward share of the rear pair


_HORIZONTAL: tuple[Factors, ...] = (
    (0, 0, 1, 0, -1, 1), (0, 0, -1, 0, -1, -1), (0, 0, -1, 0, 1, 1), (0, 0, 1, 0, 1, -1),
)  # fmt: skip
_PAIR: tuple[Factors, ...] = ((0, 0, -1, 0, 1, 0), (0, 0, 1, 0, 1, 0))
FRAMES: dict[int, MotorFrame] = {
    0: MotorFrame("BLUEROV1", (
        *_PAIR, (-0.5, 0.5, 0, 0.45, 0, 0), (0.5, 0.5, 0, 0.45, 0, 0),
        (0, -1, 0, 1, 0, 0), (-0.25, 0, 0, 0, 0, 1),
    )),
    1: MotorFrame(
        "VECTORED", (*_HORIZONTAL, (1, 0, 0, -1, 0, 0), (-1, 0, 0, -1, 0, 0)), coupled=True
    ),
    2: MotorFrame("VECTORED_6DOF", (
        *_HORIZONTAL, (1, -1, 0, -1, 0, 0), (-1, -1, 0, -1, 0, 0),
        (1, 1, 0, -1, 0, 0), (-1, 1, 0, -1, 0, 0),
    )),
    3: MotorFrame("VECTORED_6DOF_90DEG", (
        (1, 1, 0, 1, 0, 0), (0, 0, 1, 0, 1, 0), (1, -1, 0, 1, 0, 0), (0, 0, 0, 0, 0, 1),
        (0, 0, 0, 0, 0, 1), (-1, 1, 0, 1, 0, 0), (0, 0, -1, 0, 1, 0), (-1, -1, 0, 1, 0, 0),
    )),
    4: MotorFrame("SIMPLEROV_3", (*_PAIR, (0, 0, 0, -1, 0, 0))),
    5: MotorFrame("SIMPLEROV_4", (*_PAIR, (1, 0, 0, -1, 0, 0), (-1, 0, 0, -1, 0, 0),
                             (0, 0, 0, 0, 0, 1))),
}  # fmt: skip
FRAMES[6], FRAMES[7] = FRAMES[5], FRAMES[4]
NOTHING = 0.05  # [-] of the longest arm or of the direction: an axis that a thruster hardly moves


def senses(frame: MotorFrame, thrusters: Sequence[Thruster]) -> tuple[float, ...]:
    """[-] For each motor, 1 where its positive output pushes along the thruster's direction, and
    -1 where it pushes against it.

    Raises:
        ValueError: the thrusters of the vehicle file are not the motors of this frame.
    """
    if len(thrusters) != len(frame.motors):
        raise ValueError(
            f"{frame.name} has {len(frame.motors)} motors and the vehicle file has "
            f"{len(thrusters)} thrusters"
        )
    arms = [abs(v) for t in thrusters for v in wrench_per_newton(t)[3:]]
    scales = (1.0, 1.0, 1.0, *[max(*arms, 1e-3)] * 3)
    found: list[float] = []
    for number, (factors, thruster) in enumerate(zip(frame.motors, thrusters, strict=True), 1):
        column = wrench_per_newton(thruster)
        pushes = [SIGN[k] * column[ROW[k]] / scales[ROW[k]] for k in range(6)]
        sense = copysign(1.0, plain_sum(f * push for f, push in zip(factors, pushes, strict=True)))
        agree = all(sense * f * push > NOTHING**2 for f, push in zip(factors, pushes, strict=True)
                    if f)  # fmt: skip
        if not agree:
            raise ValueError(
                f"motor {number} of {frame.name} does not push as thruster {number} of the vehicle "
                f"file, {thruster.name}, does"
            )
        found.append(sense)
    return tuple(found)


Floats = NDArray[np.float64]
PULSE_SPAN = 400.0  # [µs] of a motor from rest to full
POINTS = 3201  # of a table from -1 to 1: a quarter of a microsecond
STEP = 2.0 / (POINTS - 1)
FLAT = 0.5  # [N] least slope of a curve per share of the voltage that is divided by
EDGE = 1e-9  # [-] rounding


class MotorCurves:
    """All along the motors' own positive outputs."""

    def __init__(self, thrusters: Sequence[Thruster], senses: Floats) -> None:
        """
        Args:
            senses: [-] 1 where a positive output pushes along the thruster's direction, else -1.
        """
        grid = np.linspace(-1.0, 1.0, POINTS)
        table = np.array(
            [
                sense * _thrust(thruster, sense * grid)
                for thruster, sense in zip(thrusters, senses, strict=True)
            ]
        )
        slopes = np.maximum(np.gradient(table, STEP, axis=1), FLAT)
        # Lists: for a handful of motors Python is faster than an array library.
        self._tables: list[list[float]] = table.tolist()
        self._silent = [_silent(thruster) for thruster in thrusters]
        self._dead_bands = [thruster.dead_band for thruster in thrusters]
        turning = [silent - EDGE for silent in self._silent]
        self._motors = list(zip(turning, self._tables, slopes.tolist(), strict=True))

    def thrust(self, outputs: Floats) -> Floats:
        """[N] At which the motors settle; nothing inside their dead bands."""
        return self.thrust_and_slopes(outputs)[0]

    def thrust_and_slopes(self, outputs: Floats) -> tuple[Floats, Floats]:
        """[N] As `thrust`, and per unit of output the slopes of the curves without dead bands."""
        newtons, slopes = list[float](), list[float]()
        for output, (turning, table, slope) in zip(outputs.tolist(), self._motors, strict=True):
            at = (output + 1.0) / STEP
            at = 0.0 if at < 0.0 else at if at < POINTS - 1 else POINTS - 1.0
            slopes.append(slope[round(at)])
            if -turning < output < turning:  # most motors at most times
                newtons.append(0.0)
                continue
            low = int(at) if at < POINTS - 1 else POINTS - 2
            share = at - low
            newtons.append((1.0 - share) * table[low] + share * table[low + 1])
        return np.array(newtons), np.array(slopes)

    def outputs_for(self, thrust: Floats) -> Floats:
        """[-] Per motor. Thrust at the edge of a dead band gets 1 µs more, so that rounding does
        not silence the motor; less gets nothing."""
        found = list[float]()
        rows = zip(thrust.tolist(), self._tables, self._silent, self._dead_bands, strict=True)
        for newtons, table, silent, dead_band in rows:
            if newtons == 0.0 or abs(newtons) < dead_band:
                found.append(0.0)
                continue
            output = max(abs(_inverse(table, newtons)), silent + 1.0 / PULSE_SPAN)
            found.append(copysign(output, newtons))
        return np.array(found)


def _inverse(table: list[float], newtons: float) -> float:
    """[-] Output for a thrust, limited to the ends of the table, which never falls."""
    above = bisect_right(table, newtons)
    if above == 0:
        return -1.0
    if above == POINTS:
        return (bisect_left(table, newtons) * STEP - 1.0) if newtons == table[-1] else 1.0
    low, high = table[above - 1], table[above]
    return (above - 1 + (newtons - low) / (high - low)) * STEP - 1.0


def _thrust(thruster: Thruster, shares: Floats) -> Floats:
    """[N] Along the thruster's direction, for shares -1 … 1 of the voltage, without dead band."""
    reverse, forward = thruster.limits
    curve = CURVES.get(thruster.curve)
    if curve is None:
        return np.where(shares > 0.0, shares * forward, -shares * reverse)
    newtons = np.array([curve.thrust(share) for share in np.clip(shares, -curve.top, curve.top)])
    return np.clip(newtons, reverse, forward)


def _silent(thruster: Thruster) -> float:
    """[-] Any smaller share does not turn the motor."""
    curve = CURVES.get(thruster.curve)
    return thruster.dead_band / thruster.max_thrust if curve is None else curve.silent


CHANNELS = (PITCH, ROLL, THROTTLE, YAW, FORWARD, LATERAL)  # axis of the override channels 1 to 6
STEPS = 2  # of Gauss-Newton at most; with more the wrench is no nearer, for the dead bands
SMALL = (
    0.5 / PULSE_SPAN
)  # [-] of a motor's output: a smaller step is lost in the rounding of pulses
DAMPING = 1e-9  # [-] of the trace: an axis that moves no motor stays where it is
IDENTITY = np.eye(6)
NEUTRAL = 1500  # [µs]


class RcChannel(NamedTuple):
    """One override channel: from a share of an axis to the pulse that ArduSub reads as that share.

    In MANUAL mode ArduSub takes `norm_input` of the channel: RCn_MIN, RCn_TRIM, RCn_MAX and
    RCn_REVERSED, clipped, without a dead band. The throttle of 4.5 has its trim at RC3_MIN and runs
    from 0 to 1; that of 4.8 is as all others.
    """

    least: float = 1100.0  # [µs]
    trim: float = 1500.0  # [µs]
    most: float = 1900.0  # [µs]
    reversed: bool = False

    @property
    def neutral(self) -> float:
        """[µs] Where the axis is zero: the trim, or the middle where the trim is at the end."""
        return (self.least + self.most) / 2 if self.trim <= self.least else self.trim

    def pulse(self, share: float) -> float:
        """[µs] For a share -1 … 1 of the axis, not rounded."""
        share = max(-1.0, min(1.0, -share if self.reversed else share))
        middle = self.neutral
        return middle + share * ((self.most - middle) if share > 0 else (middle - self.least))

    def share(self, pulse: float) -> float:
        """[-] What ArduSub makes of a pulse [µs]."""
        middle = self.neutral
        span = (self.most - middle) if pulse > middle else (middle - self.least)
        share = max(-1.0, min(1.0, (pulse - middle) / span))
        return -share if self.reversed else share


class MixedSticks(NamedTuple):
    pulses: tuple[int, ...]  # [µs] override channels 1 to 6
    thrust: tuple[float, ...]  # [N] per thruster, at which the motors settle
    limited: bool  # a group of motors, or the yaw channel, was at its limit


def at_rest(thrusters: int) -> MixedSticks:
    return MixedSticks((NEUTRAL,) * 6, (0.0,) * thrusters, limited=False)


class Mixer:
    """Built once per vehicle and set of parameters."""

    def __init__(
        self,
        frame: MotorFrame,
        thrusters: Sequence[Thruster],
        channels: Sequence[RcChannel],
        yaw_scale: float = 1.0,
        coupling: float = 1.0,
    ) -> None:
        """
        Args:
            channels: (6,) in the order of the overrides.
            yaw_scale: [-] ACRO_YAW_P / 3.375, by which ArduSub multiplies the yaw channel.
            coupling: [-] MOT_FV_CPLNG_K.

        Raises:
            ValueError: the thrusters are not the motors of this frame.
        """
        self._channels, self._yaw_scale = tuple(channels), yaw_scale
        self._coupling = coupling if frame.coupled else 0.0
        columns = np.array([wrench_per_newton(thruster) for thruster in thrusters])
        self._senses = np.array(senses(frame, thrusters))
        self._factors = np.array(frame.motors, dtype=float)  # (n, 6)
        self._axes_of = np.linalg.pinv(self._factors)  # (6, n)
        self._effect = columns.T * self._senses  # (6, n) of positive outputs
        self._groups = [(group, self._factors[:, group]) for group in _groups(self._factors)]
        self._curves = MotorCurves(thrusters, self._senses)

    def mix(self, thrust: Sequence[float]) -> MixedSticks:
        """`thrust`: [N] per thruster, as `ActuatorGate` permits it."""
        if not any(thrust):
            return at_rest(len(thrust))
        asked = np.array(thrust) * self._senses
        axes = self._refined(self._axes_of @ self._curves.outputs_for(asked), asked)
        return self._sent(*self._fitting(axes))

    def _refined(self, axes: Floats, asked: Floats) -> Floats:
        """The axes that give the wrench of this thrust [N] best; never worse than those given."""
        wanted = self._effect @ asked
        thrust, slopes = self._curves.thrust_and_slopes(self._factors @ axes)
        missing = wanted - self._effect @ thrust
        square_missing = missing @ missing
        for _ in range(STEPS):
            effect = (self._effect * slopes) @ self._factors
            square = effect.T @ effect
            damping = DAMPING * float(square.trace()) * IDENTITY
            step = np.asarray(np.linalg.solve(square + damping, effect.T @ missing), np.float64)
            further = axes + step
            thrust, slopes = self._curves.thrust_and_slopes(self._factors @ further)
            left = wanted - self._effect @ thrust
            square_left = left @ left
            if not square_left < square_missing:
                break
            axes, missing, square_missing = further, left, square_left
            if np.abs(self._factors @ step).max() < SMALL:
                break
        return axes

    def _fitting(self, axes: Floats) -> tuple[Floats, bool]:
        """The same direction of each group, within what its motors and the yaw channel can give."""
        axes, was_limited = axes.copy(), False
        for group, factors in self._groups:
            largest = float(np.abs(factors @ axes[group]).max())
            if YAW in group:
                largest = max(largest, abs(float(axes[YAW])) / self._yaw_scale)
            if largest > 1.0:
                axes[group] /= largest
                was_limited = True
        room = 1.0 - self._coupling * abs(float(axes[THROTTLE]))
        if self._coupling and abs(axes[FORWARD]) > room:
            axes[FORWARD] = max(-room, min(room, float(axes[FORWARD])))
            was_limited = True
        return axes, was_limited

    def _sent(self, axes: Floats, was_limited: bool) -> MixedSticks:
        shares: list[float] = axes.tolist()
        shares[YAW] /= self._yaw_scale
        pulses, read = list[int](), [0.0] * 6
        for axis, channel in zip(CHANNELS, self._channels, strict=True):
            pulses.append(round(channel.pulse(shares[axis])))
            read[axis] = channel.share(pulses[-1])
        read[YAW] *= self._yaw_scale
        motors = self._factors @ np.array(read)
        thrust = tuple((self._curves.thrust(motors) * self._senses).tolist())
        return MixedSticks(tuple(pulses), thrust, was_limited)


def _groups(factors: Floats) -> list[list[int]]:
    """Axes that share motors with each other and with none of the others."""
    one, other = (np.any(factors[:, group] != 0.0, axis=1) for group in TILTED)
    return [list(range(6))] if np.any(one & other) else [*TILTED]
