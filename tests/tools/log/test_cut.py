"""A part of a recording is a recording: cutting twice is cutting once to what both keep."""

from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from services.recorder.foxglove.channel import is_view
from services.runtime.config.errors import LindyError
from tools.__main__ import main
from tools.log.cut import WantedPart, cut_out
from tools.log.recover import recovered
from tools.recordings.recording import is_whole, open_recording

from .conftest import ShortDive
from .test_recover import foreign

times = st.floats(0.0, 8.0)
patterns = st.sampled_from([(), ("sensor/*", "state"), ("state", "reference", "pilot/*")])


def wanted(spans: tuple[float, float], topics: tuple[str, ...]) -> WantedPart:
    return WantedPart(min(spans), max(spans) + 0.01, topics)


def messages(path: Path) -> list[tuple[str, int, int, int, bytes]]:
    return foreign(path / "dive.mcap" if path.is_dir() else path)


@given(st.tuples(times, times), st.tuples(times, times), patterns)
@settings(max_examples=12)
def test_cut_and_cut_is_cut(
    dive: ShortDive, a: tuple[float, float], b: tuple[float, float], topics: tuple[str, ...]
) -> None:
    first, second = wanted(a, topics), wanted(b, ())
    both = WantedPart(max(first.from_s, second.from_s), min(first.to_s, second.to_s), topics)
    if not both.from_s < both.to_s:
        return
    with TemporaryDirectory() as name:
        folder = Path(name)
        try:
            cut_out(open_recording(dive.folder), folder / "once.mcap", both)
        except LindyError:
            return  # nothing is in it
        cut_out(open_recording(dive.folder), folder / "first.mcap", first)
        cut_out(open_recording(folder / "first.mcap"), folder / "twice.mcap", second)
        assert messages(folder / "once.mcap") == messages(folder / "twice.mcap")


@pytest.mark.slow
@given(st.tuples(times, times))
@settings(max_examples=6)
def test_it_keeps_what_arrived_in_that_time_and_nothing_else(
    dive: ShortDive, span: tuple[float, float]
) -> None:
    recording, part = open_recording(dive.folder), wanted(span, ())
    origin = recording.origin_ns() or 0
    expected = [
        message
        for message in messages(dive.folder)
        if round(part.from_s * 1e9) <= message[1] - origin < round(part.to_s * 1e9)
    ]
    with TemporaryDirectory() as folder:
        out = Path(folder) / "part.mcap"
        if expected:
            drawn = sum(is_view(topic) for topic, *_ in expected)
            assert cut_out(recording, out, part) == len(expected) - drawn
            assert messages(out) == expected


def test_attachments_and_schemas_are_kept_and_the_hash_is_not(
    dive: ShortDive, tmp_path: Path
) -> None:
    out = tmp_path / "part.mcap"
    cut_out(open_recording(dive.folder), out, WantedPart(1.0, 2.0, ("state",)))
    assert is_whole(out)
    with out.open("rb") as part, (dive.folder / "dive.mcap").open("rb") as whole:
        found, before = make_reader(part), make_reader(whole)
        names = [[a.name for a in reader.iter_attachments()] for reader in (found, before)]
        assert names[0] == names[1]
        metadata = {each.name: each.metadata for each in found.iter_metadata()}
        schemas = {schema.data for schema, _, _ in found.iter_messages() if schema is not None}
        assert schemas < {schema.data for schema, _, _ in before.iter_messages() if schema}
    assert "hash" not in metadata
    assert metadata["cut"]["to_s"] == "2.0"


def test_messages_are_counted_as_every_other_verb_counts_them(
    dive: ShortDive, tmp_path: Path
) -> None:
    """Without what is only drawn for Foxglove, which is kept."""
    every, out = messages(dive.folder), tmp_path / "part.mcap"
    drawn = sum(is_view(topic) for topic, *_ in every)
    assert drawn > 0
    assert cut_out(open_recording(dive.folder), out, WantedPart(0.0, inf)) == len(every) - drawn
    assert recovered(dive.folder, tmp_path / "mended.mcap").messages == len(every) - drawn
    assert sum(1 for _ in open_recording(str(out))) == len(every) - drawn


def test_from_beginning_to_end_is_everything(dive: ShortDive, tmp_path: Path) -> None:
    out = tmp_path / "part.mcap"
    cut_out(open_recording(dive.folder), out, WantedPart(0.0, inf))
    assert messages(out) == messages(dive.folder)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--from", "3", "--to", "2"], "expected from before to"),
        (["--from", "-5"], "--from is -5, expected seconds from 0"),
        (["--from", "nan"], "--from is nan, expected seconds from 0"),
        (["--to", "nan"], "--to is nan, expected seconds from 0"),
        (["--from", "1e308"], "holds no such message from 1e+308 s to its end"),
        (["--from", "900"], "holds no such message from 900 s to its end"),
        (["--topics", "sensor/imus"], "did you mean 'sensor/imu'?"),
    ],
)
def test_what_cannot_be_cut_is_one_sentence_and_leaves_no_file(
    dive: ShortDive,
    tmp_path: Path,
    options: list[str],
    said: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "part.mcap"
    assert main(["log", "cut", str(dive.folder), "--out", str(out), *options]) == 1
    assert said in capsys.readouterr().err
    assert not out.exists()
