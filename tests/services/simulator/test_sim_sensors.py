"""Sensors measure the truth with the errors of their settings, and thrusters shake the IMU."""

from math import sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from messages.units import Quaternion, Vec6
from services.marine.attitude import from_euler, to_world
from services.marine.vehicle import GRAVITY, Thruster, Vehicle
from services.runtime.config.stack import Stack
from services.simulator.sensors import Sensors
from services.simulator.settings import Dvl, Settings, Usbl
from services.simulator.vibration import Shaking, Vibration
from tests.services.simulator.hulls import LEVEL, REST, command, simulator, world

motion = st.tuples(*[st.floats(-3, 3)] * 6)
attitude = st.builds(from_euler, st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-3, 3))
law = settings(max_examples=50, deadline=None)


def perfect(**changes: float) -> Settings:
    names = ("gyro_bias", "gyro_drift", "gyro_noise", "accelerometer_bias", "accelerometer_noise")
    names += ("hard_iron", "magnetometer_noise", "pressure_std")
    return replace(Settings(), **(dict.fromkeys(names, 0.0) | changes))


def test_at_rest_the_imu_feels_gravity_upwards_and_its_bias() -> None:
    sensors = Sensors(Settings(gyro_noise=0.0, gyro_drift=0.0, accelerometer_noise=0.0), seed=3)
    sample = sensors.imu(7, LEVEL, REST, REST)
    ax, ay, az = sensors.accelerometer_bias
    assert sample.stamp_ns == 7
    assert sample.specific_force == pytest.approx((ax, ay, az - GRAVITY))
    assert sample.angular_rate == pytest.approx(sensors.gyro_bias)
    assert any(bias != 0 for bias in sensors.gyro_bias)


@law
@given(attitude, motion, motion)
def test_specific_force_is_the_acceleration_in_the_world_without_gravity(
    q_NB: Quaternion, nu: Vec6, nu_dot: Vec6
) -> None:
    sample = Sensors(perfect(), seed=0).imu(0, q_NB, nu, nu_dot)
    # Differentiate the world velocity R(t) v(t) numerically, with the body turning at ω.
    v, omega, dv = np.array(nu[:3]), np.array(nu[3:]), np.array(nu_dot[:3])
    in_world = np.array(to_world(q_NB, tuple(dv + np.cross(omega, v))))
    expected = in_world - np.array([0.0, 0.0, GRAVITY])
    assert to_world(q_NB, sample.specific_force) == pytest.approx(expected, abs=1e-9)
    assert sample.angular_rate == nu[3:]


@law
@given(attitude)
def test_the_magnetometer_turns_with_the_body_and_keeps_the_places_field(q_NB: Quaternion) -> None:
    sample = Sensors(perfect(), seed=0).magnetometer(0, q_NB)
    assert to_world(q_NB, sample.field) == pytest.approx((15e-6, 0.0, 49e-6), abs=1e-15)


def test_pressure_is_air_and_a_column_of_water_with_noise_in_steps() -> None:
    sensors = Sensors(perfect(atmosphere=100_000.0, water_density=1000.0), seed=0)
    assert sensors.pressure(0, 10.0).pressure == pytest.approx(100_000 + 98_100)
    assert sensors.pressure(0, -0.1).pressure == 100_000.0
    coarse = Sensors(perfect(pressure_std=300.0, pressure_step=500.0), seed=0)
    readings = {coarse.pressure(0, 5.0).pressure for _ in range(50)}
    assert len(readings) > 1
    assert all(reading % 500.0 == 0.0 for reading in readings)
    sensors = Sensors(Settings(pressure_std=500.0), seed=5)
    found = [sensors.pressure(k, 5.0) for k in range(4000)]
    celsius = [s.temperature for s in found if s.temperature is not None]
    assert np.std([s.pressure for s in found]) == pytest.approx(500.0, rel=0.05)
    assert np.std(celsius) == pytest.approx(0.01, rel=0.05)
    assert np.mean(celsius) == pytest.approx(8.0, abs=0.001)
    assert sensors.water == celsius[-1]


def test_noise_has_the_strength_of_its_density_and_no_colour() -> None:
    settings = perfect(gyro_noise=1e-4, accelerometer_noise=2e-3)
    sensors = Sensors(settings, seed=5)
    samples = [sensors.imu(0, LEVEL, REST, REST) for _ in range(5000)]
    rates = np.array([s.angular_rate for s in samples])
    forces = np.array([s.specific_force for s in samples])
    assert rates.std(axis=0) == pytest.approx(1e-4 * sqrt(Settings().imu_rate), rel=0.05)
    assert forces.std(axis=0) == pytest.approx(2e-3 * sqrt(Settings().imu_rate), rel=0.05)
    assert abs(np.corrcoef(rates[1:, 0], rates[:-1, 0])[0, 1]) < 0.06
    assert abs(np.corrcoef(rates[:, 0], rates[:, 1])[0, 1]) < 0.06


def test_biases_are_the_seeds_and_do_not_depend_on_what_was_measured() -> None:
    one, other = Sensors(Settings(), seed=1), Sensors(Settings(), seed=1)
    other.imu(0, LEVEL, REST, REST)
    assert one.gyro_bias == other.gyro_bias
    assert one.gyro_bias != Sensors(Settings(), seed=2).gyro_bias
    drawn = [Sensors(Settings(), seed).gyro_bias for seed in range(300)]
    assert np.array(drawn).std() == pytest.approx(0.0105, rel=0.1)


def test_a_dvl_may_be_off_by_a_share_of_the_velocity_that_stays() -> None:
    device, shares = Dvl(std=1e-9, scale_error=0.01), list[float]()
    for seed in range(200):
        sensors = Sensors(Settings(), seed)
        pair = [sensors.dvl(5, (v, 0.0, 0.0, 0.0, 0.0, 0.0), 4.0, device) for v in (1.0, 2.0)]
        once, twice = ((s.velocity or (0.0,))[0] for s in pair)
        assert twice == pytest.approx(2 * once, abs=1e-6)
        shares.append(once - 1.0)
    assert np.std(shares) == pytest.approx(0.01, rel=0.15)
    assert np.mean(shares) == pytest.approx(0.0, abs=0.003)


def test_a_dvl_measures_the_velocity_over_ground_with_its_noise_where_it_sees_the_bottom() -> None:
    sensors, device = Sensors(Settings(), seed=1), Dvl(std=0.02, reach=30.0)
    samples = [sensors.dvl(5, (1.0, -0.5, 0.1, 0.0, 0.0, 0.0), 4.0, device) for _ in range(2000)]
    velocities = np.array([s.velocity for s in samples])
    assert velocities.mean(axis=0) == pytest.approx((1.0, -0.5, 0.1), abs=2e-3)
    assert velocities.std(axis=0) == pytest.approx([0.02] * 3, rel=0.1)
    for altitude in (-0.1, 0.0, 31.0):
        sample = sensors.dvl(7, REST, altitude, device)
        assert (sample.stamp_ns, sample.velocity, sample.altitude) == (7, None, None)


def test_a_usbl_fix_is_the_place_with_its_noise() -> None:
    sensors, device = Sensors(Settings(), seed=1), Usbl(std=0.5)
    fixes = np.array(
        [[(s := sensors.usbl(9, 3.0, -4.0, device)).north, s.east] for _ in range(2000)]
    )
    assert fixes.mean(axis=0) == pytest.approx((3.0, -4.0), abs=0.05)
    assert fixes.std(axis=0) == pytest.approx([0.5] * 2, rel=0.1)


def allan(values: np.ndarray, hz: float, seconds: float) -> float:
    """Overlapping Allan deviation of a rate over this averaging time [s]."""
    n = round(seconds * hz)
    angle = np.concatenate([[0.0], np.cumsum(values)]) / hz
    differences = angle[2 * n :] - 2.0 * angle[n:-n] + angle[: -2 * n]
    return float(np.sqrt(np.mean(differences**2) / 2.0) / seconds)


def six_at_rest(place: Settings, seed: int, samples: int) -> np.ndarray:
    """[rad/s], [m/s²] of an IMU at rest, a column for each axis."""
    sensors = Sensors(place, seed)
    found = [
        sensors.imu(round(n * 1e9 / place.imu_rate), LEVEL, REST, REST) for n in range(samples)
    ]
    return np.array([(*s.angular_rate, *s.specific_force) for s in found])


def mean_allan(rows: np.ndarray, hz: float, seconds: float) -> float:
    """Root mean square over the columns."""
    return float(np.sqrt(np.mean([allan(column, hz, seconds) ** 2 for column in rows.T])))


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["gyro", "accelerometer"])
def test_the_allan_deviation_has_the_slopes_of_noise_and_drift(sensor: str) -> None:
    """N / √τ of noise, 0.617 σ of a drift after 1.89 time constants."""
    hz, columns = 20.0, slice(0, 3) if sensor == "gyro" else slice(3, 6)

    def rows(samples: int, **figures: float) -> np.ndarray:
        place = perfect(imu_rate=hz, **{f"{sensor}_{name}": x for name, x in figures.items()})
        return np.hstack([six_at_rest(place, seed, samples)[:, columns] for seed in (1, 2)])

    noise = rows(8_000, noise=2e-3)
    for seconds in (0.5, 2.0, 8.0):
        assert mean_allan(noise, hz, seconds) == pytest.approx(2e-3 / sqrt(seconds), rel=0.15)
    if sensor == "gyro":
        drift = rows(16_000, drift=1e-3, drift_time=5.0)
        assert mean_allan(drift, hz, 9.45) == pytest.approx(0.617e-3, rel=0.15)


@law
@given(st.floats(1e-4, 1e-2), st.floats(1e-3, 0.1))
def test_an_imu_reads_whole_steps(gyro: float, force: float) -> None:
    sensors = Sensors(Settings(gyro_step=gyro, accelerometer_step=force), seed=1)
    s = sensors.imu(0, LEVEL, REST, REST)
    for values, step in ((s.angular_rate, gyro), (s.specific_force, force)):
        counts = np.array(values) / step
        assert counts == pytest.approx(np.round(counts), abs=1e-6)
    exact = Sensors(Settings(), seed=1).imu(0, LEVEL, REST, REST)
    assert np.abs(np.subtract(s.angular_rate, exact.angular_rate)).max() <= gyro / 2 + 1e-12


def test_what_is_added_to_one_sensor_changes_no_other_number() -> None:
    plain = Sensors(Settings(), seed=3)
    more = Sensors(Settings(accelerometer_noise=3e-3), seed=3)
    a, b = plain.imu(10**9, LEVEL, REST, REST), more.imu(10**9, LEVEL, REST, REST)
    assert a.angular_rate == b.angular_rate
    assert plain.pressure(10**9, 3.0).pressure == more.pressure(10**9, 3.0).pressure


FOUR = [Thruster(str(n), (0, 0, 0), (1, 0, 0), max_thrust=40.0, max_reverse=20.0) for n in range(4)]


def shaken(
    vibration: Vibration,
    thrust: list[float],
    hz: float = 200.0,
    seed: int = 0,
    samples: int = 8_000,
) -> tuple[np.ndarray, np.ndarray]:
    """[m/s²], [rad/s]: rows of samples at a steady thrust, from its second one on."""
    of = Shaking(vibration, FOUR, seed)
    found = [of.step(thrust, 1.0 / hz) for _ in range(samples)][1:]
    return np.array([force for force, _ in found]), np.array([rate for _, rate in found])


@pytest.mark.parametrize(("share", "way"), [(0.25, 40.0), (1.0, -20.0)])
def test_steady_thrust_shakes_in_proportion_to_its_share_of_the_limit(
    share: float, way: float
) -> None:
    force, rate = shaken(Vibration(force=2.0, rate=0.1), [share * way] * 4)
    assert force.std(axis=0) == pytest.approx([2.0 * share] * 3, rel=0.1)
    assert rate.std(axis=0) == pytest.approx([0.1 * share] * 3, rel=0.1)
    for still in shaken(Vibration(force=2.0, rate=0.1), [0.0] * 4, samples=100):
        assert not still.any()
    seeds = [shaken(Vibration(), [10.0] * 4, seed=seed, samples=50)[0] for seed in (1, 1, 2)]
    assert (seeds[0] == seeds[1]).all()
    assert (seeds[0] != seeds[2]).all()


def peaks(samples: np.ndarray, hz: float) -> list[float]:
    """[Hz] where the two strongest tones of all axes lie, at least 12 Hz apart."""
    windows = samples[: len(samples) // 400 * 400].reshape(-1, 400, 3) * np.hanning(400)[:, None]
    power = (np.abs(np.fft.rfft(windows, axis=1)) ** 2).mean(axis=(0, 2))
    power = np.convolve(power, np.ones(5) / 5, "same")
    rates = np.fft.rfftfreq(400, 1.0 / hz)
    first = rates[np.argmax(power)]
    second = rates[np.argmax(np.where(np.abs(rates - first) > 12.0, power, 0.0))]
    return sorted([float(first), float(second)])


def test_its_tones_are_those_of_shaft_and_blades_and_go_with_the_root_of_the_thrust() -> None:
    vibration = Vibration(force=1.0, speed=40.0, blades=3)
    for thrust, tones in ((40.0, [40, 120]), (10.0, [20, 60])):
        found = peaks(shaken(vibration, [thrust] * 4, hz=400.0)[0], 400.0)
        assert found == pytest.approx(tones, abs=5)


def test_a_change_of_thrust_knocks() -> None:
    vibration, found = Vibration(force=1.0, knock=0.1), list[float]()
    for seed in range(150):
        of = Shaking(vibration, FOUR, seed)
        of.step([10.0] * 4, 0.01)
        of.step([10.0] * 4, 0.01)
        found += of.step([14.0] * 4, 0.01)[0]  # by 0.1 of the limit in 10 ms
    assert np.std(found) == pytest.approx(1.0, rel=0.15)


def blocks(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """[m/s²], [rad/s] 1σ of the noisiest axis over blocks of 0.42 s, by second differences, of a
    hull whose thrusters reverse at 40 % of their limits, each with a chance of one half 4.8 times
    a second, at 120 Hz: the manoeuvres of the dives on record."""
    stack = Stack(vehicle="bluerov2_heavy")
    vehicle, place = stack.section("vehicle", Vehicle), stack.section("simulator", Settings)
    place = replace(place, vibration=Vibration(), imu_rate=120.0, floor_depth=1000.0)
    sailing = simulator(place, vehicle, world(place, vehicle, depth=50.0), seed=seed)
    chance, rows = np.random.default_rng(seed), list[tuple[float, ...]]()
    ways = np.ones(len(vehicle.thruster))
    for n in range(25 * 100):
        now = round(n * 1e9 / 120.0)
        if n % 25 == 0:
            ways *= chance.choice([-1.0, 1.0], len(ways))
        if n % 5 == 0:
            thrust = tuple(0.4 * t.max_thrust * w for t, w in zip(vehicle.thruster, ways))  # noqa: B905
            sailing.obey(command(now, *thrust), now)
        sailing.advance(now)
        sample = sailing.imu()
        assert sample is not None
        rows.append((*sample.specific_force, *sample.angular_rate))
    differences = np.diff(np.array(rows), 2, axis=0)
    count = len(differences) // 50
    stds = np.sqrt((differences[: count * 50].reshape(count, 50, 6) ** 2).mean(axis=1) / 6.0)
    return stds[:, :3].max(axis=1), stds[:, 3:].max(axis=1)


@pytest.mark.slow
def test_its_blocks_of_noise_are_those_of_real_dives() -> None:
    """The dives on record: median 1.3 to 1.6 m/s², 99th percentile 2.2 to 3.8; 0.05 to 0.06 and
    0.08 to 0.1 rad/s. Their hull and thrusters are others, so a quarter more or less is allowed."""
    both = [blocks(seed) for seed in (1, 2)]
    force, rate = (np.concatenate(each) for each in zip(*both, strict=True))
    assert 1.0 < np.median(force) < 2.0
    assert 1.7 < np.quantile(force, 0.99) < 4.7
    assert 0.037 < np.median(rate) < 0.075
    assert 0.06 < np.quantile(rate, 0.99) < 0.13


def test_the_gyroscopes_bias_wanders_slowly_and_from_zero() -> None:
    sensors = Sensors(perfect(gyro_drift=1e-4), seed=4)
    rates = np.array([sensors.imu(0, LEVEL, REST, REST).angular_rate for _ in range(30_000)])
    assert abs(rates[0]).max() < 1e-5
    assert 0.2e-4 < rates.std() < 2e-4
    assert abs(np.diff(rates, axis=0)).max() < 5e-6


def test_a_slower_imu_folds_the_blades_tone() -> None:
    """120 Hz sampled at 180 Hz looks like 60."""
    vibration = Vibration(force=1.0, speed=30.0, blades=4)
    found = peaks(shaken(vibration, [40.0] * 4, hz=180.0)[0], 180.0)
    assert found == pytest.approx([30, 60], abs=5)
