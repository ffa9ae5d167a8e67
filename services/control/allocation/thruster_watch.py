"""Does each thruster follow its commands?

Each report of the driver is compared with the command that it names as in effect. A thruster is not
judged while it is out of the water, while commands are stale, or if the driver does not measure its
thrust. A dead thruster is probed periodically.
"""

from collections import deque

from messages.units import Ns
from messages.vehicle import Actuation
from services.control.allocation.watched_thruster import (
    ReportInterval,
    ThrusterVerdict,
    WatchedThruster,
)
from services.marine.vehicle import Vehicle

GAP_S = 0.2  # [s] a longer silence of the driver resets the averages
REMEMBERED = 64  # commands; more than can be under way at once

PROBE_EVERY_S, PROBE_S = 6.0, 1.5  # [s] period and duration of the probe of a dead thruster
PROBE = 2.0  # [-] times the least thrust that can be judged


class ThrusterWatch:
    """Watches all thrusters of a vehicle; `gains` is the result."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._thrusters = [WatchedThruster(thruster) for thruster in vehicle.thruster]
        self._commands = deque[tuple[Ns | None, tuple[float, ...]]](maxlen=REMEMBERED)
        self._in_effect: tuple[float, ...] | None = None  # [N] newest command that took effect
        self._heard: Ns | None = None  # stamp of the newest report

    @property
    def verdicts(self) -> tuple[ThrusterVerdict, ...]:
        return tuple([watched.verdict for watched in self._thrusters])

    @property
    def gains(self) -> tuple[float, ...]:
        """[-] Per thruster: 1 healthy, 0 dead, −1 reversed, between 0 and 1 weak."""
        return tuple([watched.gain for watched in self._thrusters])

    def sent(self, sensor_ns: Ns | None, thrust: tuple[float, ...]) -> None:
        """Store a command [N] under its sensor stamp, which the driver's report repeats."""
        self._commands.append((sensor_ns, thrust))

    def heard(self, actuation: Actuation, depth: float) -> None:
        """Compare one report of the driver with the model's response to the commands.

        Args:
            depth: [m] of the vehicle; thrusters that may be out of the water are not judged.
        """
        since, self._heard = self._heard, actuation.stamp_ns
        if since is not None and actuation.stamp_ns <= since:
            self._heard = since  # a repetition
            return
        before, command = self._in_effect, self._reported(actuation)
        self._in_effect = command
        dt = 0.0 if since is None else (actuation.stamp_ns - since) / 1e9
        known = before is not None and command is not None and 0.0 < dt <= GAP_S
        if not known or len(actuation.thrust) != len(self._thrusters):
            for watched in self._thrusters:
                watched.reset()
            return
        late = (actuation.stamp_ns - (actuation.actuated_ns or 0)) / 1e9
        interval = ReportInterval(dt, max(0.0, min(dt, late)))
        for watched, produced, newtons in zip(
            self._thrusters, actuation.thrust, command or (), strict=True
        ):
            if depth > watched.dry_above:
                watched.judge(newtons, produced, interval)
            else:
                watched.reset()

    def probing(self, thrust: tuple[float, ...], now: Ns) -> tuple[float, ...]:
        """The same commands [N], with a periodic small command to dead thrusters, so that their
        recovery is detected."""
        if now / 1e9 % PROBE_EVERY_S >= PROBE_S:
            return thrust
        pairs = zip(self._thrusters, thrust, strict=True)
        return tuple([PROBE * w.excited if w.verdict == "dead" else force for w, force in pairs])

    def _reported(self, actuation: Actuation) -> tuple[float, ...] | None:
        """[N] The command that this report names; None if it is unknown, stale or not measured."""
        if actuation.stale or actuation.actuated_ns is None or not actuation.measured:
            return None
        for sensor_ns, thrust in reversed(self._commands):
            if sensor_ns == actuation.sensor_ns:
                return thrust
        return None
