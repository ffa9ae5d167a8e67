"""Columns of a long dive wait on disk, and are the same as in memory."""

import errno
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from tests.golden.dives import golden
from tools.recordings.recording import open_recording
from tools.report import columns
from tools.report.columns import WANTED, Array, Gathering, StreamColumns

NAMES = ("stamp", "value", "flag")
ROWS = st.lists(
    st.tuples(st.integers(-9, 9), st.none() | st.floats(-1e3, 1e3), st.booleans()), max_size=40
)


def gathered(rows: list[Any], block: int) -> StreamColumns:
    gathering = Gathering(NAMES, lambda row: row, block)
    for row in rows:
        gathering.add(row)
    return gathering.columns()


def in_memory(rows: list[Any]) -> Array:
    whole = np.array(rows, dtype=np.float64).reshape(-1, len(NAMES))  # None becomes NaN
    return whole[np.argsort(whole[:, 0], kind="stable")]


@given(ROWS, st.integers(1, 50), st.integers(0, 45), st.integers(0, 45))
def test_every_column_and_part_is_what_it_would_be_in_memory(
    rows: list[Any], block: int, first: int, last: int
) -> None:
    found, expected = gathered(rows, block), in_memory(rows)
    assert found.count == len(rows)
    for place, name in enumerate(NAMES):
        assert np.array_equal(found[name], expected[:, place], equal_nan=True)
        part = found.part(name, first, last)
        assert np.array_equal(part, expected[first:last, place], equal_nan=True)


@given(ROWS, st.integers(1, 50))
def test_the_parts_of_a_column_are_all_of_it(rows: list[Any], block: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(columns, "BLOCK", block)
        parts = list(gathered(rows, 7).parts("stamp", "value"))
    assert np.array_equal(np.concatenate([stamp for stamp, _ in parts]), in_memory(rows)[:, 0])
    assert all(len(stamp) == len(value) <= block for stamp, value in parts)


def test_where_the_disk_is_full_they_stay_in_memory_and_it_is_said_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [(k, k / 3.0, k % 2) for k in range(20)]
    whole, written = columns.write_at, list[int]()

    def full(file: Any, position: int, data: bytes) -> None:
        if len(written) == 2:
            raise OSError(errno.ENOSPC, "no space left")
        written.append(position)
        whole(file, position, data)

    monkeypatch.setattr(columns, "write_at", full)
    columns._say_in_memory.cache_clear()  # pyright: ignore[reportPrivateUsage]
    found = gathered(rows, 4)
    assert len(written) == 2
    said = "lindy: cannot write a temporary file: the disk is full; figures are kept in memory, "
    assert capsys.readouterr().err == f"{said}and TMPDIR names another folder for them\n"
    assert np.array_equal(found["value"], in_memory(rows)[:, 1])


@pytest.mark.parametrize("key", [topics.STATE.key, topics.REFERENCE.key])
def test_of_a_message_that_is_decoded_in_part_the_figures_are_the_same(key: str) -> None:
    (wanted,) = (each for each in WANTED if each.topic.key == key)
    (raw, *_) = (raw for raw in open_recording(golden("pioneer")).raw() if raw.key == key)
    part = msgspec.json.decode(raw.data, type=wanted.message)
    whole = msgspec.json.decode(raw.data, type=wanted.topic.message)
    assert wanted.figures(part) == wanted.figures(whole)
    assert len(msgspec.structs.fields(part)) < len(msgspec.structs.fields(whole))
