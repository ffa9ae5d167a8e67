"""The depth observer against batch least squares, what it can know, what the time of a sample is
worth, and what it says of a sample."""

from collections.abc import Callable, Iterator
from math import inf, nan, sqrt

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import events
from messages.aiding import AidSource
from messages.events import Outbox
from services.estimation.depth.depth_filter import DepthFilter, DepthSettings
from services.estimation.depth.depth_observer import Atmosphere, DepthObserver
from services.marine.vehicle import ATMOSPHERE, GRAVITY, SEA_WATER

STEP_NS = 10_000_000
PER_METRE = SEA_WATER * GRAVITY  # [Pa/m]
AIR = Atmosphere(ATMOSPHERE, 1.0)
STD = 0.05  # [m]
SET = DepthSettings(acceleration_noise=0.05, bias_walk=0.02, motion_noise=0.3)
START = np.array([0.3, 0.2, 0.1])  # spreads of depth, rate, bias

sample = st.tuples(
    st.floats(-2.0, 2.0),  # [m/s²]
    st.floats(0.005, 0.2),  # [s]
    st.floats(-3.0, 3.0),  # [m] measured depth
    st.floats(0.0, 0.1),  # [s] its age
)


def observer(told: DepthSettings | None = None) -> DepthObserver:
    return DepthObserver(told or DepthSettings(), AIR, SEA_WATER, 0.0)


def pressure(depth: float) -> float:
    return ATMOSPHERE + depth * PER_METRE


def model(dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Transition, input and covariance of the disturbance over one step, from the textbook."""
    f = np.array([[1, dt, -dt * dt / 2], [0, 1, -dt], [0, 0, 1]])
    q = np.zeros((3, 3))
    noise = SET.acceleration_noise
    q[:2, :2] = noise**2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    q[2, 2] = SET.bias_walk**2 * dt
    return f, np.array([dt * dt / 2, dt, 0.0]), q


def batch(steps: list[tuple[float, float, float, float]]) -> np.ndarray:
    """The last state of the trajectory that fits start, motion and samples best, all at once."""
    n = len(steps)
    rows: list[np.ndarray] = [np.diag(1 / START) @ np.eye(3, 3 * n + 3)]
    right: list[np.ndarray] = [np.zeros(3)]
    for k, (acceleration, dt, depth, age) in enumerate(steps):
        f, g, q = model(dt)
        whiten = np.linalg.inv(np.linalg.cholesky(q))
        motion = np.zeros((3, 3 * n + 3))
        motion[:, 3 * k : 3 * k + 3], motion[:, 3 * k + 3 : 3 * k + 6] = -f, np.eye(3)
        rows.append(whiten @ motion)
        right.append(whiten @ g * acceleration)
        seen = np.zeros((1, 3 * n + 3))
        seen[0, 3 * k + 3 : 3 * k + 5] = 1.0, -age
        rows.append(seen / STD)
        right.append(np.array([depth / STD]))
    return np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0][-3:]


@settings(max_examples=40, deadline=None)
@given(steps=st.lists(sample, min_size=1, max_size=6))
def test_sample_by_sample_is_what_all_samples_at_once_would_give(
    steps: list[tuple[float, float, float, float]],
):
    f = DepthFilter(SET)
    f.start(0.0, float(START[0]), float(START[1]), 0.0, float(START[2]))
    for acceleration, dt, depth, age in steps:
        f.predict(acceleration, dt)
        f.update(*f.innovation(depth, STD, age), age)
    assert [f.depth, f.rate, f.bias] == pytest.approx(batch(steps).tolist(), abs=1e-9)


def test_pressure_and_accelerometer_tell_depth_rate_and_bias():
    f, _, _ = model(0.01)
    h = np.array([[1.0, -0.03, 0.0]])
    observability = np.vstack([h @ np.linalg.matrix_power(f, k) for k in range(3)])
    # Singular values are far from each other at 100 Hz; zero is exact here.
    assert np.linalg.matrix_rank(observability, tol=1e-9) == 3


def test_pressure_teaches_the_accelerometers_bias():
    o = observer(DepthSettings(pressure_std=50.0))
    o.pressure(pressure(5.0), 1)
    for k in range(1, 1001):
        o.predict(0.3, k * STEP_NS)
        o.pressure(pressure(5.0), k * STEP_NS)
    assert o.bias == pytest.approx(0.3, abs=0.02)


@settings(max_examples=50, deadline=None)
@given(
    age_steps=st.integers(0, 10),
    depth=st.floats(-0.3, 0.3),
    rate=st.floats(-1.0, 1.0),
    acceleration=st.none() | st.just(0.0),
)
def test_a_late_sample_corrects_as_if_it_had_come_when_nothing_has_happened_since(
    age_steps: int, depth: float, rate: float, acceleration: float | None
):
    # No disturbance and no unknown bias: what happened in between is then exactly known.
    quiet = DepthSettings(acceleration_noise=1e-9, bias_walk=1e-9, motion_noise=1e-9)
    then, late = DepthFilter(quiet), DepthFilter(quiet)
    for f in (then, late):
        f.start(0.0, 0.2, bias_std=1e-9)
        f.rate = rate
    then.update(*then.innovation(depth, STD, 0.0), 0.0)
    for _ in range(age_steps):
        then.predict(acceleration, 0.01)
        late.predict(acceleration, 0.01)
    age = 0.01 * age_steps
    late.update(*late.innovation(depth, STD, age), age)
    assert (late.depth, late.rate) == pytest.approx((then.depth, then.rate), abs=1e-9)
    for k, m in ((0, 0), (0, 1), (1, 1)):
        assert late.covariance[k][m] == pytest.approx(then.covariance[k][m], abs=1e-9)


def sinking(told: DepthSettings, late: float) -> float:
    """[m] Mean error while sinking at 0.5 m/s; samples of 50 Hz come `late` [s], stamped so."""
    o = observer(told)
    errors: list[float] = []
    for k in range(1, 1501):
        now = k * STEP_NS
        if k % 2 == 0:
            o.pressure(pressure(1.0 + 0.5 * (now * 1e-9 - late)), now)
        o.predict(0.0, now)
        errors.append(o.estimates(now)[0].value - (1.0 + 0.5 * now * 1e-9))
    return float(np.mean(errors[500:]))


def test_a_known_latency_takes_the_error_of_a_late_sensor_away():
    plain, told = DepthSettings(), DepthSettings(pressure_latency=0.06)
    assert sinking(plain, late=0.06) == pytest.approx(-0.03, abs=0.004)
    assert sinking(told, late=0.06) == pytest.approx(0.0, abs=0.002)


def test_it_settles_on_a_depth_holds_it_when_pressure_goes_and_comes_back():
    o = observer()
    for k in range(1, 1000):
        o.pressure(pressure(5.0), k * STEP_NS)
        o.predict(0.0, k * STEP_NS)
    depth, rate, _ = o.estimates(999 * STEP_NS)
    assert (depth.valid, depth.value) == (True, pytest.approx(5.0, abs=0.01))
    assert rate.value == pytest.approx(0.0, abs=0.01)
    said = [o.predict(0.0, k * STEP_NS) for k in range(1000, 2200)]
    assert said.count(events.LOST_DEPTH()) == 1
    late = o.estimates(2199 * STEP_NS)
    assert not late[0].valid
    o.pressure(pressure(7.0), 2200 * STEP_NS)
    o.predict(0.0, 2201 * STEP_NS)
    assert o.estimates(2201 * STEP_NS)[0].value == pytest.approx(7.0, abs=0.1)


@settings(max_examples=30, deadline=None)
@given(
    moments=st.lists(
        st.tuples(st.floats(5e4, 1.2e7), st.none() | st.floats(-150.0, 150.0), st.integers(-3, 90)),
        max_size=60,
    )
)
def test_it_never_says_a_number_that_is_not_finite(moments: list[tuple[float, float | None, int]]):
    o = observer()
    now = 0
    for pascal, acceleration, steps in moments:
        now += steps * STEP_NS
        o.pressure(pascal, now)
        o.predict(acceleration, now)
        for estimate in o.estimates(now):
            assert -inf < estimate.value < inf
            assert 0.0 <= estimate.std < inf


def test_a_reset_after_nonsense_is_named():
    o = observer()
    o.pressure(pressure(5.0), STEP_NS)
    assert o.predict(nan, 2 * STEP_NS) == events.NOT_FINITE("depth")
    assert o.estimates(2 * STEP_NS)[0].value == 0.0


def compared(depth: float) -> AidSource:
    o = observer(DepthSettings(pressure_std=STD * PER_METRE))
    o.pressure(pressure(5.0), STEP_NS)
    assert o.aiding.message() is None  # nothing to compare the first one with
    o.pressure(pressure(depth), STEP_NS + 1)
    source = o.aiding.message()
    assert source is not None
    return source


def test_what_is_said_of_a_sample_is_its_innovation_and_what_was_made_of_it():
    source = compared(5.1)
    assert (source.samples, source.value) == (1, pytest.approx(5.1))
    assert source.innovation == pytest.approx(0.1)
    assert source.variance == pytest.approx(2.0 * STD**2)
    assert source.test_ratio == pytest.approx(0.1**2 / (2.0 * (6.0 * STD) ** 2))
    # Clipped at 1.5 of 6 standard deviations.
    assert source.whole_until == pytest.approx(1.0 / 16.0)
    assert (source.weight, source.rejected) == (1.0, 0.0)
    clipped = compared(5.0 - 3.0 * sqrt(2.0) * STD)
    assert (clipped.weight, clipped.rejected) == (pytest.approx(0.5), 0.0)
    outlier = compared(5.0 + 7.0 * sqrt(2.0) * STD)
    assert outlier.test_ratio == pytest.approx((7.0 / 6.0) ** 2)
    assert (outlier.weight, outlier.rejected) == (0.0, 1.0)
    assert outlier.reasons == ("outlier:sensor/pressure",)


class Press:
    """Pressure of σ 5 cm at 50 Hz."""

    def __init__(self, seed: int) -> None:
        self.o, self.rng, self.k = observer(SHIPPED), np.random.default_rng(seed), 0
        self.outbox = Outbox()
        self.counts = self.outbox.counts

    def run(self, seconds: float, depth: float) -> Iterator[float]:
        """Seconds since the start of each step; the vehicle stays at `depth` [m]."""
        for k in range(round(seconds * 100)):
            self.k += 1
            if self.k % 2 == 0:
                said = pressure(depth + STD * float(self.rng.standard_normal()))
                self.outbox.tell(self.o.pressure(said, self.k * STEP_NS))
            self.outbox.tell(self.o.predict(0.0, self.k * STEP_NS))
            yield k * 0.01


SHIPPED = DepthSettings(pressure_std=STD * PER_METRE)


@pytest.mark.parametrize("seed", range(3))
def test_sound_pressure_is_never_clipped_on_one_side_for_long(seed: int):
    press = Press(seed)
    for _ in press.run(60.0, 5.0):
        pass
    assert press.counts["clipped:sensor/pressure"] == 0


def test_a_sensor_that_jumps_within_the_gate_is_counted_and_doubted_while_it_lasts():
    press = Press(0)
    for _ in press.run(10.0, 5.0):
        pass
    calm = press.o.estimates(press.k * STEP_NS)[0].std
    press.rng = np.random.default_rng(1)
    doubt = 0.0
    for t in press.run(60.0, 5.0 + 5.5 * STD):
        depth = press.o.estimates(press.k * STEP_NS)[0]
        doubt = max(doubt, depth.std)
        if t > 15.0:
            assert depth.value == pytest.approx(5.0 + 5.5 * STD, abs=0.05)
    assert press.counts["distrusted:sensor/imu"] == 0  # it may be a wave for as long
    assert doubt > 2.5 * calm
    assert press.o.estimates(press.k * STEP_NS)[0].std < 1.5 * calm


decode: Callable[..., DepthSettings] = msgspec.toml.decode


@pytest.mark.parametrize(
    "line", ['observer = "accelerometer"', "pressure_latency = -0.01",
             "pressure_latency = 0.5", "pressure_latency = nan"],
)  # fmt: skip
def test_a_setting_that_makes_no_sense_is_refused(line: str):
    with pytest.raises(msgspec.ValidationError):
        decode(line, type=DepthSettings)
