"""Where a sensor sits and how it is turned: mounted and put right again is as if at the origin."""

from math import cos, pi, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.sensors import (
    AltitudeSample,
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)
from messages.units import Vec3
from services.marine.attitude import from_euler, normalised, to_body, to_world
from services.marine.mounting import (
    ALONG,
    ImuMount,
    Mount,
    Mounting,
    Placed,
    Rotation,
    SensorCalibration,
    Turned,
)
from services.marine.vehicle import GRAVITY
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.vehicle.mounting import (
    AltitudeAtOrigin,
    AtOrigin,
    Moment,
    MountedAxes,
    Turning,
    measured_there,
    place_of,
    seen_there,
)
from tests.support.messages import example
from tools.checks import known_tables

S = 1_000_000_000  # [ns]
DENSITY = 1025.0  # [kg/m³]
ARM: Vec3 = (0.2, 0.05, 0.1)
VECTORS = st.tuples(*[st.floats(-5, 5)] * 3)
ARMS = st.tuples(*[st.floats(-1, 1)] * 3)
ANGLES = st.tuples(*[st.floats(-pi, pi)] * 3)


def rotation(angles: Vec3) -> Rotation:
    q = from_euler(*angles)
    x, y, z = (to_world(q, axis) for axis in ALONG)
    return (x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])


@given(ANGLES, VECTORS)
def test_to_the_sensors_axes_and_back_is_nothing(angles: Vec3, vector: Vec3) -> None:
    axes = MountedAxes(Turned(rotation=rotation(angles)))
    assert axes.to_body(axes.to_sensor(vector)) == pytest.approx(vector, abs=1e-12)
    assert axes.to_body(vector) == pytest.approx(to_world(from_euler(*angles), vector), abs=1e-9)


@given(ANGLES, st.floats(-pi, pi), ANGLES)
def test_with_a_declination_the_field_is_as_if_it_pointed_to_true_north(
    attitude: Vec3, declination: float, mount: Vec3
) -> None:
    """However the drone lies, whatever heading it takes for its own, and with a turned compass."""
    q_NB, across, down = from_euler(*attitude), 15e-6, 49e-6  # [T]
    turned = Turned(rotation=rotation(mount))
    calibration = SensorCalibration(declination=declination)
    origin = AtOrigin(Mounting(magnetometer=turned), DENSITY, calibration)
    assert origin.needs_motion == (declination != 0.0)
    origin.moved(Moment(S, (0.0, 0.0, 0.0), q_NB))
    there = (across * cos(declination), across * sin(declination), down)
    seen = MountedAxes(turned).to_sensor(to_body(q_NB, there))
    found = origin.magnetometer(MagnetometerSample(stamp_ns=S, field=seen)).field
    assert found == pytest.approx(to_body(q_NB, (across, 0.0, down)), abs=1e-10)


@given(ANGLES, ARMS, VECTORS, VECTORS)
def test_a_mounted_imu_that_turns_steadily_is_put_right(
    angles: Vec3, arm: Vec3, force: Vec3, rate: Vec3
) -> None:
    mount = ImuMount(rotation=rotation(angles), position=arm)
    felt, turned = measured_there(mount, MountedAxes(mount), force, rate, (0.0, 0.0, 0.0))
    credentials = AtOrigin(Mounting(imu=mount), DENSITY)
    for i in range(3):
        said = ImuSample(stamp_ns=i * S // 100, specific_force=felt, angular_rate=turned)
        heard = credentials.imu(said)
        assert heard.specific_force == pytest.approx(force, abs=1e-9)
        assert heard.angular_rate == pytest.approx(rate, abs=1e-9)


def test_the_angular_acceleration_is_felt_and_taken_off() -> None:
    """A point on an arm ahead is pushed sideways when the vehicle begins to turn."""
    mount = ImuMount(position=(0.5, 0.0, 0.0))
    credentials, felt, heard = AtOrigin(Mounting(imu=mount), DENSITY), (0.0, 0.0, 0.0), None
    for i in range(100):
        rate, acceleration = (0.0, 0.0, 0.02 * i), (0.0, 0.0, 2.0)
        weight = (0.0, 0.0, -GRAVITY)
        felt, turned = measured_there(mount, MountedAxes(mount), weight, rate, acceleration)
        said = ImuSample(stamp_ns=i * S // 100, specific_force=felt, angular_rate=turned)
        heard = credentials.imu(said)
    assert felt == pytest.approx((-0.5 * 1.98**2, 1.0, -GRAVITY))
    assert heard is not None
    assert heard.specific_force == pytest.approx((0.0, 0.0, -GRAVITY), abs=1e-6)
    turning = Turning()
    assert turning.acceleration((0.0, 0.0, 1.0), 0) == (0.0, 0.0, 0.0)
    assert turning.acceleration((0.0, 0.0, 2.0), S) == (0.0, 0.0, 0.0)  # a gap says nothing
    assert turning.acceleration((0.0, 0.0, 2.1), S + S // 100)[2] > 0.0


@given(ANGLES, ARMS, ANGLES, VECTORS, VECTORS)
def test_a_mounted_dvl_is_put_right(
    angles: Vec3, arm: Vec3, lies: Vec3, velocity: Vec3, rate: Vec3
) -> None:
    mount, q = Mount(rotation=rotation(angles), position=arm), from_euler(*lies)
    credentials = AtOrigin(Mounting(dvl=mount), DENSITY)
    credentials.moved(Moment(0, rate, q))
    seen = seen_there(mount, MountedAxes(mount), velocity, rate)
    heard = credentials.dvl(DvlSample(stamp_ns=1, velocity=seen, std=0.01))
    assert heard.velocity == pytest.approx(velocity, abs=1e-9)


@given(st.floats(0.05, 0.8), st.sampled_from((0.001, 0.01, 0.05)), ARMS)
def test_an_altitude_that_repeats_while_the_depth_changes_is_none(
    sinks: float, step: float, arm: Vec3
) -> None:
    """`sinks` [m/s] over ground at 12 m; altitudes are rounded to `step` [m]."""
    told = list[int]()
    frozen = AltitudeAtOrigin[AltitudeSample](arm, lambda: told.append(1))
    alive = AltitudeAtOrigin[AltitudeSample](arm)
    for k in range(1, 80):
        depth, q = 5.0 + sinks * k / 10, from_euler(0.0, 0.02 * (k % 5), 0.0)
        rounded = round((12.0 - depth) / step) * step
        still = frozen.of(AltitudeSample(stamp_ns=k, altitude=7.0), q, depth)
        assert still is not None
        sunk = depth - 5.0 - sinks / 10
        assert (still.altitude is not None) == (sunk < 0.3) or abs(sunk - 0.3) < 1e-9
        assert len(told) == (still.altitude is None)
        there = alive.of(AltitudeSample(stamp_ns=k, altitude=rounded), q, depth)
        assert there is not None
        assert there.altitude is not None


@given(ARMS, ANGLES)
def test_an_altitude_is_of_the_origin(arm: Vec3, lies: Vec3) -> None:
    """However it lies, and by where it lay when the sample came."""
    q, at_origin = from_euler(*lies), AltitudeAtOrigin[AltitudeSample](arm)
    height = 9.0 - place_of(arm, (0.0, 0.0, 4.0), q)[2]
    sample = AltitudeSample(stamp_ns=1, altitude=height)
    there = at_origin.of(sample, q, 4.0)
    assert there is not None
    assert there.altitude == pytest.approx(5.0)
    assert at_origin.of(sample, from_euler(0.0, 0.0, 0.0), 4.0) is there
    assert at_origin.of(None, q, 4.0) is None
    level = AltitudeAtOrigin[AltitudeSample](arm).of(sample, None, None)
    assert level is not None
    assert level.altitude == pytest.approx(height + arm[2])
    no_lock = DvlSample(stamp_ns=1, velocity=None, std=0.01)
    assert AltitudeAtOrigin[DvlSample](arm).of(no_lock, q, 4.0) is no_lock


@given(ARMS, ANGLES, VECTORS)
def test_depth_and_fix_are_of_the_origin(arm: Vec3, lies: Vec3, position: Vec3) -> None:
    q, mount = normalised(from_euler(*lies)), Placed(position=arm)
    credentials = AtOrigin(Mounting(pressure=mount, usbl=mount), DENSITY)
    credentials.moved(Moment(0, (0.0, 0.0, 0.0), q))
    north, east, down = place_of(arm, position, q)
    pascal = DENSITY * GRAVITY
    said = PressureSample(stamp_ns=1, pressure=2e5 + pascal * down)
    assert credentials.pressure(said).pressure == pytest.approx(2e5 + pascal * position[2])
    fix = credentials.usbl(UsblSample(stamp_ns=1, north=north, east=east, std=1.0))
    assert (fix.north, fix.east) == pytest.approx(position[:2], abs=1e-9)


def test_a_late_sample_is_put_right_by_how_the_vehicle_lay_then() -> None:
    credentials = AtOrigin(Mounting(dvl=Mount(position=(1.0, 0.0, 0.0))), DENSITY)
    for i in range(100):
        credentials.moved(Moment(i * S // 100, (0.0, 0.0, 0.01 * i)))
    heard = credentials.dvl(DvlSample(stamp_ns=S // 2 + 1, velocity=(0.0, 0.5, 0.0), std=0.01))
    assert heard.velocity == pytest.approx((0.0, 0.0, 0.0))


def test_a_sensor_at_the_origin_passes_untouched() -> None:
    origin = AtOrigin(Mounting(), DENSITY)
    assert not origin.needs_motion
    for correct, kind in (
        (origin.imu, ImuSample), (origin.magnetometer, MagnetometerSample),
        (origin.pressure, PressureSample), (origin.dvl, DvlSample), (origin.usbl, UsblSample),
    ):  # fmt: skip
        sample: Any = example(kind, full=True)
        assert correct(sample) is sample


def test_a_matrix_of_few_digits_is_made_a_rotation() -> None:
    c, s = round(cos(0.3), 4), round(sin(0.3), 4)
    axes = MountedAxes(Turned(rotation=((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))))
    columns = np.array([axes.to_body(axis) for axis in ALONG])
    assert columns @ columns.T == pytest.approx(np.eye(3), abs=1e-14)


@pytest.mark.parametrize(
    "rows",
    [
        "[[1,0,0],[0,1,0],[0,0,-1]]",  # a mirror
        "[[1,0,0],[0,1,0],[0,0.01,1]]",
        "[[0.99,0,0],[0,1,0],[0,0,1]]",
        "[[0,1,0],[1,0,0],[0,0,1]]",
    ],
)
def test_a_mounting_that_is_no_rotation_is_refused(rows: str) -> None:
    setting = f"vehicle.mounting.imu.rotation={rows}"
    with pytest.raises(LindyError, match=r"vehicle.mounting.imu: rotation is no rotation: .* \+1"):
        Stack(overrides=[setting]).check(known_tables(Registry.read()))
