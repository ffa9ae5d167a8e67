"""A map with wrong units or axes is refused by what the log's own sensors say; the right one of the
same log is not, nor is a log that does not tell."""

from collections.abc import Callable
from math import cos, pi, sin
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.vehicle import VehicleEstimate
from services.marine.attitude import down_in_body, from_euler
from services.marine.mounting import ALONG, Rotation
from services.marine.vehicle import GRAVITY
from services.runtime.config.errors import LindyError
from tools.importing.conversion import Conversion
from tools.importing.log_file import LogRow
from tools.importing.map_file import TakenMessage

from .logs import BEGAN_NS, S

HZ, SECONDS = 20, 30
FLU: Rotation = ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
Rows = list[LogRow]


def dive(swing: float, *, over: float = 0.0, noise: float = 20.0, seed: int = 1) -> Rows:
    """A vehicle that rolls and pitches and dives, and says how much. Its IMU is FRD.

    Args:
        swing: [rad] of roll and pitch, [m] of depth.
        over: [rad] by which it is rolled over.
        noise: [Pa] of the pressure.
    """
    random = np.random.default_rng(seed)
    rows: Rows = []
    for k in range(HZ * SECONDS):
        t = k / HZ
        roll, pitch = over + swing * sin(1.3 * t), swing * sin(0.9 * t)
        roll_rate, pitch_rate = swing * 1.3 * cos(1.3 * t), swing * 0.9 * cos(0.9 * t)
        f = -GRAVITY * np.array(down_in_body(from_euler(roll, pitch, 0.0)))
        w = np.array([roll_rate, pitch_rate * cos(roll), -pitch_rate * sin(roll)])
        depth = 2.0 + swing * sin(0.5 * t)
        fields = SimpleNamespace(
            f=f + random.normal(0.0, 0.02, 3),
            w=w + random.normal(0.0, 1e-3, 3),
            p=101_325.0 + 1000.0 * GRAVITY * depth + random.normal(0.0, noise),
            angles=(roll, pitch, 0.1 * t),
            depth=depth,
            ms=77_000.0 + 1000.0 * t,
        )
        rows.append(LogRow("log", fields, BEGAN_NS + k * S // HZ))
    return rows


def taken(
    *,
    rate: str = "rad/s",
    pressure: str = "Pa",
    depth: str = "m",
    angle: str = "rad",
    stamp_unit: str = "ms",
    **imu: object,
) -> list[TakenMessage]:
    """A map of that dive."""
    clock = {"stamp": "ms", "stamp_unit": stamp_unit, "clock": "board"}
    angles = {
        name: {"from": [f"angles.{k}"], "unit": angle}
        for k, name in enumerate(("roll", "pitch", "heading"))
    }
    parts: list[dict[str, object]] = [
        {"as": "sensor/imu", **clock, **imu, "fields": {
            "specific_force": {"from": ["f.0", "f.1", "f.2"], "unit": "m/s²"},
            "angular_rate": {"from": ["w.0", "w.1", "w.2"], "unit": rate}}},
        {"as": "sensor/pressure", "fields": {"pressure": {"from": ["p"], "unit": pressure}}},
        {"as": "vehicle/estimate",
         "fields": {**angles, "depth": {"from": ["depth"], "unit": depth}}},
    ]  # fmt: skip
    return [msgspec.convert({"topic": "log", **part}, TakenMessage) for part in parts]


def heard(rows: Rows, parts: list[TakenMessage], mounted: Rotation = ALONG) -> Conversion:
    return Conversion(rows, {"log": parts}, mounted=mounted)


def refusal(rows: Rows, parts: list[TakenMessage]) -> str:
    with pytest.raises(LindyError) as error:
        heard(rows, parts)
    return str(error.value)


@given(st.floats(0.0, 1.0), st.floats(0.5, 100.0), st.integers(0, 100))
def test_the_right_map_is_never_refused(swing: float, noise: float, seed: int) -> None:
    """Of a sensor that lives: one whose whole log stays within 1 Pa is refused as still."""
    conversion = heard(dive(swing, noise=noise, seed=seed), taken())
    found = [one.message for one in conversion.messages()]
    estimates = [one for one in found if isinstance(one, VehicleEstimate)]
    assert len(estimates) == HZ * SECONDS
    assert all(None not in (one.roll, one.heading, one.depth) for one in estimates)


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        (lambda: taken(stamp_unit="us"), 'go by 0.001 s in a second of the log; write stamp_unit'),
        (lambda: taken(stamp_unit="s"), 'write stamp_unit = "ms" in the map'),
        (lambda: taken(axes="FLU"), 'gravity points the wrong way, up instead of down'),
        (lambda: taken(axes="FLU"), 'write axes = "FRD" in the map'),
        (lambda: taken(axes=FLU), "write axes with two rows of the other sign"),
        (lambda: taken(rate="deg/s"), 'as its angular_rate says; write unit = "rad/s"'),
        (lambda: taken(pressure="hPa"), 'write unit = "Pa" there in the map'),
    ],
)  # fmt: skip
def test_a_wrong_map_is_one_sentence(parts: Callable[[], list[TakenMessage]], said: str) -> None:
    assert said in refusal(dive(0.2), parts())


def test_degrees_that_the_map_calls_radians_are_seen() -> None:
    rows = dive(0.1)
    for row in rows:
        row.fields.w = row.fields.w * 180.0 / pi
    assert 'write unit = "deg/s"' in refusal(rows, taken())
    heard(rows, taken(rate="deg/s"))


def test_a_log_at_rest_says_nothing_of_a_gyroscope() -> None:
    heard(dive(0.0), taken(rate="deg/s"))


def test_a_noisy_pressure_sensor_is_counted_and_imported() -> None:
    odd = heard(dive(0.3, noise=750.0), taken()).oddities.all()
    (noisy,) = (each for each in odd if each.what == "jumps from sample to sample [Pa]")
    assert 1000.0 < (noisy.most or 0.0) < 1500.0
    assert "another field" in refusal(dive(0.3, noise=20_000.0), taken())


def test_hectopascals_that_the_map_calls_pascals_stay_too_still() -> None:
    rows = dive(0.0, noise=20.0)
    for row in rows:
        row.fields.p = 101_325.0 + (row.fields.p - 101_325.0) / 500.0
    assert "all the time" in refusal(rows, taken())


def test_a_vehicle_that_is_upside_down_and_says_so_is_not_refused() -> None:
    heard(dive(0.2, over=pi), taken())


def test_a_board_that_is_mounted_upside_down_is_not_refused() -> None:
    heard(dive(0.2), taken(axes="FLU"), mounted=FLU)


def test_a_board_that_starts_again_keeps_its_pace() -> None:
    rows = dive(0.2)
    for row in rows[len(rows) // 2 :]:
        row.fields.ms -= 77_000.0
    heard(rows, taken())


def test_an_estimate_that_contradicts_the_sensors_is_left_out_and_counted() -> None:
    rows = dive(0.2)
    conversion = heard(rows, taken(depth="cm", angle="deg"))
    assert not any(isinstance(one.message, VehicleEstimate) for one in conversion.messages())
    odd = {each.what: each.count for each in conversion.oddities.all()}
    said = {"depth is 0.01 times", "roll is 0.017 times", "heading, as "}
    for words in said:
        assert [odd[what] for what in odd if what.startswith(words)] == [len(rows)], odd
