"""Motion under a horizontal force: m v̇ = F - d v - q v|v| along one body axis."""

from dataclasses import dataclass

from services.marine.vehicle import Vehicle

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
