"""`lindy ramp` and `lindy profile`: CSV, a plan as JSON, and a sentence for every mistake."""

import io
import json
from itertools import pairwise
from math import inf, isfinite, nan
from typing import Any

import pytest

from services.reference.trajectory.minimum_jerk import Limits, Ramp
from services.runtime.config.errors import LindyError
from tools.generators.baselines import PlannedBaseline
from tools.generators.fernandes import MotionRequest, plan
from tools.path import profile
from tools.ramp import Rule, generator_of, plan_of, ramp

LOG = "t,target\n0,0.3\n0.25,0\n1,0\n"
RULES: list[Rule] = ["bounded", "thesis", "direct", "filter", "minimum-time"]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    def run(text: str, **options: Any) -> list[dict[str, float]]:
        monkeypatch.setattr("sys.stdin", io.StringIO(text))
        assert ramp(**options) == 0
        header, *lines = capsys.readouterr().out.splitlines()
        assert header == "t,x,v,a,j"
        return [dict(zip("txvaj", map(float, line.split(",")), strict=True)) for line in lines]

    return run


def test_a_target_takes_effect_at_its_own_time_between_samples(run: Any) -> None:
    rows = run(LOG, jerk=3.0, accel=0.5, dt=0.1)
    reference = Ramp(Limits(3.0, 0.5))
    reference.aim(0.3, 0.0)
    expected = [reference.at(k / 10) for k in range(3)]
    reference.aim(0.0, 0.25)
    expected += [reference.at(k / 10) for k in range(3, 11)]
    for k, (row, here) in enumerate(zip(rows, expected, strict=True)):
        assert row["t"] == pytest.approx(k / 10)
        assert [row[c] for c in "xvaj"] == pytest.approx(list(here), abs=1e-12)


def test_the_sampling_time_does_not_change_the_motion(run: Any) -> None:
    coarse, fine = (run(LOG, jerk=3.0, accel=0.5, dt=dt) for dt in (0.1, 0.025))
    for row, same in zip(coarse, fine[::4], strict=True):
        assert list(row.values()) == pytest.approx(list(same.values()), abs=1e-9)


def test_the_sample_at_a_change_shows_the_new_plan_and_the_old_motion(run: Any) -> None:
    before, here = (run(f"0,1\n0.7,{target}\n", jerk=2.0, dt=0.1)[7] for target in (1, -1))
    assert here["t"] == 0.7
    assert [here[c] for c in "xva"] == pytest.approx([before[c] for c in "xva"])
    assert here["j"] == -2.0 != before["j"]


@pytest.mark.parametrize("rule", RULES)
def test_every_rule_integrates_its_own_velocity(run: Any, rule: Rule) -> None:
    rows = run("0,0.3\n1.2345,-0.2\n4,0\n", rule=rule, jerk=3.0, dt=0.001)
    assert rows[0]["x"] == 0.0
    for one, two in pairwise(rows):
        mean = (one["v"] + two["v"]) / 2
        assert two["x"] - one["x"] == pytest.approx(mean * 0.001, abs=3e-4)
    assert rows[-1]["v"] == pytest.approx(-0.2, abs=1e-4) or rule == "direct"
    assert len(rows) == 4001


# rule, v0, a0, to, J, A → T, peak acceleration, peak jerk, displacement, with 40 digits
PLANS: list[tuple[Rule, float, float, float, float, float | None, list[float]]] = [
    ("bounded", 0.5, -0.3, 2.0, 1.0, 0.5, [4.0566666667, 0.5, 1.0, 4.7523083333]),
    ("bounded", 0.0, 0.8, 2.0, 1.0, 0.5, [4.2433333333, 0.8, 1.0, 4.6462527778]),
    ("bounded", 0.3, 0.0, 0.0, 0.78, 0.2, [1.8418803418803, 0.2, 0.78, 0.27628205128]),
    ("thesis", 0.2, -0.5, 0.8, 2.0, None, [1.6147344064, 0.6991256219, 2.6192968924, 0.6987269031]),
    ("minimum-time", 0.0, 0.0, 1.0, 10.0, None, [0.63245553, 3.16227766, 10.0, 0.316227766]),
    ("bounded", 0.3, 0.0, 0.3, 1.0, None, [0.0, 0.0, 0.0, 0.0]),
]  # fmt: skip


@pytest.mark.parametrize(("rule", "v0", "a0", "to", "jerk", "accel", "expected"), PLANS)
def test_a_plan_is_json(
    rule: Rule, v0: float, a0: float, to: float, jerk: float, accel: float | None,
    expected: list[float],
) -> None:  # fmt: skip
    generator = generator_of(rule, jerk, accel)
    assert isinstance(generator, PlannedBaseline)
    generator.velocity, generator.acceleration = v0, a0
    found = json.loads(plan_of(rule, generator, to))
    keys = ["T", "peak_accel", "peak_jerk", "displacement"]
    assert [found[key] for key in keys] == pytest.approx(expected, rel=1e-8)
    assert sum(part["T"] for part in found["segments"]) == pytest.approx(found["T"])
    for part in found["segments"]:
        assert list(part) == ["T", "v0", "a0", "j0", "half_snap"]


MISTAKES: list[tuple[str, dict[str, Any], str]] = [
    (LOG, {"jerk": 0.0, "dt": 0.1}, "--jerk is 0.0"),
    (LOG, {"jerk": nan, "dt": 0.1}, "--jerk is nan"),
    (LOG, {"jerk": 1.0, "accel": -1.0, "dt": 0.1}, "--accel is -1.0"),
    (LOG, {"jerk": 1.0, "dt": 0.0}, "--dt is 0.0"),
    (LOG, {"jerk": 1.0, "dt": inf}, "--dt is inf"),
    (LOG, {"jerk": 1.0, "dt": 1e-12}, "samples"),
    ("", {"jerk": 1.0, "plan": inf}, "--plan is inf"),
    (LOG, {"jerk": 1.0}, "--dt is missing"),
    (LOG, {"dt": 0.1}, "--jerk is missing"),
    ("", {"jerk": 1.0, "dt": 0.1}, "no targets"),
    ("t,target\n", {"jerk": 1.0, "dt": 0.1}, "no targets"),
    ("0,1\n2,0\n1,1\n", {"jerk": 1.0, "dt": 0.1}, "line 3: time 1.0 is before 2.0"),
    ("0,1\n1\n", {"jerk": 1.0, "dt": 0.1}, "line 2: expected two finite numbers"),
    ("0,1\n1,2,3\n", {"jerk": 1.0, "dt": 0.1}, "line 2: expected two finite numbers"),
    ("t,target\n0,one\n", {"jerk": 1.0, "dt": 0.1}, "line 2: expected two finite numbers"),
    ("0,nan\n", {"jerk": 1.0, "dt": 0.1}, "line 1: expected two finite numbers"),
    ("0,1e308\n1,-1e308\n", {"jerk": 1.0, "dt": 0.5}, "too large"),
    ("", {"rule": "filter", "plan": 1.0}, "makes no plan"),
    ("", {"jerk": 1e-300, "plan": 1e300}, "too large"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "options", "says"), MISTAKES)
def test_a_mistake_is_one_sentence_and_nothing_is_printed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    text: str, options: dict[str, Any], says: str,
) -> None:  # fmt: skip
    monkeypatch.setattr("sys.stdin", io.StringIO(text))
    with pytest.raises(LindyError, match=says):
        ramp(**options)
    assert capsys.readouterr().out == ""


def test_a_limit_that_a_rule_does_not_know_is_not_ignored_in_silence(
    run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = io.StringIO()
    monkeypatch.setattr("sys.stderr", said)
    run(LOG, rule="thesis", jerk=3.0, accel=0.5, dt=0.1)
    assert "--accel has no effect" in said.getvalue()


def test_a_byte_order_mark_before_the_header_or_the_first_number_changes_nothing(run: Any) -> None:
    mark = "\ufeff"
    without = run(LOG, jerk=3.0, accel=0.5, dt=0.1)
    assert run(mark + LOG, jerk=3.0, accel=0.5, dt=0.1) == without
    bare = LOG.removeprefix("t,target\n")
    assert run(mark + bare, jerk=3.0, accel=0.5, dt=0.1) == without


def profiled(**request: float) -> int:
    known = {**SEA_TRIAL, **request}
    dt = known.pop("dt", None)
    return profile(*known.values(), dt=dt)


SEA_TRIAL = {"length": 50.0, "cruise": 0.3, "accel_time": 20.0, "decel_time": 20.0}


def numbers(capsys: pytest.CaptureFixture[str], **request: float) -> dict[str, Any]:
    assert profiled(**request) == 0
    return json.loads(capsys.readouterr().out)


def samples(capsys: pytest.CaptureFixture[str], **request: float) -> list[list[float]]:
    assert profiled(**request) == 0
    head, *lines = capsys.readouterr().out.splitlines()
    assert head == "t,p,v,a"
    return [[float(cell) for cell in line.split(",")] for line in lines]


def test_the_numbers_are_those_of_the_sea_trial(capsys: pytest.CaptureFixture[str]) -> None:
    names = ["v_m", "v_c", "a_m", "d_m", "t", "P"]
    assert list(numbers(capsys)) == names
    motion = plan(MotionRequest(**SEA_TRIAL, xi_a=12.0, xi_d=12.0))
    shown = {name: getattr(motion, name) for name in names}
    assert (shown["v_m"], shown["v_c"]) == pytest.approx((0.3, 0.4798060088040223), abs=1e-9)
    assert (shown["a_m"], shown["d_m"]) == pytest.approx((0.015, -0.015))
    assert shown["t"] == pytest.approx(
        (17.454536517509307, 61.89898096195374, 166.66666666666669, 184.12120318417598,
         228.5656476286204), abs=1e-9
    )  # fmt: skip
    assert shown["P"] == pytest.approx(
        (1.9358654287158867, 15.029202348930463, 46.45950806034435, 49.760003586881254, 50.0),
        abs=1e-9,
    )


def test_the_numbers_survive_a_round_trip(capsys: pytest.CaptureFixture[str]) -> None:
    shown = numbers(capsys, length=7.0)
    motion = plan(MotionRequest(7.0, 0.3, 20.0, 20.0))
    assert (shown["v_m"], tuple(shown["t"]), tuple(shown["P"])) == (motion.v_m, motion.t, motion.P)


@pytest.mark.parametrize("dt", [0.5, 0.3, 7.0, 500.0])
@pytest.mark.parametrize("length", [50.0, -50.0])
def test_the_samples_go_from_start_to_arrival(
    capsys: pytest.CaptureFixture[str], dt: float, length: float
) -> None:
    table = samples(capsys, dt=dt, length=length)
    duration = plan(MotionRequest(length, 0.3, 20.0, 20.0)).duration
    assert [row[0] for row in table] == [k * dt for k in range(len(table))]
    assert table[0][1:] == [0.0, 0.0, 0.0]
    assert table[-1][1:] == [length, 0.0, 0.0]
    assert table[-2][0] < duration <= table[-1][0]
    assert all(isfinite(value) for row in table for value in row)


BAD = [
    ({"length": 0.0}, "length is 0"),
    ({"length": nan}, "length is nan"),
    ({"cruise": inf}, "cruise is inf"),
    ({"accel_time": 0.0}, "accel_time is 0"),
    ({"decel_time": -1.0}, "decel_time is -1"),
    ({"dt": 0.0}, "--dt is 0.0, expected more than 0 s"),
    ({"dt": nan}, "--dt is nan"),
    ({"dt": 1e-12}, "rows, expected at most"),
    ({"dt": 5e-324}, "rows, expected at most"),
]


@pytest.mark.parametrize(("change", "says"), BAD)
def test_bad_input_is_one_sentence_and_no_output(
    capsys: pytest.CaptureFixture[str], change: dict[str, float], says: str
) -> None:
    with pytest.raises(LindyError) as caught:
        profiled(**change)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capsys.readouterr().out == ""
