"""What two dives differ in is found: where, when first, and by how much."""

from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.records import Metadata

from tests.support.recorded import ShortDive, rewritten
from tools.__main__ import main
from tools.log.compare import (
    DiveSeries,
    FieldDifference,
    TopicSeries,
    Words,
    differences,
    topic_differences,
)
from tools.log.cut import cut_out
from tools.log.flatten import TableColumn
from tools.recordings.mcap_copy import new_mcap
from tools.recordings.mcap_records import Raw
from tools.recordings.recording import open_recording

COLUMNS = [TableColumn("x", "number"), TableColumn("word", "string")]


def series(values: list[float], words: list[str], known: Words, step_ns: int = 10) -> TopicSeries:
    found = TopicSeries(COLUMNS)
    for n, (value, word) in enumerate(zip(values, words, strict=True)):
        found.add([value, word], n * step_ns, known)
    return found


def found_in(a: TopicSeries, b: TopicSeries, known: Words) -> list[FieldDifference]:
    return list(topic_differences("topic", (a, b), (0, 0), known))


@given(
    st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=30),
    st.data(),
)
def test_the_first_and_the_largest_difference_are_found(
    values: list[float], data: st.DataObject
) -> None:
    added = st.floats(0.0, 10.0) | st.just(0.0)
    by = data.draw(st.lists(added, min_size=len(values), max_size=len(values)))
    other = [value + more for value, more in zip(values, by, strict=True)]
    known, words = Words(), ["a"] * len(values)
    found = found_in(series(values, words, known), series(other, words, known), known)
    moved = [n for n, (a, b) in enumerate(zip(values, other, strict=True)) if a != b]
    if not moved:
        assert not found
        return
    (field,) = found
    assert (field.field, field.first_s) == ("x", moved[0] * 10 / 1e9)
    assert field.largest == max(abs(a - b) for a, b in zip(values, other, strict=True))
    assert field.share == len(moved) / len(values)


def test_words_and_what_is_not_there_differ_too() -> None:
    known = Words()
    a = series([1.0, 2.0], ["here", "here"], known)
    b = series([1.0, float("nan")], ["here", "gone"], known)
    found = {field.field: field for field in found_in(a, b, known)}
    assert (found["word"].a, found["word"].b) == ("here", "gone")
    assert (found["x"].a, found["x"].b) == (2.0, None)


def test_a_line_sampled_at_other_instants_is_the_same_line() -> None:
    known = Words()
    a = series([2.0 * n for n in range(60)], ["w"] * 60, known, step_ns=10)
    b = series([7.0 * 0.2 * n for n in range(60)], ["w"] * 60, known, step_ns=7)
    assert not found_in(a, b, known)


def test_a_dive_is_the_same_as_itself(dive: ShortDive, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["log", "compare", str(dive.folder), str(dive.folder)]) == 0
    assert "all fields of all messages are the same" in capsys.readouterr().out


def test_a_field_that_was_changed_is_named_with_its_time(
    dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:

    def changed(key: str, message: Raw) -> Raw:
        if key != "state" or message.log_ns < 4_000_000_000:
            return message
        data = message.data.replace(b'"phase":"running"', b'"phase":"other"')
        return message._replace(data=data)

    other = rewritten(dive, tmp_path / "b.mcap", changed)
    assert main(["log", "compare", str(dive.folder), str(other), "--json"]) == 1
    found = msgspec.json.decode(capsys.readouterr().out)
    (field,) = found["fields"]
    assert (field["topic"], field["field"]) == ("state", "phase")
    assert (field["a"], field["b"]) == ("running", "other")
    words = Words()
    armed = DiveSeries(open_recording(dive.folder), words).armed_ns
    assert armed is not None
    assert field["first_s"] == pytest.approx((4_000_000_000 - armed) / 1e9, abs=0.011)


def test_a_part_is_the_same_as_its_whole_where_both_are(dive: ShortDive, tmp_path: Path) -> None:
    out = tmp_path / "part.mcap"
    cut_out(open_recording(dive.folder), out, 0.5, 1.5, ("sensor/*",))
    words = Words()
    a, b = (DiveSeries(open_recording(path), words) for path in (out, dive.folder))
    found = differences(a, b)
    assert not found.fields
    assert {each.topic for each in found.counts} >= {"state", "sensor/imu"}


def test_figures_are_side_by_side(
    dive: ShortDive, clean_dive: ShortDive, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["log", "compare", str(dive.folder), str(clean_dive.folder)]) == 1
    said = capsys.readouterr().out
    assert "stick to thruster, median" in said
    assert "pilot/command" in said


def test_dives_of_two_vehicles_are_one_sentence(
    dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other.mcap"
    with new_mcap(other) as copy:
        copy.metadata(Metadata("dive", {"vehicle": "minerva"}))
    assert main(["log", "compare", str(dive.folder), str(other)]) == 1
    said = capsys.readouterr().err
    assert "is of the vehicle my_drone" in said
    assert "of minerva: compare two dives of one vehicle" in said
