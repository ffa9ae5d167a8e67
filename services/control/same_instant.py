"""Reference and state at the same instant.

The newest reference is of a sensor sample that a busy computer came to some while ago; the newest
state may be of a later one. Their difference would count the way in between as an error.
"""

from msgspec.structs import replace

from messages.reference import Motion, Reference
from messages.units import Ns

LONGEST_NS = 100_000_000  # [ns] stamps further apart say nothing of each other


def at_sample(reference: Reference, sensor_ns: Ns) -> Reference:
    """The reference run on to a sensor sample [ns], every axis with its jerk. One that belongs to
    no sample, or to one too far away, stays as it is."""
    r = reference
    if r.sensor_ns is None or abs(sensor_ns - r.sensor_ns) > LONGEST_NS:
        return r
    t = (sensor_ns - r.sensor_ns) / 1e9
    if t == 0.0:
        return r
    return replace(
        r,
        depth=_run_on(r.depth, t),
        heading=_run_on(r.heading, t),
        surge=None if r.surge is None else _run_on(r.surge, t),
        north=None if r.north is None else _run_on(r.north, t),
        east=None if r.east is None else _run_on(r.east, t),
    )


def _run_on(motion: Motion, t: float) -> Motion:
    """A motion `t` [s] later."""
    p, v, a, j = motion.position, motion.velocity, motion.acceleration, motion.jerk
    return replace(
        motion,
        position=p + t * (v + t * (a / 2 + t * j / 6)),
        velocity=v + t * (a + t * j / 2),
        acceleration=a + t * j,
    )
