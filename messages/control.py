"""Forces asked of the thrusters. From `control`; received by `simulator` or a vehicle driver."""

from messages.message import Message
from messages.units import Count, Finite, Stamp, Stick, Thrusts, Ttl, Vec6

THRUST_TTL_MS = 200.0  # [ms] older thruster commands count as zero thrust


class Wrench(Message, frozen=True, kw_only=True):
    """Force and moment about the vehicle's origin, body frame FRD. A report, not a command: a
    vehicle side, also of a board that mixes by itself, is fed with `ThrusterCommand`."""

    sensor_ns: Stamp | None  # [ns] sensor sample behind this wrench
    wanted: Vec6  # [N, N m] X, Y, Z, K, M, N that the control law asked for
    achieved: Vec6  # [N, N m] sum of the thruster commands
    depth_integral: Finite  # [N] integrator's share of Z
    heading_integral: Finite  # [N m] integrator's share of N
    saturated: bool  # achieved differs from wanted because a thruster is at its limit
    disturbance: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # [N, N m] estimated


class ThrusterCommand(Message, frozen=True, kw_only=True):
    """A force for each thruster."""

    sensor_ns: Stamp | None  # [ns] sensor sample that caused it
    pilot_ns: Stamp | None  # [ns] pilot command that caused it
    thrust: Thrusts  # [N] per thruster, in the order of the vehicle file
    ttl_ms: Ttl = THRUST_TTL_MS  # [ms] after stamp_ns the driver stops the thrusters
    epoch: Count = 0
    armed: bool = False  # False: the thrusters must not turn, and their ESCs may be off
    armed_ns: Stamp | None = None  # [ns] as in the reference
    gripper: Stick = 0.0  # [-] + opens, - closes; it ends with this command, as the thrust does
