"""Nominal dives with the same settings, each with its own seed, from power-on to the end."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from services.control.settings import Settings as ControlSettings
from services.estimation.settings import Settings as EstimationSettings
from services.gamepad.stick_log import StickLog
from services.marine.vehicle import Vehicle
from services.piloting.sticks import CENTRED
from services.reference.settings import Settings as ReferenceSettings
from services.runtime.config.stack import BODY, Stack
from services.simulator.settings import Settings as SimulatorSettings
from services.tether.profile import LinkProfile
from tools.sweep.fast.allocation import LaneAllocated
from tools.sweep.fast.control import Controllers
from tools.sweep.fast.estimation import Estimators
from tools.sweep.fast.lanes import Lanes, Mask
from tools.sweep.fast.reference import LaneReference, References
from tools.sweep.fast.sensors import LaneSensors
from tools.sweep.fast.thrusters import LaneBattery
from tools.sweep.fast.timeline import DiveTimes, SampleTimes, delays_of
from tools.sweep.fast.tracks import Tracks
from tools.sweep.fast.vessel import Vessels

STEEP = 1.2  # [rad] of pitch; in a steeper vehicle the heading may be unknown


class DiveSettings(NamedTuple):
    """What is the same in all of them."""

    vehicle: Vehicle
    simulator: SimulatorSettings
    estimation: EstimationSettings
    reference: ReferenceSettings
    control: ControlSettings
    link: LinkProfile
    script: StickLog
    seconds: float | None  # [s] after arming

    @classmethod
    def of(cls, stack: Stack, link: LinkProfile, script: StickLog) -> "DiveSettings":
        return cls(
            stack.section(BODY, Vehicle),
            stack.section("simulator", SimulatorSettings),
            stack.section("estimation", EstimationSettings),
            stack.section("reference", ReferenceSettings),
            stack.section("control", ControlSettings),
            link,
            script,
            stack.seconds,
        )


class LaneState(NamedTuple):
    """What reference and control need of the newest state: `VehicleState` in lanes."""

    depth: Lanes  # [m]
    rate: Lanes  # [m/s]
    heading: Lanes  # [rad]
    yaw_rate: Lanes  # [rad/s]
    roll: Lanes  # [rad]
    pitch: Lanes  # [rad]
    attitude: tuple[Lanes, Lanes, Lanes, Lanes]  # q_NB


def fly(
    settings: DiveSettings, seeds: Sequence[int], go_on: Callable[[float], bool] = lambda _: True
) -> Tracks | None:
    """What came of them; None: it was to stop.

    Args:
        go_on: asked now and then, with the share [-] that is done.
    """
    with np.errstate(all="ignore"):  # of lanes that are lost
        return Dives(settings, seeds).to_the_end(go_on)


class Dives:
    def __init__(self, settings: DiveSettings, seeds: Sequence[int]) -> None:
        s, count = settings, len(seeds)
        self._settings, self._times = s, SampleTimes.of(s.simulator)
        self._vessels = Vessels(s.vehicle, s.simulator, count)
        self._battery = LaneBattery(s.vehicle, s.simulator, count)
        self._sensors = LaneSensors(s.simulator, seeds)
        self._estimators = Estimators(s.estimation, s.vehicle, count)
        self._references = References(s.reference, count)
        self._controllers = Controllers(s.control, s.vehicle, count)
        self._now = 0  # [ns]
        self._lost = np.zeros(count, bool)

    def to_the_end(self, go_on: Callable[[float], bool]) -> Tracks | None:
        if (times := self.calibrated(go_on)) is None:
            return None
        running, s = self._now, self._settings
        heading, hotel = s.simulator.start_heading, self._battery.power
        tracks = Tracks(times, self._times.imu, running, s.reference, heading, hotel)
        self._control(times, tracks)
        while not self.over(times):
            self.move()
            self._control(times, tracks)
            if not go_on((self._now - running) / (times.end_ns - running)):
                return None
        tracks.lost = self.lost() | ~tracks.sound
        return tracks

    def calibrated(self, go_on: Callable[[float], bool]) -> DiveTimes | None:
        """Float at rest until the estimators run; None: it was to stop."""
        while not self._estimators.running:
            self._measure()
            if not go_on(0.0):
                return None
        s = self._settings
        return DiveTimes(s.script, delays_of(s.link), self._now, s.seconds)

    def _measure(self) -> None:
        """The IMU sample of the next instant, and the pressure samples up to it."""
        before, self._now = self._now, self._now + self._times.imu
        if not self._estimators.running:  # it floats at rest
            for at in self._times.pressures(before, self._now):
                self._estimators.pressure(self._sensors.pressure(self._vessels.position[2]), at)
            field = self._sensors.magnetometer(self._now, self._vessels)
            if field is not None:
                self._estimators.magnetometer(field)
        seconds = (self._now - self._times.imu) * 1e-9
        force, rate = self._sensors.imu(seconds, self._vessels)
        dt = self._times.imu * 1e-9 if before else 0.0
        self._estimators.imu(force, rate, self._now, dt)

    def move(self) -> None:
        """The vehicles, to the next instant, and all samples up to it."""
        self._estimators.actuation(self._vessels.thrusters.produced)  # it is heard an instant later
        since, until = self._now, self._now + self._times.imu
        for at in self._times.pressures(since, until):
            self._advance((at - since) * 1e-9)
            since = at
            self._estimators.pressure(self._sensors.pressure(self._vessels.position[2]), at)
        self._advance((until - since) * 1e-9)
        self._measure()

    def _advance(self, seconds: float) -> None:
        if seconds > 0.0:
            self._vessels.advance(seconds)
            self._battery.feed(self._vessels.thrusters.produced, seconds)

    def over(self, times: DiveTimes) -> bool:
        """Is this its last instant?"""
        return self._now + self._times.imu > times.end_ns

    def wanted(self, times: DiveTimes) -> tuple[LaneState, LaneReference, bool]:
        """The newest state, the reference at this instant, and whether the vehicles are armed."""
        attitude, depth = self._estimators.attitude, self._estimators.depth
        state = LaneState(
            depth.depth, depth.rate, attitude.heading, attitude.yaw_rate, attitude.roll,
            attitude.pitch, attitude.q,
        )  # fmt: skip
        armed = times.armed(self._now)
        sticks = times.sticks(self._now) if armed else CENTRED
        reference = self._references.step(
            state, sticks, self._controllers.turn_short, self._now / 1e9, armed=armed
        )
        self._lost |= np.abs(attitude.pitch) > STEEP
        return state, reference, armed

    def _control(self, times: DiveTimes, tracks: Tracks) -> None:
        """Reference, control and thrusters at this instant, from the newest state."""
        state, reference, armed = self.wanted(times)
        vessels = self._vessels
        produced = vessels.thrusters.produced
        truth, drawn = (vessels.position[2], vessels.attitude), (produced, self._battery.power)
        tracks.add(self._now, reference, state, truth, drawn, armed)
        done = self.controlled(reference, state).thrust if armed else np.zeros_like(produced)
        vessels.thrusters.drive(done)

    def controlled(self, reference: LaneReference, state: LaneState) -> LaneAllocated:
        """What Lindy's own control commands."""
        return self._controllers.step(reference, state, self._times.imu * 1e-9)

    def drive(self, thrust: Lanes) -> None:
        """Command thrusters [N] (thrusters, lanes)."""
        self._vessels.thrusters.drive(thrust)

    def lost(self) -> Mask:
        critical = self._settings.reference.failsafe.battery_critical
        empty = self._battery.share_left <= critical
        return self._lost | self._estimators.lost | self._references.lost | empty
