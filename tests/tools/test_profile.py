"""`lindy profile`: numbers as JSON, samples as CSV, or one sentence and nothing else."""

import json
from math import exp, inf, isfinite, nan
from typing import Any

import pytest

from services.runtime.config.errors import LindyError
from tools.generators.fernandes import MotionRequest, plan
from tools.profile import profile

SEA_TRIAL = {"length": 50.0, "cruise": 0.3, "accel_time": 20.0, "decel_time": 20.0}


def numbers(capsys: pytest.CaptureFixture[str], **request: float) -> dict[str, Any]:
    assert profile(**{**SEA_TRIAL, **request}) == 0
    return json.loads(capsys.readouterr().out)


def samples(capsys: pytest.CaptureFixture[str], **request: float) -> list[list[float]]:
    assert profile(**{**SEA_TRIAL, **request}) == 0
    head, *lines = capsys.readouterr().out.splitlines()
    assert head == "t,p,v,a"
    return [[float(cell) for cell in line.split(",")] for line in lines]


def test_the_numbers_are_those_of_the_sea_trial(capsys: pytest.CaptureFixture[str]) -> None:
    shown = numbers(capsys, xi=12.0)
    assert list(shown) == ["v_m", "v_c", "a_m", "d_m", "t", "P"]
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


def test_every_tuning_parameter_reaches_the_model(capsys: pytest.CaptureFixture[str]) -> None:
    usual = numbers(capsys)
    for name, value in (
        ("length", 60.0),
        ("cruise", 0.2),
        ("accel_time", 15.0),
        ("decel_time", 15.0),
        ("initial", 0.1),
        ("final", 0.1),
        ("epsilon", 0.1),
        ("theta_a", 0.7),
        ("theta_d", 0.3),
        ("theta_0", exp(-13)),
        ("xi", 10.0),
    ):
        assert numbers(capsys, **{name: value}) != usual, name


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
    ({"xi": 1.0}, "xi_a is 1, expected 10 to 15"),
    ({"final": 0.3, "length": 0.5}, "expected a final speed of at most"),
    ({"initial": 0.3, "length": 0.5}, "expected a final speed of at least"),
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
        profile(**{**SEA_TRIAL, **change})
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capsys.readouterr().out == ""
