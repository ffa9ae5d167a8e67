"""How an axis is held. A piloted one: its law, the transfer between its modes, and its counts. Roll
and pitch: level, by a spring and a damper."""

from collections.abc import Callable
from dataclasses import dataclass

import msgspec

from messages import events
from messages.events import Event
from messages.message import Estimate
from messages.reference import Motion
from messages.units import NotNegativeSetting, Ns
from services.control.axis.axis_law import AxisLaw

Count = Callable[[Event], None]


@dataclass(slots=True)
class BumplessTransfer:
    """A change of an axis' mode without a step: the force of the old mode fades into that of the
    new one."""

    seconds: float  # [s] of the fade
    _mode: str | None = None  # at the last step; None: not yet stepped
    _total: float = 0.0  # [N] or [N m] output of the last step
    _offset: float = 0.0  # [N] or [N m] old minus new at the change
    _left: float = 0.0  # [-] of the offset

    def step(self, mode: str, force: float, dt: float) -> float:
        """The output [N] or [N m], for the `force` that `mode` requires.

        At a mode change the output is that of the previous step; then the difference fades
        linearly.
        """
        if self._mode not in (None, mode):
            self._offset, self._left = self._total - force, 1.0
        else:
            self._left = max(0.0, self._left - dt / self.seconds)
        self._mode = mode
        self._total = force + self._left * self._offset
        return self._total

    def forget(self) -> None:
        """End the fade; the next step has no transfer."""
        self._mode, self._left = None, 0.0


@dataclass(slots=True)
class PilotedAxis:
    name: str  # as in the vehicle file
    law: AxisLaw
    transfer: BumplessTransfer
    count: Count
    own: bool = True  # it needs a lasting force to rest, as buoyancy does; False: none
    _late: bool = False  # at the last step
    _blind: bool = False  # the position has not been known since

    def held(
        self,
        motion: Motion,
        position: Estimate,
        rate: Estimate,
        dt: float,
        *,
        late: bool = False,
        extra: float = 0.0,
        upright: float = 1.0,
    ) -> float:
        """Effort [N] or [N m] that brings the axis to its reference. Without a valid position
        there is no spring, see `blind`. `late`: the rate is delayed, so feedback gains are lower.
        """
        if not (position.valid and rate.valid):
            self.count(events.INVALID(f"state.{self.name}"))
            return self.blind(
                motion, dt, extra, rate=rate.value if rate.valid else None, upright=upright
            )
        if late and not self._late:
            self.law.recall()
        self._late = late
        if late:
            self.count(events.LATE(f"state.{self.name}"))
        return self.fed_back(
            motion, position.value, rate.value, dt, late=late, extra=extra, upright=upright
        )

    def fed_back(
        self,
        motion: Motion,
        position: float,
        rate: float,
        dt: float,
        *,
        water: float = 0.0,
        extra: float = 0.0,
        late: bool = False,
        upright: float = 1.0,
    ) -> float:
        """As `held`, in a current `water` and with an additional force `extra`."""
        self._blind = False
        effort = self.law.step(motion, position, rate, dt, water, late=late)
        if effort.clamped:
            self.count(events.CLAMPED(f"control.{self.name}"))
        return self.transfer.step("held", (effort.total + extra) / upright, dt)

    def blind(
        self,
        motion: Motion,
        dt: float,
        extra: float = 0.0,
        *,
        rate: float | None = None,
        upright: float = 1.0,
    ) -> float:
        """Effort without a position: feed-forward, damping of a known rate, and compensation.

        What was learnt last may be of the estimate that has just turned out to be wrong. So the
        compensation fades to what was learnt before that and nothing more is learnt; where a
        vehicle at rest needs no force, as in yaw, it fades to zero.
        """
        if not self._blind:
            if self.own:
                self.law.recall()
            else:
                self.law.forget()
        self._blind, self._late = True, False
        total = (self.law.blind(motion, rate) + extra) / upright
        return self.transfer.step("blind" if rate is None else "damped", total, dt)

    def forced(self, force: float, dt: float) -> float:
        """The pilot's force; the axis is not held."""
        self._blind = False
        self.law.idle()
        return self.transfer.step("forced", force, dt)

    def learn(
        self,
        velocity: float | None,
        force: float,
        dt: float,
        *,
        freely: bool = False,
        short: float = 0.0,
    ) -> None:
        """Update the disturbance observer; a velocity of None, or a position that is not known,
        pauses it. `freely`, `short`: see `AxisLaw.learn`."""
        known = None if self._blind else velocity
        self.law.learn(known, force, dt, freely=freely, short=short)

    def forget(self) -> None:
        self._blind = self._late = False
        self.law.forget()
        self.transfer.forget()


class RollPitchGains(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Roll or pitch held at zero, if the thrusters can drive it. 0, 0: hydrostatic only."""

    kp: NotNegativeSetting = 0.0  # [N m/rad]
    kd: NotNegativeSetting = 0.0  # [N m s/rad]


@dataclass(slots=True)
class RollPitchHold:
    gains: RollPitchGains
    _angle: float = 0.0  # [rad] at the last step
    _at: Ns | None = None  # [ns] stamp of its sensor sample; None: not known
    rate: float = 0.0  # [rad/s] of the angle; 0 while it is not known

    def step(self, angle: Estimate, sensor_ns: Ns) -> float:
        """Moment [N m]. The rate is the difference of two angles of the attitude filter, which
        integrates the gyroscope and so adds little noise."""
        if not angle.valid:
            self.forget()
            return 0.0
        if self._at is None:
            self.rate = 0.0
        elif sensor_ns > self._at:
            self.rate = (angle.value - self._angle) / ((sensor_ns - self._at) * 1e-9)
        self._angle, self._at = angle.value, sensor_ns
        return -self.gains.kp * angle.value - self.gains.kd * self.rate

    def forget(self) -> None:
        """Restart the rate with the next sample."""
        self._at, self.rate = None, 0.0
