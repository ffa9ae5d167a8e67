"""Limits of the reference: the table [reference] of a vehicle file."""

from typing import Annotated

import msgspec

from messages.units import NotNegativeSetting, Positive, Share, WithinAnHour
from services.reference.trajectory.minimum_jerk import Limits

TiltAngle = Annotated[float, msgspec.Meta(ge=-1.6, le=1.6)]


class VelocityAxis(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An axis whose stick is a velocity; its reference is the position integral."""

    max_velocity: Positive  # [m/s or rad/s] at full stick
    max_acceleration: Positive  # [m/s² or rad/s²]
    jerk: Positive  # [m/s³ or rad/s³]
    max_error: Positive  # [m or rad] the reference stays this close to the vehicle
    stop_acceleration: Positive  # [m/s² or rad/s²] of an emergency stop
    stop_jerk: Positive  # [m/s³ or rad/s³] of an emergency stop

    @property
    def limits(self) -> Limits:
        return Limits(self.jerk, self.max_acceleration)

    @property
    def stop(self) -> Limits:
        return Limits(self.stop_jerk, self.stop_acceleration)


class HorizontalForce(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Surge and sway sticks as one force vector. Limits apply to its norm."""

    max_surge: Positive = 30.0  # [N] at full stick
    max_sway: Positive = 20.0  # [N] at full stick
    max_rate: Positive = 40.0  # [N/s] corresponds to an acceleration
    max_rate_change: Positive = 120.0  # [N/s²] corresponds to a jerk
    stop_rate: Positive = 80.0  # [N/s] of an emergency stop
    stop_rate_change: Positive = 400.0  # [N/s²] of an emergency stop

    @property
    def limits(self) -> Limits:
        return Limits(self.max_rate_change, self.max_rate)

    @property
    def stop(self) -> Limits:
        return Limits(self.stop_rate_change, self.stop_rate)


class StickForce(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The heave or yaw stick while that axis is not held."""

    full: Positive  # [N or N m] at full stick
    max_rate: Positive  # [N/s or N m/s]
    max_rate_change: Positive  # [N/s² or N m/s²]

    @property
    def limits(self) -> Limits:
        return Limits(self.max_rate_change, self.max_rate)


class TiltAxis(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Camera tilt, with a smooth stop at the ends of its range."""

    max_velocity: Positive = 0.6  # [rad/s] at full stick
    max_acceleration: Positive = 2.0  # [rad/s²]
    jerk: Positive = 8.0  # [rad/s³]
    lowest: TiltAngle = -0.52  # [rad] + upwards
    highest: TiltAngle = 0.52  # [rad]

    def __post_init__(self) -> None:
        if not self.lowest <= self.highest:
            raise ValueError(
                f"tilt: lowest is {self.lowest:g}, must not be above highest, {self.highest:g} rad"
            )

    @property
    def limits(self) -> Limits:
        return Limits(self.jerk, self.max_acceleration)


class FailsafeSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Thresholds and times of the failsafe table (failsafe/table.py)."""

    depth_limit: Positive = 100.0  # [m] the reference goes no deeper
    surface_depth: Annotated[float, msgspec.Meta(ge=0.0, le=100.0)] = 0.5  # [m] an ascent ends here
    ascent_speed: Annotated[float, msgspec.Meta(ge=0.02, le=2.0)] = 0.15  # [m/s]
    pilot_patience: WithinAnHour = 60.0  # [s] without pilot or link before the ascent
    leak_patience: Annotated[float, msgspec.Meta(ge=0.0, le=3600.0)] = 10.0  # [s] before the ascent
    battery_patience: Annotated[float, msgspec.Meta(ge=0.0, le=3600.0)] = 10.0  # [s]
    battery_low: Share = 0.25  # [-] of its charge left
    battery_critical: Share = 0.1  # [-]
    hot: Annotated[float, msgspec.Meta(ge=20.0, le=150.0)] = 60.0  # [°C] in the enclosure
    floor_distance: NotNegativeSetting = 0.5  # [m] above the bottom, by a DVL; 0: to the bottom

    def __post_init__(self) -> None:
        if not self.surface_depth < self.depth_limit:
            raise ValueError(
                f"surface_depth is {self.surface_depth:g}, must be above depth_limit, "
                f"{self.depth_limit:g} m"
            )
        if not self.battery_critical < self.battery_low:
            raise ValueError(
                f"battery_critical is {self.battery_critical:g}, must be less than "
                f"battery_low, {self.battery_low:g}"
            )


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [reference] of a vehicle file."""

    heave: VelocityAxis = VelocityAxis(0.5, 0.5, 1.5, 0.2, 1.0, 4.0)  # [m]
    yaw: VelocityAxis = VelocityAxis(1.05, 1.5, 4.0, 0.5, 3.0, 12.0)  # [rad]
    place: VelocityAxis = VelocityAxis(0.4, 0.4, 1.0, 1.0, 0.8, 3.0)  # [m] norms of surge, sway
    horizontal: HorizontalForce = HorizontalForce()
    heave_force: StickForce = StickForce(15.0, 40.0, 120.0)  # [N]
    yaw_moment: StickForce = StickForce(3.0, 8.0, 40.0)  # [N m]
    tilt: TiltAxis = TiltAxis()
    failsafe: FailsafeSettings = FailsafeSettings()
    # [m] furthest that a stop moves the held depth to where the vehicle stands; 0: it stays
    standstill: NotNegativeSetting = 0.05

    def __post_init__(self) -> None:
        if not self.failsafe.ascent_speed <= self.heave.max_velocity:
            raise ValueError(
                f"failsafe.ascent_speed is {self.failsafe.ascent_speed:g}, must not be above "
                f"heave.max_velocity, {self.heave.max_velocity:g} m/s"
            )
