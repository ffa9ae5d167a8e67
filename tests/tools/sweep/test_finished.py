"""Finished dives are never lost, and nothing that is not of the sweep is touched."""

import errno
import json
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.runtime.config.errors import LindyError
from tools.sweep.finished import About, FinishedDives, rows_file
from tools.sweep.rows import Row

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
