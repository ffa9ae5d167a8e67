"""What the hull and its weight say of the IMU.

Thrust and drag make an acceleration (Fossen 2011, eq. 6.1); what the accelerometer feels besides,
level, is gravity and its own bias. So one measurement is the direction of gravity, bounds the
velocity through the water, and says which part of the specific force is thrust:

    the level part of R (f − b_a − a(ν, τ)) is zero,    a = ν̇ + ω × ν

in the world's axes, so that it holds for a vehicle that stands on end as well. A vehicle file may
be wrong: the weight of this follows its own innovations.
"""

from collections.abc import Sequence
from math import hypot

from messages import events
from messages.events import Event
from messages.units import Vec3
from messages.vehicle import Actuation
from services.estimation.filter import (
    CURRENT,
    FORCE,
    GYRO,
    TILT,
    VELOCITY,
    ErrorStateFilter,
    to_body,
    to_world,
)
from services.estimation.quantity import Fusion, Quantity
from services.marine.hydrodynamics import Translation
from services.marine.summation import plain_sum
from services.marine.vehicle import GRAVITY, Vehicle, total_wrench, wrench_per_newton
from services.vehicle.mounting import cross

PERIOD = 0.05  # [s] between two uses
# [m/s²] 1σ of an acceleration that nothing explains, and how long it lasts. Tuned on real dives,
# range 0.1 … 0.25; simulated ones hardly mind.
UNEXPLAINED, LASTS = 0.15, 1.0  # [m/s²], [s]
SHARE = 0.3  # [-] of what thrust explains, that may be wrong
WITHOUT_THRUST = 2.0  # [-] times that where no thrust is reported
ARM = 0.04  # [m] from the centre of a turn to where the IMU is thought to be: ω² + ω̇
PATIENCE, OVERTURNED_S = 0.4, 2.0  # [s] of outliers only, of gravity felt upside down
FITS, FITS_S = 0.02, 3.0  # [-] share of outliers lately: less than one in two seconds; [s]
FRESH = 0.5  # [s] an older report of thrust is not used
SLOWS = 0.2  # [1/s] drag of a vehicle of which no file says it: it is not fast for long
DRIVEN = 0.1  # [N] of a thruster that is commanded; one that runs down has less and less
# [-] of all thrust that there is: 1 % of a BlueROV2's is 2.4 N, eight steps of an accelerometer of
# 1 mg; for as long as it does not change the vehicle may be at rest.
NOTICEABLE = 0.01
STEP = 1e-4  # [m/s] of the derivative by differences
RELEVELLED, STOPPED, UNSURE = 0.3, 0.5, 0.3  # [rad], [m/s], [rad/s] 1σ after a restart


class HullModel:
    """Thrust, drag and weight."""

    def __init__(self, vehicle: Vehicle | None, wake_share: float) -> None:
        """`vehicle` None: no acceleration is expected but that of drag."""
        self.driven = self.pushes = False  # the thrusters have run, and do now
        self.changed = False  # … otherwise than before
        self.quantities = tuple(
            Quantity(f"hull_{name}", "m/s²", 1e-3, UNEXPLAINED, LASTS, PATIENCE)
            for name in ("north", "east")
        )
        self._model = None if vehicle is None else Translation(vehicle, wake_share)
        thrusters = () if vehicle is None else vehicle.thruster
        self._columns = [wrench_per_newton(thruster) for thruster in thrusters]
        self._newest: Sequence[float] = [0.0] * len(thrusters)  # [N] when it changed last
        self._noticeable = NOTICEABLE * plain_sum(thruster.max_thrust for thruster in thrusters)
        self._thrust: tuple[float, ...] = (0.0,) * 6
        self._thrust_ns: int | None = None
        self._turn: Vec3 = (0.0, 0.0, 0.0)  # [rad/s] mean, of the use before
        self._told = False
        self._restarted_ns = -(1 << 62)
        self._over = 0.0  # [s] that down has been felt to be up
        self.restart()

    def restart(self) -> None:
        """What has been felt since the last use."""
        self._seconds = 0.0
        self._force = self._rate = (0.0, 0.0, 0.0)

    def actuation(self, sample: Actuation) -> Event | None:
        """Thrust as reported. Returns an event to tell."""
        self.pushes = max(map(abs, sample.thrust), default=0.0) > DRIVEN
        self.driven, self.changed = self.driven or self.pushes, False
        if self._model is None:
            return None
        if len(sample.thrust) != len(self._columns):
            return events.WRONG_LENGTH_ACTUATION()
        pairs = zip(sample.thrust, self._newest, strict=True)
        if plain_sum(abs(new - old) for new, old in pairs) > self._noticeable:
            self._newest, self.changed = sample.thrust, True
        self._thrust, self._thrust_ns = total_wrench(self._columns, sample.thrust), sample.stamp_ns
        return None

    def knows_thrust(self, at_ns: int) -> bool:
        return self._thrust_ns is not None and (at_ns - self._thrust_ns) * 1e-9 < FRESH

    def fits(self, f: ErrorStateFilter, at_ns: int) -> bool:
        """Has what is felt fitted gravity lately?"""
        anew = (at_ns - self._restarted_ns) * 1e-9 < FITS_S
        over = self._over > 0.0 or f.acceleration > 0.5 * GRAVITY
        return not (anew or over) and all(
            quantity.out < FITS and quantity.used_ns is not None for quantity in self.quantities
        )

    def is_afloat(self, at_ns: int) -> bool:
        """Known only where the thrust is known, and was never used."""
        return not self.driven and self.knows_thrust(at_ns)

    def feel(self, f: ErrorStateFilter, force: Vec3, rate: Vec3, dt: float) -> bool:
        """A sample [m/s²], [rad/s], FRD, that the filter has been advanced by. True: it is time for
        `fuse`."""
        biased = force[0] - f.force_bias[0], force[1] - f.force_bias[1], force[2] - f.force_bias[2]
        self._force = _add(self._force, to_world(f.rotation, biased), dt)
        self._rate = _add(self._rate, rate, dt)
        self._seconds += dt
        return self._seconds >= PERIOD - 1e-4

    def fuse(self, f: ErrorStateFilter, at_ns: int) -> Event | None:
        """Compare what was felt with what was to be expected. Returns an event to tell."""
        seconds = self._seconds
        felt: Vec3 = tuple(x / seconds for x in self._force)  # type: ignore[assignment]
        w: Vec3 = tuple(x / seconds - b for x, b in zip(self._rate, f.gyro_bias, strict=True))  # type: ignore[assignment]
        self.restart()
        (vn, ve, vd), (cn, ce), R = f.velocity, f.current, f.rotation
        u = vn - cn, ve - ce, vd
        nu, known = to_body(R, u), self.knows_thrust(at_ns)
        thrust = self._thrust if known else (0.0,) * 6
        a = self._accelerates(nu, w, thrust)
        columns = list[Vec3]()  # ∂a/∂ν in world axes
        for k in range(3):
            moved = [*nu]
            moved[k] += STEP
            b = self._accelerates((moved[0], moved[1], moved[2]), w, thrust)
            columns.append(to_world(R, tuple((y - x) / STEP for x, y in zip(a, b, strict=True))))  # type: ignore[arg-type]
        expected = to_world(R, a)
        s = felt[0] - expected[0], felt[1] - expected[1], felt[2] - expected[2]

        # How wrong may that be?
        pushed = 0.0
        if self._model is not None:
            inertia = self._model.inertia
            pushed = hypot(thrust[0] / inertia[0], thrust[1] / inertia[1])
        spun = tuple((x - y) / seconds for x, y in zip(w, self._turn, strict=True))
        self._turn = w
        turning = w[0] * w[0] + w[1] * w[1] + w[2] * w[2] + hypot(*spun)
        wrong = hypot(UNEXPLAINED, SHARE * pushed) * (1.0 if known else WITHOUT_THRUST)
        wrong = hypot(wrong, ARM * turning)

        found = Fusion.USED
        why = events.OUTLIER_ACTUATION()
        for k, quantity in enumerate(self.quantities):
            quantity.coloured = wrong
            M = to_world_row(R, columns, k)
            tilt = cross(u, M)  # −M [u]× is the row u × M
            lean = ((0.0, s[2], -s[1]), (-s[2], 0.0, s[0]))[k]
            h = (
                (VELOCITY, -M[0]), (VELOCITY + 1, -M[1]), (VELOCITY + 2, -M[2]),
                (TILT, lean[0] + tilt[0]), (TILT + 1, lean[1] + tilt[1]),
                (TILT + 2, lean[2] + tilt[2]),
                (FORCE, -R[k][0]), (FORCE + 1, -R[k][1]), (FORCE + 2, -R[k][2]),
                (CURRENT, M[0]), (CURRENT + 1, M[1]),
            )  # fmt: skip
            outcome = quantity.fuse(f, h, s[k], -s[k], at_ns, why=why)
            if outcome.value > found.value:
                found = outcome
        # A vehicle that is thought to be upside down feels no level force either.
        self._over = self._over + seconds if s[2] > -0.5 * GRAVITY else 0.0
        if self._over > OVERTURNED_S:
            found = Fusion.PERSISTENT
        if found is Fusion.PERSISTENT:
            self._over = 0.0
            self._restarted_ns = at_ns
            f.level(to_body(R, felt), RELEVELLED)
            for k in range(3):
                f.velocity[k] = 0.0 if k < 2 else f.velocity[k]
                f.forget(VELOCITY + k, STOPPED)
                f.widen(GYRO + k, UNSURE)
            for quantity in self.quantities:
                quantity.forget()
            return events.RESTARTED("attitude")
        told, self._told = self._told, found is Fusion.OUTLIER
        return why if self._told and not told else None

    def _accelerates(self, nu: Vec3, w: Vec3, thrust: tuple[float, ...]) -> Vec3:
        """[m/s²] ν̇ + ω × ν of the vehicle's origin, along its own axes."""
        u, v, h = nu
        if self._model is None:
            return -SLOWS * u, -SLOWS * v, -SLOWS * h
        p, q, r = w
        x, y, z = self._model.acceleration((u, v, h, p, q, r), thrust)  # type: ignore[arg-type]
        return x + q * h - r * v, y + r * u - p * h, z + p * v - q * u


def to_world_row(R: tuple[Vec3, Vec3, Vec3], columns: list[Vec3], k: int) -> Vec3:
    """Row k of J Rᵀ, of a J whose columns are given."""
    a, b, c = columns[0][k], columns[1][k], columns[2][k]
    x, y, z = R
    return (
        a * x[0] + b * x[1] + c * x[2],
        a * y[0] + b * y[1] + c * y[2],
        a * z[0] + b * z[1] + c * z[2],
    )


def _add(total: Vec3, v: Vec3, dt: float) -> Vec3:
    return total[0] + v[0] * dt, total[1] + v[1] * dt, total[2] + v[2] * dt
