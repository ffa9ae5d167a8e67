"""Depth of many dives: `services/estimation/depth/` in lanes, for sensors that are as they should
be. A lane whose pressure would be rejected, or whose accelerometer distrusted, is lost."""

from typing import Any

import numpy as np

from services.estimation.aiding import MEMORY as AIDING_MEMORY
from services.estimation.aiding import SAMPLES
from services.estimation.attitude_axes import MOVING_STD, AttitudeAxes
from services.estimation.depth import depth_filter as filters
from services.estimation.depth import depth_observer as observer
from services.estimation.depth.trial import MOST_MEAN
from services.marine.vehicle import GRAVITY
from tools.sweep.fast.lanes import Lanes, clamped, where
from tools.sweep.fast.swell import Swells


class DepthFilters:
    """`DepthFilter`: `state` is (9, lanes), `covariance` (9, 9, lanes)."""

    def __init__(
        self,
        settings: filters.DepthSettings,
        depth: Lanes,
        depth_std: Lanes,
        lack: Lanes,
        axes: AttitudeAxes,
    ) -> None:
        """After a calibration at rest at this depth [m].

        Args:
            lack: [m/s²] of gravity that the specific force had.
        """
        self._qa = settings.acceleration_noise**2
        self._walks = [settings.bias_walk**2] * 3 + [filters.TILT_WALK**2] * 2
        self.doubt_of_force = np.ones(len(depth))
        self._free = 0.0  # [s]
        self.state = np.zeros((filters.SIZE, len(depth)))
        self.state[0] = depth
        self.covariance = np.zeros((filters.SIZE, filters.SIZE, len(depth)))
        self.covariance[0, 0], self.covariance[1, 1] = depth_std**2, observer.RESTING_RATE_STD**2
        self._level(settings.horizontal_bias_std, axes, lack)

    def _level(self, prior: float, axes: Any, lack: Lanes) -> None:
        P, lever = self.covariance, prior / GRAVITY
        for k in (7, 8):
            P[k, k] = filters.AT_REST_STD**2
        (fn, fe, fd), (sn, se, sd), (dn, de, dd) = axes.forward, axes.starboard, axes.down
        of_biases = (
            (0.0, 0.0, prior),
            (prior, 0.0, 0.0),
            (0.0, prior, 0.0),
            (lever * fe, lever * se, lever * de),
            (-lever * fn, -lever * sn, -lever * dn),
        )
        for k, (a, b, c) in enumerate(of_biases, start=2):
            for m, (d, e, f) in enumerate(of_biases, start=2):
                P[k, m] = a * d + b * e + c * f
        for k in (5, 6):
            P[k, k] += filters.LEVELLED_STD**2
        seen = dd * P[:, 2] + fd * P[:, 3] + sd * P[:, 4]
        variance = dd * seen[2] + fd * seen[3] + sd * seen[4] + observer.RESTING_BIAS_STD**2
        self._correct(seen, lack, variance)

    def predict(self, acceleration: Lanes, dt: float, axes: Any) -> None:
        """Advance by `dt` [s] with a mean acceleration [m/s²] along down, bias included."""
        x, P = self.state, self.covariance
        x[5] -= axes.levelled[0]
        x[6] -= axes.levelled[1]
        anew = (axes.tilt_std > filters.UNSURE) & (P[5, 5] < (0.5 * axes.tilt_std) ** 2)
        if np.any(anew):
            for k in (5, 6):
                x[k, anew] = P[k][:, anew] = P[:, k][:, anew] = 0.0
                P[k, k, anew] = axes.tilt_std[anew] ** 2
        a, force_north, force_east = self._in_world(acceleration, axes)
        q = self.acceleration_density(axes)
        x[7] += (force_north - GRAVITY * x[6]) * dt
        x[8] += (force_east + GRAVITY * x[5]) * dt

        # P = F P Fᵀ: first the rows of F P that the accelerations move, then those times Fᵀ.
        half = 0.5 * dt * dt
        (fn, fe, fd), (sn, se, sd) = axes.forward, axes.starboard
        dn, de, dd = axes.down

        def accelerated(p: Any) -> tuple[Lanes, Lanes, Lanes]:
            """What a row or column of the states 2 to 6 adds to those of rate and velocity."""
            below, ahead, aside, about_north, about_east = p
            return (
                force_east * about_north
                - (dd * below + fd * ahead + sd * aside)
                - force_north * about_east,
                -(dn * below + fn * ahead + sn * aside) - GRAVITY * about_east,
                GRAVITY * about_north - (de * below + fe * ahead + se * aside),
            )

        down, north, east = accelerated(P[2:7])
        moved = np.empty((4, *P.shape[1:]))
        moved[0] = P[0] + dt * P[1] + half * down
        moved[1] = P[1] + dt * down
        moved[2] = P[7] + dt * north
        moved[3] = P[8] + dt * east
        down, north, east = accelerated(np.moveaxis(moved[:, 2:7], 1, 0))
        moved[:, 0] += dt * moved[:, 1] + half * down
        moved[:, 1] += dt * down
        moved[:, 7] += dt * north
        moved[:, 8] += dt * east
        for k, row in zip((0, 1, 7, 8), moved, strict=True):
            P[k] = row
            P[:, k] = row
        x[0] += (x[1] + 0.5 * a * dt) * dt
        x[1] += a * dt

        P[0, 0] += q * (dt**3 / 3.0)
        P[1, 0] = P[0, 1] = P[0, 1] + q * (dt**2 / 2.0)
        P[1, 1] += q * dt
        for k, walk in enumerate((*self._walks, q, q), start=2):
            P[k, k] += walk * dt

        self._free += dt
        if self._free >= filters.SPEED_EVERY:
            self._expect_speed(axes.velocity, axes.velocity_std)

    def acceleration_density(self, axes: Any) -> Lanes:
        vibration = 2 * np.maximum(0.0, axes.noise - self._qa)
        doubt = self.doubt_of_force
        return self._qa * np.minimum(doubt, filters.MOST_OF_NOISE) + doubt * vibration

    def _in_world(self, acceleration: Lanes, axes: Any) -> tuple[Lanes, Lanes, Lanes]:
        _, _, below, forward, starboard, about_north, about_east, _, _ = self.state
        (fn, fe, fd), (sn, se, sd), (north, east) = axes.forward, axes.starboard, axes.force
        dn, de, dd = axes.down
        north = north - (forward * fn + starboard * sn + below * dn)
        east = east - (forward * fe + starboard * se + below * de)
        down = acceleration - (forward * fd + starboard * sd + below * dd)
        return down + about_north * east - about_east * north, north, east

    def innovation(self, depth: Lanes, std: Lanes, age: float) -> tuple[Lanes, Lanes]:
        x, P = self.state, self.covariance
        variance = P[0, 0] - 2.0 * age * P[0, 1] + age * age * P[1, 1] + std * std
        return depth - (x[0] - age * x[1]), variance

    def update(self, innovation: Lanes, variance: Lanes, age: float) -> None:
        self._correct(self.covariance[:, 0] - age * self.covariance[:, 1], innovation, variance)

    def _correct(self, seen: Lanes, innovation: Lanes, variance: Lanes) -> None:
        gain = seen / variance
        self.state += gain * innovation
        self.covariance -= gain[:, None] * seen

    def _expect_speed(self, expected: Any, std: Lanes) -> None:
        P, x = self.covariance, self.state
        far = np.zeros(len(std), bool)
        for k in (7, 8):
            off = expected[k - 7] - x[k]
            far |= (std < MOVING_STD) & (
                off * off > filters.FAR * filters.FAR * (P[k, k] + std * std)
            )
        std = where(far, MOVING_STD, std)
        variance = filters.SPEED_DENSITY * (std / MOVING_STD) ** 2 / self._free
        self._free = 0.0
        for k in (7, 8):
            seen, wanted = P[:, k].copy(), where(far, 0.0, expected[k - 7])
            self._correct(seen, wanted - x[k], seen[k] + variance)


class Depths:
    """`DepthObserver`."""

    def __init__(
        self,
        settings: filters.DepthSettings,
        air: Lanes,
        per_metre: float,
        pressure: Lanes,
        samples: int,
        lack: Lanes,
        at_ns: int,
        axes: AttitudeAxes,
    ) -> None:
        """
        Args:
            air: [Pa] of the air above the water.
            per_metre: [Pa/m]
            pressure, samples: [Pa] mean of so many samples at rest.
        """
        count = len(air)
        self._air, self._per_metre = air, per_metre
        self._latency_ns = round(settings.pressure_latency * 1e9)
        self._declared = settings.pressure_std / per_metre  # [m]
        self._noise = np.full(count, self._declared**2)
        std = np.full(count, self._declared / samples**0.5)
        self.filter = DepthFilters(settings, (pressure - air) / per_metre, std, lack, axes)
        self.lost = np.zeros(count, bool)
        self._swell = Swells(count)
        self._at_ns, self._judged_ns = at_ns, 0
        self._input: Lanes | None = None
        self._axes: Any = axes
        self._two: tuple[Any, Any] = (0.0, 0.0)
        self._newest = np.zeros(count)
        self._mean = np.zeros(count)  # [σ] of the innovations used
        self._used_at = np.full(count, np.nan)  # [ns]
        self._product, self._square, self._last = np.zeros(count), np.ones(count), np.zeros(count)

    @property
    def depth(self) -> Lanes:
        return self.filter.state[0].copy()

    @property
    def rate(self) -> Lanes:
        return self.filter.state[1].copy()

    def predict(self, at_ns: int, axes: AttitudeAxes) -> None:
        dt, self._at_ns, self._axes = (at_ns - self._at_ns) * 1e-9, at_ns, axes
        acceleration: Any = axes.acceleration
        before, self._input, mean = self._input, acceleration, acceleration
        if before is None:
            self._mean[:], self._used_at[:] = 0.0, np.nan
        else:
            change = np.abs(acceleration - before)
            shock = where(change > observer.SHOCK, 0.5 * change * dt, 0.0)
            self.filter.covariance[1, 1] += shock * shock
            mean = (before + acceleration) / 2.0
        self.filter.predict(mean, dt, axes)

    def pressure(self, pressure: Lanes, stamp_ns: int) -> None:
        """A sample [Pa], before the IMU sample of its instant or the next one."""
        depth = (pressure - self._air) / self._per_metre
        stamp_ns -= self._latency_ns
        age = (self._at_ns - stamp_ns) * 1e-9
        before, self._judged_ns = self._judged_ns, stamp_ns
        dt = min(max(0.0, (stamp_ns - before) * 1e-9), 0.5)
        calm_std, std = self._hear_noise(depth, dt)
        innovation, variance = self.filter.innovation(depth, std, age)
        sigma = np.sqrt(variance)
        grown = self._mean * innovation > observer.GROWN * np.abs(innovation)
        if self._input is not None:
            self._swell.add(innovation, calm_std, dt)
            grown &= ~self._swell.leaves
        self.lost |= ~((np.abs(innovation / sigma) <= filters.GATE) | grown)
        used = clamped(innovation, filters.CLIP * sigma)
        fresh, self._newest = depth != self._newest, depth
        share = np.clip((stamp_ns - self._used_at) * (1e-9 / AIDING_MEMORY), 0.0, 1.0 / SAMPLES)
        share = where(fresh & ~np.isnan(self._used_at), share, 0.0)
        self._used_at = where(fresh, float(stamp_ns), self._used_at)
        self._mean = self._mean + share * (used / sigma - self._mean)
        self._weigh(used / sigma, dt)
        self.filter.update(used, variance, age)
        doubted = self._swell.leaves | (self._axes.tilt_std >= observer.DOUBTED_TILT)
        self.lost |= fresh & doubted & (np.abs(self._mean) > MOST_MEAN)

    def _hear_noise(self, depth: Lanes, dt: float) -> tuple[Lanes, Lanes]:
        """[m] 1σ of the samples without waves, and with them."""
        first, middle = self._two
        self._two = middle, depth
        off = first - 2.0 * middle + depth
        seen = np.minimum(off * off / 6.0, observer.MOST_NOISE * self._noise)
        self._noise = self._noise + (seen - self._noise) / observer.NOISE_SAMPLES
        ratio = np.sqrt(self._noise) / self._declared
        noisier = np.minimum(observer.NOISIER, ratio / observer.BY_CHANCE)
        quieter = np.minimum(1.0, np.maximum(observer.QUIETER, ratio * observer.BY_CHANCE))
        calm = self._declared * where(ratio > observer.BY_CHANCE, noisier, quieter)
        if self._input is None or not np.any(self._swell.rolls):
            return calm, calm
        density = np.sqrt(self.filter.acceleration_density(self._axes)) / observer.SLOWER**2
        swing = self._swell.amplitude
        waves = np.minimum(np.maximum(density / max(dt, 0.005) ** 0.5, 0.8 * swing), 2.0 * swing)
        return calm, where(self._swell.rolls, np.maximum(calm, waves), calm)

    def _weigh(self, normalised: Lanes, dt: float) -> None:
        self._product = (
            self._product + (normalised * self._last - self._product) / observer.WHITE_SAMPLES
        )
        square = normalised * normalised
        self._square = self._square + (square - self._square) / observer.WHITE_SAMPLES
        self._last = normalised
        likeness = self._product / where(self._square > 0.0, self._square, np.inf)
        beyond = np.maximum(0.0, np.abs(likeness) - observer.ALIKE)
        rate = where(self._swell.rolls, -1.0, where(likeness > 0.0, beyond, -beyond))
        f = self.filter
        f.doubt_of_force = np.clip(
            f.doubt_of_force * np.exp(observer.ADAPTING * dt * rate), 1.0, observer.MOST_DOUBT
        )
