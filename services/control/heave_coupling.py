"""What surge, sway and tilt do to heave, from the vehicle's model.

The law of heave takes the vehicle for level: M ż' = Z - D(ż) + w, with everything else in the
disturbance w, which its observer learns only after it acts. But most of w is known. With ν the
velocity through the water, ω the angular rate and e the world's down axis, all along body axes,

    ż = e · ν,    z̈ = e · (ν̇ + ω × ν),    M ν̇ = τ - C(ν) ν - D(ν) ν + lift
                                             (Fossen 2011, eq. 6.1 to 6.3)

of which the law knows e₃ Z and D(ż). The rest is the coupling: the vertical part of surge and sway
thrust and of their drag, the drag of a tilted hull, and the lift of a hull that the flow meets at
an angle (services/marine/hydrodynamics.py), by far the largest: 20 N on a small vehicle that dives
at full surge.

Surge and sway are not measured on most vehicles. They are predicted by the same equations from the
thrust, through the water: a steady current does not change them.
"""

from dataclasses import dataclass, field
from math import cos, sin

from messages.state import VehicleState
from messages.units import Vec3, Vec6
from services.marine.attitude import down_in_body
from services.marine.hydrodynamics import Translation, flow
from services.marine.vehicle import Vehicle

LEVEL_DOWN: Vec3 = (0.0, 0.0, 1.0)
LEAST_UPRIGHT = 0.5  # [-] of the heave thrust that is vertical; with less, nothing is modelled
HEAVE = 2


@dataclass(slots=True)
class HeaveCoupling:
    """Surge and sway through the water, and what they do to heave.

    Args:
        vehicle: of the vehicle file.
        lag: [s] of the heave thrusters.
        wake_share: [-] of the Munk moment that the wake cancels, see `wake_fins`.
    """

    vehicle: Vehicle
    lag: float
    wake_share: float = 1.0
    surge: float = 0.0  # [m/s] through the water
    sway: float = 0.0  # [m/s]
    force: float = 0.0  # [N] coupling along down in the last step
    upright: float = 1.0  # [-] e₃, of the heave thrust that is vertical
    _down: Vec3 = LEVEL_DOWN  # e
    _rate: Vec3 = (0.0, 0.0, 0.0)  # [rad/s] ω
    _hull: Translation = field(init=False)

    def __post_init__(self) -> None:
        self._hull = Translation(self.vehicle, self.wake_share)

    def step(
        self, state: VehicleState, rates: tuple[float, float], thrust: Vec6, dt: float
    ) -> None:
        """Take in the last `dt` [s].

        Args:
            rates: [rad/s] of the roll and pitch angles.
            thrust: [N, N m] mean of the wrench since the last step.
        """
        # How the vehicle lies and turns. Level while that is not known.
        self._down, self._rate = LEVEL_DOWN, (0.0, 0.0, 0.0)
        if state.roll.valid and state.pitch.valid and state.yaw_rate.valid:
            down = down_in_body(state.attitude)
            if down[HEAVE] > LEAST_UPRIGHT:
                # ω from the rates of the angles (Fossen 2011, eq. 2.28).
                roll, pitch, r = state.roll.value, state.pitch.value, state.yaw_rate.value
                roll_rate, pitch_rate = rates
                heading_rate = (r + pitch_rate * sin(roll)) / (cos(roll) * cos(pitch))
                p = roll_rate - heading_rate * sin(pitch)
                q = pitch_rate * cos(roll) + heading_rate * cos(pitch) * sin(roll)
                self._down, self._rate = down, (p, q, r)
        self.upright = self._down[HEAVE]
        # What acts on it, and how fast it is one step later.
        heave_rate = state.depth_rate.value if state.depth_rate.valid else 0.0
        nu = flow(self.surge, self.sway, heave_rate, self._down, self._rate)
        along, across, down = self._hull.acceleration(nu, thrust)
        self.force = self._coupling(nu, (along, across, down), thrust, heave_rate, self._down)
        self.surge += along * dt
        self.sway += across * dt

    def ahead(self, velocity: float, thrust: Vec6) -> float:
        """[N] The coupling that the heave thrusters should meet now, because they lag.

        Args:
            velocity: [m/s] of the depth, as it should be.
            thrust: [N, N m] to which the wrench settles.
        """
        down, nu = self._down, flow(self.surge, self.sway, velocity, self._down, self._rate)
        along, across, _ = self._hull.acceleration(nu, thrust)
        (a, b, c), (p, q, r) = down, self._rate
        t = self.lag
        soon = a + t * (r * b - q * c), b + t * (p * c - r * a), c + t * (q * a - p * b)
        nu = flow(self.surge + t * along, self.sway + t * across, velocity, soon, self._rate)
        return self._coupling(nu, self._hull.acceleration(nu, thrust), thrust, velocity, soon)

    def forget(self) -> None:
        """The vehicle rests, level."""
        self.surge = self.sway = self.force = 0.0
        self.upright, self._down, self._rate = 1.0, LEVEL_DOWN, (0.0, 0.0, 0.0)

    def _coupling(
        self, nu: Vec6, acceleration: Vec3, thrust: Vec6, heave_rate: float, down: Vec3
    ) -> float:
        """[N] What acts along down besides what the law of heave knows."""
        (u, v, w, p, q, r), (x, y, z), (a, b, c) = nu, acceleration, down
        vertical = a * (x + q * w - r * v) + b * (y + r * u - p * w) + c * (z + p * v - q * u)
        linear = self.vehicle.linear_damping[HEAVE]
        quadratic = self.vehicle.quadratic_damping[HEAVE]
        known = c * thrust[HEAVE] - (linear + quadratic * abs(heave_rate)) * heave_rate
        return self._hull.inertia[HEAVE] * vertical - known
