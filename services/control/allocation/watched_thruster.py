"""One thruster compared with a model of itself.

The model has the thruster's dead-band, limits and lag. If model and report disagree for
`PERSISTS_S` while the thruster works, the slope of the regression of report on model identifies the
fault.
"""

from cmath import exp as complex_exp
from dataclasses import dataclass, field
from math import exp
from typing import Literal

from services.marine.thruster_lag import LagMode
from services.marine.thrusters import driven
from services.marine.vehicle import Thruster

ThrusterVerdict = Literal["fine", "weak", "dead", "reversed"]

WINDOW_S = 0.2  # [s] time constant of the averages
PERSISTS_S = 0.5  # [s] before a verdict changes
EXCITED = 0.05  # [-] of the thrust limit; less than this (or two dead-bands) is not judged
AGREES = 0.35  # [-] error of a healthy thruster, as a share of its thrust
WEAK, DEAD, REVERSED = 0.6, 0.25, -0.5  # [-] slopes below which the verdict is this
FINER = 0.1  # [-] a weak thruster's gain is updated when it has changed by this
DEPTH_SURE = 0.1  # [m] uncertainty of the depth
GAINS: dict[ThrusterVerdict, float] = {"fine": 1.0, "dead": 0.0, "reversed": -1.0}  # [-]


class ReportInterval:
    """The time between two reports, and the decay of lag modes over it."""

    def __init__(self, dt: float, late: float) -> None:
        """
        Args:
            dt: [s] between the reports.
            late: [s] of it for which the newest command was in effect.
        """
        self.dt, self.late = dt, late
        self.keep = exp(-dt / WINDOW_S)  # [-] share of the averages that stays
        self._decays: dict[complex, tuple[complex, complex]] = {}

    def decay(self, pole: complex) -> tuple[complex, complex]:
        """[-] Of a mode over the whole interval, and over its later part."""
        if pole not in self._decays:
            self._decays[pole] = complex_exp(pole * self.dt), complex_exp(pole * self.late)
        return self._decays[pole]


@dataclass(slots=True)
class WatchedThruster:
    thruster: Thruster
    verdict: ThrusterVerdict = "fine"
    gain: float = 1.0  # [-]
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

    @property
    def excited(self) -> float:
        """[N] Least thrust that can be judged."""
        return max(EXCITED * self.thruster.max_thrust, 2.0 * self.thruster.dead_band)

    @property
    def dry_above(self) -> float:
        """[m] Vehicle depth above which the propeller may be in the air, at any attitude."""
        x, y, z = self.thruster.position
        return (x * x + y * y + z * z) ** 0.5 + DEPTH_SURE

    def reset(self) -> None:
        """Restart the averages; the verdict stays."""
        self._gaps = []
        self._mm = self._mp = self._pp = 0.0
        self._suspected, self._for = None, 0.0

    def judge(self, command: float, produced: float, interval: ReportInterval) -> None:
        """Take in the reported thrust [N] and update the verdict.

        Args:
            command: [N] the one in effect.
        """
        if not self._gaps:
            # The model starts at the report; for a faulty thruster they then diverge.
            self._gaps, self._settles_at = [0j] * len(self._modes), produced
        model, keep = self._follow(command, interval), interval.keep
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
            self._suspect(seen, interval.dt)

    def _follow(self, command: float, interval: ReportInterval) -> float:
        """[N] What a healthy thruster would produce now."""
        before, self._settles_at = self._settles_at, driven(self.thruster, command)
        step, thrust = before - self._settles_at, self._settles_at
        for index, (pole, share) in enumerate(self._modes):
            whole, late = interval.decay(pole)
            gap = self._gaps[index] * whole + share * step * late
            self._gaps[index] = gap
            thrust += gap.real
        return thrust

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
