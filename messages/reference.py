"""Where the drone should be. From `reference`; received by `control`."""

import msgspec

from messages.message import Message
from messages.units import Count, Finite, NotNegative, Stamp, Stick


class Motion(msgspec.Struct, frozen=True):
    """One axis of a smooth reference, valid at the message's `sensor_ns`."""

    position: Finite  # [m] or [rad]
    velocity: Finite  # per second
    acceleration: Finite  # per second²
    jerk: Finite  # per second³
    jerk_limit: NotNegative | None = None  # per second³, in force; None where a path sets the pace


class Reference(Message, frozen=True, kw_only=True):
    """All axes at one instant."""

    sensor_ns: Stamp | None  # [ns] sensor sample that caused this reference
    pilot_ns: Stamp | None  # [ns] pilot command that caused it
    epoch: Count = 0  # authority epoch of the newest command
    armed: bool  # False: thrusters stay off, the rest follows the vehicle
    armed_ns: Stamp | None = None  # [ns] of the request that armed it; a later disarm overrules it
    depth: Motion  # NED, positive down
    heading: Motion  # accumulates past ±π
    surge_force: Finite  # [N] body, ramped with limited jerk
    sway_force: Finite  # [N] body
    # While there is a force or a moment, `depth` or `heading` follows the measured value.
    heave_force: Finite | None = None  # [N] body; None: depth is held
    yaw_moment: Finite | None = None  # [N m] body; None: heading is held
    surge: Motion | None = None  # [m] along a path followed without position; adds to the force
    north: Motion | None = None  # [m] NED, where the measured position is held or follows a path
    east: Motion | None = None  # [m] NED, present when north is
    tilt: Motion = Motion(0.0, 0.0, 0.0, 0.0)  # [rad] camera, + upwards
    gripper: Stick = 0.0  # [-] of the pilot at this instant: + opens, - closes
