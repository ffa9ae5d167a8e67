"""Reference and state at the same instant.

On a busy computer the newest state may belong to a later sensor sample than the newest reference.
The motion in between would then count as a control error.
"""

from msgspec.structs import replace

from messages.reference import Motion, Reference
from messages.units import Ns

LONGEST_NS = 100_000_000  # [ns] no extrapolation over more


def at_sample(reference: Reference, sensor_ns: Ns) -> Reference:
    """The reference extrapolated to a sensor sample [ns], every axis at constant jerk. Unchanged if
    it has no sample stamp, or one too far away."""
    r = reference
    if r.sensor_ns is None or abs(sensor_ns - r.sensor_ns) > LONGEST_NS:
        return r
    t = (sensor_ns - r.sensor_ns) / 1e9
    if t == 0.0:
        return r
    return replace(
        r,
        depth=_extrapolated(r.depth, t),
        heading=_extrapolated(r.heading, t),
        surge=None if r.surge is None else _extrapolated(r.surge, t),
        north=None if r.north is None else _extrapolated(r.north, t),
        east=None if r.east is None else _extrapolated(r.east, t),
    )


def _extrapolated(motion: Motion, t: float) -> Motion:
    """A motion `t` [s] later, at constant jerk."""
    p, v, a, j = motion.position, motion.velocity, motion.acceleration, motion.jerk
    return replace(
        motion,
        position=p + t * (v + t * (a / 2 + t * j / 6)),
        velocity=v + t * (a + t * j / 2),
        acceleration=a + t * j,
    )
