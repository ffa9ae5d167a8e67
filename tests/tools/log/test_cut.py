"""A part of a recording is a recording, by times or by the number of the dive in it."""

from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from messages.vehicle import VehicleStatus
from services.recorder.foxglove.channel import is_view
from services.runtime.config.errors import LindyError
from tests.support.recorded import ShortDive, foreign, rewritten
from tools.__main__ import main
from tools.log.cut import ArmedSpan, ArmedSpans, armed_spans, around, cut_out, recovered
from tools.recordings.mcap_records import Raw
from tools.recordings.recording import is_whole, open_recording

times = st.floats(0.0, 8.0)
patterns = st.sampled_from([(), ("sensor/*", "state"), ("state", "reference", "pilot/*")])


def wanted(spans: tuple[float, float]) -> tuple[float, float]:
    """[s] From, and to."""
    return min(spans), max(spans) + 0.01


def messages(path: Path) -> list[tuple[str, int, int, int, bytes]]:
    return foreign(path / "dive.mcap" if path.is_dir() else path)


@given(st.tuples(times, times), st.tuples(times, times), patterns)
@settings(max_examples=12)
def test_cut_and_cut_is_cut(
    dive: ShortDive, a: tuple[float, float], b: tuple[float, float], topics: tuple[str, ...]
) -> None:
    first, second = wanted(a), wanted(b)
    both = max(first[0], second[0]), min(first[1], second[1])
    if not both[0] < both[1]:
        return
    with TemporaryDirectory() as name:
        folder = Path(name)
        try:
            cut_out(open_recording(dive.folder), folder / "once.mcap", *both, topics)
        except LindyError:
            return  # nothing is in it
        cut_out(open_recording(dive.folder), folder / "first.mcap", *first, topics)
        cut_out(open_recording(folder / "first.mcap"), folder / "twice.mcap", *second)
        assert messages(folder / "once.mcap") == messages(folder / "twice.mcap")


@pytest.mark.slow
@given(st.tuples(times, times))
@settings(max_examples=6)
def test_it_keeps_what_arrived_in_that_time_and_nothing_else(
    dive: ShortDive, span: tuple[float, float]
) -> None:
    recording, part = open_recording(dive.folder), wanted(span)
    origin = recording.origin_ns() or 0
    expected = [
        message
        for message in messages(dive.folder)
        if round(part[0] * 1e9) <= message[1] - origin < round(part[1] * 1e9)
    ]
    with TemporaryDirectory() as folder:
        out = Path(folder) / "part.mcap"
        if expected:
            drawn = sum(is_view(topic) for topic, *_ in expected)
            assert cut_out(recording, out, *part) == len(expected) - drawn
            assert messages(out) == expected


def test_attachments_and_schemas_are_kept_and_the_hash_is_not(
    dive: ShortDive, tmp_path: Path
) -> None:
    out = tmp_path / "part.mcap"
    cut_out(open_recording(dive.folder), out, 1.0, 2.0, ("state",))
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
    assert cut_out(open_recording(dive.folder), out, 0.0, inf) == len(every) - drawn
    assert recovered(dive.folder, tmp_path / "mended.mcap").messages == len(every) - drawn
    assert sum(1 for _ in open_recording(str(out))) == len(every) - drawn


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


Heard = list[tuple[float, VehicleStatus]]


@st.composite
def heard(draw: st.DrawFn) -> Heard:
    """Statuses with the times of their arrival, up to 20 s apart: a drone may not be heard."""
    t, found = 0.0, list[tuple[float, VehicleStatus]]()
    for armed, step in draw(st.lists(st.tuples(st.booleans(), st.floats(0.01, 20.0)), max_size=40)):
        t += step
        found.append((t, VehicleStatus(stamp_ns=round(t * 1e9), activity="ready", armed=armed)))
    return found


def spans_of(statuses: Heard) -> list[ArmedSpan]:
    spans = ArmedSpans()
    for t, status in statuses:
        spans.see(status, t)
    return spans.found


@given(heard())
def test_each_dive_that_is_cut_out_is_the_only_one_and_whole(statuses: Heard) -> None:
    spans = spans_of(statuses)
    assert [s.ended for s in spans[:-1]] == [True] * len(spans[:-1])
    assert sum(status.armed for _, status in statuses) >= len(spans)
    for number, span in enumerate(spans, start=1):
        from_s, to_s = around(spans, number, "here")
        assert 0.0 <= from_s <= span.from_s <= span.to_s < to_s
        assert span.from_s - from_s <= 5.0
        assert span.ended == (to_s < inf) or to_s - span.to_s <= 5.0
        part = [(t, status) for t, status in statuses if from_s <= t < to_s]
        assert spans_of(part) == [span]


@given(heard(), st.data())
def test_what_a_link_delivers_late_or_twice_makes_no_dive(
    statuses: Heard, data: st.DataObject
) -> None:
    arrivals = Heard()
    for number, (t, status) in enumerate(statuses):
        arrivals.append((t, status))
        if (back := data.draw(st.integers(0, 3))) <= number:
            earlier = statuses[number - back][1]
            if t - earlier.stamp_ns / 1e9 < 9.9:
                arrivals.append((t, earlier))
    assert spans_of(arrivals) == spans_of(statuses)


def test_a_drone_that_was_started_again_is_believed_though_its_clock_begins_anew() -> None:
    spans = ArmedSpans()
    for t, stamp_s, armed in [(0.0, 900, True), (1.0, 901, True), (60.0, 12, False)]:
        spans.see(VehicleStatus(stamp_ns=stamp_s * 10**9, activity="ready", armed=armed), t)
    assert spans.found == [ArmedSpan(0.0, 60.0, ended=True)]


@pytest.fixture(scope="module")
def two_dives(dive: ShortDive, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The short dive, as if it had been disarmed in the middle of its armed time."""
    (whole,) = armed_spans(open_recording(dive.folder))
    origin = open_recording(dive.folder).origin_ns() or 0
    third = whole.seconds / 3.0

    def disarmed(_: str, message: Raw) -> Raw:
        t = (message.log_ns - origin) / 1e9 - whole.from_s
        if not third < t < 2.0 * third:
            return message
        return message._replace(data=message.data.replace(b'"armed":true', b'"armed":false'))

    return rewritten(dive, tmp_path_factory.mktemp("two") / "dive.mcap", disarmed)


@pytest.mark.parametrize("number", [1, 2])
def test_a_dive_cut_by_its_number_is_a_recording_like_any_other(
    two_dives: Path, number: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["log", "info", str(two_dives), "--json"]) == 0
    dives = msgspec.json.decode(capsys.readouterr().out)["dives"]
    assert len(dives) == 2
    out = tmp_path / "cut.mcap"
    assert main(["log", "cut", str(two_dives), "--number", str(number), "--out", str(out)]) == 0
    for verb in ("check", "info"):
        assert main(["log", verb, str(out)]) == 0
    capsys.readouterr()
    assert main(["log", "info", str(out), "--json"]) == 0
    assert msgspec.json.decode(capsys.readouterr().out)["dives"] == [dives[number - 1]]
    assert main(["log", "compare", str(out), str(out)]) == 0  # what it reports of the dive


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--number", "3"], "there are 2 dives (1: "),
        (["--number", "0"], "there are 2 dives (1: "),
        (["--number", "-1"], "there are 2 dives (1: "),
        (["--number", "1", "--from", "2"], "leave out --from and --to"),
        (["--number", "1", "--to", "nan"], "leave out --from and --to"),
    ],
)
def test_a_number_that_is_not_there_is_one_sentence(
    two_dives: Path,
    tmp_path: Path,
    options: list[str],
    said: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "cut.mcap"
    assert main(["log", "cut", str(two_dives), "--out", str(out), *options]) == 1
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not out.exists()


@given(heard(), st.floats(0.0, 1000.0))
def test_who_is_armed_last_is_so_to_the_end_of_the_recording(statuses: Heard, after: float) -> None:
    spans, end = ArmedSpans(), after + (statuses[-1][0] if statuses else 0.0)
    for t, status in statuses:
        spans.see(status, t)
    ended = [span for span in spans.found if span.ended]
    found = spans.until(end)
    assert [span for span in found if span.ended] == ended
    assert [span.to_s for span in found if not span.ended] == [end] * (len(found) - len(ended))
