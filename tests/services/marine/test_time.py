"""Time by a sensor, the rhythm of a sensor, the time in a picture; and sums with the same bits
under every Python."""

import ast
from collections.abc import Sequence
from math import radians
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import messages
import services
from services.camera.core import Order
from services.camera.sea import CameraView, SimulatedSea, WaterLight
from services.marine import time_stripe
from services.marine.attitude import LEVEL
from services.marine.rhythm import PATIENCE_NS, SampleRhythm, SensorTime
from services.marine.summation import plain_sum

MS = 1_000_000  # [ns]
# Clock since the step before, and the age of the sample [ms]; None: no new sample.
steps = st.lists(
    st.tuples(st.integers(0, 300), st.one_of(st.none(), st.integers(0, 200))), min_size=1
)


@given(st.lists(st.tuples(st.integers(1, 40), st.integers(0, 300)), min_size=2))
def test_with_new_stamps_only_they_count_and_not_when_they_are_handled(
    samples: list[tuple[int, int]],
) -> None:
    time, stamp, now = SensorTime(), 0, 0
    for period, delay in samples:
        stamp += period * MS
        now = max(now, stamp + delay * MS)
        assert time.step(stamp, now) == stamp


@given(steps)
def test_it_never_runs_backwards_nor_ahead_of_the_clock_nor_loses_time(
    moves: list[tuple[int, int | None]],
) -> None:
    """Never ahead of the clock: so nothing is counted twice. Never behind the newest stamp."""
    time, now, newest, before = SensorTime(), 1000 * MS, 0, 0
    for wait, age in moves:
        now += wait * MS
        newest = newest if age is None else max(newest, now - age * MS)
        at = time.step(newest or None, now)
        assert before <= at <= now
        assert at >= newest
        before = at


def test_in_silence_it_goes_on_by_the_clock_and_returns_without_a_jump() -> None:
    time, late, last = SensorTime(), 30 * MS, 0
    for k in range(10):
        last = time.step(k * 10 * MS, k * 10 * MS + late)
    assert time.step(90 * MS, 90 * MS + late + PATIENCE_NS) == last
    silent = [time.step(90 * MS, k * 10 * MS + late) for k in range(15, 30)]
    assert silent == [k * 10 * MS for k in range(15, 30)]
    assert time.step(300 * MS, 300 * MS + late) == 300 * MS


def test_a_sensor_that_begins_to_count_anew_costs_no_time_and_adds_none() -> None:
    time = SensorTime()
    time.step(5000 * MS, 5000 * MS)
    assert time.step(10 * MS, 5040 * MS) == 5040 * MS
    assert time.step(20 * MS, 5055 * MS) == 5050 * MS
    unheard = SensorTime()
    unheard.step(1000 * MS, 1000 * MS)
    assert unheard.step(None, 1010 * MS) == 1010 * MS  # without a sample by the clock at once
    assert unheard.step(1020 * MS, 1020 * MS) == 1020 * MS


LONGEST = 5.0  # [s] as of `sensor/dvl`


def false_alarms(periods: Sequence[float]) -> int:
    """Periods [s] that would have been taken for a silence."""
    rhythm, t, alarms = SampleRhythm(LONGEST), 0.0, 0
    rhythm.see(0)
    for period in periods:
        alarms += period > rhythm.patience
        t += period
        rhythm.see(round(t * 1e9))
    return alarms


JITTER = st.floats(0.4, 1.6)


MODES = st.sampled_from([15.0, 10.0, 8.0, 4.0, 2.0])  # [Hz]


@given(st.lists(st.tuples(MODES, st.integers(1, 40), JITTER), max_size=20), st.integers(0, 20))
def test_jitter_hiccups_and_a_change_of_the_range_mode_are_no_silence(
    parts: list[tuple[float, int, float]], every: int
) -> None:
    jittered = [jitter / hz for hz, count, jitter in parts for _ in range(count)]
    assert false_alarms(jittered) == 0
    assert false_alarms([jitter for *_, jitter in parts]) == 0  # once a second
    for hz, count, _ in parts:
        assert false_alarms([1 / hz + 0.5 * (k % (every + 1) == 0) for k in range(count)]) == 0


@given(st.floats(0.1, 30.0), st.integers(40, 80))
def test_it_is_silent_after_ten_periods_and_an_outage_is_forgotten(hz: float, count: int) -> None:
    rhythm = SampleRhythm(LONGEST)
    assert rhythm.patience == LONGEST
    for begin in (0, 10**12):
        for n in range(count):
            rhythm.see(begin + round(n * 1e9 / hz))
        assert abs(rhythm.patience - min(LONGEST, max(1.0, 10.0 / hz))) < 0.1


S = 1_000_000_000
time = st.integers(-(10**18), 10**18)


def blank() -> time_stripe.Luma:
    return np.full((72, 512), 90, np.uint8)


@given(stamp=time, away=st.integers(-(10**15), 10**15))
def test_what_is_written_is_read_to_the_microsecond(stamp: int, away: int) -> None:
    luma = blank()
    time_stripe.write(luma, stamp)
    assert time_stripe.read(luma, stamp + away) == stamp // 1000 * 1000


@given(stamp=time, level=st.integers(0, 255))
def test_it_is_painted_over_and_a_picture_without_one_is_left_as_it_is(
    stamp: int, level: int
) -> None:
    luma = np.full((72, 512), level, np.uint8)
    plain = np.stack([luma, luma, luma], -1)
    time_stripe.write(luma, stamp)
    for seen in (plain.copy(), np.stack([luma, luma, luma], -1)):
        time_stripe.paint_over(seen)
        assert np.array_equal(seen, plain)


@given(stamp=time, block=st.integers(0, 63))
def test_one_wrong_block_is_noticed(stamp: int, block: int) -> None:
    luma = blank()
    time_stripe.write(luma, stamp)
    row, column = divmod(block, time_stripe.COLUMNS)
    at = luma[row * 8 : row * 8 + 8, column * 16 : column * 16 + 16]
    at[:] = 251 - at
    assert time_stripe.read(luma, stamp) is None


@pytest.mark.parametrize("kbit", [60.0, pytest.param(300.0, marks=pytest.mark.slow)])
def test_it_survives_h264_of_a_low_bitrate(kbit: float) -> None:
    av = pytest.importorskip("av")
    from services.camera.io.encoder import VideoEncoder

    sea = SimulatedSea(640, 360, radians(80.0), WaterLight(), 8.0)
    encoder, decoder = VideoEncoder(640, 360), av.CodecContext.create("h264", "r")
    decoder.thread_count, decoder.options = 1, {"flags": "low_delay"}
    hz = min(25.0, kbit / 6.0)
    size = 0
    for k in range(12):
        stamp = 5 * S + round(k * S / hz) + k * k * 7_777_000
        picture = sea.draw(CameraView((0.1 * k, 0.0, 6.0), LEVEL, -0.3, 0.5))
        time_stripe.write(picture.y, stamp)
        data = encoder.encode(picture, stamp, Order(kbit, hz, k == 0))
        size += len(data)
        (frame,) = decoder.decode(av.Packet(data))
        luma = frame.to_ndarray(format="gray")
        assert luma.shape == (360, 640)
        assert time_stripe.read(luma, 0) == stamp // 1000 * 1000
    assert size * 8e-3 < 1.6 * kbit * 12 / hz  # begun with a keyframe


# Where the builtin `sum` counts whole numbers, which are exact.
COUNTING = {
    "messages/events.py",
    "services/link_monitor/core.py",
    "services/recorder/io/mcap_file.py",
    "services/runtime/hosts/registry.py",
    "services/runtime/launch/child.py",
    "services/runtime/node/node.py",
    "services/tether/link_model.py",
    "services/visualizer/curves.py",
    "services/visualizer/status.py",
}
ROOT = Path(services.__path__[0]).parent


@given(st.lists(st.floats(-1e9, 1e9), max_size=50))
def test_it_rounds_after_each_addition(values: list[float]):
    total = 0.0
    for value in values:
        total += value
    assert plain_sum(values) == total


def test_no_service_adds_floats_with_the_builtin_sum():
    for package in (services, messages):
        for path in Path(package.__path__[0]).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            lines = [
                node.lineno
                for node in ast.walk(ast.parse(text if "sum" in text else ""))
                if isinstance(node, ast.Name) and node.id in ("sum", "fsum", "sumprod")
            ]
            name = path.relative_to(ROOT).as_posix()
            assert name in COUNTING or not lines, (
                f"{name}:{lines}: use plain_sum, or count in whole numbers"
            )
