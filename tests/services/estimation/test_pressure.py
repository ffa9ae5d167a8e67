"""Depth by pressure: late samples, waves, a coarse sensor, jumps; against a truth made here."""

from math import pi, sin

import numpy as np
import pytest

from messages.events import Outbox
from services.estimation.filter import DEPTH, DEPTH_RATE, FORCE, TILT, ErrorStateFilter
from services.estimation.pressure import Atmosphere, Pressure
from services.estimation.sensor import Sensor
from services.estimation.settings import DepthSettings, Settings
from services.marine.vehicle import ATMOSPHERE, GRAVITY

TICK = 10_000_000  # [ns]
STILL = (0.0, 0.0, 0.0)


class Dive:
    """A level vehicle whose accelerometer says how it moves along down."""

    def __init__(self, latency: float = 0.0, std: float = 100.0) -> None:
        settings = Settings(depth=DepthSettings(pressure_std=std, pressure_latency=latency))
        self.sensor = Sensor("sensor/pressure", Outbox(), 1.0)
        self.pressure = Pressure(settings, self.sensor, 0.0)
        self.pressure.air = Atmosphere(ATMOSPHERE, 0.0)
        self.filter, self.rng, self.k = ErrorStateFilter(), np.random.default_rng(1), 0
        f = self.filter
        for state, spread in ((DEPTH, 0.1), (DEPTH_RATE, 0.1), (FORCE + 2, 0.05), (TILT, 0.01)):
            f.forget(state, spread)
        self.pressure.begin(f)
        self.depth = self.rate = 0.0  # [m], [m/s] truth
        self.wave = 0.0  # [m] that a wave adds to what is measured
        self.names = list[str]()

    def run(self, seconds: float, acceleration: float = 0.0, late: float = 0.0) -> list[float]:
        """[m] Errors of the depth, at every tick; `late` [s]: the stamps of the samples."""
        errors = list[float]()
        for _ in range(round(100 * seconds)):
            self.k += 1
            self.rate += 0.01 * acceleration
            self.depth += 0.01 * self.rate
            a = acceleration + 0.01 * float(self.rng.standard_normal()) - GRAVITY
            self.filter.predict((0.0, 0.0, a), STILL, 0.01, (2.5e-6, 1e-7))
            if self.k % 4 == 0:
                depth = self.depth + self.wave * sin(2.0 * pi * self.k / 500.0)
                said = ATMOSPHERE + self.pressure.per_metre * depth
                said += 100.0 * float(self.rng.standard_normal())
                at = self.k * TICK
                event = self.pressure.fuse(self.filter, said, at + round(late * 1e9), at)
                self.names += [] if event is None else [event.name]
            errors.append(self.filter.position[2] - self.depth)
        return errors


@pytest.mark.parametrize(("told", "off"), [(0.15, 0.0), (0.0, 0.06)])
def test_a_latency_that_the_file_tells_is_taken_out(told: float, off: float) -> None:
    dive = Dive(latency=told)
    dive.run(2.0, acceleration=0.2)
    errors = dive.run(6.0, late=0.15)
    assert np.mean(errors[-100:]) == pytest.approx(-off, abs=0.02)


def test_a_wave_above_is_neither_depth_nor_a_wrong_accelerometer() -> None:
    dive = Dive()
    dive.run(5.0)
    for _ in range(300):
        dive.wave += 0.001
        dive.run(0.1)
    errors = dive.run(20.0)
    assert float(np.std(errors)) < 0.06
    assert dive.names.count("waves:sensor/pressure") == 1
    assert not [name for name in dive.names if name.startswith(("jumped", "restarted"))]


def test_a_jump_moves_the_depth_and_says_by_how_much() -> None:
    dive = Dive()
    dive.run(5.0)
    dive.pressure.air = Atmosphere(ATMOSPHERE - 20_000.0, 0.0)  # it reads two metres more
    dive.run(4.0)
    assert dive.names.count("jumped:sensor/pressure") == 1
    assert dive.filter.position[2] - dive.depth == pytest.approx(2.0, abs=0.1)
    assert dive.pressure.moved == pytest.approx(2.0, abs=0.1)
    assert dive.pressure.depth_std(dive.filter) > 1.5  # nobody knows which depth is right


def test_twelve_hours_without_a_stop_leave_the_covariance_symmetric_and_positive() -> None:
    dive = Dive()
    f = dive.filter
    for hour in range(12):
        dive.run(5.0)
        for _ in range(200):  # long steps stand for the hour between
            f.predict((0.0, 0.0, -GRAVITY), STILL, 0.1, (2.5e-6, 1e-7))
        f.spread()
        assert (f.P == f.P.T).all(), hour
        assert np.linalg.eigvalsh(f.P).min() > -1e-9 * f.P.max(), hour


def test_what_corrects_the_depth_after_a_stop_corrects_that_place_less_and_less() -> None:
    """So that who holds that place does not follow every correction of the depth."""
    by_depth, by_place, later = list[float](), list[float](), list[float]()
    for seed in range(24):
        dive = Dive()
        dive.rng = np.random.default_rng(seed)
        dive.run(3.0)
        f = dive.filter
        f.rest()
        depth, place = f.position[2], f.rest_shift
        dive.run(1.0)
        by_depth.append(f.position[2] - depth)  # it has not moved
        by_place.append(by_depth[-1] - (f.rest_shift - place))
        dive.run(4.0)
        place = f.rest_shift
        dive.run(1.0)
        later.append(f.rest_shift - place)
    assert np.std(by_place) < 0.75 * np.std(by_depth)
    assert np.std(later) < 0.4 * np.std(by_depth)
