"""Streams as columns of numbers."""

from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from tests.golden.dives import golden
from tools.analysis.dive import WANTED
from tools.recordings.columns import ARRIVAL, Gathering, StreamColumns, StreamFigures
from tools.recordings.recording import open_recording

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
