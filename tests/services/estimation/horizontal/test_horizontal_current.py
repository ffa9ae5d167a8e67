"""The current from thrust and drag, against a small truth of kinematics and drag made here."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, pi, sin

import numpy as np
import pytest
from numpy.typing import NDArray

from messages import events
from messages.events import Event
from messages.sensors import DvlSample, UsblSample
from messages.units import Quaternion
from messages.vehicle import Actuation
from services.estimation.horizontal.horizontal_filter import LEAN_TIME
from services.estimation.horizontal.horizontal_observer import HorizontalObserver, VehicleMotion
from services.estimation.horizontal.hull_model import HullModel
from services.estimation.horizontal.measurement_buffer import between
from services.marine.attitude import from_euler
from services.marine.vehicle import GRAVITY, Vehicle
from services.runtime.config.stack import Stack

pytestmark = pytest.mark.slow

S = 1_000_000_000  # [ns]
DT = 0.02  # [s]
LEAN = 0.05  # [m/s²] assumed of a vehicle that is trimmed well; twice as much is allowed for
VEHICLE = Stack().section("vehicle", Vehicle)
HULL = HullModel(VEHICLE, 1.0)
Flow = Callable[[float], tuple[float, float]]
Floats = NDArray[np.float64]


def steady(_: float) -> tuple[float, float]:
    return 0.25, -0.2


def slow(t: float) -> tuple[float, float]:
    return 0.3 * cos(2 * pi * t / 600.0), 0.3 * sin(2 * pi * t / 600.0)


@dataclass
class Voyage:
    """A level vehicle that pushes ahead and aside, and turns now and then. Its drag and thrust are
    those of the file, times `drag`."""

    flow: Flow = steady
    seed: int = 0
    drag: float = 1.0
    dvl: bool = True
    usbl: bool = True
    dvl_latency: float = 0.1  # [s]
    usbl_latency: float = 0.5  # [s]
    hull: HullModel | None = HULL
    observer: HorizontalObserver = field(init=False)
    counts: list[str] = field(default_factory=list[str])
    now: int = 0

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self.observer = HorizontalObserver(self.hull)
        self.place = np.zeros(2)  # [m] NED
        self.water = np.zeros(2)  # [m/s] surge and sway through the water
        self.heading = 0.3
        self.lean = np.zeros(2)
        self.waiting: list[tuple[int, DvlSample | UsblSample]] = []

    def run(self, seconds: float, thrust: bool = True) -> None:
        for _ in range(round(seconds / DT)):
            self.step(thrust)

    def step(self, thrust_heard: bool) -> None:
        self.now += round(DT * S)
        t = self.now / S
        turn = 0.5 * sin(0.5 * t) if t % 30 < 12 else 0.0
        thrust = (7.0 + 4.0 * sin(0.11 * t), 7.0 + 4.0 * sin(0.11 * t), 3.0 * sin(0.07 * t), 0.0)
        force = HULL.force(thrust)
        u, v = self.water.tolist()
        a = HULL.expected((u, v), turn, force, (self.drag - 1.0, self.drag - 1.0)).acceleration
        # Seen from the turning body; the current's own change is too slow to feel.
        self.water += DT * np.array([a[0] + turn * v, a[1] - turn * u])
        self.heading += turn * DT
        self.place += DT * self.over_ground
        keep = np.exp(-DT / LEAN_TIME)
        noise = self.rng.standard_normal(2)
        self.lean = keep * self.lean + LEAN * (1 - keep**2) ** 0.5 * noise
        if thrust_heard:
            self.note(self.observer.actuation(actuation(self.now, thrust)))
        felt = np.array(a) + self.lean + 0.05 * self.rng.standard_normal(2)
        force_B = (*felt.tolist(), -GRAVITY)
        motion = VehicleMotion(self.attitude, 0.0, 0.01, force_B, turn, 0.0, 0.01)
        self.note(self.observer.predict(motion, self.now))
        self.measure(round(t / DT))
        self.deliver()

    def measure(self, k: int) -> None:
        u, v = (R_BN(self.heading) @ self.over_ground + 0.01 * self.rng.standard_normal(2)).tolist()
        x, y = (self.place + 0.5 * self.rng.standard_normal(2)).tolist()
        if self.dvl and k % round(1 / DT) == 0:
            dvl = DvlSample(stamp_ns=self.now, velocity=(u, v, 0.0), std=0.01)
            self.waiting.append((self.now + round(self.dvl_latency * S), dvl))
        if self.usbl and k % round(2 / DT) == 7:
            fix = UsblSample(stamp_ns=self.now, north=x, east=y, std=0.5)
            self.waiting.append((self.now + round(self.usbl_latency * S), fix))

    def deliver(self) -> None:
        for pair in [pair for pair in self.waiting if pair[0] <= self.now]:
            self.waiting.remove(pair)
            sample = pair[1]
            if isinstance(sample, DvlSample):
                self.note(self.observer.dvl(sample))
            else:
                self.note(self.observer.usbl(sample))

    def note(self, what: Event | None) -> None:
        if what is not None:
            self.counts.append(what.name)

    @property
    def attitude(self) -> Quaternion:
        return from_euler(0.0, 0.0, self.heading)

    @property
    def over_ground(self) -> Floats:
        flow: Floats = np.array(self.flow(self.now / S))
        return R_BN(self.heading).T @ self.water + flow

    def errors(self) -> list[float]:
        """North, east [m], surge, sway, current north, current east [m/s]."""
        found = [each.value for each in self.observer.estimates(self.now) if each is not None]
        true = (*self.place, *(R_BN(self.heading) @ self.over_ground), *self.flow(self.now / S))
        return (np.array(found) - true).tolist()


def R_BN(heading: float) -> Floats:  # noqa: N802
    c, s = cos(heading), sin(heading)
    return np.array([[c, s], [-s, c]])


def actuation(now: int, thrust: tuple[float, ...]) -> Actuation:
    return Actuation(
        stamp_ns=now, thrust=thrust, actuated_ns=None, sensor_ns=None, pilot_ns=None,
        stale=False, power=0.0,
    )  # fmt: skip


@pytest.mark.parametrize("flow", [steady, slow])
@pytest.mark.parametrize("usbl_latency", [0.5, 1.5])
def test_after_a_minute_position_velocity_and_current_are_known(
    flow: Flow, usbl_latency: float
) -> None:
    rows: list[list[float]] = []
    for seed in range(4):
        drag = (0.8, 1.2, 0.9, 1.1)[seed]
        voyage = Voyage(flow, seed, drag, usbl_latency=usbl_latency)
        voyage.run(60.0)
        for _ in range(12):
            voyage.run(1.3)
            rows.append(voyage.errors())
        assert set(voyage.counts) <= {"too_old:sensor/usbl"}  # a fix from before the filter began
    place, speed, current = np.sqrt(np.mean(np.square(rows).reshape(-1, 3, 2), axis=(0, 2)))
    assert place < 0.3
    assert speed < 0.02
    assert current < 0.05


def test_without_thrust_or_hull_the_current_is_unknown_and_the_rest_is_not() -> None:
    for voyage, heard in ((Voyage(), False), (Voyage(hull=None), True)):
        voyage.run(60.0, heard)
        found = voyage.observer.estimates(voyage.now)
        assert found.current_north is None
        assert found.north is not None
        assert found.north.valid


def test_without_dvl_and_usbl_there_is_no_current_either() -> None:
    voyage = Voyage(dvl=False, usbl=False)
    voyage.run(20.0)
    assert voyage.observer.estimates(voyage.now) == (None,) * 6


def test_when_the_thrust_falls_silent_the_current_is_forgotten_slowly() -> None:
    voyage = Voyage()
    voyage.run(60.0)
    before = voyage.observer.estimates(voyage.now).current_north
    voyage.run(30.0, thrust=False)
    after = voyage.observer.estimates(voyage.now).current_north
    assert before is not None
    assert after is not None
    assert after.std > before.std
    voyage.run(240.0, thrust=False)
    assert voyage.observer.estimates(voyage.now).current_north is None


def test_thrust_of_another_vehicle_is_counted_and_not_used() -> None:
    voyage = Voyage()
    assert voyage.observer.actuation(actuation(0, (1.0,))) == events.WRONG_LENGTH(
        "vehicle/actuation"
    )


def test_something_that_pushes_hard_and_is_no_current_is_counted() -> None:
    voyage = Voyage()
    voyage.run(30.0)
    for _ in range(20):
        voyage.now += round(DT * S)
        voyage.observer.actuation(actuation(voyage.now, (7.0, 7.0, 0.0, 0.0)))
        bump = VehicleMotion(voyage.attitude, 0.0, 0.01, (-8.0, 0.0, -GRAVITY))
        voyage.note(voyage.observer.predict(bump, voyage.now))
    assert "outlier:vehicle/actuation" in voyage.counts


def test_late_samples_are_as_good_as_punctual_ones_once_they_are_there() -> None:
    """Filtering anew: when all is told, it does not matter when it was told."""
    voyages = [Voyage(usbl_latency=0.02), Voyage(usbl_latency=1.5), Voyage(dvl_latency=1.5)]
    for voyage in voyages:
        voyage.run(40.0)
        voyage.dvl = voyage.usbl = False
        voyage.run(2.0)
    punctual, *late = [voyage.errors() for voyage in voyages]
    for errors in late:
        assert errors[:2] == pytest.approx(punctual[:2], abs=0.05)  # one fix came before the filter
        assert errors[2:] == pytest.approx(punctual[2:], abs=0.005)


def test_in_the_middle_between_two_attitudes_the_heading_is_in_the_middle() -> None:
    a, b = from_euler(0.0, 0.0, 0.2), from_euler(0.0, 0.0, 0.3)
    other: Quaternion = (-b[0], -b[1], -b[2], -b[3])  # the same attitude
    for end in (b, other):
        assert between(a, end, 0.5) == pytest.approx(from_euler(0.0, 0.0, 0.25), abs=1e-6)
