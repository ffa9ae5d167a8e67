"""Fault injection in the simulated vehicle. Requests come from people and tests."""

from typing import Literal

from messages.message import Answer, Request
from messages.units import Finite, Name, Stamp, Text

# Thrusters: dead gives no thrust, reversed the opposite thrust, weak the share `value` of it, stuck
# the last thrust for ever. Sensors: silent publishes nothing, frozen repeats its last sample, noisy
# has `value` times the noise, biased is off by `value` (in the sensor's unit; an IMU's gyroscopes,
# rad/s), broken gives NaN. Some sensors can measure what a pilot must know of: the leak detector is
# wet, the battery low, critical or empty, the temperature hot. A DVL has no lock on the bottom, or
# a wrong one, on a school of fish half-way down that swims ahead with `value` m/s.
FaultKind = Literal[
    "none", "dead", "reversed", "weak", "stuck", "silent", "frozen", "noisy", "biased", "broken",
    "wet", "low", "critical", "empty", "hot", "no_lock", "wrong_lock",
]  # fmt: skip


class FaultRequest(Request, frozen=True, kw_only=True):
    """Break or mend a part. Repeated with the same id until a `FaultAnswer` names that id."""

    part: Name  # a thruster, a sensor such as sensor/pressure or pressure, or "all" to mend
    fault: FaultKind
    value: Finite | None = None


class FaultAnswer(Answer, frozen=True, kw_only=True):
    """The simulator's answer."""

    reason: Text = ""  # why the request was refused
    cause_ns: Stamp | None = None  # [ns] stamp of the request
