"""Each way in which a sensor can be bad has one counted reaction: wrong, frozen, or silent."""

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from messages import events, topics
from messages.events import Outbox
from messages.message import Estimate
from messages.sensors import DvlSample, ImuSample, MagnetometerSample, PressureSample, UsblSample
from messages.state import VehicleState
from messages.vehicle import Actuation
from services.estimation.core import Estimator
from services.estimation.sensor import Sensor, sensors_of
from services.estimation.settings import WatchSettings
from services.marine.vehicle import GRAVITY, Vehicle
from services.runtime.config.stack import Stack
from tests.services.estimation.sensed import MS, QUICK, Sensed
from tests.support.messages import example

PIONEER = Stack().section("vehicle", Vehicle)
PATIENCE = 2.0  # [s]
Sample = ImuSample | MagnetometerSample | PressureSample | DvlSample | UsblSample


def running() -> Sensed:
    vehicle = Sensed()
    assert vehicle.run(5.0).phase == "running"
    bad = ("frozen", "rate", "disturbed")
    assert not [name for name in vehicle.counts if name.startswith(bad)]
    return vehicle


def give(estimator: Estimator, sample: Sample) -> VehicleState | None:
    match sample:
        case ImuSample():
            return estimator.imu(sample, max(0, sample.stamp_ns))
        case MagnetometerSample():
            estimator.magnetometer(sample)
        case PressureSample():
            estimator.pressure(sample)
        case DvlSample():
            estimator.dvl(sample)
        case UsblSample():
            estimator.usbl(sample)
    return None


# A sample that cannot be.

OLD, NOW = 2000 * MS, 5010 * MS  # [ns]
FELT, STILL = (0.0, 0.0, -GRAVITY), (0.0, 0.0, 0.0)


def imu(stamp: int = NOW, *, force: tuple[float, ...] = FELT, rate: tuple[float, ...] = STILL):
    return example(ImuSample, stamp, specific_force=force, angular_rate=rate)


@pytest.mark.parametrize(
    ("sample", "what"),
    [
        (imu(force=(0.0, 0.0, 0.0)), "implausible:sensor/imu"),
        *((imu(force=force), "saturated:sensor/imu") for force in (156.9 * np.eye(3)).tolist()),
        *((imu(rate=rate), "saturated:sensor/imu") for rate in (-34.9 * np.eye(3)).tolist()),
        (imu(OLD, force=(0.0, 5.0, -8.0), rate=(1.0, 0.0, 0.0)), "not_newer:sensor/imu"),
        (PressureSample(stamp_ns=OLD, pressure=2e5), "not_newer:sensor/pressure"),
        (PressureSample(stamp_ns=NOW, pressure=100.0), "implausible:sensor/pressure"),
        (
            MagnetometerSample(stamp_ns=OLD, field=(0.0, 3e-5, 4e-5)),
            "not_newer:sensor/magnetometer",
        ),
        (
            MagnetometerSample(stamp_ns=NOW, field=(1.0, 0.0, 0.0)),
            "implausible:sensor/magnetometer",
        ),
        (example(DvlSample, NOW, velocity=(99.0, 0.0, 0.0)), "implausible:sensor/dvl"),
        (example(UsblSample, NOW, north=1e8), "implausible:sensor/usbl"),
    ],
)
def test_a_sample_that_cannot_be_is_counted_and_not_used(sample: Sample, what: str) -> None:
    vehicle = running()
    before = vehicle.states[-1][1]
    assert give(vehicle.estimator, sample) is None
    assert vehicle.counts[what] == 1
    after = vehicle.run(0.1)
    assert after.north is None
    for name in ("heading", "roll", "depth"):
        found, expected = getattr(after, name).value, getattr(before, name).value
        assert found == pytest.approx(expected, abs=0.01)


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
@given(st.lists(anything | st.integers(0, 10**12), max_size=40), st.booleans())
def test_nothing_that_passes_the_gate_raises_or_makes_a_state_that_is_not_finite(
    samples: list[Sample | int], calibrated: bool
) -> None:
    """A number: a silence of the IMU until then [ns]."""
    vehicle = Sensed()
    if calibrated:
        vehicle.run(3.2)
    for sample in samples:
        silence = isinstance(sample, int)
        state = vehicle.estimator.silence(sample) if silence else give(vehicle.estimator, sample)
        assert state is None or decodes(state)
    assert all(decodes(state) for _, state in vehicle.go(0.2).states[-20:])


def decodes(state: VehicleState) -> bool:
    """A receiver accepts it: every number is finite and within its limits."""
    payload = msgspec.msgpack.encode(state)
    back = msgspec.msgpack.decode(payload, type=VehicleState)
    values = [getattr(back, name) for name in back.__struct_fields__]
    return all(np.isfinite([v.value, v.std]).all() for v in values if isinstance(v, Estimate))


# A sensor that repeats itself.


def test_a_frozen_imu_is_counted_once_and_treated_as_silent() -> None:
    vehicle = running()
    vehicle.frozen = {"imu"}
    state = vehicle.run(3.0)
    assert vehicle.counts["frozen:sensor/imu"] == 1
    assert not state.heading.valid
    assert state.depth.valid  # goes on from pressure alone
    vehicle.frozen = set()
    assert not vehicle.run(0.5).heading.valid  # it may have turned
    assert vehicle.run(1.0).heading.valid  # as the compass measured it


def test_a_frozen_pressure_sensor_is_counted_once_and_depth_becomes_invalid() -> None:
    vehicle = running()
    vehicle.frozen = {"pressure"}
    state = vehicle.run(14.0)
    assert vehicle.counts["frozen:sensor/pressure"] == 1
    assert not state.depth.valid
    vehicle.frozen = set()
    assert vehicle.run(2.0).depth.valid


def test_a_frozen_magnetometer_is_counted_once_and_north_goes_on_with_the_gyroscope() -> None:
    vehicle = running()
    vehicle.frozen = {"magnetometer"}
    state = vehicle.run(5.0)
    assert vehicle.counts["frozen:sensor/magnetometer"] == 1
    assert state.heading_navigation is not None
    assert state.heading_navigation.value == pytest.approx(0.0, abs=0.05)


def test_a_frozen_position_aid_is_counted_once() -> None:
    vehicle = running()
    for _ in range(30):
        now = vehicle.run(1.0).stamp_ns
        vehicle.estimator.dvl(example(DvlSample, now, velocity=(0.1, 0.0, 0.0), std=0.01))
        vehicle.estimator.usbl(example(UsblSample, now, std=0.5))
    for aid in ("dvl", "usbl"):
        assert vehicle.counts[f"frozen:sensor/{aid}"] == 1


def coarse() -> Sensed:
    """Its IMU may repeat itself at rest for ten seconds, and does."""
    watch = WatchSettings(imu_frozen_at_rest=10.0)
    vehicle = Sensed(msgspec.structs.replace(QUICK, watch=watch), vehicle=PIONEER)
    assert vehicle.run(5.0).phase == "running"
    vehicle.frozen = {"imu"}
    return vehicle


def push(vehicle: Sensed, newtons: float, seconds: float) -> None:
    """With one thruster, told a hundred times a second."""
    thrust = (newtons, *(0.0,) * (len(PIONEER.thruster) - 1))
    for _ in range(round(100 * seconds)):
        vehicle.estimator.actuation(example(Actuation, vehicle.ms * MS, thrust=thrust))
        vehicle.run(0.01)


def test_a_coarse_imu_may_repeat_itself_at_rest_but_not_for_ever() -> None:
    vehicle = coarse()
    for n in range(10):
        push(vehicle, 0.2 * (-1) ** n, 0.2)  # of a vehicle that is held: no motion
    push(vehicle, 0.0, 7.8)
    assert "frozen:sensor/imu" not in vehicle.counts
    push(vehicle, 0.0, 0.5)
    assert vehicle.counts["frozen:sensor/imu"] == 1


@pytest.mark.parametrize("rests", [0.0, 3.0])
def test_a_coarse_imu_that_repeats_itself_while_the_thrust_changes_is_frozen(rests: float) -> None:
    vehicle = coarse()
    push(vehicle, 0.0, rests)
    for n in range(10):  # on and off, faster than the limit
        push(vehicle, 20.0 * (n % 2), 0.04)
    assert vehicle.counts["frozen:sensor/imu"] == 1
    push(vehicle, 0.0, 5.0)
    assert vehicle.counts["frozen:sensor/imu"] == 1, "it is frozen until it says something else"
    vehicle.frozen = set()
    vehicle.run(2.0)
    vehicle.frozen = {"imu"}
    push(vehicle, 0.0, 5.0)
    assert vehicle.counts["frozen:sensor/imu"] == 1, "and may then rest again"


# Samples that come too often or too rarely.


def test_a_duplicate_is_counted_and_not_used() -> None:
    vehicle = running()
    vehicle.frozen = {"imu"}
    vehicle.ms += 10
    assert vehicle.feel() is not None
    assert vehicle.feel() is None
    assert vehicle.counts["duplicated:sensor/imu"] >= 1


def test_a_wrong_rate_is_counted_once_per_passage() -> None:
    vehicle = running()
    for passage in (1, 2):
        vehicle.every["imu"] = 20
        vehicle.run(10.0)
        assert vehicle.counts["rate:sensor/imu"] == passage
        vehicle.every["imu"] = 10
        vehicle.run(6.0)
    assert vehicle.counts["rate:sensor/imu"] == 2


def watched() -> tuple[Sensor, Outbox]:
    outbox = Outbox()
    return Sensor("sensor/x", outbox, 1e3, PATIENCE), outbox


def test_a_drop_out_is_not_a_wrong_rate() -> None:
    outbox = Outbox()
    watch, at = Sensor("sensor/x", outbox, 10.0, hz=10.0), 0
    for k in range(500):
        at += (5000 if k % 7 == 6 else 100) * MS
        assert watch.judge((float(k),), at) is None
    assert not outbox.counts


@pytest.mark.parametrize(("declared", "told"), [(100.0, 1), (20.0, 0), (30.0, 1)])
def test_the_imu_rate_of_a_vehicle_is_said_and_no_other_is_silent(declared: float, told: int):
    outbox = Outbox()
    watch = sensors_of(WatchSettings(imu_rate=declared), outbox)[topics.IMU.key]
    for k in range(300):  # 20 a second
        watch.judge((0.1 * (k % 7), 0.0, -GRAVITY, 0.0, 0.0, 0.001 * (k % 5)), 50 * k * MS)
    assert outbox.counts["rate:sensor/imu"] == told


# A sensor that was heard and falls silent is counted, once for each silence.


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(1, 6000), min_size=1, max_size=20))
def test_each_silence_beyond_the_patience_is_counted_once(gaps: list[int]) -> None:
    watch, outbox = watched()
    watch.trouble(10**12)  # never heard: it is absent and not silent
    assert not outbox.counts
    at = 0
    watch.judge((0.0,), at * MS)
    for k, gap in enumerate(gaps, start=1):
        for ms in range(at, at + gap, 50):
            watch.trouble(ms * MS)
        watch.trouble((at + gap) * MS)
        at += gap
        watch.judge((float(k),), at * MS)
    assert outbox.counts["silent:sensor/x"] == sum(gap > PATIENCE * 1000 for gap in gaps)


def test_a_dvl_that_says_it_has_no_lock_is_not_silent_until_it_is() -> None:
    watch, _ = watched()
    why = events.NO_BOTTOM("sensor/x")
    for k in range(100):
        watch.refused(why, k * 100 * MS)
        assert watch.trouble(k * 100 * MS) == (why if k > 5 else None)
    lately = 99 * 100 * MS
    assert watch.trouble(lately + round((PATIENCE + 0.1) * 1e9)) == events.SILENT("sensor/x")
    assert watch.judge((1.0,), lately + 2 * round(PATIENCE * 1e9)) is None
    assert watch.trouble(lately + 2 * round(PATIENCE * 1e9)) is None


def test_a_sensor_whose_samples_cannot_be_true_is_not_silent() -> None:
    vehicle = running()
    vehicle.every["magnetometer"] = 100
    vehicle.earth = (200e-6, 0.0, 0.0)  # a magnet beside the sensor
    assert vehicle.run(4.0).troubles == ("implausible:sensor/magnetometer",)
    assert vehicle.counts["silent:sensor/magnetometer"] == 0
    assert vehicle.counts["implausible:sensor/magnetometer"] == 40


def dvl(vehicle: Sensed, *, locked: bool = True) -> None:
    """Once, about still."""
    velocity = (1e-3 * (vehicle.ms % 7), 0.0, 0.0) if locked else None
    vehicle.estimator.dvl(example(DvlSample, vehicle.ms * MS, velocity=velocity, std=0.01))


def test_without_a_lock_the_state_says_why_it_does_not_know_where_it_is() -> None:
    vehicle = running()
    for locked in (True, False):
        for _ in range(20 if locked else 60):
            dvl(vehicle, locked=locked)
            vehicle.run(0.1)
        state = vehicle.states[-1][1]
        assert state.north is not None
        assert state.north.valid == locked  # 6 s without a lock: dead reckoning no longer counts
        lost = events.NO_BOTTOM("sensor/dvl").name in (state.troubles or ())
        assert lost == (not locked)
    assert vehicle.counts["silent:sensor/dvl"] == 0


def test_the_estimator_counts_its_silent_aids_and_its_compass() -> None:
    vehicle = running()
    for second in range(5):
        dvl(vehicle)
        vehicle.estimator.usbl(
            example(UsblSample, vehicle.ms * MS, north=0.01 * second, east=0.0, std=0.5)
        )
        vehicle.run(1.0)
    vehicle.absent = {"magnetometer"}
    vehicle.run(20.0)
    for name in ("magnetometer", "dvl", "usbl"):
        assert vehicle.counts[f"silent:sensor/{name}"] == 1


def test_a_fast_dvl_is_silent_after_a_second_and_a_sample_before_the_start_is_not_ahead() -> None:
    """It is judged by the rate at which it comes, locked or not."""
    vehicle, told_s = Sensed(), 0.0
    for k in range(1100):
        vehicle.run(0.01)
        if k < 900:  # beside every sample of the IMU: one comes just as calibration ends
            dvl(vehicle, locked=k % 300 <= 250)
        if not told_s and vehicle.counts["silent:sensor/dvl"]:
            told_s = k / 100
    assert 9.9 < told_s < 10.2
    assert vehicle.counts["ahead:sensor/dvl"] == 0
