"""One axis of the thesis' control law: state feedback, feed-forward and a careful integrator.

u = L_r r - L x̂ + L_I e (Andrén 2023, 5.26 to 5.31), with position, velocity and acceleration
references. The acceleration and drag references come from the vehicle's own mass and damping, so
that feedback is left with disturbances only. Three guards keep the integrator honest: the
position error is clamped, the integral is clamped, and an integral that works against a large
error decays.
"""

from dataclasses import dataclass
from typing import Annotated

import msgspec

from messages.reference import Motion

NotNegative = Annotated[float, msgspec.Meta(ge=0.0)]
Above0 = Annotated[float, msgspec.Meta(gt=0.0)]
Share = Annotated[float, msgspec.Meta(gt=0.0, lt=1.0)]
MOVING = 1e-6  # any smaller reference velocity or acceleration is rest


class Gains(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Units: force or moment (N, N m) per position unit (m, rad)."""

    kp: NotNegative  # per position unit
    kd: NotNegative  # per position unit per second
    ki: NotNegative  # per position unit second
    max_error: Above0  # position units; guard 1
    max_integral: NotNegative  # [N] or [N m]; guard 2, well below a saturated thruster
    decay: Share = 0.98  # [-] per step; guard 3
    decay_threshold: Above0 = 0.1  # position units; guard 3 acts on errors larger than this
    acceleration_share: NotNegative = 1.0  # [-] of the acceleration feed-forward; 1 is exact
    drag_share: NotNegative = 1.0  # [-] of the drag feed-forward


class Plant(msgspec.Struct, frozen=True):
    """What the feed-forward knows of the axis."""

    inertia: float  # [kg] or [kg m²], with the water that moves along
    linear: float  # [N s/m] or [N m s/rad]
    quadratic: float  # [N s²/m²] or [N m s²/rad²]


class Effort(msgspec.Struct, frozen=True):
    """What one axis asks for, and why."""

    total: float  # [N] or [N m]
    integral: float  # the integrator's share
    clamped: bool  # guard 1 or 2 was at work


@dataclass(slots=True)
class AxisLaw:
    """The law of one axis. Its only state is the integral."""

    gains: Gains
    plant: Plant
    integral: float = 0.0  # [N] or [N m]

    def step(self, reference: Motion, position: float, rate: float, dt: float) -> Effort:
        """Effort for a reference and an estimate at the same instant.

        Args:
            position, rate: estimate, same units as the reference.
            dt: [s] since the last step.
        """
        g = self.gains
        error = reference.position - position
        near = _clamp(error, g.max_error)
        at_limit = self._integrate(reference, near, dt)
        feedback = g.kp * near + g.kd * (reference.velocity - rate)
        total = self.feed_forward(reference) + feedback + self.integral
        return Effort(total, self.integral, clamped=near != error or at_limit)

    def feed_forward(self, reference: Motion) -> float:
        """Force that makes the undisturbed plant follow the reference exactly."""
        g, plant, v = self.gains, self.plant, reference.velocity
        drag = plant.linear * v + plant.quadratic * v * abs(v)
        inertia = plant.inertia * reference.acceleration
        return g.acceleration_share * inertia + g.drag_share * drag

    def forget(self) -> None:
        self.integral = 0.0

    def _integrate(self, reference: Motion, error: float, dt: float) -> bool:
        """(5.28) to (5.31). Paused during requested motion: the integral is there for buoyancy,
        and keeps what it has learnt until the drone stands still again."""
        g = self.gains
        if self.integral * error < 0 and abs(error) > g.decay_threshold:
            self.integral *= g.decay
            return False
        if abs(reference.velocity) > MOVING or abs(reference.acceleration) > MOVING:
            return False
        wanted = self.integral + g.ki * error * dt
        self.integral = _clamp(wanted, g.max_integral)
        return wanted != self.integral


def _clamp(value: float, most: float) -> float:
    return max(-most, min(most, value))
