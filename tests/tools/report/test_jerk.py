"""Spectra of the jerk: their laws, and a dive whose figures are known; streams as columns of
numbers."""

from math import pi, sqrt
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.topic import AnyTopic
from tests.golden.dives import golden
from tools.analysis.dive import WANTED, RecordedDive
from tools.analysis.spectra import (
    BAND,
    RATE,
    Smoothness,
    jerk_spectrum,
    smoothness,
    spectrum,
    thruster_changes,
)
from tools.recordings.columns import ARRIVAL, Array, Gathering, StreamColumns, StreamFigures
from tools.recordings.recording import open_recording

SECOND = 1e9  # [ns]


def noise(count: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).normal(size=count)


@settings(max_examples=20)
@given(st.integers(16, 300), st.integers(0, 99))
def test_one_segment_keeps_the_energy_of_its_window(count: int, seed: int) -> None:
    """Parseval's theorem, for odd and even lengths."""
    values = noise(count, seed)
    window = np.sin(pi * np.arange(count) / count) ** 2
    windowed = window * (values - values.mean())
    found = spectrum(values, RATE, count)
    assert found.rms() ** 2 == pytest.approx(np.sum(windowed**2) / np.sum(window**2))


def test_the_whole_of_a_spectrum_is_the_variance() -> None:
    values = noise(200_000)
    assert spectrum(values, RATE).rms() == pytest.approx(1.0, rel=0.01)
    assert spectrum(values, RATE).rms(below=RATE / 4) == pytest.approx(sqrt(0.5), rel=0.02)


@settings(max_examples=20)
@given(st.floats(0.01, 100.0), st.floats(-50.0, 50.0))
def test_a_spectrum_scales_with_the_square_and_knows_no_offset(
    factor: float, offset: float
) -> None:
    values = noise(2000)
    one, other = spectrum(values, RATE), spectrum(factor * values + offset, RATE)
    assert np.allclose(other.density, factor**2 * one.density, rtol=1e-6, atol=1e-9 * factor**2)


@pytest.mark.parametrize("hertz", [0.3, 0.7, 1.5])
def test_a_sine_has_the_jerk_that_is_known(hertz: float) -> None:
    t = np.arange(0.0, 60.0, 1.0 / RATE)
    size = 0.4  # [m/s²]
    found = jerk_spectrum(size * np.sin(2 * pi * hertz * t))
    assert found.rms(BAND) == pytest.approx(size * 2 * pi * hertz / sqrt(2), rel=0.03)


def dive(t: Array, felt: Array, wanted: Array, thrust: Array) -> RecordedDive:
    """Heave and yaw alike. `thrust`: (n, thrusters)."""
    stamps: Array = t * SECOND
    zero: Array = 0.0 * t
    turned = np.cumsum(felt) / RATE  # so that the yaw acceleration is `felt`
    weights = np.array([2.0**k for k in range(thrust.shape[1])])
    ahead, astern = [turns.astype(np.float64) @ weights for turns in (thrust > 0.0, thrust < 0.0)]
    columns: dict[AnyTopic, dict[str, Array]] = {
        topics.REFERENCE: {
            "valid_ns": stamps, "stamp_ns": stamps, "armed": zero + 1.0,
            "depth.acceleration": wanted, "heading.acceleration": wanted,
        },
        topics.STATE: {
            "sensor_ns": stamps, "depth_acceleration.value": felt, "yaw_rate.value": turned,
        },
        topics.THRUSTERS: {
            "stamp_ns": stamps, "count": zero + thrust.shape[1], "ahead": ahead, "astern": astern,
        },
    }  # fmt: skip
    streams = {topic.key: StreamColumns(named) for topic, named in columns.items()}
    return RecordedDive({}, {}, streams)


def test_a_vehicle_on_its_reference_feels_its_jerk_and_no_other() -> None:
    t = np.arange(0.0, 40.0, 1.0 / RATE)
    wanted = 0.3 * np.sin(2 * pi * 0.5 * t)
    found = smoothness(dive(t, 1.5 * wanted, wanted, np.zeros((len(t), 1))))
    assert found.heave is not None
    assert found.yaw is not None
    assert found.heave.ratio == pytest.approx(1.5)
    assert found.yaw.ratio == pytest.approx(1.5, rel=0.01)
    assert found.heave.reference == pytest.approx(0.3 * pi / sqrt(2), rel=0.03)


def test_a_reference_at_rest_has_no_ratio_and_a_short_dive_no_spectrum() -> None:
    t = np.arange(0.0, 20.0, 1.0 / RATE)
    found = smoothness(dive(t, noise(len(t)), np.zeros_like(t), np.zeros((len(t), 1))))
    assert found.heave is not None
    assert found.heave.ratio is None
    assert found.heave.felt > 0.0
    short = smoothness(dive(t[:50], t[:50], t[:50], np.zeros((50, 1))))
    assert short.heave is None
    assert short.yaw is None


def test_starts_and_reversals_are_counted_for_each_thruster() -> None:
    first = [0, 1, 1, 0, 1, 0, -1, 0, 0, -1, 1, 0]  # starts: 1, 4, 6, 9; reversals: 6, 10
    second = [1] * 12  # from the beginning on
    t = np.arange(0.0, 5.0 * len(first), 5.0)  # [s]
    found = dive(t, t, t, np.array([first, second], np.float64).T)
    starts, reversals = thruster_changes(found)
    minutes = t[-1] / 60.0
    assert starts == pytest.approx([4 / minutes, 0.0], abs=0.01)
    assert reversals == pytest.approx([2 / minutes, 0.0], abs=0.01)
    assert msgspec.json.decode(msgspec.json.encode(smoothness(found)), type=Smoothness)


ROWS = st.lists(
    st.tuples(st.integers(-9, 9), st.none() | st.floats(-1e3, 1e3), st.integers(0, 9)), max_size=40
)
HOLDS = StreamFigures(topics.STATE, ("sensor_ns", "depth.value", "name", "gone.value"))


def said(at: int, value: float | None, name: int) -> Any:
    depth = SimpleNamespace(value=value)
    return SimpleNamespace(sensor_ns=at, depth=depth, name=f"n{name}", gone=None)


@given(ROWS, st.integers(-5, 10**15))
def test_every_column_is_in_the_order_of_the_first_and_none_is_nan(
    rows: list[Any], origin: int
) -> None:
    gathering = Gathering(HOLDS)
    for row in rows:
        gathering.add(said(row[0] + origin, *row[1:]), 7)
    found = gathering.columns(origin)
    whole = np.array(rows, dtype=np.float64).reshape(-1, 3)  # None becomes NaN
    expected = whole[np.argsort(whole[:, 0], kind="stable")]
    assert found.count == len(rows)
    assert np.array_equal(found["sensor_ns"], expected[:, 0])
    assert np.array_equal(found["depth.value"], expected[:, 1], equal_nan=True)
    assert found.said("name", "n3", "n4").tolist() == [row[2] in (3, 4) for row in expected]
    assert np.isnan(found["gone.value"]).all()
    assert np.all(found[ARRIVAL] == 7.0)


@pytest.mark.parametrize("key", [topics.STATE.key, topics.REFERENCE.key])
def test_of_a_message_that_is_decoded_in_part_the_figures_are_the_same(key: str) -> None:
    (wanted,) = (each for each in WANTED if each.topic.key == key)
    (raw, *_) = (raw for raw in open_recording(golden("pioneer")).raw() if raw.key == key)
    columns: list[StreamColumns] = []
    for kind in (wanted.message, wanted.topic.message):
        gathering = Gathering(wanted)
        gathering.add(msgspec.json.decode(raw.data, type=kind))
        columns.append(gathering.columns())
    part, whole = columns
    for name in wanted.fields:
        assert np.array_equal(part[name], whole[name], equal_nan=True)
    fields = msgspec.structs.fields
    assert len(fields(wanted.message)) < len(fields(wanted.topic.message))
