"""Does each thruster do what it is told?

Each report of the driver is held against the command that, so the driver says, was in effect. A
thruster that does not work for a reason we know (it is out of the water, commands are stale) is not
judged, nor is one of which the driver only believes what it does; a dead one is tried again now and
then.
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

GAP_S = 0.2  # [s] after a longer silence of the driver everything begins anew
REMEMBERED = 64  # commands; more than any of them is on its way

PROBE_EVERY_S, PROBE_S = 6.0, 1.5  # [s] a dead thruster is tried again, for so long
PROBE = 2.0  # [-] times the thrust that excites


class ThrusterWatch:
    """Watches all thrusters of a vehicle; `gains` is what to make of them."""

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
        """[-] Per thruster: 1 healthy, 0 dead, −1 reversed, between them weak."""
        return tuple([watched.gain for watched in self._thrusters])

    def sent(self, sensor_ns: Ns | None, thrust: tuple[float, ...]) -> None:
        """Remember a command [N] by the sensor sample behind it; the driver names that too."""
        self._commands.append((sensor_ns, thrust))

    def heard(self, actuation: Actuation, depth: float) -> None:
        """Compare one report of the driver with what should have come of the commands.

        Args:
            depth: [m] of the vehicle; thrusters that may be out of the water are not judged.
        """
        since, self._heard = self._heard, actuation.stamp_ns
        if since is not None and actuation.stamp_ns <= since:
            self._heard = since  # seen before
            return
        before, command = self._in_effect, self._taken(actuation)
        self._in_effect = command
        dt = 0.0 if since is None else (actuation.stamp_ns - since) / 1e9
        known = before is not None and command is not None and 0.0 < dt <= GAP_S
        if not known or len(actuation.thrust) != len(self._thrusters):
            for watched in self._thrusters:
                watched.begin_anew()
            return
        late = (actuation.stamp_ns - (actuation.actuated_ns or 0)) / 1e9
        pace = ReportInterval(dt, max(0.0, min(dt, late)))
        for watched, produced, newtons in zip(
            self._thrusters, actuation.thrust, command or (), strict=True
        ):
            if depth > watched.dry_above:
                watched.judge(newtons, produced, pace)
            else:
                watched.begin_anew()

    def probing(self, thrust: tuple[float, ...], now: Ns) -> tuple[float, ...]:
        """The same commands [N], but now and then a little for a dead thruster that is not
        counted on: else nobody would see it come back."""
        if now / 1e9 % PROBE_EVERY_S >= PROBE_S:
            return thrust
        pairs = zip(self._thrusters, thrust, strict=True)
        return tuple([PROBE * w.excited if w.verdict == "dead" else force for w, force in pairs])

    def _taken(self, actuation: Actuation) -> tuple[float, ...] | None:
        """[N] The command that this report is about; None when it is not one of ours, or tells
        nothing."""
        if actuation.stale or actuation.actuated_ns is None or not actuation.measured:
            return None
        for sensor_ns, thrust in reversed(self._commands):
            if sensor_ns == actuation.sensor_ns:
                return thrust
        return None
