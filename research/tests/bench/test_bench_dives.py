"""Benchmarks with real dives: what they start. Their figures are for `lindy bench` to measure."""

import os
from pathlib import Path

from lindy.api.dives import Registry
from lindy_research.bench.costs import costs, total
from lindy_research.bench.onboard import LEFT_OUT, without_files


def test_the_drone_s_side_is_the_simulated_stack_without_what_writes_files(tmp_path: Path) -> None:
    stack, whole = Registry.read(str(without_files(tmp_path / "x.toml"))), Registry.read()
    assert dict(stack) == {n: spec for n, spec in whole.items() if n not in LEFT_OUT}
    assert len(stack) == len(whole) - len(LEFT_OUT)


def test_what_has_ended_costs_nothing_and_what_runs_has_memory() -> None:
    found = costs({"this": os.getpid(), "gone": 2**22 + 1}, 0.0)
    assert set(found) == {"this"}
    assert total(found).rss_mb > 10.0
