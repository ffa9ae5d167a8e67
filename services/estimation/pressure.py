"""Depth from pressure: the datum, the time of each sample, a wave above, a coarse sensor, jumps.

A sample measures the depth at its own time, and what a wave adds: h = p_d − age · v_d + w. The wave
is a state of the filter (Fossen 2011, eq. 8.128), so that neither the accelerometer nor the
pressure has to be wrong in one; the model has no mean, so it explains no constant offset.
"""

from math import hypot, inf
from typing import NamedTuple

from messages import events, topics
from messages.events import Event
from services.estimation.filter import DEPTH, DEPTH_RATE, WAVE, WAVE_RATE, ErrorStateFilter
from services.estimation.quantity import Fusion, Quantity
from services.estimation.sensor import Sensor
from services.estimation.settings import Settings
from services.marine.vehicle import ATMOSPHERE, GRAVITY
from services.marine.water import density_of

LATEST_AGE = 0.5  # [s] an older sample is not used
AHEAD = 0.2  # [s] a sample may be this much newer than the newest IMU sample
VALID_FOR = 2.0  # [s] depth is valid this long after a sample that was used
LOST_AFTER = 10.0  # [s] of that: the depth is no longer known
KNOWN_RATE = 0.1  # [m/s] 1σ; without pressure the accelerometer keeps it below for half a minute
PATIENCE = 1.5  # [s] of outliers only
MEAN_MEMORY = 12.0  # [s] of the mean innovation: longer than a wave
GROWN = 0.6  # [σ] mean innovation before the first outlier: it has grown, and did not jump
GROWN_FAST = 1.0  # [σ] the same of the newest one: it grows within some samples
JUMPED_RATE, RESTARTED_RATE = 0.1, 0.5  # [m/s] 1σ of the rate after a jump, or a restart
STEPS = 2.0  # [steps] through which a coarse sensor has to change its value
CHANGES = 3  # … after which the least one seen is its step
# The wave: its variance rises and falls with these time constants, and is never less than the
# filter can tell from nothing. Tuned on simulated dives, range 5 … 20 and 20 … 100 s.
WAVE_RISE, WAVE_FALL = 10.0, 25.0  # [s]
LEAST_WAVE, MOST_WAVE, FIRST_WAVE = 0.001, 100.0, 0.005  # [m] 1σ; the last before any is felt
SURPRISE = 6.0
TOLD_WAVE = 0.05  # [m] 1σ of one that is told
BOB_SMOOTH, BOB_MEMORY = 0.3, 5.0  # [s] of the acceleration of who floats on a wave
BOB_NOISE = 0.008  # [m/s²] 1σ of that smoothed, without a wave
STANDARD_STD = 2000.0  # [Pa] 1σ of the weather
GIVEN_STD = 100.0  # [Pa] 1σ of an atmosphere that another instrument measured
# [Pa] Outside, the vehicle did not float: from a mountain lake at 3000 m to the highest pressure of
# the air measured below 750 m, 1083.8 hPa (Agata, 1968; WMO archive of extremes). A calibration
# less than 0.7 m under water, in standard air, cannot be told from high pressure.
LEAST_ATMOSPHERE, MOST_ATMOSPHERE = 70e3, 108.4e3
ENOUGH, ROUGH_STD = 20, 500.0  # samples of who floats in waves, [Pa] 1σ of the air by their mean


class Atmosphere(NamedTuple):
    """The air above the water, and how well it is known."""

    pressure: float  # [Pa]
    std: float  # [Pa]


STANDARD = Atmosphere(ATMOSPHERE, STANDARD_STD)


class Pressure:
    """The depth of the vehicle's origin below the surface."""

    def __init__(self, settings: Settings, sensor: Sensor, floating_depth: float) -> None:
        self.per_metre = density_of(settings.water_density) * GRAVITY  # [Pa/m]
        self.quantity = Quantity(
            "pressure", "m", settings.depth.pressure_std / self.per_metre,
            patience=PATIENCE, memory=MEAN_MEMORY,
        )  # fmt: skip
        self.air = STANDARD
        given = settings.calibration.atmosphere
        self._given = None if given is None else Atmosphere(given, GIVEN_STD)
        self._above = floating_depth * self.per_metre  # [Pa] of water above a vehicle that floats
        self._floated, self._was_afloat = 0, False  # samples before the dive; known to float
        self.moved = 0.0  # [m] sum of the jumps of the pressure that were followed
        self.newest: float | None = None  # [Pa]
        self._sensor = sensor
        self._latency_ns = round(settings.depth.pressure_latency * 1e9)
        self._lost = self._waves = False
        self._bob = self._bob_mean = 0.0  # [m/s²]
        self._bob_variance = (FIRST_WAVE * WAVE_RATE**2) ** 2
        self._changes, self._step, self._at_change = 0, inf, 0.0  # [-], [Pa], [m]

    def begin(self, f: ErrorStateFilter) -> None:
        f.wave_variance = FIRST_WAVE**2
        f.forget(WAVE, FIRST_WAVE / WAVE_RATE)
        f.forget(WAVE + 1, FIRST_WAVE)

    # The air.

    def float_below(self, pressure: float, *, afloat: bool) -> None:
        """A sample before the dive. While it floats, the air is that above its floating depth; in
        waves the mean is. Where no thrust is reported, it may not float."""
        if self._was_afloat and not afloat:
            return
        self._was_afloat = self._was_afloat or afloat
        self._floated += 1
        mean = pressure if self._floated == 1 else self.air.pressure + self._above
        mean += (pressure - mean) / self._floated
        self.air = Atmosphere(mean - self._above, STANDARD_STD)

    def take_air(
        self, f: ErrorStateFilter, at_rest: Atmosphere, *, driven: bool, moved: bool
    ) -> Event | None:
        """The air by the pressure at rest: the depth is moved, and the vehicle has not. Returns an
        event to tell.

        Args:
            driven: the thrusters have run: the vehicle may not float.
            moved: tell who flies.
        """
        event = None
        air = Atmosphere(at_rest.pressure - self._above, at_rest.std)
        if self._given is not None:
            air = self._given
        elif not LEAST_ATMOSPHERE <= air.pressure <= MOST_ATMOSPHERE:
            air, detail = STANDARD, f"{at_rest.pressure / 100.0:.0f} hPa"
            event = events.IMPLAUSIBLE_ATMOSPHERE(detail=detail)
        elif driven:
            air, event = STANDARD, events.ASSUMED_ATMOSPHERE()
        by = (self.air.pressure - air.pressure) / self.per_metre
        f.position[2] += by
        self.air = air
        if moved:
            self.moved += by
        return event

    def give_up(self, f: ErrorStateFilter) -> None:
        """The dive begins without a rest."""
        if self._was_afloat and self._floated >= ENOUGH and self._given is None:
            self.air = Atmosphere(self.air.pressure, ROUGH_STD)
        else:
            self.air = self._given or STANDARD
            self.restart(f)

    # Samples.

    def restart(self, f: ErrorStateFilter) -> None:
        """The newest sample gives the depth, of a vehicle that may move."""
        if self.newest is not None:
            f.position[2] = (self.newest - self.air.pressure) / self.per_metre
            f.velocity[2] = 0.0
            f.forget(DEPTH, self.quantity.white)
            f.forget(DEPTH_RATE, RESTARTED_RATE)
            self.quantity.forget()

    def fuse(self, f: ErrorStateFilter, pressure: float, stamp_ns: int, at_ns: int) -> Event | None:
        """Use a sample [Pa] that is valid, with the filter at this time [ns]. Returns an event to
        tell."""
        quantity, stamp_ns = self.quantity, max(0, stamp_ns - self._latency_ns)
        age = (at_ns - stamp_ns) * 1e-9
        if not -AHEAD <= age <= LATEST_AGE:
            quantity.refuse(events.LATE_PRESSURE(), stamp_ns)
            return events.LATE_PRESSURE()
        f.spread()
        h = ((DEPTH, 1.0), (DEPTH_RATE, -age), (WAVE + 1, 1.0))
        depth = (pressure - self.air.pressure) / self.per_metre
        off = depth - (f.position[2] - age * f.velocity[2])
        outlier = events.OUTLIER(topics.PRESSURE.key)
        innovation = off - f.wave[1]
        outcome = quantity.fuse(f, h, depth, innovation, stamp_ns, why=outlier)
        if outcome is Fusion.USED:
            self._lost = False
            return self._hear_wave(f, off)
        # Did it jump there, or is the filter drifting off, because the IMU is wrong?
        grown = quantity.mean * innovation > GROWN * abs(innovation)
        fast = f.wide_force and quantity.newest * innovation > GROWN_FAST * abs(innovation)
        if outcome is Fusion.OUTLIER and not fast:
            return outlier
        grown = grown or fast
        f.forget(DEPTH, abs(innovation))
        f.widen(DEPTH_RATE, RESTARTED_RATE if grown else JUMPED_RATE)
        quantity.set_anew(f, h, innovation, stamp_ns)
        if grown:
            return events.RESTARTED_DEPTH()
        self.moved += innovation
        std = hypot(self.air.std, innovation * self.per_metre)  # either depth may be right
        self.air = Atmosphere(self.air.pressure, std)
        return events.JUMPED_PRESSURE()

    def hear_step(self, f: ErrorStateFilter, pressure: float) -> None:
        """Is the sensor coarse? Then the same value again is a measurement, for as long as the
        vehicle has not moved by more than its steps."""
        last, self.newest = self.newest, pressure
        if last is not None and pressure != last:
            self._changes += 1
            self._step = min(self._step, abs(pressure - last))
            self._at_change = f.position[2]
        step = self._step / self.per_metre
        quantity, sensor = self.quantity, self._sensor
        coarse = self._changes >= CHANGES and step * step >= quantity.white_variance
        moved = abs(f.position[2] - self._at_change) > STEPS * step + 3.0 * f.std(DEPTH)
        sensor.repeats, sensor.rest_ns = coarse, 1 << 62 if coarse and not moved else None
        quantity.rounding = step * step / 12.0 if coarse else 0.0

    def _hear_wave(self, f: ErrorStateFilter, off: float) -> Event | None:
        """The wave's variance is what neither noise nor the depth's own error explains."""
        dt = self.quantity.period
        seen = off * off - 1.1 * self.quantity.white_variance - float(f.P[DEPTH, DEPTH])
        seen = min(seen, 9.0 * f.wave_variance + 0.02)
        expected = f.wave_variance + self.quantity.white_variance + float(f.P[DEPTH, DEPTH])
        memory = WAVE_RISE if off * off > SURPRISE * expected else WAVE_FALL
        variance = f.wave_variance + min(0.1, dt / memory) * (seen - f.wave_variance)
        f.wave_variance = min(MOST_WAVE**2, max(LEAST_WAVE**2, variance))
        limit = TOLD_WAVE / 2.0 if self._waves else TOLD_WAVE
        told, self._waves = self._waves, f.wave_variance > limit * limit
        return events.WAVES_PRESSURE() if self._waves and not told else None

    def hear_bobbing(self, f: ErrorStateFilter, dt: float) -> None:
        """Who floats on a wave sees none in the pressure, but feels it: a / ω₀²."""
        self._bob += min(1.0, dt / BOB_SMOOTH) * (f.acceleration - self._bob)
        share = min(1.0, dt / BOB_MEMORY)
        self._bob_mean += share * (self._bob - self._bob_mean)
        self._bob_variance += share * ((self._bob - self._bob_mean) ** 2 - self._bob_variance)
        variance = max(0.0, self._bob_variance - BOB_NOISE**2) / WAVE_RATE**4
        f.wave_variance = min(MOST_WAVE**2, max(LEAST_WAVE**2, variance))

    # Estimates.

    def depth_std(self, f: ErrorStateFilter) -> float:
        """[m] The atmosphere's included, which is constant during a dive."""
        return hypot(f.std(DEPTH), self.air.std / self.per_metre)

    def is_heard(self, now: int, seconds: float = VALID_FOR) -> bool:
        used_ns = self.quantity.used_ns
        return used_ns is not None and (now - used_ns) * 1e-9 <= seconds

    def age_ms(self, now: int) -> float | None:
        """[ms] Since the newest sample that was used; None before the first."""
        used_ns = self.quantity.used_ns
        return None if used_ns is None else max(0, now - used_ns) * 1e-6

    def lost(self, now: int) -> Event | None:
        """Told once."""
        if self._lost or self.quantity.used_ns is None or self.is_heard(now, LOST_AFTER):
            return None
        self._lost = True
        return events.LOST_DEPTH()
