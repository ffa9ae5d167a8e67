"""A place that is held and moved by the surge and sway sticks: velocities in the body, a position
in NED.

Two motions add up. What the vehicle, or a path, did before comes to rest in NED, straight and in
closed form (`vector.py`). The stick's velocity u is such a vector reference in the body; with the
rotation R by the heading reference ψ, and S a quarter turn clockwise, it is in NED

    v = R u                a = R (u' + ψ' S u)
    j = R (u'' + 2 ψ' S u' + ψ'' S u - ψ'² u)

so position, velocity and acceleration are continuous because those of u and ψ are. Its position is
the integral of v by the trapezoid rule with end correction, which is exact for cubics: exact while
the heading stands, of fourth order while it turns.
"""

from dataclasses import dataclass, field
from math import hypot

from services.reference.guidance.ground_motion import GroundMotion, Pair, turned
from services.reference.trajectory.minimum_jerk import Limits, Sample
from services.reference.trajectory.vector import VectorRamp, bounded_plan

STILL = (0.0, 0.0)
NOTHING = Sample(0.0, 0.0, 0.0, 0.0)


@dataclass(slots=True)
class StationKeeping:
    """Time is the caller's, in seconds, and never runs backwards. `step` moves it on."""

    limits: Limits  # of the norms, of each of the two motions
    held: bool = False  # False: nobody uses it
    offset: float = 0.0  # [rad] north heading minus control heading
    _before: VectorRamp = field(init=False)  # [m/s] north, east: what comes to rest
    _stick: VectorRamp = field(init=False)  # [m/s] surge, sway
    _moved: Pair = STILL  # [m] north, east, by the stick and by `shift`
    _since: float = 0.0  # [s] of the newest step
    _by_stick: tuple[Sample, Sample] = field(init=False)  # north and east, at the newest step

    def __post_init__(self) -> None:
        self._before = VectorRamp(self.limits, STILL, STILL)
        self._stick = VectorRamp(self.limits, STILL, STILL)
        self._by_stick = NOTHING, NOTHING

    @property
    def now(self) -> tuple[Sample, Sample]:
        """North and east at the newest step."""
        return self._at(0), self._at(1)

    def take_measured(self, ground: GroundMotion, t: float) -> None:
        """Hold from `t` [s] on: go on as the vehicle moves, and come to rest."""
        self.offset = ground.offset
        pairs = zip(ground.position, ground.velocity, strict=True)
        north, east = (Sample(x, v, 0.0, 0.0) for x, v in pairs)
        self.take(north, east, t)

    def take(self, north: Sample, east: Sample, t: float) -> None:
        """Go on from another generator's motion at `t` [s], and come to rest."""
        v, a = (north.velocity, east.velocity), (north.acceleration, east.acceleration)
        stages = tuple(bounded_plan(v, a, STILL, self.limits))
        here = (north.position, east.position)
        self._before = VectorRamp(self.limits, here, STILL, t, stages)
        self._stick = VectorRamp(self.limits, STILL, STILL, t)
        self._moved, self._since, self._by_stick = STILL, t, (NOTHING, NOTHING)
        self.held = True

    def step(self, heading: Sample, offset: float, t: float) -> None:
        """Move on to `t` [s], where the heading reference is `heading`. A new offset of north
        counts only once nothing moves that it could turn."""
        stick, time = self._stick.at(t), t - self._since
        if all(s.velocity == 0.0 == s.acceleration for s in stick):
            self.offset = offset
        before, self._by_stick = self._by_stick, self._in_north(stick, heading)
        north, east = (
            x
            + time * (a.velocity + b.velocity) / 2
            + time * time * (a.acceleration - b.acceleration) / 12
            for x, a, b in zip(self._moved, before, self._by_stick, strict=True)
        )
        self._moved, self._since = (north, east), t

    def aim(self, velocity: Pair, t: float) -> None:
        """From `t` [s], that of the newest step, go to this surge and sway velocity [m/s]."""
        self._stick.aim(velocity, t)

    def brake(self, t: float, limits: Limits) -> None:
        """From `t` [s], that of the newest step, come to rest by these limits."""
        self._before.aim(STILL, t, limits)
        self._stick.aim(STILL, t, limits)

    def shift(self, north: float, east: float) -> None:
        """Move the position reference without touching its velocity."""
        self._moved = (self._moved[0] + north, self._moved[1] + east)

    def settles(self) -> float:
        """[s] When the wanted velocity is reached."""
        ramps = (self._before, self._stick)
        return max(ramp.since + sum(stage[0].duration for stage in ramp.stages) for ramp in ramps)

    def error(self, ground: GroundMotion) -> tuple[Pair, float]:
        """[m] From the vehicle to the reference, north and east, and its size."""
        north, east = (s.position - x for s, x in zip(self.now, ground.position, strict=True))
        return (north, east), hypot(north, east)

    def _at(self, axis: int) -> Sample:
        x, v, a, j = self._before.at(self._since)[axis]
        _, by_v, by_a, by_j = self._by_stick[axis]
        return Sample(x + self._moved[axis], v + by_v, a + by_a, j + by_j)

    def _in_north(self, stick: tuple[Sample, ...], heading: Sample) -> tuple[Sample, Sample]:
        """The stick's motion in NED, without its position."""
        (_, u, a, j), (_, v, b, k) = stick
        angle, r, bend = heading.position + self.offset, heading.velocity, heading.acceleration
        vn, ve = turned((u, v), angle)
        an, ae = turned((a - r * v, b + r * u), angle)
        jn, je = turned(
            (j - 2 * r * b - bend * v - r * r * u, k + 2 * r * a + bend * u - r * r * v), angle
        )
        return Sample(0.0, vn, an, jn), Sample(0.0, ve, ae, je)
