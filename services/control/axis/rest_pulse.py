"""Short pulses, for an axis at rest that needs less effort than its thrusters can hold.

Within the thrusters' dead-band feedback has no effect: the error grows until it calls for the
dead-band's edge, which then moves the vehicle further than it was off. A pulse at the edge of one
thruster is as small as it is short. With linear drag D it turns a vehicle without other forces by
J / D, with J [N m s] its moment times its length, whatever the thrusters' lag, and a vehicle that
coasts at the rate v goes on by M v / D. So the length that brings it to its reference is known
before. What each pulse has done corrects that, for a vehicle with another drag than its file's.

The thrusters take turns, so that the side forces of their pulses, which move the vehicle by
centimetres, cancel out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from services.control.axis.plant import Plant

LONGEST_PULSE = 15  # steps
DAMPED, SETTLED = 2.0, 4.0  # time constants of the hull and of the thrusters, to come to rest
SMOOTHING = 0.2  # [s]
BEYOND = 0.5  # [-] of the zone; so far beyond the reference, where pulse follows pulse one way
MOVED = 0.3  # [-] of what was planned; a vehicle that moved less lies on something
LONGEST_WAIT = 64.0  # [-] times the usual pause, at most, after pulses that moved nothing
CORRECTED_AT_ONCE, LARGEST_CORRECTION = (
    1.25,
    4.0,
)  # [-] by which the model of the pulse is corrected


@dataclass(slots=True)
class RestPulse:
    """Says when to give a pulse, while the effort of the law is without effect.

    Args:
        plant: of the axis, with linear drag.
        lag: [s] of its thrusters.
        period: [s] for which an effort is held.
        pushes: [N m] smallest effort of each thruster alone.
        zone: [rad] errors up to this are left alone.
    """

    plant: Plant
    lag: float
    period: float
    pushes: Sequence[float]
    zone: float
    effective: bool = True  # the thrusters gave something for the last effort
    turn: int = 0  # whose push the newest pulse is, of `pushes`
    correction: float = 1.0  # [-] what a pulse turns, over what the model says
    _left: int = 0  # steps of the pulse under way, and one of nothing that ends it
    _sign: float = 0.0  # of the newest pulse
    _end: float = 0.0  # [rad] error at which the vehicle comes to rest, without the rate's noise
    _since: float = 0.0  # [s] with neither motion of the reference nor pulse
    _before: float = 0.0  # [rad] where it would have come to rest without the newest pulse
    _planned: float = 0.0  # [rad] turn by the newest pulse; 0: none, or its effect is known
    _patience: float = 1.0  # [-] of the pause between pulses

    def step(self, error: float, rate: float, *, resting: bool) -> float | None:
        """What to give instead of the law's effort, in pushes of thruster `turn`: 1 or -1, and 0
        for a step after it. None: the law's effort.

        Args:
            error: [rad] reference minus position.
            rate: [rad/s] of the vehicle.
            resting: the reference rests.
        """
        if not resting:
            self.forget()
            return None
        if self._left > 0:
            self._left -= 1
            return self._sign if self._left > 0 else 0.0
        if self.effective:
            self._since = self._planned = 0.0
            return None
        self._since += self.period
        end = error - rate * self._coasting
        self._end += min(1.0, self.period / min(self._since, SMOOTHING)) * (end - self._end)
        if self._since < self._pause:
            return None
        self._judge(self._end)
        if self._since < self._pause or abs(self._end) <= self.zone:
            return None
        self._begin(self._end)
        return self._sign

    @property
    def _coasting(self) -> float:
        """[s]"""
        return self.plant.inertia / self.plant.linear

    @property
    def _pause(self) -> float:
        """[s] Until the thrusters have stopped, and after a pulse until its effect is seen."""
        pulsed = self._patience if self._sign else 0.0
        return SETTLED * self.lag + pulsed * DAMPED * self._coasting

    def _judge(self, end: float) -> None:
        """What did the newest pulse do?"""
        if self._planned == 0.0:
            return
        moved = (self._before - end) / self._planned
        self._planned = 0.0
        if moved < MOVED:  # pulses would go on for ever
            self._patience = min(LONGEST_WAIT, 2.0 * self._patience)
            return
        self._patience = 1.0
        corrected = self.correction * min(CORRECTED_AT_ONCE, max(1.0 / CORRECTED_AT_ONCE, moved))
        self.correction = min(
            LARGEST_CORRECTION, max(1.0, corrected)
        )  # never longer than the model says

    def _begin(self, end: float) -> None:
        sign = 1.0 if end > 0.0 else -1.0
        beyond = BEYOND * self.zone if sign == self._sign else 0.0
        self.turn = (self.turn + 1) % len(self.pushes)
        push = self.correction * self.pushes[self.turn]
        one = push * self.period / self.plant.linear  # [rad] turn by one step of it
        steps = max(1, min(LONGEST_PULSE, round((abs(end) + beyond) / one)))
        self._left, self._sign, self._since = steps, sign, 0.0
        self._before, self._planned = end, sign * steps * one

    def forget(self) -> None:
        """Begin anew, as after a motion. What a pulse does stays known."""
        self._left, self._since, self._patience = 0, 0.0, 1.0
        self._sign = self._planned = 0.0
