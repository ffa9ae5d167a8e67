"""One piloted axis: its law, the transfer between its modes, and its counts."""

from collections.abc import Callable
from dataclasses import dataclass

from messages.message import Estimate
from messages.reference import Motion
from services.control.axis.axis_law import AxisLaw
from services.control.axis.bumpless_transfer import BumplessTransfer

Count = Callable[[str], None]


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
            self.count(f"invalid:state.{self.name}")
            return self.blind(
                motion, dt, extra, rate=rate.value if rate.valid else None, upright=upright
            )
        if late and not self._late:
            self.law.recall()
        self._late = late
        if late:
            self.count(f"late:state.{self.name}")
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
            self.count(f"clamped:control.{self.name}")
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
        if velocity is None or self._blind:
            self.law.pause()
        else:
            self.law.learn(velocity, force, dt, freely=freely, short=short)

    def forget(self) -> None:
        self._blind = self._late = False
        self.law.forget()
        self.transfer.forget()
