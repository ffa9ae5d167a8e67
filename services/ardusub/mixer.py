"""From a force for each thruster to ArduSub's six axes, and what the motors then do.

ArduSub's MANUAL mode mixes six axes linearly into the motors and knows no thrust curve. A force for
each thruster is therefore taken as the wrench it amounts to, and the six axes are those whose
motors, each through its own curve, give that wrench (Gauss-Newton). What pushes only against itself
(a thrust bias) is no wrench and does not come through. Every limit is applied here, so that ArduSub
itself never clips or scales.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.units import Vec6
from services.ardusub.frames import (
    FORWARD,
    LATERAL,
    PITCH,
    ROLL,
    THROTTLE,
    TILTED,
    YAW,
    MotorFrame,
    senses,
)
from services.ardusub.motor_curves import PULSE_SPAN, MotorCurves
from services.marine.vehicle import Thruster, total_wrench, wrench_per_newton

Floats = NDArray[np.float64]
CHANNELS = (PITCH, ROLL, THROTTLE, YAW, FORWARD, LATERAL)  # axis of the override channels 1 to 6
STEPS = 2  # of Gauss-Newton at most; with more the wrench is no nearer, for the dead bands
SMALL = (
    0.5 / PULSE_SPAN
)  # [-] of a motor's output: a smaller step is lost in the rounding of pulses
DAMPING = 1e-9  # [-] of the trace: an axis that moves no motor stays where it is
IDENTITY = np.eye(6)
NEUTRAL = 1500  # [µs]
NEUTRALS = (NEUTRAL,) * 6
NO_WRENCH: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


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
    wrench: Vec6  # [N, N m] of it
    limited: bool  # a group of motors, or the yaw channel, was at its limit


def at_rest(thrusters: int) -> MixedSticks:
    return MixedSticks(NEUTRALS, (0.0,) * thrusters, NO_WRENCH, limited=False)


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
        self._thrusters, self._channels = tuple(thrusters), tuple(channels)
        self._yaw_scale = yaw_scale
        self._coupling = coupling if frame.coupled else 0.0
        self._columns = [wrench_per_newton(thruster) for thruster in thrusters]
        self._senses = np.array(senses(frame, thrusters))
        self._factors = np.array(frame.motors, dtype=float)  # (n, 6)
        self._axes_of = np.linalg.pinv(self._factors)  # (6, n)
        self._effect = np.array(self._columns).T * self._senses  # (6, n) of positive outputs
        self._groups = [(group, self._factors[:, group]) for group in _groups(self._factors)]
        self._curves = MotorCurves(thrusters, self._senses)

    def mix(self, thrust: Sequence[float], *, curved: bool = True) -> MixedSticks:
        """
        Args:
            thrust: [N] per thruster, as `ActuatorGate` permits it.
            curved: False: as if thrust were proportional to the pulse, for comparison.
        """
        if not any(thrust):
            return at_rest(len(self._thrusters))
        asked = np.array(thrust) * self._senses
        if curved:
            axes = self._refined(self._axes_of @ self._curves.outputs_for(asked), asked)
        else:
            most = np.array([thruster.max_thrust for thruster in self._thrusters])
            axes = self._axes_of @ (asked / most)
        fitting, was_limited = self._fitting(axes)
        return self._sent(fitting, was_limited)

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
        wrench = total_wrench(self._columns, thrust)
        return MixedSticks(tuple(pulses), thrust, wrench, was_limited)


def _groups(factors: Floats) -> list[list[int]]:
    """Axes that share motors with each other and with none of the others."""
    groups = [sorted(group) for group in TILTED]
    shared = [np.any(factors[:, group] != 0.0, axis=1) for group in groups]
    return [sorted({ROLL, PITCH, THROTTLE, YAW, FORWARD, LATERAL})] if np.any(
        shared[0] & shared[1]
    ) else groups  # fmt: skip
