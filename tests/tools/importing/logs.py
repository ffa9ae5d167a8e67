"""Short synthetic logs, written by the formats' own libraries."""

import json
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import cos, sin
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from messages.message import Message
from services.marine.vehicle import GRAVITY
from tools.__main__ import main
from tools.recordings.recording import RecordedMessage, open_recording

S = 1_000_000_000  # [ns]
BEGAN_NS = 1_700_000_000 * S  # [ns] UTC
IMU_HZ, SLOW_HZ, SECONDS = 50, 10, 4
M = TypeVar("M", bound=Message)


def noise(seed: int) -> Iterator[float]:
    """[-] As a sensor has it: no two samples are the same."""
    yield from np.random.default_rng(seed).normal(0.0, 0.01, 10_000)


def ros1(
    path: Path,
    kind: str = "plain",
    *,
    unit: float = 1.0,
    clock: Callable[[int], int] = lambda at: at,
) -> Path:
    """A bag of ROS 1 with an IMU, pressure, a DVL that is not valid half of the time, and a pad.

    Args:
        kind: plain; unset: stamps of 1970; board: stamps since the board began, arriving late;
            nan, twice, gap: what happens at 2 s.
        unit: by which specific force is divided.
        clock: what the computer's clock says at a time [ns], with which all is stamped.
    """
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    began = BEGAN_NS
    delays = np.random.default_rng(3).exponential(0.004, 10_000)
    with Writer(path) as writer:
        links = {
            name: writer.add_connection(name, kind_, typestore=store)
            for name, kind_ in (("/imu", "sensor_msgs/msg/Imu"), ("/joy", "sensor_msgs/msg/Joy"),
                                ("/depth", "sensor_msgs/msg/FluidPressure"))
        }  # fmt: skip

        def write(name: str, at: int, message: Any) -> None:
            data = store.serialize_ros1(message, message.__msgtype__)
            writer.write(links[name], at, data)

        random, before = noise(1), None
        for k in range(SECONDS * IMU_HZ):
            at = clock(began + k * S // IMU_HZ)
            if kind == "gap" and 2.0 <= k / IMU_HZ < 3.0:
                continue
            stamp = {"unset": 0, "board": at - began + 77 * S}.get(kind, at)
            arrival = at + (round(delays[k] * 1e9) if kind == "board" else 0)
            wild = float("nan") if kind == "nan" and k == 2 * IMU_HZ else next(random)
            message = imu(store.types, stamp, wild, unit)
            write("/imu", arrival, before if kind == "twice" and before and k % 2 else message)
            before = message
            if k % (IMU_HZ // SLOW_HZ) == 0:
                pressure = 101325.0 + 500.0 * k / IMU_HZ + next(random)
                write("/depth", at, fluid(store.types, stamp, pressure))
                write("/joy", at, joy(store.types, at, k / (SECONDS * IMU_HZ)))
    return path


def ros2(folder: Path) -> Path:
    """A bag of ROS 2 with an IMU."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, random = get_typestore(Stores.ROS2_HUMBLE), noise(2)
    with Writer(folder, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        link = writer.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=store)
        for k in range(SECONDS * IMU_HZ):
            at = BEGAN_NS + k * S // IMU_HZ
            message = imu(store.types, at, next(random), 1.0)
            writer.write(link, at, store.serialize_cdr(message, "sensor_msgs/msg/Imu"))
    return folder


def header(types: Mapping[str, Any], stamp: int) -> Any:
    time = types["builtin_interfaces/msg/Time"](sec=stamp // S, nanosec=stamp % S)
    kind = types["std_msgs/msg/Header"]
    return kind(stamp=time, frame_id="", **({"seq": 0} if "seq" in kind.__annotations__ else {}))


def imu(types: Mapping[str, Any], stamp: int, wild: float, unit: float) -> Any:
    """At rest, forward, port, up."""
    vector, covariance = types["geometry_msgs/msg/Vector3"], np.zeros(9)
    return types["sensor_msgs/msg/Imu"](
        header=header(types, stamp),
        orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=covariance,
        angular_velocity=vector(x=0.1 + wild, y=0.2, z=0.3),
        angular_velocity_covariance=covariance,
        linear_acceleration=vector(x=0.0, y=0.5 / unit, z=(GRAVITY + wild) / unit),
        linear_acceleration_covariance=covariance,
    )


def fluid(types: Mapping[str, Any], stamp: int, pascal: float) -> Any:
    return types["sensor_msgs/msg/FluidPressure"](
        header=header(types, stamp), fluid_pressure=pascal, variance=0.0
    )


def joy(types: Mapping[str, Any], stamp: int, forward: float) -> Any:
    axes = np.array([0.0, 0.5, 0.0, 0.25, forward, 0.0], np.float32)
    return types["sensor_msgs/msg/Joy"](
        header=header(types, stamp), axes=axes, buttons=np.zeros(2, np.int32)
    )


def messages(folder: Path, key: str) -> list[RecordedMessage]:
    """Of one topic of a recording, every one of which can be read."""
    recording = open_recording(folder)
    found = [recorded for recorded in recording if recorded.key == key]
    assert not recording.unreadable
    return found


def of(folder: Path, key: str, kind: type[M]) -> list[M]:
    """The messages of one topic, which are of this kind."""
    found = [one.message for one in messages(folder, key)]
    assert all(isinstance(one, kind) for one in found)
    return cast(list[M], found)


def remarks(folder: Path) -> str:
    return " ".join(report(folder)["remarks"])


def imported(log: Path, out: Path, *options: str) -> Path:
    assert main(["import", str(log), "--out", str(out), *options]) == 0
    return out


def pressure_map(folder: Path, unit: str = "Pa", only: str = "") -> tuple[str, str]:
    """The option for a table with the columns `time` [s] and `pressure`."""
    path = folder / "map.toml"
    path.write_text(f"""
about = "one table"
vehicle = "bluerov2_heavy"
[[take]]
topic = "*"
as = "sensor/pressure"
{only}
stamp = "time"
stamp_unit = "s"
[take.fields]
pressure = {{ from = ["pressure"], unit = "{unit}" }}
""")
    return "--map", str(path)


def report(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "import.json").read_text())


def odd(folder: Path) -> dict[str, int]:
    """How often, by what."""
    return {
        f"{each['stream']}: {each['what']}": each["count"] for each in report(folder)["oddities"]
    }


# ArduSub.

FORMATS = {  # number, name → struct, letters, columns, units
    (128, "FMT"): ("<BB4s16s64s", "BBnNZ", "Type,Length,Name,Format,Columns", "-b---"),
    (129, "FMTU"): ("<QB16s16s", "QBNN", "TimeUS,FmtType,UnitIds,MultIds", "s---"),
    (130, "MSG"): ("<Q64s", "QZ", "TimeUS,Message", "s-"),
    (131, "IMU"): ("<QBffffff", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", "s#EEEooo"),
    (132, "BARO"): ("<QBff", "QBff", "TimeUS,I,Press,Temp", "s#PO"),
    (133, "MODE"): ("<QB", "QB", "TimeUS,ModeNum", "s-"),
    (134, "ARM"): ("<QB", "QB", "TimeUS,ArmState", "s-"),
    (136, "ATT"): ("<Qhhh", "Qccc", "TimeUS,Roll,Pitch,Yaw", "sddd"),
    (137, "XKF1"): ("<QBff", "QBff", "TimeUS,C,VD,PD", "s#nm"),
    (135, "RCIN"): ("<Q6H", "QHHHHHH", "TimeUS,C1,C2,C3,C4,C5,C6", "sYYYYYY"),
}
GWK, GMS = 2288, 100_000  # week and milliseconds of GPS time
GPS_NS = (315_964_800 + GWK * 604_800 - 18) * S + GMS * 1_000_000  # [ns] UTC of that
BOOT_S = 60  # [s] of the board's clock at the first row


def packed(number: int, *values: Any) -> bytes:
    """A message of a DataFlash log."""
    layout = next(layout for (kind, _), (layout, *_) in FORMATS.items() if kind == number)
    return b"\xa3\x95" + bytes([number]) + struct.pack(layout, *values)


def dataflash(path: Path, firmware: str = "ArduSub V4.5.3", *, restart: bool = False) -> Path:
    """Two IMUs, two barometers, sticks, mode and arming.

    Args:
        restart: the board starts again at 2 s.
    """
    rows = [packed(128, number, 3 + struct.calcsize(layout), name.encode(), letters.encode(),
                   columns.encode())
            for (number, name), (layout, letters, columns, _) in FORMATS.items()]  # fmt: skip
    at = BOOT_S * 1_000_000
    rows += [packed(129, at, number, units.encode(), b"-" * len(units))
             for (number, _), (*_, units) in FORMATS.items()]  # fmt: skip
    rows += [packed(130, at, firmware.encode()), packed(133, at, 2), packed(134, at, 1)]
    random, us = noise(4), at
    for k in range(SECONDS * IMU_HZ):
        us = at + k * 1_000_000 // IMU_HZ
        if restart and k >= SECONDS * IMU_HZ // 2:
            us -= at
        for number in (0, 1):
            rows.append(packed(131, us, number, 0.1, 0.2, 0.3, number, next(random), -GRAVITY))
        if k % (IMU_HZ // SLOW_HZ) == 0:
            rows.append(packed(132, us, 0, 99_000.0 + next(random), 40.0))
            rows.append(packed(132, us, 1, 101_325.0 + 100.0 * next(random), 12.0))
            rows.append(packed(136, us, -1000, 500, 27000))
            rows.append(packed(137, us, 0, 0.25, 2.5))
            rows.append(packed(135, us, 1500, 1500, 1900, 1500, 1700, 1100))
    rows.append(packed(134, us, 0))
    path.write_bytes(b"".join(rows))
    return path


def tlog(
    path: Path,
    *,
    kind: int = 12,
    systems: Sequence[int] = (1,),
    milli: float = 1.0,
    clock: Callable[[int], int | None] = lambda at: at,
    seconds: int = SECONDS,
) -> Path:
    """A telemetry log with the sticks of a ground station.

    Args:
        clock: what the ground station's clock says at a time [ns]; None: it heard nothing.
        kind: type of the vehicle.
        systems: vehicles in it.
        milli: by which the pressure [hPa] is multiplied.
    """
    from pymavlink.dialects.v20 import (  # pyright: ignore[reportMissingTypeStubs]
        ardupilotmega as mavlink,
    )

    random = noise(5)
    attitude = (-0.1, 0.05, -2.5, 0.01, 0.02, 0.03)  # [rad] [rad/s] roll, pitch, heading, rates
    ground: Any = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    boards: list[Any] = [mavlink.MAVLink(None, srcSystem=each, srcComponent=1) for each in systems]
    with path.open("wb") as file:

        def write(at: int, codec: Any, message: Any) -> None:
            if (said := clock(at)) is not None:
                file.write(struct.pack(">Q", said // 1000) + bytes(message.pack(codec)))

        for k in range(seconds * SLOW_HZ):
            at = BEGAN_NS + k * S // SLOW_HZ
            ms = (BOOT_S * S + k * S // SLOW_HZ) // 1_000_000
            for board in boards:
                armed = 128 if k >= 10 else 0
                if k % 10 == 0:
                    write(at, board, board.heartbeat_encode(kind, 3, armed, 19, 4))
                acc = round(100 * next(random))
                imu = (ms * 1000, acc, 0, -1000, 100, 200, 300, 200 + acc, 0, 400)
                write(at, board, board.raw_imu_encode(*imu))
                hpa = milli * (1013.25 + next(random))
                write(at, board, board.attitude_encode(ms, *attitude))
                write(at, board, board.vfr_hud_encode(0.0, 0.0, 217, 0, -3.5, -0.25))
                write(at, board, board.scaled_pressure2_encode(ms, hpa, 0.0, 1200))
            write(at, ground, ground.heartbeat_encode(6, 8, 192, 0, 4))
            write(at, ground, ground.manual_control_encode(1, 500, -1000, 0, 0, 0))
    return path


# PX4.

ULOG_TOPICS = {  # in the order of their sizes, as PX4 has them, so that nothing is padded
    "sensor_combined": (
        "<Q6f", "uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;"
    ),
    "vehicle_air_data": ("<Qf", "uint64_t timestamp;float baro_pressure_pa;"),
    "vehicle_attitude": ("<Q4f", "uint64_t timestamp;float[4] q;"),
    "vehicle_local_position": (
        "<Q2f?", "uint64_t timestamp;float z;float vz;bool z_valid;"
    ),
    "manual_control_setpoint": (
        "<Q4f", "uint64_t timestamp;float roll;float pitch;float yaw;float throttle;"
    ),
    "vehicle_status": (
        "<Q3B", "uint64_t timestamp;uint8_t nav_state;uint8_t arming_state;uint8_t system_type;"
    ),
    "vehicle_gps_position": ("<2Q", "uint64_t timestamp;uint64_t time_utc_usec;"),
}  # fmt: skip


def ulog(path: Path, *, kind: int = 12, gps_ns: int = BEGAN_NS) -> Path:
    """A log of PX4: one IMU, a barometer, attitude and depth, sticks, a mode. At the end of 2 s its
    estimator no longer knows the depth.

    Args:
        kind: type of the vehicle.
        gps_ns: [ns] UTC as its GPS says.
    """
    blocks = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", BOOT_S * 1_000_000)]

    def block(letter: bytes, body: bytes) -> None:
        blocks.append(struct.pack("<Hc", len(body), letter) + body)

    block(b"B", bytes(40))
    for name, (_, columns) in ULOG_TOPICS.items():
        block(b"F", f"{name}:{columns}".encode())
    for number, name in enumerate(ULOG_TOPICS):
        block(b"A", struct.pack("<BH", 0, number) + name.encode())
    numbers = {name: number for number, name in enumerate(ULOG_TOPICS)}

    def say(name: str, us: int, *values: float) -> None:
        body = struct.pack(ULOG_TOPICS[name][0], us, *values)
        block(b"D", struct.pack("<H", numbers[name]) + body)

    random = noise(6)
    say("vehicle_gps_position", BOOT_S * 1_000_000, gps_ns // 1000)
    for k in range(SECONDS * IMU_HZ):
        us = BOOT_S * 1_000_000 + k * 1_000_000 // IMU_HZ
        say("sensor_combined", us, 0.1, 0.2, 0.3, next(random), 0.0, -GRAVITY)
        if k % (IMU_HZ // SLOW_HZ) == 0:
            say("vehicle_air_data", us, 101_325.0 + 10_000.0 * k / IMU_HZ + next(random))
            say("vehicle_attitude", us, cos(1.0), 0.0, 0.0, sin(1.0))
            say("vehicle_local_position", us, 1.0 * k / IMU_HZ, 1.0, k < 2 * IMU_HZ)
            say("manual_control_setpoint", us, 0.25, 0.5, -1.0, 0.75)
        if k % IMU_HZ == 0:
            say("vehicle_status", us, 1, 2 if k else 1, kind)
    path.write_bytes(b"".join(blocks))
    return path


# MCAP.


def mcap(path: Path, kind: str = "ros2") -> Path:
    """A recording of another program with an IMU.

    Args:
        kind: ros1, ros2 or json; protobuf: what is not read.
    """
    from mcap.writer import Writer
    from rosbags.typesys import Stores, get_typestore

    store, random = get_typestore(Stores.ROS2_HUMBLE), noise(2)
    name = "sensor_msgs/msg/Imu"
    words, _ = store.generate_msgdef(name, ros_version=1 if kind == "ros1" else 2)
    types = {"ros1": "ros1msg", "ros2": "ros2msg", "json": "jsonschema", "protobuf": "protobuf"}
    said = {"ros1": "ros1", "ros2": "cdr"}.get(kind, kind)
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=4000)
        writer.start()
        data = b"{}" if kind == "json" else words.encode()
        known = name.replace("/msg/", "/") if kind == "ros1" else name
        schema = writer.register_schema(known, types[kind], data)
        channel = writer.register_channel("/imu", said, schema)
        for k in range(SECONDS * IMU_HZ):
            at = BEGAN_NS + k * S // IMU_HZ
            message = imu(store.types, at, next(random), 1.0)
            if kind == "ros1":
                payload = bytes(store.serialize_ros1(message, name))
            elif kind == "json":
                payload = json.dumps(_plain(message)).encode()
            else:
                payload = bytes(store.serialize_cdr(message, name))
            writer.add_message(channel, at, payload, at)
        writer.finish()
    return path


def _plain(value: Any) -> Any:
    """As JSON has it."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if hasattr(value, "__dataclass_fields__"):
        return {name: _plain(getattr(value, name)) for name in value.__dataclass_fields__
                if name != "__msgtype__"}  # fmt: skip
    return value


WRITERS: dict[str, Callable[[Path], Path]] = {
    "a.bag": ros1, "a.mcap": mcap, "a.bin": dataflash, "a.tlog": tlog, "a.ulg": ulog,
}  # fmt: skip
