"""Links over which no command can arrive in time are refused before the start."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.pilot import TTL_MS
from services.tether.delay import Delay, Pareto, Table
from services.tether.io.profile_file import named
from services.tether.link_model import LinkDirection
from services.tether.profile import DirectionProfile
from tools.__main__ import main
from tools.link_fit import COMMAND_BYTES, flyable, profiles, shortest_ms

MS = st.floats(0.0, 500.0)


def table(delays: list[float]) -> Table:
    return Table(ms=tuple(delays))


DELAYS: st.SearchStrategy[Delay | None] = st.one_of(
    st.none(),
    st.builds(Pareto, mean_ms=MS),
    st.builds(table, st.lists(MS, min_size=2, max_size=5)),
)
LEGS = st.builds(
    DirectionProfile, delay_ms=MS, delay=DELAYS, rate_kbit=st.sampled_from([0.0, 5.0, 500.0]),
    overhead_bytes=st.integers(0, 200),
)  # fmt: skip


@given(LEGS, st.integers(0, 1000))
def test_no_command_is_ever_faster_than_the_shortest_delay(leg: DirectionProfile, seed: int):
    line: LinkDirection[int] = LinkDirection(leg, np.random.default_rng(seed))
    for second in range(5):
        entered = second * 10_000_000_000
        line.enter(second, entered, COMMAND_BYTES)
        before = entered + round(1e6 * shortest_ms(leg)) - 2
        assert line.leave(before) is None
        while line.leave(entered + 9_999_999_999) is not None:
            pass


def test_all_profiles_but_the_acoustic_one_can_be_flown():
    assert set(profiles()) - set(flyable()) == {"acoustic"}


def test_the_shortest_delay_of_a_trace_is_that_of_its_fastest_message(tmp_path: Path):
    (tmp_path / "trace.csv").write_text("sent_s,arrived_s\n0,0.5\n1,1.42\n2,\n")
    profile = tmp_path / "mine.toml"
    profile.write_text('[down]\ndelay = { kind = "trace", file = "trace.csv" }\n')
    assert shortest_ms(named(str(profile)).profile.down) == pytest.approx(420.0)


@pytest.mark.parametrize("verb", ["dive", "simulate"])
def test_a_link_that_cannot_be_flown_is_refused_at_once_with_those_that_can(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str
):
    out = tmp_path / "dive"
    assert main([verb, "--pilot", "script:first_dive", "--link", "acoustic", "--out", str(out)])
    sentence = capsys.readouterr().err
    ms = shortest_ms(named("acoustic").profile.down)
    for words in (f"{ms:.0f} ms", f"{TTL_MS:g} ms", "tether, wifi_buoy", "satellite", "never arm"):
        assert words in sentence
    assert not out.exists()


def test_it_can_still_be_looked_at(capsys: pytest.CaptureFixture[str]):
    assert main(["link", "show", "--profile", "acoustic", "--seconds", "1"]) == 0
    assert "seq,sent_s" in capsys.readouterr().out
