"""One axis run ahead: the drone's own law over the stick positions that are on their way."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp

from messages.reference import Motion
from services.reference.trajectory.minimum_jerk import Limits, Ramp, Sample

CATCH_UP = 0.5  # [s] in which a vehicle that is faster or slower than its reference joins it


@dataclass(frozen=True, slots=True)
class Change:
    """A stick position on its way."""

    at: float  # [s] when the drone acts on it
    target: float  # per second


def reference_ahead(
    motion: Motion, begun: float, changes: Sequence[Change], limits: Limits, until: float
) -> Sample:
    """The reference at time `until`, from what it was at `begun` [s].

    Args:
        motion: the newest reference that has arrived.
        changes: stick positions in the order of their effect. The first is the one the reference
            was already on its way to.
    """
    ramp = Ramp(limits)
    ramp.take(Sample(motion.position, motion.velocity, motion.acceleration, motion.jerk), begun)
    for change in changes:
        if change.at >= until:
            break
        ramp.aim(change.target, max(change.at, begun))
    return ramp.at(until)


def coasting(motion: Motion, seconds: float) -> Sample:
    """Where a path or a turn sets the pace: the reference goes on as it does."""
    v, a, j = motion.velocity, motion.acceleration, motion.jerk
    velocity = v + seconds * (a + seconds * j / 2)
    position = motion.position + seconds * (v + seconds * (a / 2 + seconds * j / 6))
    return Sample(position, velocity, a + seconds * j, j)


def joined(
    ahead: Sample, motion: Motion, position: float, rate: float, seconds: float
) -> tuple[float, float]:
    """Position and rate of the vehicle: what it was off its reference stays, what it was faster
    fades.

    Args:
        ahead, motion: the reference then and `seconds` before.
        position, rate: of the vehicle before.
    """
    faster, kept = rate - motion.velocity, exp(-seconds / CATCH_UP)
    off = position - motion.position + faster * CATCH_UP * (1.0 - kept)
    return ahead.position + off, ahead.velocity + faster * kept
