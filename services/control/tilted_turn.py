"""A turn of a tilted vehicle, seen from its own axes.

The heading turns about the vertical; the gyroscope, the hull's drag and the thrusters' moment are
about the body's down axis. With the rates of Euler angles (Fossen 2011, eq. 2.28)

    r = ψ̇ cos φ cos θ - θ̇ sin φ.

A vehicle that surges and dives at once pitches by more than twenty degrees: then r is less than ψ̇
by a tenth, which a law that compares them takes for an error.
"""

from math import cos, sin

from msgspec.structs import replace

from messages.message import Estimate
from messages.reference import Motion


def along_body(heading: Motion, roll: Estimate, pitch: Estimate) -> Motion:
    """The heading's reference as a motion about the body's down axis: ψ̇ cos φ cos θ. Its position
    stays the heading [rad]. Unchanged while the tilt is not known."""
    if not (roll.valid and pitch.valid):
        return heading
    share = cos(roll.value) * cos(pitch.value)
    return replace(
        heading,
        velocity=share * heading.velocity,
        acceleration=share * heading.acceleration,
        jerk=share * heading.jerk,
    )


def of_heading(yaw_rate: Estimate, roll: Estimate, pitch_rate: float) -> Estimate:
    """The part of the rate r [rad/s] that turns the heading, r + θ̇ sin φ."""
    if not roll.valid:
        return yaw_rate
    return replace(yaw_rate, value=yaw_rate.value + pitch_rate * sin(roll.value))
