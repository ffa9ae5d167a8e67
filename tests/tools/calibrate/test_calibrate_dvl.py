"""How a DVL is mounted is found from surges, sways and turns, as well as it says; what does not
tell is refused."""

from collections.abc import Iterator
from math import cos, degrees, pi, radians, sin
from pathlib import Path

import msgspec
import numpy as np
import pytest

from messages.message import Message
from messages.sensors import DvlSample
from messages.units import Vec3, Vec6
from services.marine.attitude import from_euler
from services.marine.mounting import ALONG, Mount, Mounting, Rotation
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.simulator.sensors import Sensors
from services.simulator.settings import Dvl, Settings
from tools.__main__ import main
from tools.calibrate.dvl import DvlGuide
from tools.calibrate.guide import (
    CalibrationError,
    SensorFound,
    Setting,
    with_settings,
)
from tools.calibrate.noise import Floats
from tools.identify.results import read_vehicle

DT_NS = 10_000_000  # [ns] of the IMU
DEVICE = Dvl(rate=10.0, std=0.005)
# Velocity [m/s] or turn rate [rad/s] in surge, sway, heave, yaw, and from when to when [s].
MANOEUVRE = (
    (0, 0.5, 5.0, 12.0), (0, -0.4, 13.0, 20.0), (1, 0.4, 22.0, 29.0), (3, 0.5, 31.0, 43.0),
    (0, 0.4, 44.0, 52.0), (3, -0.5, 53.0, 65.0), (2, 0.3, 66.0, 71.0), (2, -0.3, 72.0, 77.0),
    (1, -0.4, 78.0, 84.0), (0, 0.5, 85.0, 92.0),
)  # fmt: skip


def rotation(yaw: float, forward: float) -> Floats:
    """Clockwise by `yaw` [deg], then leaning forward [deg]."""
    y, f = radians(yaw), radians(forward)
    turn = np.array([[cos(y), -sin(y), 0.0], [sin(y), cos(y), 0.0], [0.0, 0.0, 1.0]])
    lean = np.array([[cos(f), 0.0, sin(f)], [0.0, 1.0, 0.0], [-sin(f), 0.0, cos(f)]])
    return lean @ turn


def three(R: Floats) -> Rotation:
    a, b, c = R.tolist()
    return tuple(a), tuple(b), tuple(c)


def flown(
    seed: int,
    R: Floats,
    arm: Vec3 = (0.0, 0.0, 0.0),
    scale: float = 1.0,
    late: float = 0.0,
    flies: tuple[tuple[int, float, float, float], ...] = MANOEUVRE,
    current: tuple[float, float] = (0.0, 0.0),
) -> Iterator[Message]:
    """Samples of a vehicle that moves level, each velocity a smooth pulse; the DVL measures `late`
    [s] after its stamps, in a steady current [m/s] north and east."""
    sensors = Sensors(Settings(), seed, Mounting(dvl=Mount(position=arm, rotation=three(R))))
    for n in range(9500):
        t = n * 0.01
        yield sensors.imu(n * DT_NS, *moving(flies, t)[:3])
        if n % 10 == 0:
            _, nu, _, heading = moving(flies, t + late)
            north, east = current
            c, s = cos(heading), sin(heading)
            over: Vec6 = (nu[0] + c * north + s * east, nu[1] - s * north + c * east, *nu[2:])
            sample = sensors.dvl(n * DT_NS, over, 4.0, DEVICE)
            x, y, z = sample.velocity or (0.0, 0.0, 0.0)
            velocity = (scale * x, scale * y, scale * z)
            yield msgspec.structs.replace(sample, velocity=velocity)


def moving(
    flies: tuple[tuple[int, float, float, float], ...], t: float
) -> tuple[tuple[float, float, float, float], Vec6, Vec6, float]:
    """Attitude, velocity, its derivative and heading at `t` [s]."""
    value, slope, heading = [0.0] * 4, [0.0] * 4, 0.0
    for axis, most, begin, end in flies:
        lasts = end - begin
        x = min(max(t - begin, 0.0), lasts)
        value[axis] += most * sin(pi * x / lasts) ** 2
        slope[axis] += most * pi / lasts * sin(2.0 * pi * x / lasts)
        if axis == 3:
            heading += most * (x / 2.0 - lasts / (4.0 * pi) * sin(2.0 * pi * x / lasts))
    u, v, w, r = value
    a, b, c, d = slope
    return from_euler(0, 0, heading), (u, v, w, 0, 0, r), (a, b, c, 0.0, 0.0, d), heading


def found(samples: Iterator[Message], vehicle: Vehicle | None = None) -> SensorFound:
    guide = DvlGuide(vehicle or Stack(vehicle="bluerov2_heavy").section("vehicle", Vehicle))
    for sample in samples:
        guide.see(sample)
    return guide.result()


def of(key: str, result: SensorFound) -> Setting | None:
    return next((setting for setting in result.settings if setting.key == key), None)


def off(result: SensorFound, R: Floats) -> tuple[float, float, float]:
    """[deg] About forward, starboard and down."""
    setting = of("rotation", result)
    assert setting is not None
    E: Floats = np.array(setting.value) @ R.T
    return degrees(E[2, 1]), degrees(E[0, 2]), degrees(E[1, 0])


TURNED, ARM = rotation(-170.0, 3.0), (0.3, -0.1, 0.15)


@pytest.fixture(scope="module")
def mounted() -> SensorFound:
    """Of a DVL that is mounted anyhow, measures 4 % too much, and stamps 0.08 s early."""
    return found(flown(3, TURNED, ARM, scale=1.04, late=0.08, current=(0.2, -0.1)))


def test_how_it_is_mounted_its_scale_and_its_late_stamps_are_found(mounted: SensorFound) -> None:
    about_x, about_y, about_z = off(mounted, TURNED)
    assert max(abs(about_x), abs(about_y)) < 0.6
    assert abs(about_z) < 0.6
    position, scale = of("position", mounted), of("dvl_scale", mounted)
    assert position is not None
    assert position.value[:2] == pytest.approx(ARM[:2], abs=0.02)  # type: ignore[index]
    assert scale is not None
    assert scale.value == pytest.approx(1.0 / 1.04, abs=0.01)
    assert any("ms later than its time stamps say" in remark for remark in mounted.remarks)


@pytest.mark.slow
def test_of_one_that_is_right_no_scale_is_said() -> None:
    R = rotation(90.0, 0.0)
    result = found(flown(3, R))
    assert max(map(abs, off(result, R))) < 0.6
    assert of("dvl_scale", result) is None  # it is 1


@pytest.mark.slow
def test_it_is_known_as_well_as_it_says() -> None:
    """Over seeds, the error of the yaw over its deviation is that of a normal distribution."""
    R, ratios = rotation(10.0, 0.0), list[float]()
    for seed in range(4):
        result = found(flown(seed, R))
        setting = of("rotation", result)
        assert setting is not None
        std = float(setting.about.partition("± ")[2].partition(" ")[0])
        ratios.append(off(result, R)[2] / std)
    assert 0.2 < float(np.sqrt(np.mean(np.square(ratios)))) < 1.7


@pytest.mark.slow
def test_a_bottom_that_swims_for_some_seconds_is_left_out() -> None:
    R = rotation(90.0, 0.0)

    def fish() -> Iterator[Message]:
        for sample in flown(2, R):
            if isinstance(sample, DvlSample) and 20e9 < sample.stamp_ns < 24e9:
                x, y, z = sample.velocity or (0.0, 0.0, 0.0)
                yield msgspec.structs.replace(sample, velocity=(x - 0.4, y, z))
            else:
                yield sample

    result = found(fish())
    assert abs(off(result, R)[2]) < 1.0
    assert any("left out because they do not fit" in remark for remark in result.remarks)


LEVEL = np.array(ALONG)


def without(kind: type[Message]) -> Iterator[Message]:
    return (sample for sample in flown(0, LEVEL) if not isinstance(sample, kind))


def unlocked() -> Iterator[Message]:
    for sample in flown(0, LEVEL):
        dvl = isinstance(sample, DvlSample)
        yield msgspec.structs.replace(sample, velocity=None) if dvl else sample


@pytest.mark.parametrize(
    ("samples", "words"),
    [
        (without(DvlSample), "there is no sample of sensor/dvl"),
        (unlocked(), "none of its 950 samples has a velocity: no lock on the bottom"),
        (
            (s for s in flown(0, LEVEL) if isinstance(s, DvlSample)),
            "beside 0 samples of sensor/imu",
        ),
        pytest.param(
            flown(0, LEVEL, flies=()),
            "fly surge, stop, sway, stop, turn on the spot, dive and rise",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_does_not_tell_is_refused_in_one_sentence(
    samples: Iterator[Message], words: str
) -> None:
    with pytest.raises(CalibrationError) as told:
        found(samples)
    assert words in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.slow
def test_without_a_turn_the_place_is_not_stated() -> None:
    straight = tuple(pulse for pulse in MANOEUVRE if pulse[0] != 3)
    result = found(flown(1, rotation(90.0, 0.0), flies=straight))
    assert of("position", result) is None
    assert any("turn on the spot" in remark for remark in result.remarks)


def test_a_vehicle_file_gets_both_tables(mounted: SensorFound) -> None:
    path = Stack(vehicle="bluerov2_heavy").vehicle_path
    text = path.read_text()
    new = with_settings(path.name, text, mounted.settings, "from a test")
    assert with_settings(path.name, new, mounted.settings, "from a test") == new
    before, after = read_vehicle(path.name, text), read_vehicle(path.name, new)
    assert np.array(after.mounting.dvl.rotation) == pytest.approx(TURNED, abs=0.02)
    assert after.mounting.dvl.position[0] == pytest.approx(0.3, abs=0.02)
    assert after.calibration.dvl_scale == pytest.approx(0.962, abs=0.01)
    assert msgspec.structs.replace(after.mounting, dvl=before.mounting.dvl) == before.mounting


@pytest.mark.slow
def test_of_a_dive_that_flies_the_manoeuvre(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The simulated DVL is turned by 90°, and the vehicle file does not know: no sound sensor is
    refused for that."""
    dive, new = tmp_path / "dive", tmp_path / "mine.toml"
    quarter = "simulator.mounting.dvl.rotation=[[0,-1,0],[1,0,0],[0,0,1]]"
    options = ["--vehicle", "bluerov2_heavy", "--set", "sensors.dvl=a50", "--set", quarter]
    place = ["--set", "simulator.mounting.dvl.position=[0.2,0.1,0.15]"]
    script = ["--pilot", "script:dvl_check", "--out", str(dive)]
    assert main(["simulate", *options, *place, *script]) == 0
    assert "ended cleanly" in capsys.readouterr().out
    assert main(["calibrate", "dvl", str(dive), "--out", str(new)]) == 0
    assert "[vehicle.mounting.dvl]\nrotation = [[" in capsys.readouterr().out
    mount = read_vehicle(new.name, new.read_text()).mounting.dvl
    assert np.array(mount.rotation) == pytest.approx(rotation(90.0, 0.0), abs=0.02)
    assert mount.position[:2] == pytest.approx((0.2, 0.1), abs=0.03)
