"""Each way in which a sensor can be bad has one named, counted reaction."""

from collections import Counter
from math import inf, nan

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from messages import topics
from messages.events import Outbox
from messages.message import Estimate
from messages.sensors import (
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)
from messages.state import VehicleState
from messages.vehicle import Actuation
from services.estimation.core import Estimator
from services.estimation.sensor import Sensor, sensors_of
from services.estimation.settings import CalibrationSettings, Settings, WatchSettings
from services.marine.vehicle import GRAVITY, SEA_WATER, Vehicle
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost

QUICK = Settings(calibration=CalibrationSettings(still_time=3.0))  # [s] less to wait for
FLOATING = 0.168  # [m]
PIONEER = Stack().section("vehicle", Vehicle)
MS = 1_000_000  # [ns]
SURFACE = 100_900.0 + SEA_WATER * GRAVITY * FLOATING  # [Pa]


class Bench:
    """An estimator with a vehicle at rest, whose sensors can be made bad one by one."""

    def __init__(self) -> None:
        self.estimator = Estimator(QUICK, FLOATING)
        self.rng = np.random.default_rng(0)
        self.ms = 0
        self.imu_every = self.press_every = 10  # [ms]
        self.frozen: set[str] = set()
        self.absent: set[str] = set()
        self.field = np.array([15e-6, 0.0, 49e-6])  # [T]
        self.last: dict[str, tuple[float, ...]] = {}
        self.state: VehicleState | None = None

    def run(self, seconds: float) -> VehicleState:
        for _ in range(round(seconds * 100)):
            self.ms += 10
            if "pressure" not in self.absent and self.ms % (2 * self.press_every) == 0:
                pressure, *_ = self.say("pressure", [SURFACE], 300.0)
                stamp = self.ms * MS + (self.ms % 70) * 1000
                self.estimator.pressure(PressureSample(stamp_ns=stamp, pressure=pressure))
            if "field" not in self.absent:
                x, y, z = self.say("field", self.field.tolist(), 2e-7)
                self.estimator.magnetometer(
                    MagnetometerSample(stamp_ns=self.ms * MS, field=(x, y, z))
                )
            if self.ms % self.imu_every == 0:
                self.feel()
        assert self.state is not None
        return self.state

    def feel(self) -> None:
        fx, fy, fz = self.say("force", [0.0, 0.0, -GRAVITY], 0.02)
        p, q, r = self.say("rate", [0.0, 0.0, 0.0], 0.001)
        sample = ImuSample(
            stamp_ns=self.ms * MS, specific_force=(fx, fy, fz), angular_rate=(p, q, r)
        )
        self.state = self.estimator.imu(sample, self.ms * MS) or self.state

    def say(self, name: str, truth: list[float], noise: float) -> tuple[float, ...]:
        if name not in self.frozen or name not in self.last:
            self.last[name] = tuple((truth + noise * self.rng.standard_normal(len(truth))).tolist())
        return self.last[name]

    @property
    def counts(self) -> Counter[str]:
        return self.estimator.outbox.counts


def running() -> Bench:
    bench = Bench()
    assert bench.run(5.0).phase == "running"
    assert not [name for name in bench.counts if name.startswith(("frozen", "rate", "disturbed"))]
    return bench


def test_a_frozen_imu_is_counted_once_and_treated_as_silent() -> None:
    bench = running()
    bench.frozen = {"force", "rate"}
    state = bench.run(3.0)
    assert bench.counts["frozen:sensor/imu"] == 1
    assert not state.heading.valid
    assert state.depth.valid  # goes on from pressure alone
    bench.frozen = set()
    assert not bench.run(0.5).heading.valid  # it may have turned
    assert bench.run(1.0).heading.valid  # as the compass measured it


class Coarse(Bench):
    """An IMU that may repeat itself at rest for ten seconds, and the thrust that is reported."""

    def __init__(self) -> None:
        super().__init__()
        watch = WatchSettings(imu_frozen_at_rest=10.0)
        self.estimator = Estimator(
            msgspec.structs.replace(QUICK, watch=watch), FLOATING, vehicle=PIONEER
        )
        assert self.run(5.0).phase == "running"
        self.frozen = {"force", "rate"}

    def push(self, newtons: float, seconds: float) -> None:
        """With one thruster, told a hundred times a second."""
        for _ in range(round(100 * seconds)):
            rest = (0.0,) * (len(PIONEER.thruster) - 1)
            self.estimator.actuation(
                Actuation(
                    stamp_ns=self.ms * MS, thrust=(newtons, *rest), measured=False,
                    actuated_ns=None, sensor_ns=None, pilot_ns=None, stale=False, power=0.0,
                )
            )  # fmt: skip
            self.run(0.01)


def test_a_coarse_imu_may_repeat_itself_at_rest_but_not_for_ever() -> None:
    bench = Coarse()
    bench.push(0.0, 9.8)
    assert "frozen:sensor/imu" not in bench.counts
    bench.push(0.0, 0.5)
    assert bench.counts["frozen:sensor/imu"] == 1


@pytest.mark.parametrize("rests", [0.0, 3.0])
def test_a_coarse_imu_that_repeats_itself_while_the_thrust_changes_is_frozen(rests: float) -> None:
    bench = Coarse()
    bench.push(0.0, rests)
    for n in range(10):  # on and off, faster than the limit
        bench.push(20.0 * (n % 2), 0.04)
    assert bench.counts["frozen:sensor/imu"] == 1
    bench.push(0.0, 5.0)
    assert bench.counts["frozen:sensor/imu"] == 1, "it is frozen until it says something else"
    bench.frozen = set()
    bench.run(2.0)
    bench.frozen = {"force", "rate"}
    bench.push(0.0, 5.0)
    assert bench.counts["frozen:sensor/imu"] == 1, "and may then rest again"


def test_the_small_thrust_of_a_vehicle_that_is_held_is_no_motion() -> None:
    bench = Coarse()
    for n in range(20):
        bench.push(0.2 * (-1) ** n, 0.2)
    assert "frozen:sensor/imu" not in bench.counts


def test_a_frozen_pressure_sensor_is_counted_once_and_depth_becomes_invalid() -> None:
    bench = running()
    bench.frozen = {"pressure"}
    state = bench.run(14.0)
    assert bench.counts["frozen:sensor/pressure"] == 1
    assert not state.depth.valid
    bench.frozen = set()
    assert bench.run(2.0).depth.valid


def test_a_frozen_magnetometer_is_counted_once_and_north_goes_on_with_the_gyroscope() -> None:
    bench = running()
    bench.frozen = {"field"}
    state = bench.run(5.0)
    assert bench.counts["frozen:sensor/magnetometer"] == 1
    assert state.heading_navigation is not None
    assert state.heading_navigation.value == pytest.approx(0.0, abs=0.05)
    assert not bench.run(60.0).heading_navigation.valid  # type: ignore[union-attr]


@pytest.mark.parametrize("axis", range(6))
def test_a_saturated_axis_is_counted_and_the_sample_not_used(axis: int) -> None:
    bench = running()
    before = bench.state
    values = [0.0, 0.0, -GRAVITY, 0.0, 0.0, 0.0]
    values[axis] = 156.9 if axis < 3 else -34.9
    fx, fy, fz, p, q, r = values
    stamp = (bench.ms + 10) * MS
    sample = ImuSample(stamp_ns=stamp, specific_force=(fx, fy, fz), angular_rate=(p, q, r))
    assert bench.estimator.imu(sample, stamp) is None
    assert bench.counts["saturated:sensor/imu"] == 1
    after = bench.run(0.1)
    assert before is not None
    assert after.heading.value == pytest.approx(before.heading.value, abs=1e-3)


def test_time_going_backwards_is_counted_and_not_used() -> None:
    bench = running()
    old = 2000 * MS
    bench.estimator.pressure(PressureSample(stamp_ns=old, pressure=2e5))
    bench.estimator.magnetometer(MagnetometerSample(stamp_ns=old, field=(0.0, 3e-5, 4e-5)))
    bench.estimator.imu(
        ImuSample(stamp_ns=old, specific_force=(0.0, 5.0, -8.0), angular_rate=(1.0, 0.0, 0.0)),
        bench.ms * MS,
    )
    for name in ("pressure", "magnetometer", "imu"):
        assert bench.counts[f"not_newer:sensor/{name}"] == 1
    assert bench.run(0.1).roll.value == pytest.approx(0.0, abs=0.01)


def test_a_duplicate_is_counted_and_not_used() -> None:
    bench = running()
    bench.frozen = {"force", "rate"}
    bench.feel()
    assert bench.counts["duplicated:sensor/imu"] + bench.counts["not_newer:sensor/imu"] == 1
    bench.ms += 10
    bench.feel()
    bench.feel()
    assert bench.counts["duplicated:sensor/imu"] >= 1


def test_a_wrong_rate_is_counted_once_per_passage() -> None:
    bench = running()
    for passage in (1, 2):
        bench.imu_every = 20
        bench.run(10.0)
        assert bench.counts["rate:sensor/imu"] == passage
        bench.imu_every = 10
        bench.run(6.0)
    assert bench.counts["rate:sensor/imu"] == 2


def test_a_drop_out_is_not_a_wrong_rate() -> None:
    outbox = Outbox()
    watch = Sensor("sensor/x", outbox, 10.0, hz=10.0)
    at = 0
    for k in range(500):
        at += (5000 if k % 7 == 6 else 100) * MS
        assert watch.judge((float(k),), at) is None
    assert not outbox.counts


def test_a_pressure_sensor_that_boots_late_is_waited_for_and_said() -> None:
    bench = Bench()
    bench.absent = {"pressure"}
    assert bench.run(8.0).phase == "calibrating"
    assert bench.counts["waiting:sensor/pressure"] == 1
    assert "pressure" in bench.estimator.outbox.said[-1][1]
    bench.absent = set()
    assert bench.run(2.0).phase == "running"


def test_a_magnetometer_beside_steel_from_the_start_is_said_and_gives_no_north() -> None:
    bench = Bench()
    bench.field = np.array([60e-6, 10e-6, 60e-6])
    state = bench.run(5.0)
    assert state.phase == "running"
    assert bench.counts["disturbed:sensor/magnetometer"] == 1
    assert any("not the Earth's" in text for _, text, _ in bench.estimator.outbox.said)
    assert state.heading_navigation is None
    assert state.heading.valid
    bench.field = np.array([15e-6, 0.0, 49e-6])
    assert bench.run(4.0).heading_navigation is not None


def test_dvl_and_usbl_nonsense_is_counted() -> None:
    bench = running()
    stamp = bench.ms * MS
    bench.estimator.dvl(DvlSample(stamp_ns=stamp, velocity=(99.0, 0.0, 0.0), std=0.01))
    bench.estimator.usbl(UsblSample(stamp_ns=stamp, north=1e8, east=0.0, std=1.0))
    assert bench.counts["implausible:sensor/dvl"] == 1
    assert bench.counts["implausible:sensor/usbl"] == 1
    assert bench.run(0.1).north is None


@pytest.mark.parametrize("frozen", ["dvl", "usbl"])
def test_a_frozen_position_aid_is_counted_once(frozen: str) -> None:
    bench = running()
    for _ in range(30):
        bench.run(1.0)
        stamp = bench.ms * MS
        if frozen == "dvl":
            bench.estimator.dvl(DvlSample(stamp_ns=stamp, velocity=(0.1, 0.0, 0.0), std=0.01))
        else:
            bench.estimator.usbl(UsblSample(stamp_ns=stamp, north=5.0, east=2.0, std=0.5))
    assert bench.counts[f"frozen:sensor/{frozen}"] == 1


@pytest.mark.parametrize("bad", [nan, inf, -inf, None])
def test_what_is_not_a_number_stops_at_the_gate(bad: float | None) -> None:
    host = VirtualHost()
    service = host.add("estimation", ServiceSpec(sides=["drone"]), Stack())
    raw = host.side("drone").say(topics.IMU)
    sample = {"stamp_ns": 0, "specific_force": [0.0, 0.0, bad], "angular_rate": [0.0, 0.0, 0.0]}
    if bad is None:
        sample["specific_force"] = [0.0, 0.0]  # an axis is missing
    raw(msgspec.msgpack.encode(sample))
    host.run(1000 * MS)
    assert service.counts["malformed:sensor/imu"] == 1


number = st.one_of(st.floats(-1e9, 1e9), st.floats(-50.0, 50.0), st.floats(-1e-4, 1e-4))
vector = st.tuples(number, number, number)
positive = st.one_of(st.floats(0.0, 1e9), st.floats(5e4, 5e5))
stamp = st.integers(-(10**10), 10**12)
anything = st.one_of(
    st.builds(ImuSample, stamp_ns=stamp, specific_force=vector, angular_rate=vector),
    st.builds(MagnetometerSample, stamp_ns=stamp, field=vector),
    st.builds(PressureSample, stamp_ns=stamp, pressure=positive),
    st.builds(DvlSample, stamp_ns=stamp, velocity=vector, std=positive),
    st.builds(UsblSample, stamp_ns=stamp, north=number, east=number, std=positive),
)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(anything, max_size=40), st.booleans())
def test_nothing_that_passes_the_gate_raises_or_makes_a_state_that_is_not_finite(
    samples: list[ImuSample | MagnetometerSample | PressureSample | DvlSample | UsblSample],
    calibrated: bool,
) -> None:
    bench = Bench()
    if calibrated:
        bench.run(3.2)
    for sample in samples:
        state = give(bench.estimator, sample)
        assert state is None or decodes(state)
    assert decodes(bench.run(0.2)) if bench.state is not None else True


def give(estimator: Estimator, sample: object) -> VehicleState | None:
    if isinstance(sample, ImuSample):
        return estimator.imu(sample, max(0, sample.stamp_ns))
    if isinstance(sample, MagnetometerSample):
        estimator.magnetometer(sample)
    elif isinstance(sample, PressureSample):
        estimator.pressure(sample)
    elif isinstance(sample, DvlSample):
        estimator.dvl(sample)
    elif isinstance(sample, UsblSample):
        estimator.usbl(sample)
    return None


def decodes(state: VehicleState) -> bool:
    """Whoever hears it lets it in: every number is finite and within its limits."""
    payload = msgspec.msgpack.encode(state)
    back = msgspec.msgpack.decode(payload, type=VehicleState)
    values = [getattr(back, name) for name in back.__struct_fields__]
    return all(np.isfinite([v.value, v.std]).all() for v in values if isinstance(v, Estimate))


@pytest.mark.parametrize(("declared", "told"), [(100.0, 1), (20.0, 0), (30.0, 1)])
def test_the_imu_rate_of_a_vehicle_is_said_and_no_other_is_silent(declared: float, told: int):
    outbox = Outbox()
    watch = sensors_of(WatchSettings(imu_rate=declared), outbox)[topics.IMU.key]
    for k in range(300):  # 20 a second
        watch.judge((0.1 * (k % 7), 0.0, -GRAVITY, 0.0, 0.0, 0.001 * (k % 5)), 50 * k * MS)
    assert outbox.counts["rate:sensor/imu"] == told


def test_the_settings_leave_no_watch_without_limits() -> None:
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert({"imu_frozen": 0.0}, WatchSettings)
