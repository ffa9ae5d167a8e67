"""`lindy calibrate noise` finds the noise that was put in, and says when it cannot."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.message import Message
from messages.sensors import ImuSample, MagnetometerSample, PressureSample
from messages.topic import AnyTopic
from messages.vehicle import VehicleStatus
from services.estimation.settings import Settings
from services.recorder.foxglove.channel import foxglove_schema
from services.recorder.io.mcap_file import McapFile
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.simulator.core import Settings as Simulator
from tools.calibrate.noise import (
    HeardAtRest,
    NoiseAxis,
    RestingSamples,
    deviation,
    lines,
    measured,
    noise,
    read,
    resting,
)
from tools.recordings.recording import open_recording
from tools.up import on_side

STREAMS: tuple[AnyTopic, ...] = (
    topics.IMU, topics.MAGNETOMETER, topics.PRESSURE, topics.STATUS,
)  # fmt: skip
GYRO, FORCE, FIELD, PASCAL = 1.2e-3, 0.03, 0.4e-6, 480.0  # one sample's std
decode: Callable[..., Any] = msgspec.toml.decode


def felt(
    seconds: float, *, rate: np.ndarray | None = None, force: np.ndarray | None = None
) -> np.ndarray:
    """Turn rates and forces at rest on the bench, n × 6; with what is added along z."""
    rng, n = np.random.default_rng(1), round(seconds * 100)
    turns, forces = GYRO * rng.standard_normal((n, 3)), FORCE * rng.standard_normal((n, 3))
    turns += np.array([0.01, -0.004, 0.002])
    forces[:, 2] -= 9.8
    turns[:, 2] += 0.0 if rate is None else rate
    forces[:, 2] += 0.0 if force is None else force
    return np.hstack([turns, forces])


def imu(
    seconds: float, *, rate: np.ndarray | None = None, force: np.ndarray | None = None
) -> list[Message]:
    return [
        ImuSample(stamp_ns=k * 10_000_000, angular_rate=(p, q, r), specific_force=(x, y, z))
        for k, (p, q, r, x, y, z) in enumerate(felt(seconds, rate=rate, force=force).tolist())
    ]


def pressures(seconds: float, *, step: float = 0.0, writer: float = 0.0) -> list[Message]:
    rng, n = np.random.default_rng(2), round(seconds * 42)
    said = 101_325.0 + PASCAL * rng.standard_normal(n) + writer * np.arange(n) / 42
    said = np.round(said / step) * step if step else said
    return [
        PressureSample(stamp_ns=round(k * 1e9 / 42), pressure=each)
        for k, each in enumerate(said.tolist())
    ]


def fields(seconds: float) -> list[Message]:
    rng, n = np.random.default_rng(3), round(seconds * 100)
    said = np.array([15e-6, 0.0, 48e-6]) + FIELD * rng.standard_normal((n, 3))
    return [
        MagnetometerSample(stamp_ns=k * 10_000_000, field=(x, y, z))
        for k, (x, y, z) in enumerate(said.tolist())
    ]


def write(folder: Path, *streams: Iterable[Message]) -> Path:
    keys = {topic.message.__name__: topic.key for topic in STREAMS}
    file = McapFile(folder / "dive.mcap")
    for topic in STREAMS:
        file.open_channel(topic.key, topic.message.__name__, foxglove_schema(topic.message))
    for stream in streams:
        for n, sample in enumerate(stream):
            file.write(keys[type(sample).__name__], msgspec.json.encode(sample), n, n, n)
    file.finish()
    return folder


class Told(NamedTuple):
    begin: float  # [s] of the rest
    seconds: float
    axes: dict[str, NoiseAxis]
    settings: dict[str, float | None]


def told(folder: Path) -> Told:
    rest = resting(read(open_recording(folder)), folder)
    axes = list(measured(rest.samples))
    settings = {line.key: line.value for line in lines(axes)}
    return Told(rest.begin, rest.seconds, {axis.name: axis for axis in axes}, settings)


def test_noise_that_was_put_in_is_found(tmp_path: Path):
    found = told(write(tmp_path, imu(40), fields(40), pressures(40)))
    assert len(found.axes) == 10
    for name, std, hz in (
        ("gyroscope x", GYRO, 100), ("gyroscope z", GYRO, 100), ("accelerometer y", FORCE, 100),
        ("magnetometer z", 1e6 * FIELD, 100), ("pressure", PASCAL, 42),
    ):  # fmt: skip
        axis = found.axes[name]
        assert axis.rate == pytest.approx(hz, rel=1e-3)
        assert axis.std == pytest.approx(std, rel=0.06)
        assert axis.noise.density == pytest.approx(std / hz**0.5, rel=0.1)
        assert axis.noise.drift == pytest.approx(std / (hz * axis.noise.over) ** 0.5, rel=0.6)
    assert found.axes["gyroscope x"].mean == pytest.approx(0.01, abs=1e-4)
    assert found.settings["pressure_std"] == pytest.approx(480, rel=0.06)
    assert found.settings["acceleration_noise"] == pytest.approx(0.003, rel=0.1)


def test_what_is_printed_can_be_pasted_into_a_vehicle_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    noise(write(tmp_path, imu(40), pressures(40)))
    pasted = capsys.readouterr().out
    settings = msgspec.convert(decode(pasted)["estimation"], Settings)
    assert settings.depth.pressure_std == pytest.approx(480, rel=0.06)
    assert settings.depth.acceleration_noise == pytest.approx(0.003, rel=0.1)


def test_rounding_in_coarse_steps_is_noise_too(tmp_path: Path):
    found = told(write(tmp_path, imu(40), pressures(40, step=5000.0)))
    assert found.settings["pressure_std"] == pytest.approx(5000.0 / 12**0.5, rel=0.01)


def test_a_frozen_sensor_gives_no_line_but_a_word(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    stuck = [PressureSample(stamp_ns=k * 20_000_000, pressure=101_325.0) for k in range(1500)]
    noise(write(tmp_path, imu(30), stuck))
    pasted = capsys.readouterr().out
    assert "# pressure_std: every sample is the same" in pasted
    assert "pressure_std" not in decode(pasted)["estimation"]["depth"]


def test_samples_whose_time_does_not_rise_change_nothing(tmp_path: Path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    once = imu(30)
    clean = told(write(tmp_path / "a", once))
    twice = [each for sample in once for each in (sample, sample)]
    assert told(write(tmp_path / "b", twice, once[:500])) == clean


def bump(seconds: float, size: float) -> np.ndarray:
    """At rest but for a push of half a second in the middle."""
    added = np.zeros(round(seconds * 100))
    added[len(added) // 2 : len(added) // 2 + 50] = size
    return added


@pytest.mark.parametrize(
    ("streams", "sentence"),
    [
        ([imu(19)], "too short: 19.0 s"),
        ([], "fewer than 100 IMU samples"),
        ([pressures(40)], "fewer than 100 IMU samples"),
        ([imu(30, rate=bump(30, 0.3))], r"not at rest: the drone turns after 15\.\d s"),
        ([imu(30, force=bump(30, 2.0))], r"not at rest: the drone is pushed after 15\.\d s"),
        ([imu(30, rate=np.linspace(0.0, 0.1, 3000))], "not at rest: the drone turns"),
        ([imu(30), pressures(30, writer=100.0)], "not at rest: the pressure wanders by"),
    ],
)
def test_a_recording_that_cannot_tell_is_refused_in_one_sentence(
    tmp_path: Path, streams: list[list[Message]], sentence: str
):
    with pytest.raises(LindyError, match=sentence):
        noise(write(tmp_path, *streams))


STILL_40 = imu(40)  # at rest for 40 s


def status(seconds: float, *, armed: bool) -> VehicleStatus:
    return VehicleStatus(stamp_ns=round(seconds * 1e9), activity="ready", armed=armed)


@pytest.mark.parametrize("sentence", ["was armed after 5.2 s", "up drone --out", "5.0 s, noise"])
def test_an_armed_drone_is_not_at_rest_however_still_it_lies(tmp_path: Path, sentence: str):
    said = [status(1.0, armed=False), status(5.2, armed=True)]
    with pytest.raises(LindyError, match=sentence):
        noise(write(tmp_path, STILL_40, said))


def test_of_a_recording_with_motion_in_it_the_longest_rest_is_used_and_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    turn = np.zeros(7000)
    turn[200:300] = 0.5
    folder = write(tmp_path, imu(70, rate=turn), pressures(70), [
        status(0.0, armed=False), status(30.0, armed=True), status(31.0, armed=False),
    ])  # fmt: skip
    found = told(folder)
    assert found.begin == pytest.approx(36.0, abs=0.51)
    assert found.seconds == pytest.approx(34.0, abs=0.51)
    assert found.axes["gyroscope z"].std == pytest.approx(GYRO, rel=0.06)
    assert found.axes["pressure"].std == pytest.approx(PASCAL, rel=0.06)
    noise(folder)
    said = f"used {found.seconds:.1f} s at rest, from {found.begin:.1f} s"
    assert said in capsys.readouterr().out


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 590), st.floats(0.1, 2.0))
def test_motion_is_never_inside_the_rest_that_is_used(at: int, size: float):
    turn = np.zeros(6000)
    turn[10 * at : 10 * at + 100] = size
    t = np.linspace(0.0, 59.99, 6000)
    samples = RestingSamples(t, felt(60, rate=turn))
    heard = HeardAtRest({topics.IMU.key: samples}, [])
    rest = resting(heard, Path("x"))
    begin, end = rest.begin, rest.begin + rest.seconds
    assert end <= at / 10 + 0.51 or begin >= at / 10 + 0.99
    assert np.all(np.abs(rest.samples[topics.IMU.key].values[:, 2]) < 0.02 + 5 * GYRO)


@pytest.mark.slow
def test_the_drone_s_side_alone_makes_such_a_recording(tmp_path: Path):
    """What `--help` and the errors say: `lindy up drone`, which nobody arms."""
    host = VirtualHost()
    stack = Stack(out=str(tmp_path), pilot="topside", seed=3)
    host.add_all(on_side(Registry.read(), "drone", gateway=False), stack)
    host.run(45_000_000_000)
    host.close()
    found = told(tmp_path)
    assert found.begin == pytest.approx(0.0, abs=0.01)
    assert found.seconds > 40.0
    densities = {name: axis.noise.density for name, axis in found.axes.items()}
    put_in = stack.section("simulator", Simulator)
    assert densities["gyroscope z"] == pytest.approx(put_in.gyro_noise, rel=0.1)
    assert densities["accelerometer x"] == pytest.approx(put_in.accelerometer_noise, rel=0.1)


def test_the_deviation_is_the_textbook_s_for_two_samples_at_a_time():
    values = np.random.default_rng(7).standard_normal(200)
    tau, adev = deviation(values, 10.0)
    assert tau[0] == pytest.approx(0.1)
    assert adev[0] == pytest.approx(np.sqrt(np.mean(np.diff(values) ** 2) / 2))
    pairs = (values[1:] + values[:-1]) / 2
    assert tau[1] == pytest.approx(0.2)
    assert adev[1] == pytest.approx(np.sqrt(np.mean((pairs[2:] - pairs[:-2]) ** 2) / 2))
