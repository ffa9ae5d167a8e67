"""Vibration: what running thrusters do to an IMU, beside what real ones did."""

import numpy as np
import pytest
from msgspec.structs import replace

from messages.control import ThrusterCommand
from messages.events import Outbox
from services.marine.vehicle import Thruster, Vehicle
from services.runtime.config.stack import Stack
from services.simulator.core import Simulator, at_the_surface
from services.simulator.settings import Settings
from services.simulator.vibration import Shaking, Vibration

ONE = [Thruster(name="one", position=(0, 0, 0), direction=(1, 0, 0), max_thrust=40.0)]
FOUR = [replace(ONE[0], name=str(n), max_reverse=20.0) for n in range(4)]


def shaken(
    vibration: Vibration,
    thrust: list[float],
    hz: float = 200.0,
    seed: int = 0,
    bandwidth: float | None = None,
    samples: int = 12_000,
) -> tuple[np.ndarray, np.ndarray]:
    """[m/s²], [rad/s]: rows of samples at a steady thrust, from its second one on."""
    thrusters = FOUR if len(thrust) == 4 else ONE
    of = Shaking(vibration, thrusters, seed, bandwidth)
    found = [of.step(thrust, 1.0 / hz) for _ in range(samples)][1:]
    return np.array([force for force, _ in found]), np.array([rate for _, rate in found])


def test_thrusters_that_stand_still_shake_nothing() -> None:
    force, rate = shaken(Vibration(force=5.0, rate=1.0), [0.0] * 4, samples=100)
    assert not force.any()
    assert not rate.any()


@pytest.mark.parametrize("share", [0.25, 1.0])
@pytest.mark.parametrize("way", [40.0, -20.0])
def test_steady_thrust_shakes_in_proportion_to_its_share_of_the_limit(
    share: float, way: float
) -> None:
    force, rate = shaken(Vibration(force=2.0, rate=0.1), [share * way] * 4)
    assert force.std(axis=0) == pytest.approx([2.0 * share] * 3, rel=0.1)
    assert rate.std(axis=0) == pytest.approx([0.1 * share] * 3, rel=0.1)


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


@pytest.mark.parametrize(
    ("speed", "blades", "hz", "tones"),
    [(30.0, 4, 180.0, [30, 60]), (40.0, 2, 100.0, [20, 40])],
)
def test_a_slower_imu_folds_the_blades_tone(
    speed: float, blades: int, hz: float, tones: list[float]
) -> None:
    """120 Hz sampled at 180 Hz looks like 60; 80 sampled at 100 like 20."""
    vibration = Vibration(force=1.0, speed=speed, blades=blades)
    assert peaks(shaken(vibration, [40.0] * 4, hz=hz)[0], hz) == pytest.approx(tones, abs=5)


@pytest.mark.parametrize("bandwidth", [10.0, 20.0])
def test_the_imus_filter_takes_the_tones_beyond_its_bandwidth(bandwidth: float) -> None:
    """Of three parts of power the flow's is left, and those of the tones by their rates."""
    vibration = Vibration(force=1.0, speed=20.0, blades=5)
    wide = shaken(vibration, [40.0] * 4)[0]
    narrow = shaken(vibration, [40.0] * 4, bandwidth=bandwidth)[0]
    gone = 1.0 - np.mean(narrow**2) / np.mean(wide**2)
    squares = np.square(Shaking(vibration, FOUR, 0)._ways)  # pyright: ignore[reportPrivateUsage]
    shaft, blades, flow = squares[:, :3].reshape(4, 3, 3).sum(axis=(0, 2)) / 3.0
    assert flow + shaft + blades == pytest.approx(1.0)
    left = shaft / (1.0 + (20.0 / bandwidth) ** 4) + blades / (1.0 + (100.0 / bandwidth) ** 4)
    assert gone == pytest.approx(shaft + blades - left, abs=0.015)


def test_the_same_seed_shakes_the_same() -> None:
    vibration = Vibration()
    same = [shaken(vibration, [10.0] * 4, seed=seed, samples=50)[0] for seed in (1, 1, 2)]
    assert (same[0] == same[1]).all()
    assert (same[0] != same[2]).all()


def test_a_change_of_thrust_knocks() -> None:
    vibration, found = Vibration(force=1.0, knock=0.1), list[float]()
    for seed in range(150):
        of = Shaking(vibration, FOUR, seed)
        of.step([10.0] * 4, 0.01)
        of.step([10.0] * 4, 0.01)
        found += of.step([14.0] * 4, 0.01)[0]  # by 0.1 of the limit in 10 ms
    assert np.std(found) == pytest.approx(1.0, rel=0.15)


def blocks(
    seed: int, vibration: Vibration | None, bandwidth: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """[m/s²], [rad/s] 1σ of the noisiest axis over blocks of 0.42 s, by second differences, of a
    hull whose thrusters reverse at 40 % of their limits, each with a chance of one half 4.8 times
    a second, at 120 Hz: the manoeuvres of the dives on record."""
    stack = Stack(vehicle="bluerov2_heavy")
    vehicle, place = stack.section("vehicle", Vehicle), stack.section("simulator", Settings)
    place = replace(place, vibration=vibration, imu_rate=120.0, imu_bandwidth=bandwidth)
    place = replace(place, floor_depth=1000.0)
    world = at_the_surface(vehicle, place)
    world = replace(world, state=(0.0, 0.0, 50.0, *world.state[3:]))
    simulator = Simulator(vehicle, place, seed, world, Outbox())
    chance, rows = np.random.default_rng(seed), list[tuple[float, ...]]()
    ways = np.ones(len(vehicle.thruster))
    for n in range(25 * 100):
        now = round(n * 1e9 / 120.0)
        if n % 25 == 0:
            ways *= chance.choice([-1.0, 1.0], len(ways))
        if n % 5 == 0:
            thrust = tuple(0.4 * t.max_thrust * w for t, w in zip(vehicle.thruster, ways))  # noqa: B905
            simulator.obey(
                ThrusterCommand(
                    stamp_ns=now, sensor_ns=None, pilot_ns=None, thrust=thrust, armed=True
                ), now,
            )  # fmt: skip
        simulator.advance(now)
        sample = simulator.imu()
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
    both = [blocks(seed, Vibration()) for seed in (1, 2)]
    force, rate = (np.concatenate(each) for each in zip(*both, strict=True))
    assert 1.0 < np.median(force) < 2.0
    assert 1.7 < np.quantile(force, 0.99) < 4.7
    assert 0.037 < np.median(rate) < 0.075
    assert 0.06 < np.quantile(rate, 0.99) < 0.13


def test_an_imu_with_a_filter_has_less_of_it() -> None:
    steady = Vibration(knock=0.0)
    wide, narrow = blocks(1, steady)[0], blocks(1, steady, bandwidth=2.0)[0]
    assert 0.4 < np.median(narrow) / np.median(wide) < 0.75  # the flow's third of the power


def test_without_vibration_the_motion_alone_is_far_from_it() -> None:
    assert np.median(blocks(1, None)[0]) < 0.1
