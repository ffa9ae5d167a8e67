"""The axes a pilot moves, their limits, and the generator behind each."""

from dataclasses import dataclass
from typing import Annotated, Self

import msgspec

from messages.reference import Motion
from services.reference.minimum_jerk import Limits, Ramp, Sample
from services.reference.vector import VectorRamp

Above0 = Annotated[float, msgspec.Meta(gt=0.0, le=1e6)]
Angle = Annotated[float, msgspec.Meta(ge=-1.6, le=1.6)]


class VelocityAxis(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A stick that is a velocity, with its position integral."""

    max_velocity: Above0  # per s, at full stick
    max_acceleration: Above0  # per s²
    jerk: Above0  # per s³
    max_error: Above0  # position units; the reference waits for a vehicle that is held back
    stop_acceleration: Above0  # per s², of an emergency stop
    stop_jerk: Above0  # per s³, of an emergency stop

    @property
    def limits(self) -> Limits:
        return Limits(self.jerk, self.max_acceleration)

    @property
    def stop(self) -> Limits:
        return Limits(self.stop_jerk, self.stop_acceleration)


class HorizontalForce(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Surge and sway sticks as one force, whose changes run straight. Limits are of its norm."""

    max_surge: Above0 = 30.0  # [N] at full stick
    max_sway: Above0 = 20.0  # [N] at full stick
    max_rate: Above0 = 40.0  # [N/s] plays the part of the acceleration
    max_rate_change: Above0 = 120.0  # [N/s²] plays the part of the jerk
    stop_rate: Above0 = 80.0  # [N/s] of an emergency stop
    stop_rate_change: Above0 = 400.0  # [N/s²] of an emergency stop

    @property
    def limits(self) -> Limits:
        return Limits(self.max_rate_change, self.max_rate)

    @property
    def stop(self) -> Limits:
        return Limits(self.stop_rate_change, self.stop_rate)


class TiltAxis(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The camera, which stops smoothly at the end of its range."""

    max_velocity: Above0 = 0.6  # [rad/s] at full stick
    max_acceleration: Above0 = 2.0  # [rad/s²]
    jerk: Above0 = 8.0  # [rad/s³]
    lowest: Angle = -0.52  # [rad] + upwards
    highest: Angle = 0.52  # [rad]

    @property
    def limits(self) -> Limits:
        return Limits(self.jerk, self.max_acceleration)


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [reference] of a vehicle file."""

    heave: VelocityAxis = VelocityAxis(0.5, 0.5, 1.5, 0.2, 1.0, 4.0)  # [m]
    yaw: VelocityAxis = VelocityAxis(1.05, 1.5, 4.0, 0.5, 3.0, 12.0)  # [rad]
    horizontal: HorizontalForce = HorizontalForce()
    tilt: TiltAxis = TiltAxis()


@dataclass(slots=True)
class Axes:
    heave: Ramp  # [m] positive down
    yaw: Ramp  # [rad] accumulated
    tilt: Ramp  # [rad]
    pace: Ramp  # [m] along a path that was followed; its end is ramped out here
    force: VectorRamp  # [N] surge and sway, as a "velocity"

    @classmethod
    def of(cls, settings: Settings) -> Self:
        return cls(
            Ramp(settings.heave.limits),
            Ramp(settings.yaw.limits),
            Ramp(settings.tilt.limits),
            Ramp(settings.heave.limits),
            VectorRamp(settings.horizontal.limits, (0.0, 0.0), (0.0, 0.0)),
        )

    def rest(self, depth: float, heading: float, t: float) -> None:
        """Everything at rest here. The camera stays as it is."""
        self.heave.rest(depth, t)
        self.yaw.rest(heading, t)
        self.pace.rest(0.0, t)
        self.force.rest(t)


def motion(ramp: Ramp, t: float) -> Motion:
    return Motion(*ramp.at(t), jerk_limit=ramp.in_force.jerk)


def on_a_path(sample: Sample) -> Motion:
    """A motion whose pace a path sets."""
    return Motion(*sample)
