"""Sensor samples in, `VehicleState` out: one state per IMU sample, or for the newest of several
that arrive at once.

One error-state Kalman filter (filter.py). The IMU predicts; pressure (pressure.py), the hull's
weight, thrust and drag (hull.py), rest (rest.py), the magnetometer (compass.py), and DVL and fixes
(aids.py) correct. Samples arrive in the sensors' own axes and positions; they are transformed to
the vehicle's origin and body axes (services/vehicle/mounting.py). What was made of each
measurement: messages/state.py.
"""

from collections.abc import Iterator
from math import atan2, degrees, exp, hypot, isfinite, pi
from typing import Any

from msgspec import UNSET

from messages import events, topics
from messages.events import Outbox
from messages.message import Estimate
from messages.sensors import (
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)
from messages.state import AidSource, VehicleState
from messages.topic import AnyTopic
from messages.units import Vec3
from messages.vehicle import Actuation
from services.estimation.aids import FIRST_CURRENT, STILL_CURRENT, Aids
from services.estimation.checkpoint import EstimationCheckpoint
from services.estimation.compass import UNUSABLE_BIAS, Compass
from services.estimation.filter import (
    BLIND_TURN,
    CURRENT,
    DEPTH,
    DEPTH_RATE,
    DEVIATION,
    FORCE,
    GYRO,
    NORTH,
    POSITION,
    TILT,
    VELOCITY,
    YAW,
    ErrorStateFilter,
    to_world,
)
from services.estimation.hull import HullModel
from services.estimation.pressure import KNOWN_RATE, RESTARTED_RATE, Atmosphere, Pressure
from services.estimation.quantity import Quantity
from services.estimation.rest import Calibrated, Rest
from services.estimation.sensor import OF, sensors_of
from services.estimation.settings import Settings
from services.estimation.start import IMU_PATIENCE_NS, Start
from services.marine.attitude import minus, to_euler, wrapped, yawed
from services.marine.mounting import Mounting
from services.marine.vehicle import Vehicle
from services.marine.water import density_of
from services.vehicle.mounting import AtOrigin, Moment

AIDING_NS = round(1e9 / topics.AIDING.hz)
# A gap between IMU samples [s]: it is told; beyond the next, the mean of its ends is not the truth;
# beyond the last, nothing is known of it. Tuned on real dives of 20 Hz and with holes.
TOLD_GAP, INTEGRATED, BRIDGED = 0.1, 0.35, 1.0  # [s]
LONGEST_STEP, MOST_STEPS = 0.5, 20  # [s], [-] of a blind prediction
LONGEST_GAP = 60.0  # [s] of a restart that matters
SCALE = 0.01  # [-] of a turn that is missed or leaks into another axis
GYRO_NOISE = 3e-4  # [rad/s/√Hz] of a small MEMS gyroscope
YAW_RATE_CUTOFF, YAW_RATE_STD = 8.0, 0.0006  # [Hz] of the low-pass, [rad/s] of what it lets through
# An IMU that is not where it is said to be feels ω² and ω̇ for so long, averaged over so long.
ARM_S, SPIN_S = 0.1, 0.5  # [s]
# 1σ of what has never been measured: tilt by a moving accelerometer, gyroscope's bias (that of an
# MPU-6000 in a real vehicle was 0.06), accelerometer's along down (10 mg).
FIRST_TILT, FIRST_GYRO, FIRST_FORCE = 0.1, 0.1, 0.1  # [rad], [rad/s], [m/s²]
LEVELLED, FIRST_VELOCITY, FAR = 0.01, 0.2, 100.0  # [m], [m/s], [m]
# 1σ after a restart: tilt by the accelerometer of a vehicle that is driven, biases from before it.
RESUMED_TILT, RESUMED_GYRO, RESUMED_FORCE = 0.2, 1e-3, 0.02  # [rad], [rad/s], [m/s²]
WIDE_S = 2.0  # [s] they may walk quickly, after the last time
# [-] share of the hull's outliers that says the same: two in a row. On real dives none or seven
# follow each other; a step of the gyroscope by 1 rad/s moves the vehicle by 0.08, 0.16 and 0.32 m
# where two, three and five are waited for.
REJECTED = 0.2
# While innovations are not centred, once, where more than the pressure says so.
INCONSISTENT_TILT, INCONSISTENT_GYRO = 0.1, 0.3  # [rad], [rad/s]
INCONSISTENT_FORCE = 0.2  # [m/s²] level, 20 mg: else all that is wrong is the gyroscope's
# Slower than the first, after it was faster than the second, a vehicle has come to rest. How that
# place is corrected is told for so long; after 5 s a correction is a tenth of the first ones.
RESTED, WENT, REST_TOLD_NS = 0.02, 0.08, 10_000_000_000  # [m/s], [m/s], [ns]
STEEPEST = 1.4  # [rad] of pitch; closer to the vertical, heading is invalid
UNKNOWN_TILT = 0.3  # [rad] 1σ beyond which the attitude is invalid …
UNSURE_TILT = 0.15  # [rad] … or no dive begins
LEAST_TILT, LEAST_HEADING = 1e-3, 2e-3  # [rad] no 1σ is stated to be less
BANDWIDTH = 50.0  # [Hz] of the accelerometer at 100 Hz, to turn noise density into spread
AID_SOURCES = (
    "pressure", "hull_north", "hull_east", "rest_x", "rest_y", "rest_z", "compass", "dvl_surge",
    "dvl_sway", "usbl_north", "usbl_east",
)  # fmt: skip

LACKS = {topics.IMU.key: events.UNUSABLE_IMU, topics.PRESSURE.key: events.UNUSABLE_PRESSURE}


class Estimator:
    """The state of the vehicle."""

    def __init__(
        self,
        settings: Settings,
        floating_depth: float,
        checkpoint: EstimationCheckpoint | None = None,
        vehicle: Vehicle | None = None,
        outbox: Outbox | None = None,
    ) -> None:
        """
        Args:
            floating_depth: [m] of the origin when the vehicle floats.
            checkpoint: of an earlier run; None: calibrate.
            vehicle: for thrust and drag; None: the current stays unknown.
            outbox: for events. Its counts of refused samples name the cause of a missing sensor.
        """
        self.outbox = Outbox() if outbox is None else outbox
        self._settings, self._floating_depth = settings, floating_depth
        self._sensors = sensors_of(settings.watch, self.outbox)
        density = density_of(settings.water_density)
        self._at_origin = AtOrigin(Mounting(), density)
        if vehicle is not None:
            self._at_origin = AtOrigin(vehicle.mounting, density, vehicle.calibration)
        self._hull = HullModel(vehicle, settings.horizontal.wake_share)
        self._pressure = Pressure(settings, self._sensors[topics.PRESSURE.key], floating_depth)
        self._compass = Compass(settings.attitude)
        self._rest = Rest(settings.calibration)
        self._aids = Aids()
        self._start: Start | None = None  # None: the dive has begun
        self._at_ns: int | None = None  # [ns] time of the filter
        self._imu_ns: int | None = None  # [ns] newest IMU sample used
        self._resumed_ns: int | None = None  # [ns] time of validity of the checkpoint
        self._now: int | None = None  # [ns] of the newest IMU sample or silence
        self._before: tuple[Vec3, Vec3] | None = None  # newest specific force and rate
        self._kept: ErrorStateFilter | None = None  # as it was before a silence of the IMU
        self._arm = (Mounting() if vehicle is None else vehicle.mounting).imu.position_std  # [m]
        self._off_ns = -(1 << 62)  # [ns] when the IMU was inconsistent last
        self._spin = (0.0, 0.0, 0.0)  # [rad/s²]
        self._swinging = 0.0  # [1/s⁴] mean of (ω² + ω̇)²
        self._yaw_rate = self._lag = 0.0  # [rad/s]
        self._went = False  # since it came to rest last …
        self._rested_ns = -REST_TOLD_NS  # [ns] … and when that was
        self._told_ns = 0  # [ns] when what was made of the measurements was told
        self._lacking = set[str]()  # sensors that the state lacks, and the pilot was told so
        self._troubles: tuple[str, ...] = ()  # events: which sensors cannot be used now, and why
        self.filter = ErrorStateFilter()
        self._begin()
        if checkpoint is None:
            self._start = Start(settings, self._rest, self.outbox)
        else:
            self._resume(checkpoint)

    # Sensor samples.

    def imu(self, sample: ImuSample, now: int) -> VehicleState | None:
        """The state at this sample. An unusable sample counts as silence, but before the dive it
        has a state that says what is wrong."""
        self._now = now
        if self.follow(sample) or (self._start is not None and self._start.blocked_by):
            return self._state(now, sample.stamp_ns)
        return self.silence(now)

    def follow(self, sample: ImuSample) -> bool:
        """Use this sample without a state, because newer ones have arrived already. False: it
        cannot be used."""
        if not self._usable(topics.IMU, sample, hypot(*sample.specific_force)):
            return False
        sample = self._at_origin.imu(sample)
        force, rate, at_ns = sample.specific_force, sample.angular_rate, sample.stamp_ns
        dt = self._predict(force, rate, at_ns)
        f, tell = self.filter, self.outbox.tell  # a silence may have changed the filter
        if dt > 0.0:
            rested = self._rest.unrest is None
            complete = self._rest.imu(force, rate, dt)
            if self._start is not None:
                self._calibrate(self._start, dt, at_ns, rested=rested)
            elif complete and self._rest.calibrates:
                self._improve()
            elif complete:
                tell(self._rest.fuse(f, at_ns, driven=self._hull.driven))
            if self._hull.feel(f, force, rate, dt):
                event = self._hull.fuse(f, at_ns)
                tell(event if self._start is None else None)
                self._judge_imu(at_ns)
                self._compass.watch(f)
            if self._start is None:
                self._look_for_rest(at_ns)
                tell(self._aids.remember(f, at_ns))
                tell(self._pressure.lost(at_ns))
        if not f.is_sound:
            tell(events.NOT_FINITE("state"))
            self._restart(force)
        if self._at_origin.needs_motion:  # sensors with a lever arm
            turn = minus(rate, f.gyro_bias)
            self._at_origin.moved(Moment(at_ns, turn, yawed(f.q, f.north)))
        return True

    def silence(self, now: int) -> VehicleState | None:
        """No IMU sample in time: a predicted state, or None before `IMU_PATIENCE_NS` has passed."""
        self._now = now
        if self._start is not None:
            self._start.judge(now)
        if self._imu_ns is None or self._at_ns is None or now - self._imu_ns <= IMU_PATIENCE_NS:
            return None
        if self._start is None:
            if self._kept is None:
                self._kept = self.filter.copy()
            self._go_blind(now)
            self.outbox.tell(self._pressure.lost(now))
        self.outbox.tell(events.PREDICTED(topics.STATE.key))
        return self._state(now, self._imu_ns)

    def pressure(self, sample: PressureSample) -> None:
        self._pressure.hear_step(self.filter, sample.pressure)
        if not self._usable(topics.PRESSURE, sample, sample.pressure):
            return
        sample, pressure, f = self._at_origin.pressure(sample), self._pressure, self.filter
        pressure.newest = sample.pressure
        self._rest.pressure(sample.pressure)
        if self._start is not None:
            afloat = self._at_ns is not None and self._hull.is_afloat(self._at_ns)
            pressure.float_below(sample.pressure, afloat=afloat)
        if self._at_ns is not None:
            event = pressure.fuse(f, sample.pressure, sample.stamp_ns, self._at_ns)
            if self._start is None:
                self.outbox.tell(event)
            else:
                pressure.moved = 0.0

    def magnetometer(self, sample: MagnetometerSample) -> None:
        if not self._usable(topics.MAGNETOMETER, sample, hypot(*sample.field)):
            return
        sample = self._at_origin.magnetometer(sample)
        self._rest.magnetometer(sample.field)
        # Without attitude, a field says nothing; before the dive the rest measures it.
        rests = self._start is not None and self._rest.unrest is None
        if self._hears_imu(sample.stamp_ns) and not rests:
            self.outbox.tell(self._compass.fuse(self.filter, sample.field, sample.stamp_ns))

    def dvl(self, sample: DvlSample) -> None:
        if self._usable(topics.DVL, sample) and self._start is None:
            self.outbox.tell(self._aids.dvl(self.filter, self._at_origin.dvl(sample)))

    def usbl(self, sample: UsblSample) -> None:
        if self._usable(topics.USBL, sample) and self._start is None:
            self.outbox.tell(self._aids.usbl(self.filter, self._at_origin.usbl(sample)))

    def actuation(self, sample: Actuation) -> None:
        """Thrust as reported: with the hull's drag, the only measurement of the current."""
        self.outbox.tell(self._hull.actuation(sample))
        if self._hull.pushes:
            self._rest.pushed()
            if self._start is None:
                self._rest.begin()
        if self._hull.changed:
            self._sensors[topics.IMU.key].moved_ns = sample.stamp_ns

    # Prediction.

    def _predict(self, force: Vec3, rate: Vec3, at_ns: int) -> float:
        """Advance the filter to an IMU sample. Returns by how much [s]; 0: it begins here."""
        f, before, imu_ns = self.filter, self._before, self._imu_ns
        self._before, self._imu_ns = (force, rate), at_ns
        if before is None or imu_ns is None:
            self._at_ns = at_ns
            f.level(force, FIRST_TILT if self._resumed_ns is None else RESUMED_TILT)
            if self._resumed_ns is not None:
                gap = min(LONGEST_GAP, abs(at_ns - self._resumed_ns) * 1e-9)
                f.widen(YAW, BLIND_TURN[2] * gap**0.5)
                self._compass.unseen(f)
            return 0.0
        dt = (at_ns - imu_ns) * 1e-9
        kept, self._kept = self._kept, None
        if dt > TOLD_GAP:
            self.outbox.tell(events.GAP(topics.IMU.key))
            self._rest.moved()
        if dt > BRIDGED:
            self._go_blind(at_ns)
            f.level(force, UNKNOWN_TILT)
            self._hull.restart()
            self._compass.unseen(f)
            return 0.0
        if kept is not None:
            f = self.filter = kept
        f0, w0 = before
        mean_rate = _mean(w0, rate)
        noise = self._densities(minus(mean_rate, f.gyro_bias), minus(rate, w0), dt)
        f.predict(_mean(f0, force), mean_rate, dt, noise)
        if dt > INTEGRATED:
            f.widen_blind(dt)
            self._hull.restart()
        self._at_ns = at_ns
        if dt > TOLD_GAP:
            self._compass.unseen(f)
        if kept is not None and (newest := self._pressure.newest) is not None:
            self.outbox.tell(self._pressure.fuse(f, newest, at_ns, at_ns))
        turn = rate[2] - f.gyro_bias[2]
        self._yaw_rate += (1.0 - exp(-2.0 * pi * YAW_RATE_CUTOFF * dt)) * (turn - self._yaw_rate)
        self._lag = turn - self._yaw_rate
        return dt

    def _look_for_rest(self, at_ns: int) -> None:
        """Has the vehicle come to rest along down, as far as that is known?"""
        f = self.filter
        speed = abs(f.velocity[2])
        rests = self._went and speed < RESTED and f.std(DEPTH_RATE) < RESTED
        if rests:
            f.rest()
            self._rested_ns = at_ns
        self._went = speed > WENT or (self._went and not rests)

    def _densities(self, turn: Vec3, change: Vec3, dt: float) -> tuple[float, float]:
        """[m²/s³], [rad²/s] of what the IMU does not measure: its noise as stated, or as measured
        where that is more, and what turns add (mean rate [rad/s], and its change [rad/s])."""
        p, q, r = turn
        turning = p * p + q * q + r * r
        share, (a, b, c) = min(1.0, dt / ARM_S), self._spin
        x, y, z = _times(1.0 / dt, change)
        self._spin = a, b, c = a + share * (x - a), b + share * (y - b), c + share * (z - c)
        felt = turning + hypot(a, b, c)
        self._swinging += min(1.0, dt / SPIN_S) * (felt * felt - self._swinging)
        x, y, z, p, q, r = self._sensors[topics.IMU.key].variances
        stated = self._settings.depth.acceleration_noise
        force = max(stated * stated, (x + y + z) / 3.0 * dt)
        rate = max(GYRO_NOISE * GYRO_NOISE, (p + q + r) / 3.0 * dt)
        force += 2.0 * ARM_S * self._arm * self._arm * self._swinging
        return force, rate + SCALE * SCALE * turning

    def _go_blind(self, now: int) -> None:
        assert self._at_ns is not None
        left = (now - self._at_ns) * 1e-9
        self._hull.restart()
        steps = min(MOST_STEPS, 1 + int(left / LONGEST_STEP))
        for _ in range(steps if left > 0.0 else 0):
            self.filter.predict_blind(left / steps)
        self._at_ns = max(now, self._at_ns)

    def _judge_imu(self, at_ns: int) -> None:
        """Whose mean innovation is not zero? Then the IMU's biases have changed: they may walk
        quickly until it is."""
        f = self.filter
        by_hull = any(q.off_centre or q.out > REJECTED for q in self._hull.quantities)
        off, wide = by_hull or self._pressure.quantity.off_centre, f.wide_force
        if off:
            self._off_ns = at_ns
        f.wide_force = (at_ns - self._off_ns) * 1e-9 < WIDE_S
        f.wide_gyro = f.wide_force and (f.wide_gyro or by_hull)
        if off and not wide and self._start is None:
            self.outbox.tell(events.INCONSISTENT_IMU())
        if by_hull:
            self._compass.lose()
            for k in range(3):
                f.widen(TILT + k, INCONSISTENT_TILT)
                f.widen(GYRO + k, INCONSISTENT_GYRO)
            for k in range(2):
                f.widen(FORCE + k, INCONSISTENT_FORCE)
                if self._aids.origin is not None:  # or the velocity over the ground is wrong
                    f.widen(CURRENT + k, FIRST_CURRENT)
            for quantity in self._hull.quantities:
                quantity.forget()

    # Before the dive, and its beginning.

    def _begin(self) -> None:
        """With nothing known."""
        f = self.filter
        for k in range(3):
            f.forget(TILT + k, FIRST_TILT)
            f.forget(GYRO + k, FIRST_GYRO)
            f.forget(FORCE + k, FIRST_FORCE if k == 2 else self._settings.depth.horizontal_bias_std)
            f.forget(VELOCITY + k, FIRST_VELOCITY)
            f.forget(POSITION + k, LEVELLED)
        f.forget(YAW, LEAST_HEADING)
        f.forget(NORTH, pi)
        f.forget(DEVIATION, self._settings.attitude.compass_std)
        for k in range(2):
            f.forget(CURRENT + k, STILL_CURRENT)
        f.position[2] = self._floating_depth
        self._pressure.begin(f)

    def _restart(self, force: Vec3) -> None:
        """After a number that is not finite."""
        heading, self.filter = self.filter.heading, ErrorStateFilter()
        self._begin()
        f = self.filter
        f.turn_to(heading if isfinite(heading) else 0.0, pi)
        f.level(force, UNKNOWN_TILT)
        self._compass.knows_north = False
        for quantities in self._quantities().values():
            for quantity in quantities:
                quantity.restart()
        self._hull.restart()
        self._pressure.restart(f)

    def _resume(self, kept: EstimationCheckpoint) -> None:
        """Go on with a dive from a checkpoint: no calibration under water."""
        f, self._resumed_ns, self._rest.calibrates = self.filter, kept.stamp_ns, False
        self._hull.driven = True
        self._pressure.air = Atmosphere(kept.atmosphere, kept.atmosphere_std)
        f.gyro_bias, f.force_bias = kept.gyro_bias, kept.accelerometer_bias
        for k in range(3):
            f.forget(GYRO + k, RESUMED_GYRO)
        f.forget(FORCE + 2, RESUMED_FORCE)
        f.turn_to(kept.heading, min(pi, kept.heading_std))
        f.forget(DEPTH, FAR)
        f.forget(DEPTH_RATE, RESTARTED_RATE)
        strength, dip = kept.field_strength, kept.field_dip
        if kept.north is not None and strength is not None and dip is not None:
            f.north, f.deviation = kept.north, kept.deviation
            f.forget(NORTH, self._settings.attitude.compass_std)
            self._compass.knows_north = True
            self._compass.learn(strength, dip)
        self.outbox.say(
            "warning",
            f"goes on with the dive: atmosphere {kept.atmosphere / 100.0:.1f} hPa, "
            f"heading {round(degrees(kept.heading)) % 360} deg from before the restart",
        )

    def _calibrate(self, start: Start, dt: float, at_ns: int, *, rested: bool) -> None:
        f, pressure = self.filter, self._pressure
        afloat = self._hull.is_afloat(at_ns)
        learnt = start.imu(rested=rested)
        if afloat:
            pressure.hear_bobbing(f, dt)
        if learnt is not None:
            air = self._take_rest(learnt)
            f.forget(YAW, LEAST_HEADING)
            if learnt.field is not None:
                x, y, z = learnt.field
                self._align((x, y, z), at_ns)
            bias = ", ".join(f"{degrees(rate):+.3f}" for rate in learnt.gyro_bias)
            self.outbox.say("info", f"calibrated: gyroscope bias {bias} deg/s, atmosphere {air}")
        elif max(f.tilt_stds) < UNSURE_TILT and self._hull.fits(f, at_ns) and (
            start.gives_up(afloat=afloat)
        ):  # fmt: skip
            self.outbox.tell(events.ROUGH_CALIBRATION())
            pressure.give_up(f)
            f.forget(YAW, LEAST_HEADING)
            self._rest.begin()
        else:
            return
        self._start = None
        self._rest.moved()

    def _improve(self) -> None:
        """After a beginning without rest: what a first rest measures."""
        learnt = self._rest.result()
        if learnt is None:
            return
        said = "the gyroscope"
        if air := self._take_rest(learnt):
            said += f" and the air, {air},"
        self.outbox.say("info", f"at rest: {said} calibrated")

    def _take_rest(self, learnt: Calibrated) -> str:
        """The pressure of the air in words; empty: in mid-dive it is no news."""
        f, self._rest.calibrates = self.filter, False
        for k in range(3):
            Ph, explained = f.explained(((GYRO + k, 1.0),))
            variance = explained + learnt.gyro_std[k] ** 2
            f.correct(Ph, variance, learnt.gyro_bias[k] - f.gyro_bias[k])
        driven, begun = self._hull.driven, self._start is None
        if driven and begun:
            return ""
        measured = Atmosphere(learnt.pressure, learnt.pressure_std)
        self.outbox.tell(self._pressure.take_air(f, measured, driven=driven, moved=begun))
        return f"{self._pressure.air.pressure / 100.0:.1f} hPa"

    def _align(self, field: Vec3, at_ns: int) -> None:
        """Both headings begin as the bearing of this field [T], FRD, if it can be the Earth's."""
        n, e, d = to_world(self.filter.rotation, field)
        level, compass = hypot(n, e), self._compass
        told = compass.disturbed
        if not compass.learn(1e6 * hypot(level, d), atan2(d, level)):
            if not told:
                self.outbox.tell(events.DISTURBED(topics.MAGNETOMETER.key))
            text = "the magnetic field here is not the Earth's: the compass is not used"
            self.outbox.say("warning", text)
            return
        self.filter.turn_to(self.filter.heading - atan2(e, n), LEAST_HEADING)
        compass.take_north(self.filter, to_world(self.filter.rotation, field))
        compass.used_ns = at_ns

    # Monitoring and restart.

    def aid_sources(self, now: int) -> Iterator[tuple[str, AidSource]]:
        """What was made of each measured quantity, by its name; nothing before a tenth of a second
        has passed since the last time."""
        if now < self._told_ns + AIDING_NS:
            return
        self._told_ns = now
        for key, quantities in self._quantities().items():
            trouble = next((name for name in self._troubles if name.endswith(key)), None)
            for quantity in quantities:
                if (source := quantity.message(trouble)) is not None:
                    yield quantity.name, source

    def checkpoint(self, now: int) -> EstimationCheckpoint | None:
        """State for a restart; None while calibrating."""
        if self._start is not None:
            return None
        f, compass, air = self.filter, self._compass, self._pressure.air
        return EstimationCheckpoint(
            stamp_ns=now,
            atmosphere=max(0.0, air.pressure),
            atmosphere_std=air.std,
            gyro_bias=f.gyro_bias,
            accelerometer_bias=f.force_bias,
            heading=f.heading,
            heading_std=f.std(YAW),
            north=f.north if compass.knows_north else None,
            deviation=f.deviation,
            field_strength=compass.strength,
            field_dip=compass.dip,
        )

    def _usable(self, topic: AnyTopic, sample: Any, magnitude: float | None = None) -> bool:
        """May this sample be used? Before the dive it is also judged whether a sensor of this
        `magnitude` can be right, be the sample usable or not."""
        key = topic.key
        content, refused = OF[key](sample)
        if refused is None:
            refused = self._sensors[key].judge(content, sample.stamp_ns)
        else:
            self._sensors[key].refused(refused, sample.stamp_ns)
        if self._start is not None:
            if self._now is not None and magnitude is not None:
                self._start.arrived(key, magnitude, sample.stamp_ns, self._now)
        elif refused is not None:
            for quantity in self._quantities()[key]:
                quantity.refuse(refused, sample.stamp_ns)
        return refused is None

    def _quantities(self) -> dict[str, tuple[Quantity, ...]]:
        """By the key of the samples."""
        return {
            topics.IMU.key: (*self._hull.quantities, *self._rest.quantities),
            topics.PRESSURE.key: (self._pressure.quantity,),
            topics.MAGNETOMETER.key: (self._compass.quantity,),
            topics.DVL.key: self._aids.dvl_quantities,
            topics.USBL.key: self._aids.usbl_quantities,
        }

    # Messages.

    def _state(self, now: int, sensor_ns: int) -> VehicleState:
        """The estimates as one message. Valid are, once it is calibrated:

        - attitude and yaw rate while IMU samples arrive and they are known well enough; headings as
          well, and not after a silence or a change of the gyroscope's bias that left them unknown,
          until the compass has found them. Without one, the control heading goes on from where it
          was, with its standard deviation.
        - depth and depth rate for two seconds after a pressure sample that was used; the rate also
          for as long after it as the accelerometer keeps it known.
        - IMU silent: at first no states, so receivers see the last one age. After 0.2 s, states
          come at the topic's rate with everything from the IMU invalid. Depth and depth rate go on
          from pressure alone. `sensor_ns` stays at the last IMU sample.
        """
        f, running = self.filter, self._start is None
        imu = running and self._hears_imu(now)
        heard = running and self._pressure.is_heard(now)
        roll, pitch, _ = to_euler(f.q)
        tilts, rate_std, yaw_std = f.tilt_stds, f.std(DEPTH_RATE), f.std(YAW)
        level = imu and max(tilts) < UNKNOWN_TILT
        known = level and not self._compass.lost and abs(pitch) < STEEPEST
        turns = imu and (not self._compass.lost or f.std(GYRO + 2) < UNUSABLE_BIAS)
        left, blocked_by = None, None
        if self._start is not None:
            blocked_by = self._start.blocked_by
            left = self._start.seconds_left
        navigation = None
        if running and self._compass.knows_north:
            std = max(LEAST_HEADING, self._compass.north_std(f))
            recent = known and self._compass.is_recent(now)
            navigation = Estimate(wrapped(f.heading + f.north), std, recent)
        if running:
            depth = Estimate(f.position[2], self._pressure.depth_std(f), heard)
            rate = Estimate(f.velocity[2], rate_std, heard or (imu and rate_std < KNOWN_RATE))
            noise = self._settings.depth.acceleration_noise * BANDWIDTH**0.5
            acceleration = Estimate(f.acceleration, hypot(f.std(FORCE + 2), noise), imu and heard)
        else:  # the floating depth is not a measurement
            depth = Estimate(self._floating_depth, 0.5, valid=False)
            rate = acceleration = Estimate(0.0, 0.5, valid=False)
        self._troubles = self._find_troubles(now, imu, heard) if running else ()
        moved, origin = self._pressure.moved, self._aids.origin
        told = running and now - self._rested_ns < REST_TOLD_NS
        horizontal: dict[str, Any] = self._aids.estimates(
            f, now, with_current=self._hull.knows_thrust(now)
        )
        return VehicleState(
            stamp_ns=now,
            sensor_ns=sensor_ns,
            phase="running" if running else "calibrating",
            calibration_left=left,
            blocked_by=blocked_by or UNSET,
            troubles=self._troubles or UNSET,
            depth_moved=moved or UNSET,
            depth_corrected=f.rest_shift if told else UNSET,
            depth=depth,
            depth_rate=rate,
            depth_acceleration=acceleration,
            attitude=f.q,
            roll=Estimate(roll, max(LEAST_TILT, tilts[0]), level),
            pitch=Estimate(pitch, max(LEAST_TILT, tilts[1]), level),
            heading=Estimate(
                f.heading, pi if self._compass.lost else min(pi, LEAST_HEADING + yaw_std), known
            ),
            heading_navigation=navigation,
            yaw_rate=Estimate(self._yaw_rate, hypot(YAW_RATE_STD, self._lag), turns),
            **horizontal,
            pressure_age_ms=self._pressure.age_ms(now) if running else None,
            origin=UNSET if origin is None else origin,
        )

    def _find_troubles(  # noqa: C901 - all there is, top down
        self, now: int, imu: bool, heard: bool
    ) -> tuple[str, ...]:
        """Names of the events that say which sensors cannot be used now, and why. A sensor that the
        state lacks, and when it is back, is told once."""
        found = list[str]()
        for sensor in self._sensors.values():
            if (event := sensor.trouble(now)) is not None:
                found.append(event.name)
        for topic, used in ((topics.IMU, imu), (topics.PRESSURE, heard)):
            key = topic.key
            if used:
                if key in self._lacking:
                    self._lacking.remove(key)
                    self.outbox.tell(events.REGAINED(key))
                continue
            if key not in self._lacking:
                self._lacking.add(key)
                self.outbox.tell(LACKS[key]())
            if not any(name.endswith(key) for name in found):
                found.append(LACKS[key].name)
        if self.filter.wide_force:
            found.append(events.INCONSISTENT_IMU.name)
        if self._rest.calibrates:
            found.append(events.ROUGH_CALIBRATION.name)
        key = topics.MAGNETOMETER.key
        if self._compass.disturbed and not any(name.endswith(key) for name in found):
            found.append(events.DISTURBED(key).name)
        return tuple(found)

    def _hears_imu(self, now: int) -> bool:
        return self._imu_ns is not None and now - self._imu_ns <= IMU_PATIENCE_NS


def _mean(a: Vec3, b: Vec3) -> Vec3:
    return 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])


def _times(k: float, a: Vec3) -> Vec3:
    return k * a[0], k * a[1], k * a[2]
