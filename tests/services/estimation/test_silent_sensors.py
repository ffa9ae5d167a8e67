"""A sensor that was heard and falls silent is counted, once for each silence."""

from hypothesis import given, settings
from hypothesis import strategies as st

from messages import events
from messages.events import Outbox
from messages.sensors import DvlSample, ImuSample, MagnetometerSample, PressureSample, UsblSample
from messages.state import VehicleState
from messages.units import Vec3
from services.estimation.core import Estimator
from services.estimation.sensor import Sensor
from services.estimation.settings import CalibrationSettings, Settings
from services.marine.vehicle import GRAVITY

MS = 1_000_000  # [ns]
PATIENCE = 2.0  # [s]


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(1, 6000), min_size=1, max_size=20))
def test_each_silence_beyond_the_patience_is_counted_once(gaps: list[int]) -> None:
    outbox = Outbox()
    watch = Sensor("sensor/x", outbox, 1e3, PATIENCE)
    at = 0
    watch.judge((0.0,), at * MS)
    for k, gap in enumerate(gaps, start=1):
        for ms in range(at, at + gap, 50):
            watch.trouble(ms * MS)
        watch.trouble((at + gap) * MS)
        at += gap
        watch.judge((float(k),), at * MS)
    assert outbox.counts["silent:sensor/x"] == sum(gap > PATIENCE * 1000 for gap in gaps)


def test_a_sensor_that_was_never_heard_is_absent_and_not_silent() -> None:
    outbox = Outbox()
    watch = Sensor("sensor/x", outbox, 1e3, PATIENCE)
    watch.trouble(10**12)
    assert not outbox.counts


def test_a_dvl_that_says_it_has_no_lock_is_not_silent_until_it_is() -> None:
    outbox = Outbox()
    watch = Sensor("sensor/x", outbox, 1e3, PATIENCE)
    why = events.NO_BOTTOM("sensor/x")
    for k in range(100):
        watch.refused(why, k * 100 * MS)
        assert watch.trouble(k * 100 * MS) == (why if k > 5 else None)
    lately = 99 * 100 * MS
    assert watch.trouble(lately + round((PATIENCE + 0.1) * 1e9)) == events.SILENT("sensor/x")
    assert watch.judge((1.0,), lately + 2 * round(PATIENCE * 1e9)) is None
    assert watch.trouble(lately + 2 * round(PATIENCE * 1e9)) is None


def test_a_sensor_whose_samples_cannot_be_true_is_not_silent() -> None:
    estimator = Estimator(Settings(calibration=CalibrationSettings(still_time=1.0)), 0.17)
    state: VehicleState | None = None
    for k in range(1, 1000):
        now, wave = 10 * k * MS, 1e-3 * (k % 7)
        if k % 2:
            estimator.pressure(PressureSample(stamp_ns=now, pressure=101_900.0 + wave))
        if k % 10 == 0:  # a magnet beside the sensor, from the sixth second
            field = (15e-6, 1e-8 * (k % 7), 49e-6) if k < 600 else (200e-6, 1e-8 * (k % 7), 0.0)
            estimator.magnetometer(MagnetometerSample(stamp_ns=now, field=field))
        force, rate = (0.0, wave, -GRAVITY), (1e-7 * (k % 7), 0.0, 0.0)
        state = estimator.imu(imu_sample(now, force, rate), now) or state
    assert state is not None
    assert state.troubles == ("implausible:sensor/magnetometer",)
    assert estimator.outbox.counts["silent:sensor/magnetometer"] == 0
    assert estimator.outbox.counts["implausible:sensor/magnetometer"] == 40


def test_without_a_lock_the_state_says_why_it_does_not_know_where_it_is() -> None:
    estimator = Estimator(Settings(calibration=CalibrationSettings(still_time=1.0)), 0.17)
    states = list[VehicleState]()
    for k in range(1, 1600):
        now, wave = 10 * k * MS, 1e-3 * (k % 7)
        if k % 2:
            estimator.pressure(PressureSample(stamp_ns=now, pressure=101_900.0 + wave))
        if k % 10 == 0:
            seen = (wave, 0.0, 0.0) if k < 1000 else None
            estimator.dvl(DvlSample(stamp_ns=now, velocity=seen, std=0.01))
        force, rate = (0.0, wave, -GRAVITY), (1e-7 * (k % 7), 0.0, 0.0)
        if (state := estimator.imu(imu_sample(now, force, rate), now)) is not None:
            states.append(state)
    assert states[990].north is not None
    assert states[990].north.valid
    last = states[-1]
    assert events.NO_BOTTOM("sensor/dvl").name in (last.troubles or ())
    assert last.north is not None
    assert not last.north.valid  # 6 s without a lock: dead reckoning no longer counts
    assert estimator.outbox.counts["silent:sensor/dvl"] == 0


def imu_sample(now: int, force: Vec3, rate: Vec3) -> ImuSample:
    return ImuSample(stamp_ns=now, specific_force=force, angular_rate=rate)


def test_the_estimator_counts_its_silent_aids_and_its_compass() -> None:
    estimator = Estimator(Settings(calibration=CalibrationSettings(still_time=1.0)), 0.17)
    for k in range(1, 4000):
        now, wave = 10 * k * MS, 1e-3 * (k % 7)
        rate = (1e-4 * wave, 0.0, 0.0)
        if k % 2:
            estimator.pressure(PressureSample(stamp_ns=now, pressure=101_900.0 + wave))
        if k < 1000:
            estimator.magnetometer(
                MagnetometerSample(stamp_ns=now, field=(15e-6, wave * 1e-6, 49e-6))
            )
        if k < 1000 and k % 100 == 0:
            estimator.dvl(DvlSample(stamp_ns=now, velocity=(wave, 0.0, 0.0), std=0.01))
            estimator.usbl(UsblSample(stamp_ns=now, north=wave, east=0.0, std=0.5))
        imu = ImuSample(stamp_ns=now, specific_force=(0.0, wave, -GRAVITY), angular_rate=rate)
        estimator.imu(imu, now)
    for name in ("magnetometer", "dvl", "usbl"):
        assert estimator.outbox.counts[f"silent:sensor/{name}"] == 1


def test_a_fast_dvl_is_silent_after_a_second_and_a_sample_before_the_start_is_not_ahead() -> None:
    """It is judged by the rate at which it comes, locked or not."""
    estimator, told_s = (
        Estimator(Settings(calibration=CalibrationSettings(still_time=1.0)), 0.17),
        0.0,
    )
    for k in range(1, 2000):
        now, wave = 10 * k * MS, 1e-3 * (k % 7)
        if k % 2:
            estimator.pressure(PressureSample(stamp_ns=now, pressure=101_900.0 + wave))
        state = estimator.imu(imu_sample(now, (0.0, wave, -GRAVITY), (1e-4 * wave, 0.0, 0.0)), now)
        if k <= 1500:  # beside every sample of the IMU: one comes just as calibration ends
            seen = None if k % 300 > 250 else (wave, 0.0, 0.0)
            estimator.dvl(DvlSample(stamp_ns=now, velocity=seen, std=0.01))
        if state is not None and not told_s and estimator.outbox.counts["silent:sensor/dvl"]:
            told_s = k / 100
    assert 15.9 < told_s < 16.2
    assert estimator.outbox.counts["ahead:sensor/dvl"] == 0
