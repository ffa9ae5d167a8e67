"""Does each thruster follow its commands?

Each report of the driver is compared with the command that it names as in effect, thruster by
thruster, through a model that has the thruster's dead-band, limits and lag. If model and report
disagree for `PERSISTS_S` while the thruster works, the slope of the regression of report on model
identifies the fault. A thruster is not judged while it is out of the water, while commands are
stale, or if the driver does not measure its thrust. A dead thruster is probed periodically.
"""

from cmath import exp as complex_exp
from collections import deque
from dataclasses import dataclass, field
from math import exp
from typing import Literal

from messages.units import Ns
from messages.vehicle import Actuation
from services.marine.vehicle import LagMode, Thruster, Vehicle, driven

ThrusterVerdict = Literal["fine", "weak", "dead", "reversed"]

GAP_S = 0.2  # [s] a longer silence of the driver resets the averages
REMEMBERED = 64  # commands; more than can be under way at once

PROBE_EVERY_S, PROBE_S = 6.0, 1.5  # [s] period and duration of the probe of a dead thruster
PROBE = 2.0  # [-] times the least thrust that can be judged

WINDOW_S = 0.2  # [s] time constant of the averages
PERSISTS_S = 0.5  # [s] before a verdict changes
EXCITED = 0.05  # [-] of the thrust limit; less than this (or two dead-bands) is not judged
AGREES = 0.35  # [-] error of a healthy thruster, as a share of its thrust
WEAK, DEAD, REVERSED = 0.6, 0.25, -0.5  # [-] slopes below which the verdict is this
FINER = 0.1  # [-] a weak thruster's gain is updated when it has changed by this
DEPTH_SURE = 0.1  # [m] uncertainty of the depth
GAINS: dict[ThrusterVerdict, float] = {"fine": 1.0, "dead": 0.0, "reversed": -1.0}  # [-]


class ThrusterWatch:
    """Watches all thrusters of a vehicle; each one's `gain` is the result."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.thrusters = [WatchedThruster(thruster) for thruster in vehicle.thruster]
        self._commands = deque[tuple[Ns | None, tuple[float, ...]]](maxlen=REMEMBERED)
        self._in_effect: tuple[float, ...] | None = None  # [N] newest command that took effect
        self._heard: Ns | None = None  # stamp of the newest report

    @property
    def verdicts(self) -> tuple[ThrusterVerdict, ...]:
        return tuple([watched.verdict for watched in self.thrusters])

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
        before, command = self._in_effect, None
        # The command that this report names; None if it is unknown, stale or not measured.
        if not actuation.stale and actuation.actuated_ns is not None and actuation.measured:
            for sensor_ns, thrust in reversed(self._commands):
                if sensor_ns == actuation.sensor_ns:
                    command = thrust
                    break
        self._in_effect = command
        dt = 0.0 if since is None else (actuation.stamp_ns - since) / 1e9
        known = before is not None and command is not None and 0.0 < dt <= GAP_S
        if not known or len(actuation.thrust) != len(self.thrusters):
            for watched in self.thrusters:
                watched.reset()
            return
        late = (actuation.stamp_ns - (actuation.actuated_ns or 0)) / 1e9
        late = max(0.0, min(dt, late))  # [s] for which the newest command was in effect
        for watched, produced, newtons in zip(
            self.thrusters, actuation.thrust, command or (), strict=True
        ):
            if depth > watched.dry_above:
                watched.judge(newtons, produced, dt, late)
            else:
                watched.reset()

    def probing(self, thrust: tuple[float, ...], now: Ns) -> tuple[float, ...]:
        """The same commands [N], with a periodic small command to dead thrusters, so that their
        recovery is detected."""
        if now / 1e9 % PROBE_EVERY_S >= PROBE_S:
            return thrust
        pairs = zip(self.thrusters, thrust, strict=True)
        return tuple([PROBE * w.excited if w.verdict == "dead" else force for w, force in pairs])


@dataclass(slots=True)
class WatchedThruster:
    """One thruster compared with a model of itself."""

    thruster: Thruster
    verdict: ThrusterVerdict = "fine"
    gain: float = 1.0  # [-] 1 healthy, 0 dead, −1 reversed, between 0 and 1 weak
    excited: float = field(init=False)  # [N] least thrust that can be judged
    dry_above: float = field(
        init=False
    )  # [m] depth; the propeller may be in the air at a lesser one
    _modes: list[LagMode] = field(init=False)
    _gaps: list[complex] = field(default_factory=list[complex])  # [N] of each mode of the model
    _settles_at: float = 0.0  # [N] final value of the model
    _mm: float = 0.0  # [N²] averages over the window: model², …
    _mp: float = 0.0  # [N²] … model · reported …
    _pp: float = 0.0  # [N²] … and reported²
    _suspected: ThrusterVerdict | None = None  # verdict of the newest reports, if another …
    _for: float = 0.0  # [s] … and for how long

    def __post_init__(self) -> None:
        self._modes = self.thruster.modes
        self.excited = max(EXCITED * self.thruster.max_thrust, 2.0 * self.thruster.dead_band)
        x, y, z = self.thruster.position
        self.dry_above = (x * x + y * y + z * z) ** 0.5 + DEPTH_SURE

    def reset(self) -> None:
        """Restart the averages; the verdict stays."""
        self._gaps = []
        self._mm = self._mp = self._pp = 0.0
        self._suspected, self._for = None, 0.0

    def judge(self, command: float, produced: float, dt: float, late: float) -> None:
        """Take in the reported thrust and update the verdict.

        Args:
            command: [N] the one in effect.
            produced: [N]
            dt: [s] since the report before.
            late: [s] of it for which the newest command was in effect.
        """
        if not self._gaps:
            # The model starts at the report; for a faulty thruster they then diverge.
            self._gaps, self._settles_at = [0j] * len(self._modes), produced
        # What a healthy thruster would produce now.
        before, self._settles_at = self._settles_at, driven(self.thruster, command)
        step, model = before - self._settles_at, self._settles_at
        for index, (pole, share) in enumerate(self._modes):
            gap = self._gaps[index] * complex_exp(pole * dt)
            gap += share * step * complex_exp(pole * late)
            self._gaps[index] = gap
            model += gap.real
        # Averages over the window.
        keep = exp(-dt / WINDOW_S)
        new = 1.0 - keep
        self._mm = keep * self._mm + new * model * model
        self._mp = keep * self._mp + new * model * produced
        self._pp = keep * self._pp + new * produced * produced
        seen = self._seen()
        if seen is None or seen == self.verdict:
            self._suspected, self._for = None, 0.0
            if seen == "weak" and abs(self._slope - self.gain) > FINER:
                self.gain = self._slope
        else:
            self._suspect(seen, dt)

    def _suspect(self, seen: ThrusterVerdict, dt: float) -> None:
        self._for = self._for + dt if seen == self._suspected else 0.0
        self._suspected = seen
        if self._for >= PERSISTS_S:
            self.verdict = seen
            self.gain = self._slope if seen == "weak" else GAINS[seen]
            self._suspected, self._for = None, 0.0

    @property
    def _slope(self) -> float:
        """[-] Of the regression of report on model, through zero."""
        return self._mp / self._mm

    def _seen(self) -> ThrusterVerdict | None:
        """Verdict from the averages; None if they are inconclusive."""
        least = self.excited * self.excited
        at_work = self._mm > least
        error = self._mm - 2.0 * self._mp + self._pp
        if error <= max(0.25 * least, AGREES * AGREES * self._mm):
            return "fine" if at_work else None
        if not at_work:  # it turns without a command: stuck, treated as dead
            return "dead" if self._pp > 4.0 * least else None
        slope = self._slope
        if slope >= WEAK:
            return None
        follows = self._pp - slope * self._mp <= AGREES * AGREES * self._pp
        if not follows or REVERSED <= slope < DEAD:
            return "dead"
        return "reversed" if slope < REVERSED else "weak"
