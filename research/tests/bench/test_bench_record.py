"""What is kept of a benchmark, and when a figure is worse than the last."""

import json
import sys
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lindy_research.bench import SECTIONS
from lindy_research.bench import __main__ as bench
from lindy_research.bench.record import (
    BEGIN,
    END,
    QUIET,
    KeptFigure,
    compare,
    cores_at_work,
    kept,
    noisier,
    with_table,
    worse,
)
from lindy_research.bench.table import Figure

ratios = st.floats(1e-3, 1e3)
noises = st.floats(0.0, 1e3)
OPPOSITE = {"better": "worse", "worse": "better", "same": "same"}


def figure(ratio: float, section: str = "a", name: str = "time") -> Figure:
    return Figure(
        section=section, name=name, unit="ms", ours=ratio, baseline_name="one", baseline=1.0, goal=1
    )


def of(*found: float, others: float = 0.0, machine: str = "m") -> list[KeptFigure]:
    return kept([[figure(ratio)] for ratio in found], others, machine)


@given(ratios, ratios, noises)
def test_seen_from_the_other_side_worse_is_better(old: float, new: float, noise: float) -> None:
    assert compare(new, old, noise) == OPPOSITE[compare(old, new, noise)]
    assert compare(old, old, noise) == "same"


@given(st.lists(ratios, min_size=1, max_size=7))
def test_the_figure_of_several_runs_is_one_of_them_and_all_are_within_its_noise(
    found: list[float],
) -> None:
    (one,) = of(*found)
    assert one.ratio in found
    assert one.runs == len(found)
    assert max(found) - min(found) == one.noise
    assert sum(ratio <= one.ratio for ratio in found) * 2 >= len(found)
    assert sum(ratio >= one.ratio for ratio in found) * 2 >= len(found)


def test_only_quiet_figures_of_the_same_machine_are_judged() -> None:
    last = of(1.0, 1.1)
    assert worse(last, of(1.3, 1.4)) == [(last[0], of(1.3, 1.4)[0])]
    assert worse(last, of(1.15, 1.2)) == []  # within the noise of both
    assert worse(last, of(1.3, 1.4, others=2 * QUIET)) == []
    assert worse(of(1.0, 1.1, others=2 * QUIET), of(1.3, 1.4)) == []
    assert worse(last, of(1.3, 1.4, machine="other")) == []
    assert worse(of(1.0), of(9.0)) == worse(last, of(9.0)) == []  # noise unknown
    assert worse([], of(9.0)) == []


@given(st.lists(st.integers(0, 10**6), min_size=8, max_size=8), st.integers(1, 64))
def test_the_cores_at_work_are_what_is_neither_idle_nor_waiting(ticks: list[int], n: int) -> None:
    begin = [7] * 8
    after = [a + b for a, b in zip(begin, ticks, strict=True)]
    first, second = (f"cpu  {' '.join(map(str, t))} 0 0\ncpu0 1 2\n" for t in (begin, after))
    found = cores_at_work(first, second, n)
    assert 0.0 <= found <= n
    if sum(ticks):
        assert found == pytest.approx(n * (1.0 - (ticks[3] + ticks[4]) / sum(ticks)))


def test_figures_beside_other_work_do_not_replace_quiet_ones() -> None:
    loud = kept([[figure(2.0, "a")]], 2 * QUIET, "m")
    assert noisier(of(1.0), loud)
    assert not noisier(loud, loud)
    assert not noisier(loud, of(1.0))
    assert not noisier(of(1.0), of(1.0))
    assert not noisier([], loud)
    assert not noisier(kept([[figure(1.0, "b")]], 0.0, "m"), loud)


def test_the_table_takes_the_place_of_the_one_before_and_the_prose_stays() -> None:
    page = f"# Costs\n\nprose\n\n{BEGIN}\n\nold\n\n{END}\n\nmore prose\n"
    first = with_table(page, of(2.0, 2.5))
    assert "prose" in first
    assert "more prose" in first
    assert "old" not in first
    row = "time | 2 ms | one | 1 ms | **2** | 1 | 0.5 |"
    assert f"| a: {row}" in first.partition("### a")[0]  # what is missed
    assert f"| {row}" in first.partition("### a\n\nm; 2 runs; other work took 0.0 cores.")[2]
    assert with_table(first, of(2.0, 2.5)) == first
    with pytest.raises(ValueError, match="there is no"):
        with_table("no marks", [])


def test_what_is_worse_fails_and_is_kept_only_when_it_is_accepted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "performance.md").write_text(f"{BEGIN}{END}", encoding="utf-8")
    ratio = [1.0]
    section = ModuleType("section")
    section.__dict__["figures"] = lambda: [figure(ratio[0])]
    monkeypatch.setitem(sys.modules, SECTIONS["reference"], section)
    monkeypatch.setattr(bench, "_cores_at_work", lambda: 0.0)
    words = ["--only", "reference", "--runs", "2"]

    def last() -> float:
        return json.loads((tmp_path / "performance.json").read_text())[0]["ratio"]

    assert bench.main(words, tmp_path) == 0
    ratio[0] = 1.5
    assert bench.main(words, tmp_path) == 1
    assert "ratio 1.5, last 1, noise 0: worse" in capsys.readouterr().out
    assert last() == 1.0
    assert bench.main([*words, "--accept"], tmp_path) == 0
    assert last() == 1.5


def test_a_busy_machine_is_refused_unless_it_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "performance.md").write_text(f"{BEGIN}{END}", encoding="utf-8")
    section = ModuleType("section")
    section.__dict__["figures"] = lambda: [figure(1.0)]
    monkeypatch.setitem(sys.modules, SECTIONS["reference"], section)
    monkeypatch.setattr(bench, "_cores_at_work", lambda: 1.8)
    monkeypatch.setattr(bench, "PATIENCE_S", -1.0)
    assert bench.main(["--only", "reference"], tmp_path) == 1
    assert "other work takes" in capsys.readouterr().out
    assert not (tmp_path / "performance.json").exists()
    assert bench.main(["--only", "reference", "--busy"], tmp_path) == 0
