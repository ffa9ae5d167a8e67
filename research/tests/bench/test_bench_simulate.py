"""The simulate section of the bench: each figure is of a dive that was really flown."""

import pytest

pytest.importorskip("rerun", reason="the viewer extra is not installed")

from lindy_research.bench import simulate


def test_costs_and_sizes_are_measured_on_dives_that_left_files(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(simulate, "SECONDS", 12)
    monkeypatch.setattr(simulate, "TURNS", 1)
    found = {figure.name: figure for figure in simulate.figures()}
    assert len(found) == 6
    for figure in found.values():
        assert figure.section == "simulate"
        assert figure.ours is not None
        assert figure.ours > 0
    for name in ("dive.mcap per 100 s", "dive.rrd per 100 s"):
        size = found[name].ours
        assert size is not None
        assert 3.0 < size < 20.0  # [MB]
