"""Trouble on purpose: what a simulated vehicle can be asked to break. From people and tests."""

from typing import Literal

from messages.message import Answer, Request
from messages.units import Finite, Stamp

# Thrusters: dead gives nothing, reversed the opposite, weak `value` of the thrust, stuck what was
# asked for last. Sensors: silent says nothing, frozen repeats itself, noisy has `value` times the
# noise, biased is off by `value` (in the sensor's unit; an IMU its gyroscopes, rad/s), broken says
# what is not a number.
FaultKind = Literal[
    "none", "dead", "reversed", "weak", "stuck", "silent", "frozen", "noisy", "biased", "broken"
]


class FaultRequest(Request, frozen=True, kw_only=True):
    """Break or mend a part. Repeated with the same id until a `FaultAnswer` names that id."""

    part: str  # a thruster's name, a sensor's key such as sensor/pressure, or "all" to mend
    fault: FaultKind
    value: Finite | None = None


class FaultAnswer(Answer, frozen=True, kw_only=True):
    """The simulator's word on it."""

    reason: str = ""  # why not
    cause_ns: Stamp | None = None  # [ns] stamp of the request
