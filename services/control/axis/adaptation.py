"""What is learnt of heave and yaw in flight, and when the vehicle is calm enough to learn.

Surge and sway are the pilot's forces on most vehicles, and their velocity is not measured: nothing
is learnt of them.
"""

from dataclasses import dataclass, field

from messages.reference import Reference
from messages.state import VehicleState
from messages.units import Vec6
from services.control.axis.model_estimate import (
    HEAVE_NOISE,
    YAW_NOISE,
    AdaptationSettings,
    ModelEstimate,
)
from services.control.axis.plant import plant_of
from services.marine.vehicle import Vehicle

CALM_SPEED = 0.25  # [m/s] surge or sway that would be faster disturbs heave and yaw
LEVEL = 0.2  # [rad] of roll and pitch


@dataclass(slots=True)
class Adaptation:
    settings: AdaptationSettings
    vehicle: Vehicle
    heave: ModelEstimate = field(init=False)
    yaw: ModelEstimate = field(init=False)
    _most: tuple[float, float] = field(init=False)  # [N] surge and sway of a calm vehicle
    _calm: bool = False  # since the last step, as far as the commands go
    _rates: tuple[float, float] = (0.0, 0.0)  # [m/s, rad/s] heave and yaw asked for, 0: not held

    def __post_init__(self) -> None:
        v, s = self.vehicle, self.settings
        self.heave = ModelEstimate(plant_of(v, 2), HEAVE_NOISE, s, s.heave)
        self.yaw = ModelEstimate(plant_of(v, 5), YAW_NOISE, s, s.yaw)
        self._most = plant_of(v, 0).drag(CALM_SPEED), plant_of(v, 1).drag(CALM_SPEED)

    def learn(
        self,
        state: VehicleState,
        heave: tuple[float | None, float],
        yaw: tuple[float | None, float],
        dt: float,
    ) -> None:
        """Take in the `dt` [s] since the last step.

        Args:
            heave, yaw: velocity [m/s, rad/s], None: not known; and mean thrust of the commands
                [N, N m], as of the vehicle file.
        """
        s, submerged = state, state.depth.value > self.vehicle.size[2]
        level = all(abs(tilt.value) < LEVEL for tilt in (s.roll, s.pitch) if tilt.valid)
        calm = self._calm and level
        self.heave.step(*heave, dt, self._rates[0], calm=calm and submerged)
        self.yaw.step(*yaw, dt, self._rates[1], calm=calm)

    def asked(self, reference: Reference, wanted: Vec6) -> None:
        """The reference and the wrench [N, N m] until the next step."""
        r = reference
        self._rates = (
            0.0 if r.heave_force is not None else r.depth.velocity,
            0.0 if r.yaw_moment is not None else r.heading.velocity,
        )
        self._calm = abs(wanted[0]) < self._most[0] and abs(wanted[1]) < self._most[1]

    def saturated(self) -> None:
        """A thruster is at its limit."""
        self._calm = False

    def pause(self) -> None:
        self.heave.pause()
        self.yaw.pause()

    def scaled(self, wanted: Vec6) -> Vec6:
        """The commands [N, N m], as of the vehicle file, that yield a wrench."""
        x, y, z, k, m, n = wanted
        return x, y, z / self.heave.thrust.value, k, m, n / self.yaw.thrust.value
