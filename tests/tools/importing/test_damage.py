"""What is damaged, missing or set wrong in a log costs that alone, and is said, in every format."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from messages.sensors import PressureSample
from tests.tools.test_cli_verbs import complaint
from tools.recordings.mcap_records import Damage, records

from .logs import (
    BEGAN_NS,
    IMU_HZ,
    SECONDS,
    SLOW_HZ,
    WRITERS,
    S,
    dataflash,
    fluid,
    imported,
    imu,
    mcap,
    messages,
    noise,
    odd,
    of,
    pressure_map,
    remarks,
    ros1,
    ros2,
    tlog,
    ulog,
)

CHANGED_S = 1_650_000_000  # [s] UTC at which a file was changed last
RUBBISH = np.random.default_rng(11).bytes(70_000)


def imu_samples(folder: Path) -> int:
    return len(messages(folder, "sensor/imu"))


def all_samples(name: str) -> int:
    return SECONDS * (SLOW_HZ if name.endswith("tlog") else IMU_HZ)


@pytest.mark.parametrize("space", [bytes(3_000_000), b"\xff" * 3_000_000, bytes(100)])
@pytest.mark.parametrize("name", WRITERS)
def test_empty_space_behind_a_log_is_passed_over(tmp_path: Path, name: str, space: bytes) -> None:
    """What a logger took before it wrote, and erased flash."""
    log = WRITERS[name](tmp_path / name)
    with log.open("ab") as file:
        file.write(space)
    out = imported(log, tmp_path / "dive")
    assert imu_samples(out) == all_samples(name)
    assert "no message" not in remarks(out)


def test_zeros_behind_a_recording_that_was_cut_off_are_one_damage(tmp_path: Path) -> None:
    whole = mcap(tmp_path / "a.mcap").read_bytes()
    log = tmp_path / "cut.mcap"
    log.write_bytes(whole[: len(whole) // 2] + bytes(1_000_000))
    damage = Damage()
    assert sum(1 for _ in records(log, damage=damage)) > 100
    assert len(damage.places) == 1
    assert 50 < imu_samples(imported(log, tmp_path / "dive")) < SECONDS * IMU_HZ


@pytest.mark.parametrize("year_s", [5, 946_684_805])  # 1970, of RTC chips
@pytest.mark.parametrize("name", ["a.bag", "a.bin", "a.ulg", "a.tlog", "a.csv"])
def test_a_clock_that_was_never_set_ends_when_the_file_was_changed(
    tmp_path: Path, name: str, year_s: int
) -> None:
    def clock(at: int) -> int:
        return at - BEGAN_NS + year_s * S

    options: tuple[str, ...] = ()
    if name == "a.bag":
        log = ros1(tmp_path / name, clock=clock)
    elif name == "a.tlog":
        log = tlog(tmp_path / name, clock=clock)
    elif name == "a.ulg":
        log = ulog(tmp_path / name, gps_ns=year_s * S)
    elif name == "a.csv":
        log, options = tmp_path / name, pressure_map(tmp_path, "mbar")
        rows = [f"{year_s + k / IMU_HZ},{1013.0 + k}" for k in range(SECONDS * IMU_HZ)]
        log.write_text("\n".join(["time,pressure", *rows]) + "\n")
    else:
        log = dataflash(tmp_path / name)
    os.utime(log, (CHANGED_S, CHANGED_S))
    out = imported(log, tmp_path / "dive", *options)
    key = "sensor/pressure" if name == "a.csv" else "sensor/imu"
    times = [one.log_ns for one in messages(out, key)]
    assert times[-1] == pytest.approx(CHANGED_S * S, abs=S // 5)
    assert times[-1] - times[0] == pytest.approx(SECONDS * S, abs=S // 5)
    assert "its clock was never set" in remarks(out)


Clock = Callable[[int], int]
DAY = 86_400 * S  # [ns]
CLOCKS: dict[str, list[int]] = {  # [ns] ahead of the truth, in each of the seconds of a log
    "set once": [-1096 * DAY, 0, 0, 0],
    "never set, then set": [-BEGAN_NS + S, -BEGAN_NS + S, 0, 0],
    "there and back": [0, -1096 * DAY, 0, -1096 * DAY],
    "back by three seconds": [0, 0, -3 * S, -3 * S],
    "back and back": [0, -3 * S, -6 * S, -9 * S],
}
BACK = [kind for kind in CLOCKS if kind.startswith("back")]


def table_by(path: Path, clock: Clock) -> Path:
    """Ten rows a second."""
    times = [BEGAN_NS + k * S // SLOW_HZ for k in range(SECONDS * SLOW_HZ)]
    rows = [f"{clock(at) / S:.3f},{1013.0 + k}" for k, at in enumerate(times)]
    path.write_text("\n".join(["time,pressure", *rows]) + "\n")
    return path


def bag_by(path: Path, clock: Clock) -> Path:
    """Also its stamps are by the clock."""
    return ros1(path, clock=clock)


def tlog_by(path: Path, clock: Clock) -> Path:
    return tlog(path, clock=clock)


CLOCKED: dict[
    str, tuple[Callable[[Path, Clock], Path], int, list[str]]
] = {  # how, [1/s], which clocks
    "tlog": (tlog_by, SLOW_HZ, [*CLOCKS]),
    "csv": (table_by, SLOW_HZ, [*CLOCKS]),
    "bag": (bag_by, IMU_HZ, ["set once", "never set, then set", *BACK]),
}


@pytest.mark.parametrize(
    ("form", "kind"), [(form, kind) for form in CLOCKED for kind in CLOCKED[form][2]]
)
def test_a_clock_that_is_set_in_mid_log_goes_on(tmp_path: Path, form: str, kind: str) -> None:
    write, hz, _ = CLOCKED[form]
    ahead = CLOCKS[kind]
    name = f"a.{form}"
    log = write(tmp_path / name, lambda at: at + ahead[min(SECONDS - 1, (at - BEGAN_NS) // S)])
    options = pressure_map(tmp_path, "mbar") if form == "csv" else ()
    out = imported(log, tmp_path / "dive", *options)
    samples = messages(out, "sensor/pressure" if form == "csv" else "sensor/imu")
    wanted = [BEGAN_NS + k * S // hz for k in range(SECONDS * hz)]
    assert [one.log_ns for one in samples] == pytest.approx(wanted, abs=2_000_000)
    if form == "bag":
        assert [one.publish_ns for one in samples] == pytest.approx(wanted, abs=1_000_000)
    assert "log: the logger's clock stepped" in " ".join(odd(out))


def test_one_wrong_time_does_not_date_a_log(tmp_path: Path) -> None:
    def clock(at: int) -> int:
        return at + (20_000 * DAY if at == BEGAN_NS + S else 0)

    out = imported(tlog(tmp_path / "a.tlog", clock=clock), tmp_path / "dive")
    times = [one.log_ns for one in messages(out, "sensor/imu")]
    assert times[0] == pytest.approx(BEGAN_NS, abs=2_000_000)
    assert times[-1] - times[0] == pytest.approx(3.9 * S, abs=2_000_000)


def test_damaged_times_stretch_no_log(tmp_path: Path) -> None:
    """One bit of each twentieth, from milliseconds to years."""
    log = tlog(tmp_path / "a.tlog", seconds=20)
    data, at, number = bytearray(log.read_bytes()), 8, 0
    while at < len(data):
        number += 1
        if number % 20 == 10:
            bit = 10 + number // 20 % 40
            data[at - 1 - bit // 8] ^= 1 << bit % 8
        at += 12 + data[at + 1] + 8
    log.write_bytes(data)
    out = imported(log, tmp_path / "dive")
    for key in ("sensor/imu", "vehicle/estimate", "pilot/command"):
        times = [one.publish_ns for one in messages(out, key)]
        assert times[-1] - times[0] == pytest.approx(19.9 * S, abs=2 * S)
    assert "of its times are damaged" in remarks(out)


def test_a_delay_of_the_link_is_no_step(tmp_path: Path) -> None:
    """Three seconds in which nothing comes, and then all of it at once."""

    def clock(at: int) -> int:
        late = at - (BEGAN_NS + 20 * S)
        return BEGAN_NS + 23 * S + late // 1000 if 0 <= late < 3 * S else at

    out = imported(tlog(tmp_path / "a.tlog", clock=clock, seconds=40), tmp_path / "dive")
    times = [one.publish_ns for one in messages(out, "sensor/imu")]
    assert [*np.diff(times)] == pytest.approx([S // SLOW_HZ] * (len(times) - 1), abs=S // 50)
    assert not [what for what in odd(out) if what.startswith("log:")]


@pytest.mark.parametrize("kind", ["RAW_IMU", "SCALED_PRESSURE2", "HEARTBEAT"])
def test_packets_with_a_wrong_checksum_are_counted_by_name(tmp_path: Path, kind: str) -> None:
    numbers = {"RAW_IMU": 27, "SCALED_PRESSURE2": 137, "HEARTBEAT": 0}
    data, at, damaged = bytearray(tlog(tmp_path / "a.tlog").read_bytes()), 8, 0
    while at < len(data):
        length, number = data[at + 1], int.from_bytes(data[at + 7 : at + 10], "little")
        if number == numbers[kind]:
            damaged += 1
            data[at + 10 + length] ^= 0xFF * (damaged % 2)  # half of them
        at += 12 + length + 8
    (tmp_path / "a.tlog").write_bytes(data)
    out = imported(tmp_path / "a.tlog", tmp_path / "dive")
    assert f"damaged messages are left out: {(damaged + 1) // 2} of {kind}" in remarks(out)


# Bags with a topic that cannot be read.

ZERO_HASH = "RIHS01_" + "0" * 64
OWN_TYPES = {  # what the bag says of /thrusters, its type, and what is said of it
    "empty": ("", "my_msgs/msg/One", "its type is not in the log"),
    "a part is missing": (
        "my_msgs/Part[] parts\nfloat64 x\n", "my_msgs/msg/One",
        "my_msgs/msg/Part, a part of its type, is not in the log",
    ),
    "constants only": (
        "my_msgs/State[] states\n" + "=" * 80 + "\nMSG: my_msgs/State\nuint8 OFF=0\nuint8 ON=1\n",
        "my_msgs/msg/All", "",
    ),
    "lines of Windows and remarks": (
        "# made elsewhere\r\nfloat64 x # [m]\r\n\r\n", "my_msgs/msg/One", "",
    ),
    "wide letters": ("wstring name\n", "my_msgs/msg/One", "its type has wstring"),
    "itself": ("my_msgs/One[] more\n", "my_msgs/msg/One", "its type cannot be read"),
    "another type of a known name": ("float64 x\n", "geometry_msgs/msg/Vector3", ""),
}  # fmt: skip


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
@pytest.mark.parametrize("kind", OWN_TYPES)
def test_a_topic_that_cannot_be_read_costs_that_topic_alone(
    tmp_path: Path, kind: str, storage: str
) -> None:
    words, type_, said = OWN_TYPES[kind]
    out = imported(bag_with(tmp_path / "bag", words, type_, storage), tmp_path / "dive")
    assert imu_samples(out) == SECONDS * IMU_HZ
    pressures = of(out, "sensor/pressure", PressureSample)
    assert len(pressures) == SECONDS * SLOW_HZ
    assert pressures[0].pressure == pytest.approx(101_325.0, abs=1.0)
    assert (f"/thrusters ({type_}) is left out: {said}" in remarks(out)) == bool(said)


def bag_with(folder: Path, words: str, type_: str, storage: str) -> Path:
    """An IMU, pressure, and a topic of an own type."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, random = get_typestore(Stores.ROS2_HUMBLE), noise(2)
    with Writer(folder, version=9, storage_plugin=StoragePlugin[storage]) as writer:
        links: dict[str, Any] = {
            name: writer.add_connection(f"/{name}", f"sensor_msgs/msg/{kind}", typestore=store)
            for name, kind in (("imu", "Imu"), ("depth", "FluidPressure"))
        }
        own = writer.add_connection("/thrusters", type_, msgdef=words, rihs01=ZERO_HASH)
        for k in range(SECONDS * IMU_HZ):
            at = BEGAN_NS + k * S // IMU_HZ
            sample = imu(store.types, at, next(random), 1.0)
            writer.write(links["imu"], at, store.serialize_cdr(sample, "sensor_msgs/msg/Imu"))
            if k % (IMU_HZ // SLOW_HZ) == 0:
                depth = fluid(store.types, at, 101_325.0 + k / 1e3)
                data = store.serialize_cdr(depth, "sensor_msgs/msg/FluidPressure")
                writer.write(links["depth"], at, data)
                writer.write(own, at, b"\x00\x01\x00\x00" + bytes(8))
    return folder


def test_one_file_of_a_bag_is_read_too(tmp_path: Path) -> None:
    [part] = ros2(tmp_path / "bag").glob("*.db3")
    assert imu_samples(imported(part, tmp_path / "dive")) == SECONDS * IMU_HZ


def test_messages_that_are_not_of_their_type_are_counted(tmp_path: Path) -> None:
    """One sample of the recording is cut short."""
    from mcap.reader import make_reader
    from mcap.writer import Writer

    with mcap(tmp_path / "a.mcap").open("rb") as file, (tmp_path / "b.mcap").open("wb") as torn:
        writer = Writer(torn)
        writer.start()
        channel = 0
        for number, (schema, _, message) in enumerate(make_reader(file).iter_messages()):
            if number == 0:
                assert schema is not None
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                channel = writer.register_channel("/imu", "cdr", kind)
            data = message.data[: 40 if number % 10 == 3 else None]
            writer.add_message(channel, message.log_time, data, message.publish_time)
        writer.finish()
    out = imported(tmp_path / "b.mcap", tmp_path / "dive")
    assert imu_samples(out) == SECONDS * IMU_HZ * 9 // 10
    assert f"damaged messages are left out: {SECONDS * IMU_HZ // 10} of /imu" in remarks(out)


@pytest.mark.parametrize(
    ("name", "cure"),
    [
        ("a.bag", "`rosbag reindex` mends what can be read"),
        ("a.db3", "`sqlite3 a.db3 .recover | sqlite3 new.db3` saves what can be read"),
        ("bag", "or name one .db3 or .mcap file of it"),
    ],
)
def test_of_a_bag_that_was_cut_off_it_is_said_what_mends_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, cure: str
) -> None:
    log = tmp_path / name
    if name == "a.bag":
        data = ros1(log).read_bytes()
    else:
        [part] = ros2(tmp_path / "bag").glob("*.db3")
        data = part.read_bytes()
    if name == "bag":
        (log / "metadata.yaml").write_text("rosbag2_bagfile_information:\n  version: 9\n  storage")
    else:
        log.write_bytes(data[: len(data) * 2 // 3])
    assert cure in complaint(capsys, "import", str(log), "--out", str(tmp_path / "dive"))
    assert not (tmp_path / "dive").exists()


def test_of_a_bag_with_a_damaged_part_what_is_before_it_is_kept(tmp_path: Path) -> None:
    log = ros1(tmp_path / "a.bag")
    data = bytearray(log.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 3000] = RUBBISH[:3000]
    log.write_bytes(data)
    out = imported(log, tmp_path / "dive")
    assert SECONDS * IMU_HZ // 8 < imu_samples(out) < SECONDS * IMU_HZ
    assert remarks(out) != ""
