"""The bottom below the vehicle, and a height that is held above it.

The bottom's depth is the measured altitude plus the vehicle's own depth, so the vehicle's motion
does not count as one of the bottom. Altitudes come once a second and may be a fish's: what does not
fit is believed once it has lasted.

Holding a height adds nothing to the reference law of the depth. It asks for a velocity, as the
stick does: over flat ground none, so the reference rests exactly as in depth hold; over a slope
that of the bottom. What counts is where the reference would come to rest relative to the bottom,
so a stop of the stick is the stop of depth hold.

Where a depth is held and no height, the same law says how fast the stick may still lead down.
"""

from dataclasses import dataclass, field
from math import exp, hypot

from messages import topics
from messages.sensors import AltitudeSample, DvlSample
from messages.state import VehicleState
from services.marine.rhythm import SampleRhythm
from services.marine.summation import plain_sum
from services.reference.trajectory.minimum_jerk import Limits, Sample, solve, travelled

MEMORY_S = 1.5  # [s] the filter's fading memory
GATE = 0.3  # [m] a sample further from what was expected does not fit
LASTING_S = 0.9  # [s] samples that do not fit, all to one side, are taken for true after that
FASTEST = 1.0  # [m/s] no bottom changes faster below a vehicle that follows it
UNSEEN_S = 2.5  # [s] after the newest altitude the bottom is not taken to fall away any further
PATIENCE_S = (topics.DVL.stale_after_ns or 0) / 1e9  # [s] without one that fits it is lost
BAND = 0.15  # [m] the height may be off by so much before the reference moves
FLAT = 0.04  # [m/s] a bottom that changes more slowly counts as flat
RETURN_S = 1.0  # [s] time constant of the return to the height, and of the last way to a limit
AHEAD_S = 1.5  # [s] so much of the way ahead is added to the least height: nobody measures there
SAME_VELOCITY = 0.01  # [m/s] a velocity that differs by less is not asked for anew


@dataclass(slots=True)
class Bottom:
    """Its depth and how that changes below the vehicle, by a filter of fading memory. Times `t` in
    seconds, never decreasing."""

    _depth: float = 0.0  # [m] at `_at`
    _rate: float = 0.0  # [m/s] + falling away
    _at: float | None = None  # [s] of the newest sample believed; None: not known
    _began: float | None = None  # [s] of the first call
    _now: float = 0.0  # [s] of the newest
    _count: int = 0  # samples since the start
    speed: float = 0.0  # [m/s] over the ground, of the newest that was measured
    _doubted: tuple[float, float] | None = None  # [s], [m] the first of those that do not fit
    _stamp_ns: int = -1  # of the newest sample
    _heard: float = 0.0  # [s] of the newest sample, also of one without an altitude
    _rhythm: SampleRhythm = field(default_factory=lambda: SampleRhythm(PATIENCE_S))

    @property
    def known(self) -> bool:
        return self._at is not None

    @property
    def lost(self) -> bool:
        """It is not known, and there was time for an altitude, also after a restart."""
        return not self.known and self._began is not None and self._now - self._began > PATIENCE_S

    @property
    def rate(self) -> float:
        """[m/s] + falling away; 0 where it counts as flat."""
        unseen = self._at is not None and self._now - self._at > UNSEEN_S
        flat = abs(self._rate) < FLAT or (unseen and self._rate > 0.0)
        return 0.0 if flat else self._rate

    def depth(self, t: float) -> float:
        """[m] At `t` [s]; only while it is known."""
        assert self._at is not None
        return self._depth + self.rate * (t - self._at)

    def see(
        self,
        dvl: DvlSample | None,
        state: VehicleState | None,
        t: float,
        altimeter: AltitudeSample | None = None,
    ) -> None:
        """The newest fresh samples, as often as anybody likes, beside the newest state. Where there
        is an altimeter, the height is its own; how fast the bottom passes, the DVL says."""
        self._began, self._now = t if self._began is None else self._began, t
        if self._at is not None and (
            t - self._at > PATIENCE_S or t - self._heard > self._rhythm.patience
        ):
            self._at, self._doubted = None, None
        if dvl is not None and dvl.velocity is not None:
            self.speed = hypot(*dvl.velocity[:2])
        sample = altimeter or dvl
        if sample is None or state is None or sample.stamp_ns == self._stamp_ns:
            return
        self._stamp_ns = sample.stamp_ns
        self._rhythm.see(sample.stamp_ns)
        age = max(0.0, (state.sensor_ns - sample.stamp_ns) / 1e9)
        self._heard = t - age
        if sample.altitude is None or not (state.depth.valid and state.depth_rate.valid):
            return
        self._take(sample.altitude + state.depth.value - age * state.depth_rate.value, t - age)

    def shift(self, by: float) -> None:
        """The depths [m] by which it is known were measured anew."""
        self._depth += by

    def _take(self, found: float, t: float) -> None:
        """A depth of the bottom [m], measured at `t` [s]."""
        if self._at is None:
            self._depth, self._rate, self._at, self._count = found, 0.0, t, 1
            return
        dt = max(0.0, t - self._at)
        expected = self._depth + self._rate * dt
        off = found - expected
        if abs(off) > GATE:
            self._doubt(found, off, t)
            return
        # Growing memory at first; critically damped g-h filter after that (Brookner 1998, §1.3).
        keep = exp(-dt / MEMORY_S)
        self._count += 1
        self._depth = expected + max(1.0 - keep * keep, 1.0 / self._count) * off
        if dt > 0.0:
            self._rate = _within(self._rate + (1.0 - keep) ** 2 * off / dt, FASTEST)
        self._at, self._doubted = t, None

    def _doubt(self, found: float, off: float, t: float) -> None:
        """A sample that does not fit, `off` [m] from what was expected."""
        first = self._doubted
        at = self._at or 0.0
        if first is None or (first[1] - self._depth - self._rate * (first[0] - at)) * off < 0.0:
            self._doubted = t, found
        elif t - first[0] >= LASTING_S:
            self._rate = _within((found - first[1]) / (t - first[0]), FASTEST)
            self._depth, self._at, self._count, self._doubted = found, t, 2, None


@dataclass(slots=True)
class HeightHold:
    """The height that is held, and the velocity of the depth that keeps it."""

    fastest: float  # [m/s] of the depth
    floor: float  # [m] at rest the reference comes no nearer to the bottom
    wanted: float | None = None  # [m] above the bottom; None: taken where the reference stops next
    _asked: float = 0.0  # [m/s] newest

    def forget(self) -> None:
        """Hold none, or another one."""
        self.wanted, self._asked = None, 0.0

    def velocity(
        self, stick: float, here: Sample, limits: Limits, bottom: Bottom, t: float
    ) -> float:
        """[m/s] Positive down, for the reference `here`, within its limits, at `t` [s].

        Args:
            stick: [m/s] 0: let go.
        """
        rate, height = bottom.rate, _height(here, limits, bottom, t)
        if stick != 0.0:
            self.wanted, asked = None, rate + stick
        else:
            if self.wanted is None:
                self.wanted = max(height, self.floor + BAND)
            error = height - self.wanted
            asked = rate + (error - _within(error, BAND)) / RETURN_S
        asked = _within(min(asked, self._most(height, bottom)), self.fastest)
        if asked == 0.0 or stick != 0.0 or abs(asked - self._asked) >= SAME_VELOCITY:
            self._asked = asked
        return self._asked

    def sinking(
        self, stick: float, here: Sample, limits: Limits, bottom: Bottom, t: float
    ) -> float:
        """[m/s] What is left of a stick that leads down to the bottom, where no height is held.
        Never upwards: a bottom that rises moves nothing. It ends `BAND` above the least height,
        where noise of the altitude warns of nothing.

        Args:
            stick: [m/s] > 0.
        """
        height = _height(here, limits, bottom, t) - BAND
        return max(0.0, min(stick, self._most(height, bottom)))

    def _most(self, height: float, bottom: Bottom) -> float:
        """[m/s] The fastest way down, for a reference that would stop at `height` [m]."""
        return bottom.rate + (height - self.floor - AHEAD_S * bottom.speed) / RETURN_S


def _height(here: Sample, limits: Limits, bottom: Bottom, t: float) -> float:
    """[m] Above the bottom, where the reference `here` at `t` [s] would stop relative to it."""
    stop = solve(here.velocity, here.acceleration, bottom.rate, limits)
    ends = t + plain_sum(segment.duration for segment in stop)
    return bottom.depth(ends) - here.position - travelled(stop)


def _within(value: float, most: float) -> float:
    return max(-most, min(most, value))
