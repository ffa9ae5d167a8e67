"""Propagates one axis of the reference with the drone's own law and the commands on the link."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp

from messages.reference import Motion
from services.marine.vehicle import Vehicle
from services.reference.trajectory.minimum_jerk import Limits, Ramp, Sample

CATCH_UP = 0.5  # [s] time constant with which the vehicle's rate error decays


@dataclass(frozen=True, slots=True)
class Change:
    """A stick position on the link."""

    at: float  # [s] when the drone acts on it
    target: float  # per second


def reference_ahead(
    motion: Motion, begun: float, changes: Sequence[Change], limits: Limits, until: float
) -> Sample:
    """The reference at time `until`, from what it was at `begun` [s].

    Args:
        motion: the newest reference that has arrived.
        changes: stick positions in the order of their effect. The first is the one that the
            reference already includes.
    """
    ramp = Ramp(limits)
    ramp.take(Sample(motion.position, motion.velocity, motion.acceleration, motion.jerk), begun)
    for change in changes:
        if change.at >= until:
            break
        ramp.aim(change.target, max(change.at, begun))
    return ramp.at(until)


def coasting(motion: Motion, seconds: float) -> Sample:
    """Extrapolation with constant jerk, for a reference along a path or a turn."""
    v, a, j = motion.velocity, motion.acceleration, motion.jerk
    velocity = v + seconds * (a + seconds * j / 2)
    position = motion.position + seconds * (v + seconds * (a / 2 + seconds * j / 6))
    return Sample(position, velocity, a + seconds * j, j)


def joined(
    ahead: Sample, motion: Motion, position: float, rate: float, seconds: float
) -> tuple[float, float]:
    """Position and rate of the vehicle: its position error stays, its rate error decays.

    Args:
        ahead: predicted reference.
        motion: reference `seconds` before.
        position, rate: of the vehicle at that time.
    """
    rate_error, decay = rate - motion.velocity, exp(-seconds / CATCH_UP)
    error = position - motion.position + rate_error * CATCH_UP * (1.0 - decay)
    return ahead.position + error, ahead.velocity + rate_error * decay


STEP = 0.02  # [s]


@dataclass(slots=True)
class Drift:
    """Model of one body axis, driven by the reference forces that arrive."""

    inertia: float  # [kg] with added mass
    linear: float  # [N s/m]
    quadratic: float  # [N s²/m²]
    velocity: float = 0.0  # [m/s]

    @classmethod
    def of(cls, vehicle: Vehicle, axis: int) -> "Drift":
        """0 for surge, 1 for sway."""
        return cls(
            vehicle.mass + vehicle.added_mass[axis],
            vehicle.linear_damping[axis],
            vehicle.quadratic_damping[axis],
        )

    def go(self, force: float, seconds: float) -> float:
        """[m] Displacement while this force [N] acts; the velocity is kept for the next call."""
        steps = max(1, round(seconds / STEP))
        dt, moved = seconds / steps, 0.0
        for _ in range(steps):
            v = self.velocity
            drag = self.linear + self.quadratic * abs(v)
            # Implicit in the drag, so that any step is stable.
            self.velocity = (self.inertia * v + force * dt) / (self.inertia + drag * dt)
            moved += (v + self.velocity) / 2 * dt
        return moved
