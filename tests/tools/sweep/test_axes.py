"""Axes of a sweep, and its finished dives, which are never lost."""

import errno
import json
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.runtime.config.errors import LindyError
from tools.sweep.axes import SweepAxes, axes
from tools.sweep.rows import About, FinishedDives, Row, rows_file


def read(**options: str) -> SweepAxes:
    given = {name: [text] for name, text in options.items()}
    defaults = {"vehicle": ["pioneer"], "link": ["tether"], "pilot": ["script:a"], "seed": ["0"]}
    return axes(**{"settings": [], **defaults, **given})


words = st.text("abcxyz_0123456789.-", min_size=1, max_size=6)
several = st.lists(words, min_size=1, max_size=4, unique=True)


@given(several, several, several, st.integers(0, 50), st.integers(1, 9))
def test_a_sweep_is_the_product_of_its_axes(
    vehicles: list[str], links: list[str], gains: list[str], first: int, many: int
):
    found = read(
        vehicle=",".join(vehicles),
        link=" , ".join(links),
        settings=f"control.depth.kp={','.join(gains)}",
        seed=f"{first}..{first + many - 1}",
    )
    dives = list(found.dives())
    assert len(dives) == found.count == len(vehicles) * len(links) * len(gains) * many
    assert [dive.number for dive in dives] == list(range(found.count))
    assert len({(dive.combination, dive.seed) for dive in dives}) == found.count
    assert {dive.combination.vehicle for dive in dives} == set(vehicles)
    assert {dive.combination.link for dive in dives} == set(links)
    assert {dive.seed for dive in dives} == set(range(first, first + many))
    wanted = {(f"control.depth.kp={gain}",) for gain in gains}
    assert {dive.combination.settings for dive in dives} == wanted


def test_a_comma_inside_brackets_or_quotes_is_part_of_a_value():
    found = read(settings="pd_control.depth=[80, 70],[60, 65]")
    assert found.settings == {"pd_control.depth": ("[80, 70]", "[60, 65]")}
    assert read(settings="a.b='x,y',z").settings == {"a.b": ("'x,y'", "z")}


def test_seeds_are_ranges_and_single_ones_in_the_order_given():
    assert read(seed="5..7,1,9").seed == (5, 6, 7, 1, 9)


def test_an_option_may_be_given_several_times():
    found = axes(
        ["pioneer"], ["tether", "severe,remote"], ["script:a"], ["a.b=1", "a.c=2,3"], ["0"]
    )
    assert found.link == ("tether", "severe", "remote")
    assert found.settings == {"a.b": ("1",), "a.c": ("2", "3")}
    assert found.varied == ["link", "a.c"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"link": ""}, "--link : a value is empty"),
        ({"link": "tether,,severe"}, "--link tether,,severe: a value is empty"),
        ({"vehicle": "pioneer,pioneer"}, "--vehicle names pioneer twice"),
        ({"settings": "control.depth.kp"}, "expected key.path=value"),
        ({"settings": "=3"}, "expected key.path=value"),
        ({"settings": "a.b=1,1"}, "--set a.b= names 1 twice"),
        ({"settings": "a.b="}, "a value is empty"),
        ({"seed": "9..1"}, "--seed 9..1 goes backwards; write 1..9"),
        ({"seed": "1..3,2"}, "--seed names 2 twice"),
        ({"seed": "one"}, "--seed 'one': expected whole numbers"),
        ({"seed": "-1"}, "--seed '-1': expected whole numbers"),
        ({"seed": "1.5"}, "--seed '1.5': expected whole numbers"),
        ({"seed": ""}, "--seed '': expected whole numbers"),
        ({"seed": "1..999999999999"}, "makes 999999999999 dives"),
        (
            {"seed": "1..600000", "link": "a,b"},
            "these axes make 1200000 dives; the most is 1000000",
        ),
    ],
)
def test_a_mistake_is_one_sentence(options: dict[str, str], says: str):
    with pytest.raises(LindyError) as error:
        read(**options)
    assert says in str(error.value)


ABOUT: About = {"stack": "simulated", "--seed": [1, 2, 3], "files": {"a": "12"}}


def row(number: int) -> Row:
    return {"dive": number, "end": "clean", "note": "ü"}


@pytest.fixture
def table(tmp_path: Path) -> Path:
    return tmp_path / "new" / "x.csv"


def test_rows_are_there_again_when_the_sweep_goes_on(table: Path):
    with closing(FinishedDives(table, ABOUT)) as finished:
        finished.add(row(2))
        finished.replace_table(b"first")
        finished.add(row(0))
    with closing(FinishedDives(table, ABOUT)) as finished:
        assert finished.rows == {2: row(2), 0: row(0)}
        finished.replace_table(b"second")
    assert table.read_bytes() == b"second"
    with closing(FinishedDives(table, ABOUT)) as finished:
        assert len(finished.rows) == 2
    assert sorted(path.name for path in table.parent.iterdir()) == ["x.csv", "x.csv.rows.jsonl"]


@given(st.integers(0, 10_000))
def test_wherever_a_kill_cuts_a_row_those_before_it_stay(
    tmp_path_factory: pytest.TempPathFactory, cut: int
):
    table = tmp_path_factory.mktemp("cut") / "x.csv"
    with closing(FinishedDives(table, ABOUT)) as finished:
        begun = rows_file(table).stat().st_size
        for number in range(3):
            finished.add(row(number))
    data = rows_file(table).read_bytes()
    kept = begun + cut % (len(data) - begun + 1)
    rows_file(table).write_bytes(data[:kept])
    whole = data[begun:kept].count(b"\n")
    with closing(FinishedDives(table, ABOUT)) as finished:
        assert sorted(finished.rows) == list(range(whole))
        finished.add(row(7))
    with closing(FinishedDives(table, ABOUT)) as finished:
        assert sorted(finished.rows) == [*range(whole), 7]


def refused(table: Path, about: About = ABOUT) -> str:
    before = {path: path.read_bytes() for path in table.parent.iterdir()}
    with pytest.raises(LindyError) as error:
        FinishedDives(table, about)
    assert {path: path.read_bytes() for path in table.parent.iterdir()} == before
    return str(error.value)


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"stack": "mine"}, 'stack is "simulated" there and "mine" here'),
        ({"--seed": [1, 2]}, "--seed is [1, 2, 3] there and [1, 2] here"),
        ({"files": {"a": "13"}}, 'files is {"a": "12"} there and {"a": "13"} here'),
        ({"more": 1}, "more is not given there and 1 here"),
    ],
)
def test_another_sweep_is_refused_by_what_differs(table: Path, changed: About, says: str):
    FinishedDives(table, ABOUT).close()
    assert says in refused(table, {**ABOUT, **changed})


def test_a_table_that_is_not_the_sweeps_is_left_alone(table: Path):
    table.parent.mkdir()
    table.write_text("mine")
    assert "it exists already" in refused(table)


def test_a_file_that_is_not_a_sweeps_is_left_alone(table: Path):
    table.parent.mkdir()
    for text in ("", "mine", "mine\n", '{"dive": 1}\n', "[1]\n"):
        rows_file(table).write_text(text)
        assert "is not the file of a sweep" in refused(table)
    about = json.dumps({"lindy sweep": 1, **ABOUT})
    rows_file(table).write_text(f'{about}\n{{"dive": 0}}\nmine\n{{"dive": 1}}\n')
    assert ":3: this is not the row of a dive" in refused(table)


def test_two_sweeps_do_not_write_to_the_same_file(table: Path):
    with closing(FinishedDives(table, ABOUT)):
        assert "another lindy sweep is at work" in refused(table)


def test_a_full_disk_keeps_the_rows_before(table: Path, monkeypatch: pytest.MonkeyPatch):
    finished = FinishedDives(table, ABOUT)
    finished.add(row(0))
    file = finished._file  # pyright: ignore[reportPrivateUsage]

    class Full:
        """Takes five bytes more."""

        flush, close = file.flush, file.close

        def write(self, data: bytes) -> int:
            file.write(data[:5])
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(finished, "_file", Full())
    with pytest.raises(LindyError, match="the disk is full"):
        finished.add(row(1))
    assert sorted(finished.rows) == [0]
    finished.close()
    with closing(FinishedDives(table, ABOUT)) as again:
        assert sorted(again.rows) == [0]


def test_a_table_that_cannot_be_written_is_named_and_the_rows_are_safe(
    table: Path, monkeypatch: pytest.MonkeyPatch
):
    def full(_from: Path, _to: Path) -> None:
        raise OSError(errno.ENOSPC, "full")

    with closing(FinishedDives(table, ABOUT)) as finished:
        finished.add(row(0))
        monkeypatch.setattr(Path, "replace", full)
        with pytest.raises(LindyError) as error:
            finished.replace_table(b"table")
    assert f"cannot write {table}: the disk is full; all finished dives are safe in" in str(
        error.value
    )
    assert [path.name for path in table.parent.iterdir()] == ["x.csv.rows.jsonl"]
