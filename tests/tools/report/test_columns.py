"""Streams as columns of numbers."""

from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from tests.golden.dives import golden
from tools.recordings.columns import Gathering
from tools.recordings.recording import open_recording
from tools.report.columns import WANTED

NAMES = ("stamp", "value", "flag")
ROWS = st.lists(
    st.tuples(st.integers(-9, 9), st.none() | st.floats(-1e3, 1e3), st.booleans()), max_size=40
)


@given(ROWS)
def test_every_column_is_in_the_order_of_the_first_and_none_is_nan(rows: list[Any]) -> None:
    gathering = Gathering(NAMES, lambda row: row)
    for row in rows:
        gathering.add(row)
    found = gathering.columns()
    whole = np.array(rows, dtype=np.float64).reshape(-1, len(NAMES))  # None becomes NaN
    expected = whole[np.argsort(whole[:, 0], kind="stable")]
    assert found.count == len(rows)
    for place, name in enumerate(NAMES):
        assert np.array_equal(found[name], expected[:, place], equal_nan=True)


@pytest.mark.parametrize("key", [topics.STATE.key, topics.REFERENCE.key])
def test_of_a_message_that_is_decoded_in_part_the_figures_are_the_same(key: str) -> None:
    (wanted,) = (each for each in WANTED if each.topic.key == key)
    (raw, *_) = (raw for raw in open_recording(golden("pioneer")).raw() if raw.key == key)
    part = msgspec.json.decode(raw.data, type=wanted.message)
    whole = msgspec.json.decode(raw.data, type=wanted.topic.message)
    assert wanted.figures(part) == wanted.figures(whole)
    assert len(msgspec.structs.fields(part)) < len(msgspec.structs.fields(whole))
