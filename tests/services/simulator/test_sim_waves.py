"""Waves: the laws of the water in them, of their spectrum, and of a hull in them."""

from math import exp, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from messages.units import Vec3
from services.marine.attitude import down_in_body, to_world
from services.marine.vehicle import GRAVITY
from services.simulator.settings import Settings
from services.simulator.waves import Sea, Waves, jonswap, lines_of, wave_number
from tests.services.simulator.hulls import NEUTRAL, PIONEER, deep, simulator, vessel, world

REGULAR = Waves(height=0.3, period=4.0, lines=1)
SEA_STATE = Waves(height=0.3, period=4.0)
K = wave_number(2.0 * pi / 4.0)
places = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(0.0, 20.0))
seas = st.builds(
    Waves,
    height=st.floats(0.05, 0.4),
    period=st.floats(2.5, 12.0),
    lines=st.sampled_from([1, 2, 30]),
    peak=st.floats(1.0, 7.0),
    heading=st.floats(-3.0, 3.0),
    spread=st.floats(0.0, 0.6),
)
law = settings(max_examples=50, deadline=None)


@law
@given(seas, st.integers(0, 1000), st.floats(12.1, 200.0), places)
def test_waves_are_water_that_moves_under_its_own_pressure(
    waves: Waves, seed: int, t: float, place: Vec3
) -> None:
    """The momentum equation of small motion: ρ a = -∇p, with the dynamic pressure ρ g rise; the
    acceleration is the derivative of the velocity; and water is not compressed."""
    sea, d = Sea(waves, seed), 1e-4
    here = sea.at(t, place)
    widening = 0.0
    deep = place[2] > d
    for axis in range(2 + deep):
        ahead = sea.at(t, tuple(x + d * (i == axis) for i, x in enumerate(place)))  # type: ignore[arg-type]
        behind = sea.at(t, tuple(x - d * (i == axis) for i, x in enumerate(place)))  # type: ignore[arg-type]
        slope = (ahead.rise - behind.rise) / (2 * d)
        assert here.acceleration[axis] == pytest.approx(-GRAVITY * slope, abs=1e-4)
        widening += (ahead.velocity[axis] - behind.velocity[axis]) / (2 * d)
    assert not deep or abs(widening) < 1e-4
    change = np.subtract(sea.at(t + d, place).velocity, sea.at(t - d, place).velocity) / (2 * d)
    assert change == pytest.approx(here.acceleration, abs=1e-4)


@law
@given(seas, st.integers(0, 1000))
def test_every_line_obeys_the_dispersion_of_deep_water_and_together_they_have_the_height(
    waves: Waves, seed: int
) -> None:
    lines = lines_of(waves, seed)
    assert len(lines) == waves.lines
    for line in lines:
        assert line.omega**2 == pytest.approx(GRAVITY * line.wave_number)
        assert 0.6 <= line.omega * waves.period / (2.0 * pi) <= 3.0
        assert line.north**2 + line.east**2 == pytest.approx(1.0)
    variance = sum(line.amplitude**2 / 2.0 for line in lines)
    # A regular wave's height is from trough to crest, which are two amplitudes.
    quarter = waves.height / (4.0 if waves.lines > 1 else 8.0**0.5)
    assert variance == pytest.approx(quarter**2)


def test_the_spectrum_is_highest_at_its_peak_by_the_enhancement() -> None:
    ratios = np.linspace(0.6, 3.0, 2401)
    density = [jonswap(ratio, 3.3) for ratio in ratios]
    assert ratios[np.argmax(density)] == pytest.approx(1.0, abs=2e-3)
    assert jonswap(1.0, 3.3) == pytest.approx(3.3 * jonswap(1.0, 1.0))
    for ratio in (1.0 - 0.07, 1.0 + 0.09):  # where its exponent is −1/2
        assert jonswap(ratio, 3.3) == pytest.approx(3.3 ** exp(-0.5) * jonswap(ratio, 1.0))
    assert jonswap(2.5, 3.3) == pytest.approx(jonswap(2.5, 1.0))


def test_each_seed_has_a_sea_of_its_own_and_always_the_same() -> None:
    at = (1.0, 2.0, 3.0)
    assert Sea(SEA_STATE, 5).at(30.0, at) == Sea(SEA_STATE, 5).at(30.0, at)
    assert len({Sea(SEA_STATE, seed).at(30.0, at) for seed in range(20)}) == 20
    # Written down: the same on every computer.
    first = lines_of(SEA_STATE, 5)[0]
    assert (first.omega, first.phase) == (1.0051629533321587, 0.8459439654156582)


def test_waves_run_where_they_are_headed_and_spread_about_it() -> None:
    straight = lines_of(replace(SEA_STATE, heading=0.7), 1)
    assert {(line.north, line.east) for line in straight} == {(np.cos(0.7), np.sin(0.7))}
    spread = lines_of(replace(SEA_STATE, heading=0.7, spread=0.4, lines=200), 1)
    headings = np.arctan2([line.east for line in spread], [line.north for line in spread])
    assert np.mean(headings) == pytest.approx(0.7, abs=0.1)
    assert np.std(headings) == pytest.approx(0.4, rel=0.15)


def test_before_they_begin_the_sea_is_calm() -> None:
    late = Sea(replace(SEA_STATE, begins=30.0), 0).at(29.9, (0.0, 0.0, 1.0))
    assert late == (0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def pressures(waves: Waves, seconds: float = 12.0) -> np.ndarray:
    """[Pa] at a hull that lies 3 m deep and is left alone."""
    place = Settings(waves=waves, pressure_std=0.0)
    sailing = simulator(place, NEUTRAL, world(place, NEUTRAL, depth=3.0))
    found = list[float]()
    for n in range(round(seconds * 42)):
        sailing.advance(round(n * 1e9 / 42))
        sample = sailing.pressure()
        assert sample is not None
        found.append(sample.pressure)
    return np.array(found)


def test_a_hull_that_is_carried_hardly_feels_the_waves_pressure() -> None:
    """The water's own parcels keep their pressure, to the first order."""
    held = 1025 * GRAVITY * 0.15 * exp(-K * 3.0)  # [Pa]
    assert np.ptp(pressures(REGULAR)[200:]) < 0.25 * held


def test_a_carried_hull_goes_round_as_the_water_does_and_its_imu_feels_it() -> None:
    hull = vessel(deep(waves=REGULAR), at=(0.0, 0.0, 3.0))
    radius = 0.15 * exp(-K * 3.0)
    depths, forces = list[float](), list[float]()
    for _ in range(3000):
        hull.advance(0.005)
        depths.append(hull.position[2])
        forces.append(hull.acceleration[2])
    # The drag of the hull's start from rest moves it less in the end than it seems.
    assert np.ptp(depths[1400:]) / 2 == pytest.approx(radius, rel=0.15)
    assert np.max(forces[1400:]) == pytest.approx(radius * (pi / 2) ** 2, rel=0.25)
    numbers = np.diff(depths[1400:], 2) / 0.005**2
    assert np.corrcoef(numbers, forces[1401:-1])[0, 1] > 0.99


@pytest.mark.parametrize("thrust", [0.0, 35.0])
def test_the_imu_feels_how_the_hull_really_moves_also_through_the_waves(thrust: float) -> None:
    """The acceleration over the ground, turned to the world, is that of the velocity: also of a
    hull that drives through the waves and meets them more often."""
    place = deep(waves=replace(SEA_STATE, heading=2.5))
    hull = vessel(place, at=(0.0, 0.0, 2.0), seed=3)
    hull.propulsion.drive([thrust, thrust, 0.0, 0.0])
    velocities, forces = list[Vec3](), list[Vec3]()
    for _ in range(2400):
        hull.advance(0.005)
        q_NB, (u, v, w, p, q, r) = hull.attitude, hull.through_water
        a, b, c, *_ = hull.acceleration
        velocities.append(to_world(q_NB, hull.velocity[:3]))  # type: ignore[arg-type]
        forces.append(to_world(q_NB, (a + q * w - r * v, b + r * u - p * w, c + p * v - q * u)))
    wanted = np.gradient(np.array(velocities), 0.005, axis=0)[801:-1]
    assert np.std(wanted) > 0.05
    assert np.array(forces)[801:-1] == pytest.approx(wanted, abs=0.005)


def test_a_hull_lighter_than_its_water_is_carried_further_and_one_heavier_less() -> None:
    def swing(net_buoyancy: float) -> float:
        place = deep(waves=replace(REGULAR, period=8.0))
        drag = (0.0, 0.0, 1000.0, 10.0, 10.0, 10.0)  # upright, and it hardly rises
        vehicle = replace(NEUTRAL, linear_damping=drag, quadratic_damping=(0.0,) * 6)
        vehicle = replace(vehicle, net_buoyancy=net_buoyancy)
        hull = vessel(place, vehicle, at=(0.0, 0.0, 20.0))
        speeds = list[float]()
        for _ in range(3200):
            hull.advance(0.005)
            speeds.append(hull.velocity[0])
        return float(np.ptp(speeds[1600:]))

    # v / v_water = (ρV + A) / (m + A), Morison's without drag.
    share = (PIONEER.mass + 10.0 / GRAVITY + 5.22) / (PIONEER.mass + 5.22)
    assert swing(10.0) / swing(0.0) == pytest.approx(share, rel=0.03)
    assert swing(-10.0) < swing(0.0)


def test_a_hull_in_long_waves_leans_towards_their_surface() -> None:
    """Its centre of buoyancy follows the pressure, so that down is where g less the water's
    acceleration points."""
    waves = Waves(height=1.0, period=16.0, lines=1)
    hull = vessel(deep(waves=waves), at=(0.0, 0.0, 2.0))
    leans, slopes = list[float](), list[float]()
    for _ in range(200 * 64):
        hull.advance(0.005)
        assert hull.sea is not None
        leans.append(down_in_body(hull.attitude)[0])
        slopes.append(hull.sea.at(hull.elapsed, hull.position).acceleration[0] / GRAVITY)
    assert np.ptp(leans[6400:]) == pytest.approx(np.ptp(slopes[6400:]), rel=0.3)
    assert np.corrcoef(leans[6400:], slopes[6400:])[0, 1] > 0.8


def test_a_floating_hull_rides_on_the_waves() -> None:
    place = deep(waves=replace(REGULAR, period=8.0))
    hull = vessel(place, PIONEER, at=(0.0, 0.0, PIONEER.floating_depth))
    depths, drafts = list[float](), list[float]()
    for _ in range(200 * 40):
        hull.advance(0.005)
        assert hull.sea is not None
        depths.append(hull.position[2])
        drafts.append(hull.position[2] + hull.sea.at(hull.elapsed, hull.position).rise)
    assert np.ptp(depths[3200:]) == pytest.approx(0.3, rel=0.1)
    assert np.ptp(drafts[3200:]) < 0.03


def test_the_surface_of_a_sea_has_a_quarter_of_its_height_as_deviation_and_its_period() -> None:
    stds, peaks = list[float](), list[float]()
    for seed in range(5):
        sea = Sea(SEA_STATE, seed)
        rises = np.array([sea.at(10.0 + 0.25 * n, (3.0, 4.0, 0.0)).rise for n in range(2048)])
        stds.append(float(rises.std()))
        power = np.abs(np.fft.rfft(rises * np.hanning(2048))) ** 2
        smooth = np.convolve(power, np.ones(9) / 9, "same")
        peaks.append(float(np.fft.rfftfreq(2048, 0.25)[np.argmax(smooth)]))
    assert np.mean(stds) == pytest.approx(0.3 / 4.0, rel=0.03)
    assert np.median(peaks) == pytest.approx(0.25, rel=0.07)


def test_waves_fade_with_depth_the_short_ones_first_and_before_they_begin_the_sea_is_calm() -> None:
    regular = Sea(REGULAR, 0)
    for depth in (0.0, 2.0, 10.0):
        rises = [regular.at(8.0 + 0.01 * n, (0.0, 0.0, depth)).rise for n in range(400)]
        assert max(rises) == pytest.approx(0.15 * exp(-K * depth), rel=1e-3)
    sea, lines = Sea(SEA_STATE, 2), lines_of(SEA_STATE, 2)
    for depth in (1.0, 4.0):
        rises = [sea.at(10.0 + 0.5 * n, (0.0, 0.0, depth)).rise for n in range(2000)]
        left = sum(0.5 * (x.amplitude * exp(-x.wave_number * depth)) ** 2 for x in lines)
        assert np.var(rises) == pytest.approx(left, rel=0.05)
    late = Sea(replace(SEA_STATE, begins=30.0), 0).at(29.9, (0.0, 0.0, 1.0))
    assert late == (0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
