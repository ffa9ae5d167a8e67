"""The family of depth observers: one estimator against batch least squares, what each can know,
and what the time of a sample is worth."""

from collections import Counter
from collections.abc import Callable, Iterator
from math import inf, nan, sqrt

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.estimation.depth.depth_filter import LEAST_MOTION_NOISE, DepthFilter, DepthSettings
from services.estimation.depth.depth_observer import Atmosphere, DepthObserver
from services.estimation.depth.depth_variants import VARIANTS
from services.marine.vehicle import ATMOSPHERE, GRAVITY, SEA_WATER
from services.reference.trajectory.minimum_jerk import Limits, Ramp

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


def observer(way: str, told: DepthSettings | None = None) -> DepthObserver:
    return DepthObserver(told or DepthSettings(), AIR, SEA_WATER, 0.0, VARIANTS[way])


def pressure(depth: float) -> float:
    return ATMOSPHERE + depth * PER_METRE


def model(dt: float, way: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Transition, input and covariance of the disturbance over one step, from the textbook."""
    with_bias = way == "accelerometer"
    f = np.array([[1, dt, -dt * dt / 2], [0, 1, -dt], [0, 0, 1]])
    if not with_bias:
        f[0, 2] = f[1, 2] = 0.0
    noise = SET.acceleration_noise if with_bias else SET.motion_noise
    q = np.zeros((3, 3))
    q[:2, :2] = noise**2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    q[2, 2] = SET.bias_walk**2 * dt
    g = np.array([dt * dt / 2, dt, 0.0]) * (way in ("accelerometer", "reference"))
    return f, g, q


def batch(steps: list[tuple[float, float, float, float]], way: str) -> np.ndarray:
    """The last state of the trajectory that fits start, motion and samples best, all at once."""
    n = len(steps)
    rows: list[np.ndarray] = [np.diag(1 / START) @ np.eye(3, 3 * n + 3)]
    right: list[np.ndarray] = [np.zeros(3)]
    for k, (acceleration, dt, depth, age) in enumerate(steps):
        f, g, q = model(dt, way)
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


@pytest.mark.parametrize("way", ["timed", "reference", "accelerometer"])
@settings(max_examples=40, deadline=None)
@given(steps=st.lists(sample, min_size=1, max_size=6))
def test_sample_by_sample_is_what_all_samples_at_once_would_give(
    way: str, steps: list[tuple[float, float, float, float]]
):
    f = DepthFilter(SET)
    f.start(0.0, float(START[0]), float(START[1]), 0.0, float(START[2]))
    for acceleration, dt, depth, age in steps:
        f.predict(acceleration if VARIANTS[way].driven else None, dt, VARIANTS[way].measured)
        f.update(*f.innovation(depth, STD, age), age)
    assert [f.depth, f.rate, f.bias] == pytest.approx(batch(steps, way).tolist(), abs=1e-9)


@pytest.mark.parametrize(("way", "known"), [("timed", 2), ("reference", 2), ("accelerometer", 3)])
def test_pressure_alone_tells_depth_and_rate_and_with_an_accelerometer_its_bias(
    way: str, known: int
):
    f, _, _ = model(0.01, way)
    h = np.array([[1.0, -0.03, 0.0]])
    observability = np.vstack([h @ np.linalg.matrix_power(f, k) for k in range(3)])
    # Singular values are far from each other at 100 Hz; zero is exact here.
    assert np.linalg.matrix_rank(observability, tol=1e-9) == known


def test_only_an_accelerometer_teaches_its_bias():
    spreads: dict[str, float] = {}
    for way in ("timed", "reference", "accelerometer"):
        o = observer(way, DepthSettings(pressure_std=50.0))
        o.pressure(pressure(5.0), 1)
        for k in range(1, 1001):
            o.predict(0.3, k * STEP_NS)
            o.pressure(pressure(5.0), k * STEP_NS)
        spreads[way] = o.bias
    assert spreads["accelerometer"] == pytest.approx(0.3, abs=0.02)
    assert spreads["timed"] == spreads["reference"] == 0.0


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
    for name in ("depth", "rate", "p00", "p01", "p11"):
        assert getattr(late, name) == pytest.approx(getattr(then, name), abs=1e-9)


def sinking(way: str, told: DepthSettings, late: float) -> float:
    """[m] Mean error while sinking at 0.5 m/s; samples of 50 Hz come `late` [s], stamped so."""
    o = observer(way, told)
    errors: list[float] = []
    for k in range(1, 1501):
        now = k * STEP_NS
        if k % 2 == 0:
            o.pressure(pressure(1.0 + 0.5 * (now * 1e-9 - late)), now)
        o.predict(0.0, now)
        errors.append(o.estimates(now)[0].value - (1.0 + 0.5 * now * 1e-9))
    return float(np.mean(errors[500:]))


@pytest.mark.parametrize("way", ["timed", "reference", "accelerometer"])
def test_a_known_latency_takes_the_error_of_a_late_sensor_away(way: str):
    plain, told = DepthSettings(), DepthSettings(pressure_latency=0.06)
    assert sinking(way, plain, late=0.06) == pytest.approx(-0.03, abs=0.004)
    assert sinking(way, told, late=0.06) == pytest.approx(0.0, abs=0.002)


@pytest.mark.parametrize("way", ["hold", "new"])
def test_an_untimed_observer_knows_no_latency(way: str):
    told = DepthSettings(pressure_latency=0.06)
    assert sinking(way, told, late=0.06) < -0.025


def test_a_held_sample_counts_in_every_step_and_a_new_one_once():
    spreads: dict[str, float] = {}
    for way in ("hold", "new"):
        o = observer(way)
        o.pressure(pressure(5.0), STEP_NS)
        o.pressure(pressure(5.0), STEP_NS + 1)
        for k in range(2, 12):
            o.predict(None, k * STEP_NS)
        spreads[way] = o.estimates(0)[0].std
    assert spreads["hold"] < 0.7 * spreads["new"]


def test_a_held_outlier_is_counted_once_and_then_forgotten():
    o = observer("hold")
    for k in range(1, 200):
        o.pressure(pressure(5.0), k * STEP_NS)
        o.predict(None, k * STEP_NS)
    o.pressure(pressure(50.0), 200 * STEP_NS)
    said = [o.predict(None, k * STEP_NS) for k in range(200, 220)]
    assert said == ["outlier:sensor/pressure"] + [None] * 19
    assert o.estimates(0)[0].value == pytest.approx(5.0, abs=0.05)


@pytest.mark.parametrize("way", list(VARIANTS))
def test_every_way_settles_on_a_depth_holds_it_when_pressure_goes_and_comes_back(way: str):
    o = observer(way)
    for k in range(1, 1000):
        o.pressure(pressure(5.0), k * STEP_NS)
        o.predict(0.0, k * STEP_NS)
    depth, rate, _ = o.estimates(999 * STEP_NS)
    assert (depth.valid, depth.value) == (True, pytest.approx(5.0, abs=0.01))
    assert rate.value == pytest.approx(0.0, abs=0.01)
    said = [o.predict(0.0, k * STEP_NS) for k in range(1000, 2200)]
    assert said.count("lost:depth") == 1
    late = o.estimates(2199 * STEP_NS)
    # A held sample is no news: it must not keep the depth valid.
    assert not late[0].valid
    o.pressure(pressure(7.0), 2200 * STEP_NS)
    o.predict(0.0, 2201 * STEP_NS)
    assert o.estimates(2201 * STEP_NS)[0].value == pytest.approx(7.0, abs=0.1)


@pytest.mark.parametrize("way", list(VARIANTS))
@settings(max_examples=30, deadline=None)
@given(
    events=st.lists(
        st.tuples(st.floats(5e4, 1.2e7), st.none() | st.floats(-150.0, 150.0), st.integers(-3, 90)),
        max_size=60,
    )
)
def test_no_way_ever_says_a_number_that_is_not_finite(
    way: str, events: list[tuple[float, float | None, int]]
):
    o = observer(way)
    now = 0
    for pascal, acceleration, steps in events:
        now += steps * STEP_NS
        o.pressure(pascal, now)
        o.predict(acceleration, now)
        for estimate in o.estimates(now):
            assert -inf < estimate.value < inf
            assert 0.0 <= estimate.std < inf


@pytest.mark.parametrize("way", ["accelerometer", "reference"])
def test_a_reset_after_nonsense_is_named(way: str):
    o = observer(way)
    o.pressure(pressure(5.0), STEP_NS)
    assert o.predict(nan, 2 * STEP_NS) == "not_finite:depth"
    assert o.estimates(2 * STEP_NS)[0].value == 0.0


def surprise_of(depth: float) -> float:
    o = observer("accelerometer", DepthSettings(pressure_std=STD * PER_METRE))
    o.pressure(pressure(5.0), STEP_NS)
    o.pressure(pressure(depth), STEP_NS + 1)
    return o.surprise


def test_the_surprise_is_the_innovation_over_its_spread():
    assert surprise_of(5.1) == pytest.approx(0.1 / (sqrt(2.0) * STD), rel=1e-3)
    assert surprise_of(4.9) == pytest.approx(-surprise_of(5.1), rel=1e-6)


class Press:
    """Pressure of σ 5 cm at 50 Hz on an observer that is told what the reference asks."""

    def __init__(self, way: str, seed: int) -> None:
        told = ALLOWED if way == "reference" else SHIPPED
        self.o, self.rng, self.k = observer(way, told), np.random.default_rng(seed), 0
        self.counts: Counter[str | None] = Counter()

    def run(self, seconds: float, depth: float, asked: Callable[[float], float]) -> Iterator[float]:
        """Seconds since the start of each step; the vehicle stays at `depth` [m]."""
        for k in range(round(seconds * 100)):
            self.k += 1
            if self.k % 2 == 0:
                said = pressure(depth + STD * float(self.rng.standard_normal()))
                self.counts[self.o.pressure(said, self.k * STEP_NS)] += 1
            self.counts[self.o.predict(asked(k * 0.01), self.k * STEP_NS)] += 1
            yield k * 0.01


SHIPPED = DepthSettings(pressure_std=STD * PER_METRE)
ALLOWED = DepthSettings(
    observer="reference", motion_noise=LEAST_MOTION_NOISE, pressure_std=STD * PER_METRE
)


def ask_for_half_a_metre_per_second(t: float) -> float:
    """[m/s²] The reference's way there, with the Pioneer's jerk."""
    ramp = Ramp(Limits(1.5, 0.5))
    ramp.aim(0.5, 0.0)
    return ramp.at(t)[2]


@pytest.mark.parametrize("seed", range(3))
def test_a_blocked_vehicle_that_is_believed_to_move_is_found_out_within_a_second(seed: int):
    press = Press("reference", seed)
    for _ in press.run(10.0, 5.0, lambda _: 0.0):
        pass
    worst, believed, late = 0.0, 0.0, list[float]()
    for t in press.run(10.0, 5.0, ask_for_half_a_metre_per_second):
        depth, rate, acceleration = press.o.estimates(press.k * STEP_NS)
        assert not acceleration.valid  # it is asked for, not measured
        assert abs(depth.value - 5.0) < 4.0 * depth.std
        assert abs(rate.value) < 4.0 * rate.std
        if t > 2.4:  # the ramp ends after 1.4 s
            late.append(rate.value)
        worst, believed = max(worst, abs(depth.value - 5.0)), max(believed, rate.value)
    assert 0.1 < believed < 0.6  # it does believe, at first
    assert abs(float(np.mean(late[:100]))) < 0.1
    assert worst < 0.12
    assert press.counts["outlier:sensor/pressure"] == 0


@pytest.mark.parametrize("way", ["accelerometer", "reference"])
@pytest.mark.parametrize("seed", range(3))
def test_sound_pressure_is_never_clipped_on_one_side_for_long(way: str, seed: int):
    press = Press(way, seed)
    for _ in press.run(60.0, 5.0, lambda _: 0.0):
        pass
    assert press.counts["clipped:sensor/pressure"] == 0


def test_a_sensor_that_jumps_within_the_gate_is_counted_and_doubted_while_it_lasts():
    press = Press("accelerometer", 0)
    for _ in press.run(10.0, 5.0, lambda _: 0.0):
        pass
    calm = press.o.estimates(press.k * STEP_NS)[0].std
    press.rng = np.random.default_rng(1)
    doubt = 0.0
    for t in press.run(20.0, 5.0 + 5.5 * STD, lambda _: 0.0):
        depth = press.o.estimates(press.k * STEP_NS)[0]
        doubt = max(doubt, depth.std)
        if t > 15.0:
            assert depth.value == pytest.approx(5.0 + 5.5 * STD, abs=0.05)
    assert press.counts["distrusted:sensor/imu"] == press.counts["trusted:sensor/imu"] == 1
    assert doubt > 2.5 * calm
    assert press.o.estimates(press.k * STEP_NS)[0].std == pytest.approx(calm, rel=0.2)


decode: Callable[..., DepthSettings] = msgspec.toml.decode


@pytest.mark.parametrize("way", list(VARIANTS))
def test_the_vehicle_file_chooses_the_observer(way: str):
    chosen = decode(f'observer = "{way}"\nmotion_noise = 0.5', type=DepthSettings)
    assert chosen.observer == way


@pytest.mark.parametrize(
    "line", ['observer = "best"', "pressure_latency = -0.01",
             "pressure_latency = 0.5", "pressure_latency = nan"],
)  # fmt: skip
def test_a_setting_that_makes_no_sense_is_refused(line: str):
    with pytest.raises(msgspec.ValidationError):
        decode(line, type=DepthSettings)


def test_the_observer_that_hears_the_reference_may_not_believe_it_too_much():
    with pytest.raises(msgspec.ValidationError, match=r"needs at least 0\.5"):
        decode('observer = "reference"\nmotion_noise = 0.2', type=DepthSettings)
    assert decode('observer = "timed"\nmotion_noise = 0.1', type=DepthSettings).motion_noise == 0.1
