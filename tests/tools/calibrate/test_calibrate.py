"""What a calibration finds is what is wrong with the simulated sensors, to within the deviations it
states; what does not tell enough is refused."""

import tomllib
from collections.abc import Iterator, Sequence
from itertools import chain
from math import atan2, degrees, pi, radians, remainder, sin
from pathlib import Path

import msgspec
import numpy as np
import pytest

from messages import topics
from messages.message import Message
from messages.sensors import ImuSample, PressureSample
from messages.units import Quaternion, Vec6
from services.marine.attitude import from_euler
from services.marine.mounting import ImuMount, Mounting, SensorCalibration, Turned
from services.marine.vehicle import ATMOSPHERE, SEA_WATER
from services.recorder.foxglove.channel import foxglove_schema
from services.recorder.io.mcap_file import McapFile
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.simulator.sensors import Sensors
from services.simulator.settings import SensorErrors, Settings
from services.vehicle.mounting import AtOrigin, MountedAxes
from tools.__main__ import main
from tools.calibrate.compass import CompassGuide
from tools.calibrate.guide import (
    CalibrationError,
    CalibrationGuide,
    SensorFound,
    listen,
    with_settings,
)
from tools.calibrate.imu import AccelerometerGuide, GyroscopeGuide
from tools.calibrate.pressure import PressureGuide
from tools.identify.results import read_vehicle

REST: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
STEP_NS = 10_000_000  # [ns] of the IMU
# No biases but those that are asked for: they are the truth to be found.
PLAIN = Settings(gyro_bias=0.0, gyro_drift=0.0, accelerometer_bias=0.0, hard_iron=0.0)
BIAS, SCALE = (0.3, -0.2, 0.15), (1.02, 0.99, 1.01)
SIDES = [(0.0, 0.0), (180.0, 0.0), (90.0, 0.0), (-90.0, 0.0), (0.0, 90.0), (0.0, -90.0)]


def sensors(seed: int, errors: SensorErrors, mounting: Mounting | None = None) -> Sensors:
    settings = msgspec.structs.replace(PLAIN, sensor_errors=errors)
    return Sensors(settings, seed, mounting or Mounting())


def lying(of: Sensors, q_NB: Quaternion, begin_s: float, seconds: float) -> Iterator[ImuSample]:
    for n in range(round(seconds * 100)):
        yield of.imu(round(begin_s * 1e9) + n * STEP_NS, q_NB, REST, REST)


def on_sides(of: Sensors, sides: Sequence[tuple[float, float]]) -> Iterator[ImuSample]:
    """7 s on each, by somebody who does not look closely."""
    for n, (roll, pitch) in enumerate(sides):
        q_NB = from_euler(radians(roll + 8.0), radians(pitch * 0.94 - 3.0), 0.4 * n)
        yield from lying(of, q_NB, 10.0 * n, 7.0)


def turning(of: Sensors, by: float, seconds: float = 40.0) -> Iterator[Message]:
    rate = radians(by) / seconds
    for n in range(round(seconds * 100)):
        heading = rate * n * 0.01
        sway = 0.03 * sin(0.9 * n * 0.01)  # [rad] nobody holds it quite level
        q_NB = from_euler(sway, 0.5 * sway, heading)
        turn: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, rate)
        yield of.magnetometer(n * STEP_NS, q_NB)
        yield of.imu(n * STEP_NS, q_NB, turn, REST)


def found(guide: CalibrationGuide, samples: Iterator[Message] | Iterator[ImuSample]) -> SensorFound:
    for sample in samples:
        guide.see(sample)
    return guide.result()


def values(setting: object) -> list[float]:
    return np.array(setting, dtype=float).ravel().tolist()


def test_the_gyroscopes_bias_is_found_as_well_as_it_says() -> None:
    offset, ratios = (0.01, -0.02, 0.005), list[float]()
    for seed in range(8):
        of, guide = sensors(seed, SensorErrors(gyro_offset=offset)), GyroscopeGuide()
        (setting,), (remark,) = found(guide, lying(of, from_euler(0.1, 0.0, 0.0), 0.0, 31.0))
        assert guide.done
        assert "0.00012 rad/s/√Hz" in remark or "0.00013 rad/s/√Hz" in remark
        errors = zip(values(setting.value), offset, setting.std, strict=True)
        ratios += [(value - true) / std for value, true, std in errors]
    assert max(map(abs, ratios)) < 4.0
    assert 0.6 < np.std(ratios) < 1.4


def test_the_accelerometers_bias_and_scale_are_found_from_six_sloppy_sides() -> None:
    errors = SensorErrors(accelerometer_offset=BIAS, accelerometer_scale=SCALE)
    truth = [*BIAS, *(1.0 / s for s in SCALE)]  # f' = s f + b
    ratios = list[float]()
    for seed in range(8):
        guide = AccelerometerGuide()
        bias, scale = found(guide, on_sides(sensors(seed, errors), SIDES)).settings
        assert guide.done
        both = [*values(bias.value), *values(scale.value)]
        assert both == pytest.approx(truth, abs=0.005)
        stds = [*bias.std, *scale.std]
        ratios += [(b - t) / s for b, t, s in zip(both, truth, stds, strict=True)]
    assert max(map(abs, ratios)) < 4.0
    assert 0.5 < np.std(ratios) < 1.5


IRON = SensorErrors(
    hard_iron=(4e-6, -3e-6, 2e-6), soft_iron=((1.05, 0.03, 0.0), (0.03, 0.96, 0.0), (0.0, 0.0, 1.0))
)
QUARTER = ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))  # R_BS


@pytest.mark.parametrize("mounting", [Mounting(), Mounting(magnetometer=Turned(rotation=QUARTER))])
def test_the_iron_around_the_compass_is_found_and_gone(mounting: Mounting) -> None:
    of, guide = sensors(3, IRON, mounting), CompassGuide(mounting)
    settings = found(guide, turning(of, 400.0)).settings
    assert guide.done
    given = {setting.key: setting.value for setting in settings}
    corrected = msgspec.convert(given, SensorCalibration, strict=False)
    bias, true = np.array(corrected.magnetometer_bias), np.array(IRON.hard_iron)
    # Its vertical part is not seen; what is level is known as well as it says.
    assert np.all(np.abs(bias - true)[:2] < 4.0 * np.array(settings[0].std)[:2] + 1e-7)
    axes, still = MountedAxes(mounting.magnetometer), sensors(3, IRON, mounting)
    before = [heading_error(axes, still, h, SensorCalibration()) for h in HEADINGS]
    after = [heading_error(axes, still, h, corrected) for h in HEADINGS]
    assert max(map(abs, before)) > 10.0
    assert max(map(abs, after)) < 1.5


HEADINGS = np.linspace(-3.1, 3.1, 21).tolist()  # [rad]


def heading_error(
    axes: MountedAxes, of: Sensors, heading: float, calibration: SensorCalibration
) -> float:
    """[deg] Of a compass that is read for a quarter of a second."""
    q_NB = from_euler(0.0, 0.0, heading)
    fields = [axes.to_body(calibration.field(of.magnetometer(0, q_NB).field)) for _ in range(25)]
    x, y, _ = np.mean(fields, axis=0).tolist()
    return degrees(remainder(-atan2(y, x) - heading, 2.0 * pi))


def in_air(of: Sensors, seconds: float, sinking: float = 0.0) -> Iterator[PressureSample]:
    for n in range(round(seconds * 42)):
        yield of.pressure(round(n * 1e9 / 42), sinking * n / 42)


def test_the_pressures_offset_is_found_as_well_as_it_says() -> None:
    ratios = list[float]()
    for seed in range(12):
        of, guide = sensors(seed, SensorErrors(pressure_offset=850.0)), PressureGuide(ATMOSPHERE)
        (setting,), _ = found(guide, in_air(of, 21.0))
        assert guide.done
        (offset,), (std,) = values(setting.value), setting.std
        ratios.append((offset - 850.0) / std)
    assert max(map(abs, ratios)) < 4.0
    assert 0.6 < np.std(ratios) < 1.4


def shaken(of: Sensors) -> Iterator[ImuSample]:
    for n in range(3000):
        turn: Vec6 = (0.0, 0.0, 0.0, 0.3 * sin(0.05 * n), 0.0, 0.0)
        yield of.imu(n * STEP_NS, from_euler(0.0, 0.0, 0.0), turn, REST)


GOOD = SensorErrors()
WILD = SensorErrors(accelerometer_offset=(4.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("guide", "samples", "words"),
    [
        (GyroscopeGuide(), shaken(sensors(0, GOOD)), "longest rest is"),
        (GyroscopeGuide(), iter(()), "longest rest is 0.0 s, needed are 10"),
        (AccelerometerGuide(), on_sides(sensors(0, GOOD), SIDES[:5]), "nose up"),
        (AccelerometerGuide(), shaken(sensors(0, GOOD)), "all six sides are needed"),
        (AccelerometerGuide(), on_sides(sensors(0, WILD), SIDES), "not those of a working"),
        (CompassGuide(Mounting()), turning(sensors(0, GOOD), 200.0), "needed are all and 324 deg"),
        (CompassGuide(Mounting()), turning(sensors(0, GOOD), 0.0), "0 of 24 directions"),
        (PressureGuide(ATMOSPHERE), in_air(sensors(0, GOOD), 3.0), "needed are 50 in 10 s"),
        (PressureGuide(ATMOSPHERE), in_air(sensors(0, GOOD), 20.0, 0.02), "wanders by"),
        (PressureGuide(60_000.0), in_air(sensors(0, GOOD), 20.0), "barometer in hPa"),
    ],
)
def test_what_does_not_tell_is_refused_in_one_sentence(
    guide: CalibrationGuide, samples: Iterator[Message], words: str
) -> None:
    with pytest.raises(CalibrationError) as told:
        found(guide, samples)
    assert words in str(told.value)
    assert "\n" not in str(told.value)
    assert guide.prompt


def test_a_field_that_changes_meanwhile_is_refused() -> None:
    before = list(turning(sensors(0, GOOD), 220.0, 15.0))
    wrong = sensors(0, SensorErrors(hard_iron=(9e-6, 0.0, 0.0)))
    after = list(turning(wrong, 400.0, 25.0))
    later = [
        msgspec.structs.replace(s, stamp_ns=s.stamp_ns + 41_000_000_000)  # type: ignore[type-var]
        for s in after
    ]
    with pytest.raises(CalibrationError, match="off its ellipse"):
        found(CompassGuide(Mounting()), chain(before, later))


@pytest.mark.parametrize("name", ["pioneer", "minerva", "bluerov2_heavy"])
def test_a_vehicle_file_gets_the_table_and_keeps_all_else(name: str) -> None:
    path = Stack(vehicle=name).vehicle_path
    text = path.read_text()
    guide = PressureGuide(ATMOSPHERE)
    offset = found(guide, in_air(sensors(1, SensorErrors(pressure_offset=500.0)), 21.0)).settings
    gyro = found(GyroscopeGuide(), lying(sensors(1, GOOD), from_euler(0, 0, 0), 0.0, 31.0)).settings
    new = with_settings(path.name, text, offset, "from a test")
    newer = with_settings(path.name, with_settings(path.name, new, gyro, "x"), offset, "again")
    before, after = read_vehicle(path.name, text), read_vehicle(path.name, newer)
    assert after.calibration.pressure_offset == pytest.approx(500.0, abs=60.0)
    assert after.calibration.gyro_bias != (0.0, 0.0, 0.0)
    assert msgspec.structs.replace(after, calibration=before.calibration) == before
    assert tomllib.loads(newer).keys() == tomllib.loads(text).keys()
    assert newer.count("pressure_offset =") == 1


def test_a_file_of_another_form_is_refused() -> None:
    settings = found(PressureGuide(ATMOSPHERE), in_air(sensors(1, GOOD), 21.0)).settings
    text = Stack().vehicle_path.read_text().replace("[vehicle]", "[vehicle]\ncalibration = {}", 1)
    with pytest.raises(LindyError, match="by hand"):
        with_settings("mine.toml", text, settings, "from a test")


def test_on_the_bus_it_says_what_to_do_until_it_has_enough(tmp_path: Path) -> None:
    """The whole simulator, with its drawn biases, seen by the node of `lindy calibrate`."""
    host, said, guide = VirtualHost(), list[str](), GyroscopeGuide()
    stack = Stack(
        out=str(tmp_path), seed=4, overrides=["simulator.sensor_errors.gyro_offset=[0.02,0,0]"]
    )
    host.add("simulator", Registry.read()["simulator"], stack)
    heard = listen(host.node("calibrate", ["drone"]), guide, said.append)
    host.run(40_000_000_000, done=lambda: guide.done)
    assert guide.done
    assert heard() > 3000
    assert len(said) > 10
    (setting,), _ = guide.result()
    drawn = Sensors(stack.section("simulator", Settings), 4).gyro_bias
    assert values(setting.value)[0] == pytest.approx(drawn[0] + 0.02, abs=3e-4)


def test_a_recording_becomes_a_new_vehicle_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = McapFile(tmp_path / "dive.mcap")
    file.attach("pioneer.toml", "application/toml", Stack().vehicle_path.read_bytes())
    file.open_channel(topics.IMU.key, "ImuSample", foxglove_schema(ImuSample))
    of = sensors(2, SensorErrors(gyro_offset=(0.03, 0.0, 0.0)))
    for n, sample in enumerate(lying(of, from_euler(0.0, 0.0, 0.0), 0.0, 20.0)):
        file.write(topics.IMU.key, msgspec.json.encode(sample), n, n, n)
    file.finish()
    new = tmp_path / "mine.toml"
    assert main(["calibrate", "gyroscope", str(tmp_path), "--out", str(new)]) == 0
    assert "[vehicle.calibration]\ngyro_bias = [0.0" in capsys.readouterr().out
    bias = read_vehicle(new.name, new.read_text()).calibration.gyro_bias
    assert bias == pytest.approx((0.03, 0.0, 0.0), abs=2e-4)
    assert main(["calibrate", "gyroscope", str(tmp_path), "--out", str(new)]) == 1
    assert "it exists already" in capsys.readouterr().err
    assert main(["calibrate", "accelerometer", str(tmp_path)]) == 1
    assert "all six sides are needed" in capsys.readouterr().err
    assert main(["calibrate", "pressure", str(tmp_path), "--atmosphere", "1.0"]) == 1
    assert "expected 500 to 1200 hPa" in capsys.readouterr().err


def test_estimation_corrects_by_the_table() -> None:
    """What is in [vehicle.calibration] takes away what is in [simulator.sensor_errors]."""
    calibration = SensorCalibration(
        accelerometer_bias=BIAS,
        accelerometer_scale=(1 / SCALE[0], 1 / SCALE[1], 1 / SCALE[2]),
        gyro_bias=(0.01, 0.0, -0.02),
        magnetometer_bias=(4e-6, -3e-6, 2e-6),
        pressure_offset=700.0,
    )
    wrong = SensorErrors(
        accelerometer_offset=BIAS,
        accelerometer_scale=SCALE,
        gyro_offset=(0.01, 0.0, -0.02),
        hard_iron=(4e-6, -3e-6, 2e-6),
        pressure_offset=700.0,
    )
    mounting = Mounting(imu=ImuMount(rotation=QUARTER))
    q_NB, nu = from_euler(0.3, -0.2, 1.0), (0.1, 0.2, 0.3, 0.1, -0.2, 0.3)
    good, bad = sensors(5, SensorErrors(), mounting), sensors(5, wrong, mounting)
    corrected = AtOrigin(Mounting(), SEA_WATER, calibration)
    right, raw = good.imu(7, q_NB, nu, REST), corrected.imu(bad.imu(7, q_NB, nu, REST))
    assert raw.angular_rate == pytest.approx(right.angular_rate)
    assert raw.specific_force == pytest.approx(right.specific_force, abs=3e-3)  # noise is scaled
    field = corrected.magnetometer(bad.magnetometer(7, q_NB)).field
    assert field == pytest.approx(good.magnetometer(7, q_NB).field, abs=1e-12)
    depth = corrected.pressure(bad.pressure(7, 3.0)).pressure
    assert depth == pytest.approx(good.pressure(7, 3.0).pressure)
