"""The sticks of a dive that a script flew are that script, to the nanosecond."""

from math import radians
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from messages.link import LinkRequest
from messages.pilot import Course, PilotRequest, RequestKind
from messages.simulator import FaultRequest
from services.gamepad.io.path_file import course_named, course_of
from services.gamepad.stick_log import StickLogRow, parse
from services.piloting.pilot_intents import OutputIntent
from services.piloting.sticks import CENTRED, Sticks
from tests.support.recorded import ShortDive
from tools.__main__ import main
from tools.log.sticks import RecordedSticks, RequestEvents, SticksRow, as_csv, in_degrees, sticks_of
from tools.recordings.recording import open_recording


def rows(text: str, folder: Path) -> tuple[StickLogRow, ...]:
    """A stick log, its paths read."""

    def course(name: str) -> Course:
        return course_of(folder / Path(name).name)

    return parse(text.encode(), course).rows


def test_they_are_the_script(clean_dive: ShortDive, tmp_path: Path) -> None:
    found = sticks_of(open_recording(clean_dive.folder))
    assert not found.remarks
    (name,) = found.paths
    (tmp_path / name).write_text(found.paths[name])
    again = rows(as_csv(found, "again"), tmp_path)
    (tmp_path / "box.toml").write_text(found.paths[name])
    assert again == rows(clean_dive.script, tmp_path)


def test_the_verb_writes_a_stick_log_and_its_path_and_overwrites_nothing(
    clean_dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "again.csv"
    assert main(["log", "export", "--as", "sticks", str(clean_dive.folder), "--out", str(out)]) == 0
    assert f"follow {tmp_path}/again_path1.toml" in out.read_text()
    assert course_of(tmp_path / "again_path1.toml").min_radius > 0.0
    before = out.read_bytes()
    assert main(["log", "export", "--as", "sticks", str(clean_dive.folder), "--out", str(out)]) == 1
    assert "it exists already" in capsys.readouterr().err
    assert out.read_bytes() == before


def test_without_a_name_it_is_the_next_that_is_free_beside_the_recording(
    clean_dive: ShortDive, tmp_path: Path
) -> None:
    """As tables have it; a dive with a viewer has a dive.rrd, too."""
    path = tmp_path / "dive.mcap"
    path.symlink_to(clean_dive.folder / "dive.mcap")
    for kind in ("sticks", "trace") * 2:
        assert main(["log", "export", "--as", kind, str(path)]) == 0
    names = {"sticks.csv", "sticks-2.csv", "trace.csv", "trace-2.csv"}
    assert names <= {each.name for each in tmp_path.iterdir()}


@given(st.integers(-36_000, 36_000).map(lambda hundredths: hundredths / 100.0))
def test_a_heading_comes_back_as_it_was_written(heading: float) -> None:
    assert float(in_degrees(radians(heading))) == heading


travel = st.floats(-1.0, 1.0)
tool_events = st.sampled_from(["", "light", "output lasers 1.0", "output light 0.25"])


@given(st.lists(st.tuples(st.builds(Sticks, *[travel] * 6), tool_events), min_size=2, max_size=6))
def test_tools_are_read_as_they_were_written(flown: list[tuple[Sticks, str]]) -> None:
    rows_in = [SticksRow(k * 10**9, *each) for k, each in enumerate(flown)]
    text = as_csv(RecordedSticks(rows_in, {}, "", []), "tools")
    back = parse(text.encode(), course_named).rows
    assert [row.sticks for row in back] == [sticks for sticks, _ in flown]
    named = {"output lasers 1.0": OutputIntent("lasers", 1.0), "": None,
             "output light 0.25": OutputIntent("light", 0.25)}  # fmt: skip
    assert [row.event for row in back] == [named.get(event, event) for _, event in flown]


def test_a_request_for_an_output_is_an_event() -> None:
    def event(kind: RequestKind, value: float, output: str = "") -> str:
        request = PilotRequest(stamp_ns=0, id="1", kind=kind, value=value, output=output)
        return RequestEvents("", []).of(request)

    assert event("output", 1.0, "lasers") == "output lasers 1.0"
    assert event("light", 0.25) == "output light 0.25"
    assert event("light", 1.0) == "light"


@given(name=st.text(max_size=60), settings=st.lists(st.text(max_size=60), max_size=3))
@example(name="lights\n2,1,1,1,1,0,", settings=[])
@example(name="x\x85y", settings=["up.delay_ms=1,2"])
def test_no_name_of_a_stranger_becomes_a_row_of_the_script(name: str, settings: list[str]) -> None:
    remarks: list[str] = []
    events = RequestEvents("", remarks)
    requests = (
        PilotRequest(stamp_ns=0, id="", kind="output", output=name, value=1.0),
        FaultRequest(stamp_ns=0, id="", part=name, fault="dead"),
        LinkRequest(stamp_ns=0, id="", kind="profile", profile=name),
        LinkRequest(stamp_ns=0, id="", kind="set", settings=tuple(settings)),
    )
    said = [events.of(request) for request in requests]
    csv = [SticksRow(n, CENTRED, event) for n, event in enumerate([*said, ""])]
    text = as_csv(RecordedSticks(csv, {}, name, remarks), f"the sticks of {name}")
    times = ["0", *(f"0.00000000{n}" for n in range(1, 5))]
    assert [line.partition(",")[0] for line in text.splitlines()[2:]] == times
