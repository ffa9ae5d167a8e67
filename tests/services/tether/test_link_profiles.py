"""Profile files: those that are shipped are whole, and a mistake is told in one sentence."""

from pathlib import Path

import pytest

from services.runtime.config.errors import LindyError
from services.runtime.config.settings import DEPLOY
from services.tether.delay import Trace
from services.tether.io.profile_file import adjusted, named

PROFILES = sorted(path.stem for path in (DEPLOY / "links").glob("*.toml"))


@pytest.mark.parametrize("name", PROFILES)
def test_a_shipped_profile_reads_and_says_what_it_is(name: str) -> None:
    assert named(name).profile.about


@pytest.mark.parametrize("name", PROFILES)
def test_numbers_of_a_shipped_profile_have_their_source_beside_them(name: str) -> None:
    text = (DEPLOY / "links" / f"{name}.toml").read_text(encoding="utf-8")
    assert "=" not in text.partition("\n")[2] or "\n# " in text


def write(folder: Path, text: str) -> str:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "[up]\ndelay_ms = -1.0",
            r"mine\.toml:2: up\.delay_ms: expected a number >= 0.0, found -1",
        ),
        ("[up]\nduplicate = 1.5", "up.duplicate: expected a number <= 1.0, found 1.5"),
        ("[up]\ncorrupt = nan", "up.corrupt: expected a number"),
        ("[up]\nloss = { loss_good = 2.0 }", "up.loss.loss_good: expected a number"),
        ("[up]\nloss = { los_good = 0.1 }", "did you mean 'loss_good'"),
        ("[up]\ndelay = { kind = 'paretto', mean_ms = 1.0 }", "did you mean 'pareto'"),
        ("[up]\ndelay = { mean_ms = 1.0 }", "up.delay.kind: unknown kind None"),
        (
            "[up]\ndelay = { kind = 'pareto', mean_ms = 5.0, shape = 1.0 }",
            "shape: expected a number",
        ),
        (
            "[up]\njitter_ms = 1.0\ndelay = { kind = 'table', ms = [1, 2] }",
            "jitter_ms or delay, not both",
        ),
        ("[up]\nqueue = { limit_bytes = 1000 }", "a queue needs rate_kbit above 0"),
        ("[up]\nrate_kbit = 9.0\nqueue = { policy = 'red' }", "up.queue.policy: invalid enum"),
        ("[up]\nrat_kbit = 9.0", "up.rat_kbit: unknown key; did you mean 'rate_kbit'"),
        ("[upp]\nrate_kbit = 9.0", "upp: unknown key; did you mean 'up'"),
        (
            "[up.outages]\nwindows = [{start_s = 1.0, seconds = 2.0},"
            " {start_s = 2.0, seconds = 1.0}]",
            "windows overlap: the outage at 2 s begins before the one at 1 s ends",
        ),
        (
            "[up.outages]\nrepeat_s = 2.0\nwindows = [{start_s = 1.0, seconds = 2.0}]",
            "repeat_s is 2, expected at least the end of the last outage, 3",
        ),
        (
            "[up]\nloss = { to_bad = 0.1, to_good = 0.0 }",
            "the link would stay bad for ever",
        ),
        ("[up]\ndelay = { kind = 'trace' }", "a trace needs a file"),
        (
            "[up]\ndelay = { kind = 'trace', file = 'no.csv' }",
            r"cannot read .*no\.csv: No such file",
        ),
    ],
)
def test_a_mistake_is_named_with_its_place(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(LindyError, match=says):
        named(write(tmp_path, text))


def test_a_trace_is_read_from_beside_its_profile(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("# how\nsent_s,arrived_s\n0,0.1\n1,\n2,2.5\n")
    found = named(write(tmp_path, "[up]\ndelay = { kind = 'trace', file = 't.csv' }"))
    delay = found.profile.up.delay
    assert isinstance(delay, Trace)
    assert delay.sent_s == (0.0, 1.0, 2.0)
    assert delay.arrived_s == (0.1, None, 2.5)
    after, _ = adjusted(found, ["up.delay_ms=3"])  # the folder is still known
    assert after.profile.up.delay == delay


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("0,0.1\n0,0.2\n", "expected ascending times"),
        ("0,0.1\n1,0.5\n", "expected 0 to 60 s later"),
        ("0,0.1,7\n", r"t\.csv:1: expected sent_s,arrived_s"),
        ("zero,0.1\n", r"t\.csv:1: expected sent_s,arrived_s"),
        ("0,nan\n", "expected 0 to 60 s later"),
        ("", "holds no rows"),
    ],
)
def test_a_mistake_in_a_trace_is_told_of_that_file(tmp_path: Path, rows: str, says: str) -> None:
    (tmp_path / "t.csv").write_text(rows)
    with pytest.raises(LindyError, match=says) as caught:
        named(write(tmp_path, "[up]\ndelay = { kind = 'trace', file = 't.csv' }"))
    assert "t.csv" in str(caught.value)


def test_settings_change_single_keys_and_say_what_has_changed() -> None:
    before = named("tether")
    after, words = adjusted(before, ["up.delay_ms=80", "down.rate_kbit=256"])
    assert after.profile.up.delay_ms == 80.0
    assert after.profile.up.jitter_ms == before.profile.up.jitter_ms
    assert words == "up.delay_ms 1.0 → 80, down.rate_kbit unset → 256"
    assert before.profile.up.delay_ms == 1.0


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ([], "nothing to set"),
        (["up.delay_ms"], r"^up\.delay_ms: expected key\.path=value"),
        (["up.delay_ms=-3"], r"^up\.delay_ms: expected"),
        (["up.dellay_ms=3"], "did you mean 'delay_ms'"),
        (["up.delay_ms=fast"], r"up\.delay_ms: expected a number"),
    ],
)
def test_a_wrong_setting_is_refused_in_one_sentence(settings: list[str], says: str) -> None:
    with pytest.raises(LindyError, match=says):
        adjusted(named("tether"), settings)
