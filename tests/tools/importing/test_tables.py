"""Tables, alone and several together, become one recording."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from messages.sensors import PressureSample
from tests.tools.test_cli_verbs import complaint
from tools.__main__ import main
from tools.importing.column_files import TableFile

from .logs import (
    BEGAN_NS,
    IMU_HZ,
    SECONDS,
    S,
    dataflash,
    imported,
    messages,
    odd,
    of,
    report,
    ros1,
    tlog,
)

BEGAN = datetime(2023, 11, 14, 22, 13, 20, tzinfo=UTC)  # BEGAN_NS
MAP = """
about = "one table"
vehicle = "pioneer"
[[take]]
type = "table"
as = "sensor/pressure"
stamp = "{stamp}"
stamp_unit = "{unit}"
[take.fields]
pressure = {{ from = ["press.abs [mbar]"], unit = "{pressure}" }}
temperature = {{ from = ["water"], unit = "°C" }}
"""


def column_map(
    folder: Path, stamp: str = "when", unit: str = "date", pressure: str = "mbar"
) -> tuple[str, str]:
    path = folder / "columns.toml"
    path.write_text(MAP.format(stamp=stamp, unit=unit, pressure=pressure))
    return "--map", str(path)


def table(path: Path, *, zone: str = "Z") -> Path:
    """Pressure ten times a second, in every second row; in the others only a temperature inside."""
    lines = ["when,seconds,press.abs [mbar],water,inside"]
    for k in range(40):
        at = BEGAN + timedelta(seconds=k / 20)
        said = f"{at:%Y-%m-%d %H:%M:%S.%f}{zone},{at.timestamp()}"
        lines.append(f"{said},,,40.{k}" if k % 2 else f"{said},{1013.25 + k / 10},12.5,--.--")
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_tables_of_a_recording_give_its_samples_again(tmp_path: Path, kind: str) -> None:
    first = imported(ros1(tmp_path / "a.bag"), tmp_path / "first")
    assert main(["log", "export", "--as", kind, str(first), "--out", str(tmp_path / "tables")]) == 0
    tables = sorted((tmp_path / "tables").glob(f"*.{kind}"))
    assert main(["import", *map(str, tables), "--out", str(tmp_path / "again")]) == 0
    for key in ("sensor/imu", "sensor/pressure", "pilot/command"):
        before, after = (messages(tmp_path / name, key) for name in ("first", "again"))
        assert [one.message for one in after] == [one.message for one in before]
        assert [one.publish_ns for one in after] == [one.publish_ns for one in before]
    assert odd(tmp_path / "again") == {}


@pytest.mark.parametrize(("stamp", "unit"), [("when", "date"), ("seconds", "s")])
def test_a_row_without_our_sensor_is_none_of_its_samples(
    tmp_path: Path, stamp: str, unit: str
) -> None:
    options = column_map(tmp_path, stamp, unit)
    out = imported(table(tmp_path / "a.csv"), tmp_path / "dive", *options)
    found = messages(out, "sensor/pressure")
    later = [one.publish_ns - BEGAN_NS for one in found]
    assert later == pytest.approx([k * S // 10 for k in range(20)], abs=1000)
    last = of(out, "sensor/pressure", PressureSample)[-1]
    assert last.pressure == pytest.approx(101_325.0 + 380.0)
    assert odd(out) == {"sensor/pressure: rows without pressure, left out": 20}
    assert report(out)["remarks"] == []


def test_a_number_that_is_none_is_counted(tmp_path: Path) -> None:
    log = table(tmp_path / "a.csv")
    log.write_text(log.read_text().replace(f",{1013.25 + 0.4}", ",nan"))
    out = imported(log, tmp_path / "dive", *column_map(tmp_path))
    assert len(messages(out, "sensor/pressure")) == 19
    assert odd(out)["sensor/pressure: pressure is not a number, left out"] == 1


def test_a_clock_that_was_never_set_begins_when_the_map_says(tmp_path: Path) -> None:
    log = tmp_path / "a.csv"
    log.write_text("up,press.abs [mbar]\n5.0,1013.2\n5.5,1013.3\n")
    _, path = column_map(tmp_path, "up", "s")
    Path(path).write_text("began = 2023-11-14T22:13:20Z\n" + Path(path).read_text())
    found = messages(imported(log, tmp_path / "dive", "--map", path), "sensor/pressure")
    assert [one.publish_ns for one in found] == [BEGAN_NS, BEGAN_NS + S // 2]


def test_times_without_a_zone_are_utc_which_is_said(tmp_path: Path) -> None:
    log = table(tmp_path / "a.csv", zone="")
    out = imported(log, tmp_path / "dive", *column_map(tmp_path))
    assert messages(out, "sensor/pressure")[0].publish_ns == BEGAN_NS
    assert report(out)["remarks"] == ["the times of a.csv have no zone: taken as UTC"]


def test_rows_without_a_time_are_counted(tmp_path: Path) -> None:
    log = table(tmp_path / "a.csv")
    log.write_text(log.read_text() + ",,1013.25,12.5,\n")
    out = imported(log, tmp_path / "dive", *column_map(tmp_path))
    assert len(messages(out, "sensor/pressure")) == 20
    assert report(out)["remarks"] == ["1 row of a.csv has no time and is left out"]


@pytest.mark.parametrize(
    ("content", "options", "said"),
    [
        ("", {}, "a.csv is empty"),
        ("when,x\n", {}, "a.csv has no rows below its names of columns"),
        ("when,x\n1,2,3\n", {}, "a.csv is damaged or no table"),
        (None, {"stamp": "time"}, "has no column 'time' for the time; write at table as"),
        (None, {"unit": "s"}, 'when has dates; write stamp_unit = "date" at'),
        (None, {"stamp": "seconds"}, "seconds has no dates; write stamp_unit = one of"),
        (None, {"pressure": "Pa"}, "write zero = -101325 where it counts from the surface or unit"),
        (
            f"when,press.abs [mbar],water\n{BEGAN:%Y-%m-%d %H:%M:%SZ},deep,12\n",
            {},
            "press.abs [mbar] is 'deep', which is no number",
        ),
        ("when,x\n1,2\n", {}, "a has no press.abs [mbar], which the map names at table as"),
    ],
)
def test_a_wrong_table_is_one_sentence_and_leaves_nothing(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    content: str | None,
    options: dict[str, str],
    said: str,
) -> None:
    log = table(tmp_path / "a.csv")
    if content is not None:
        log.write_text(content)
    out = tmp_path / "dive"
    wanted = column_map(tmp_path, **options)
    assert said in complaint(capsys, "import", str(log), "--out", str(out), *wanted)
    assert not out.exists()


def test_no_parquet_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "a.parquet"
    log.write_bytes(b"PK\x03\x04 no table")
    said = "a.parquet is no log that is read and begins with b'PK"
    assert said in complaint(capsys, "import", str(log))
    log.write_bytes(b"PAR1 no table")
    assert "a.parquet is damaged or no table" in complaint(capsys, "import", str(log))


@pytest.mark.parametrize(("write", "name"), [(ros1, "a.csv"), (dataflash, "a.ulg")])
def test_a_log_is_known_by_how_it_begins(
    tmp_path: Path, write: Callable[[Path], Path], name: str
) -> None:
    out = imported(write(tmp_path / name), tmp_path / "dive")
    assert len(messages(out, "sensor/imu")) == SECONDS * IMU_HZ


def test_what_cannot_be_read_of_a_table_is_not_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "a.csv"
    log.write_text("a,b\n1,2,\x1b[31mred\n")
    said = complaint(capsys, "import", str(log))
    assert "1 lines do not have the 2 cells of its names, the first is line 2" in said
    assert "red" not in said


def imu_table(folder: Path, name: str, *, later_s: int = 0) -> Path:
    """As `lindy log export --as csv` writes it."""
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    axes = [f"{kind}.{axis}" for kind in ("specific_force", "angular_rate") for axis in "xyz"]
    lines = [",".join(["publish_ns", *axes])]
    for k in range(SECONDS * IMU_HZ):
        at = BEGAN_NS + later_s * S + k * S // IMU_HZ
        lines.append(f"{at},0.0,{(k + later_s) * 1e-3},-9.81,0.0,0.0,0.1")
    path.write_text("\n".join(lines) + "\n")
    return path


def depth_table(folder: Path, *, later_s: int = 0) -> Path:
    path = folder / "sensor_pressure.csv"
    lines = [f"{BEGAN_NS + later_s * S + k * S // 10},{1e5 + k}" for k in range(SECONDS * 10)]
    path.write_text("\n".join(["publish_ns,pressure", *lines]) + "\n")
    return path


def test_two_sensors_of_one_dive_are_in_the_order_of_their_times(tmp_path: Path) -> None:
    both = str(imu_table(tmp_path, "sensor_imu.csv")), str(depth_table(tmp_path, later_s=2))
    assert main(["import", *both, "--out", str(tmp_path / "dive")]) == 0
    found = [messages(tmp_path / "dive", key) for key in ("sensor/imu", "sensor/pressure")]
    assert [len(each) for each in found] == [SECONDS * IMU_HZ, SECONDS * 10]
    assert found[1][0].publish_ns - found[0][0].publish_ns == 2 * S
    assert report(tmp_path / "dive")["file"] == "sensor_imu.csv, sensor_pressure.csv"


def test_a_table_that_the_map_takes_nothing_of_is_left_out_which_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`lindy log export` writes one for each stream."""
    state = tmp_path / "state.csv"
    state.write_text(f"publish_ns,phase\n{BEGAN_NS},running\n{BEGAN_NS + S},running\n")
    logs = str(imu_table(tmp_path, "sensor_imu.csv")), str(state)
    assert main(["import", *logs, "--out", str(tmp_path / "dive")]) == 0
    assert "left out, because the map takes nothing of it: state.csv" in capsys.readouterr().out
    assert len(messages(tmp_path / "dive", "sensor/imu")) == SECONDS * IMU_HZ
    assert "nothing in it is in this map" in complaint(capsys, "import", str(state))


def test_the_pieces_of_a_log_become_one(tmp_path: Path) -> None:
    names = [("a/sensor_imu.csv", 0), ("b/sensor_imu.csv", SECONDS)]
    logs = [str(imu_table(tmp_path, name, later_s=later)) for name, later in reversed(names)]
    assert main(["import", *logs, "--out", str(tmp_path / "dive")]) == 0
    assert len(messages(tmp_path / "dive", "sensor/imu")) == 2 * SECONDS * IMU_HZ
    assert odd(tmp_path / "dive") == {}


def test_files_of_several_dives_are_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one, other = imu_table(tmp_path, "a/sensor_imu.csv"), imu_table(tmp_path, "b/sensor_imu.csv")
    late = depth_table(tmp_path, later_s=3600)
    days = imu_table(tmp_path, "c/sensor_imu.csv", later_s=2 * 86_400)
    cases = {
        (one, other): "sensor_imu.csv and sensor_imu.csv both have sensor_imu at the same time",
        (one, late): "sensor_pressure.csv is from 2023-11-14 23:13:20 to 2023-11-14 23:13:23: that "
        "is not one dive, or they are by two clocks",
        (one, days): "that is not one dive, or they are by two clocks",
        (one, one): "is named twice",
        (one, dataflash(tmp_path / "1.bin")): "are of two formats, each with clocks of its own",
        (
            dataflash(tmp_path / "2.bin"),
            dataflash(tmp_path / "3.bin", "ArduCopter V4.3.6"),
        ): "3.bin is of ArduCopter V4.3.6; expected a log of ArduSub",
        (
            tlog(tmp_path / "1.tlog"),
            tlog(tmp_path / "2.tlog", systems=(2,)),
        ): "both have ATTITUDE at the same time: they are of two boards",
    }
    for logs, said in cases.items():
        out = tmp_path / "dive"
        assert said in complaint(capsys, "import", *map(str, logs), "--out", str(out))
        assert not out.exists()


def test_rows_in_no_order_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A few that go back are of a clock that was set; half of them are of a table that was
    shuffled, which would become a recording of nonsense."""
    head, *rows = table(tmp_path / "whole.csv").read_text().splitlines()
    slow = [row.replace(row.split(",")[0], f"{BEGAN + timedelta(seconds=3 * k):%Y-%m-%d %H:%M:%SZ}")
            for k, row in enumerate(rows)]  # fmt: skip
    path = tmp_path / "shuffled.csv"
    path.write_text("\n".join([head, *slow[::2], *slow[1::2]]))  # goes back once
    assert main(["import", str(path), *column_map(tmp_path), "--out", str(tmp_path / "once")]) == 0
    path.write_text("\n".join([head, *slow[::-1]]))
    capsys.readouterr()
    said = complaint(
        capsys, "import", str(path), *column_map(tmp_path), "--out", str(tmp_path / "x")
    )
    assert "its rows are not in the order of their times (39 are before the one above" in said
    assert "at about line 3" in said


def test_words_that_are_categories_and_decimal_numbers_are_columns(tmp_path: Path) -> None:
    pa: Any = import_module("pyarrow")  # without types
    pq: Any = import_module("pyarrow.parquet")
    said, exact = pa.array(["manual", "hold", "manual"]), pa.array([1.5, 2.5, 3.5])
    columns = {
        "plain": said,
        "category": said.dictionary_encode(),
        "exact": exact.cast(pa.decimal128(9, 2)),
        "large": said.cast(pa.large_string()),
    }
    pq.write_table(pa.table(columns), tmp_path / "a.parquet")
    found = TableFile(tmp_path / "a.parquet").sources()
    assert found["a"].columns == {*columns}
