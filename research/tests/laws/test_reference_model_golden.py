"""The reference model against numbers computed independently, and against the paper's tables."""

from math import exp

import pytest

from lindy.api.references import MotionRequest, plan
from lindy_research.laws.model_as_printed import advanced_as_printed
from tools.generators.route import sequence

# ξ: v_c, t1 … t5, P1 … P4 of L 50, V_d 0.3, T_a = T_d = 20, θ0 = e^(−100/9), corrected times
BASIC = {
    10: (
        0.4785584125388044,
        (17.777697066791532, 62.22214151123597, 166.66666666666669, 184.4443637334582,
         228.88880817790266),
        (1.943682180725179, 15.037019100939755, 46.37037664756897, 49.76000358688125),
    ),
    12: (
        0.4798060088040223,
        (17.454536517509307, 61.89898096195374, 166.66666666666669, 184.12120318417598,
         228.5656476286204),
        (1.9358654287158867, 15.029202348930463, 46.45950806034435, 49.760003586881254),
    ),
    15: (
        0.4810185727108803,
        (17.14285679325449, 61.587301237698924, 166.66666666666669, 183.80952345992117,
         228.2539679043656),
        (1.9297958284695214, 15.023132748684096, 46.54694237737443, 49.760003586881254),
    ),
}  # fmt: skip


def sea_trial(xi: float) -> MotionRequest:
    return MotionRequest(50.0, 0.3, 20.0, 20.0, theta_0=exp(-100 / 9), xi_a=xi, xi_d=xi)


@pytest.mark.parametrize("xi", BASIC)
def test_the_sea_trial_of_the_basic_version(xi: int) -> None:
    v_c, t, P = BASIC[xi]
    m = plan(sea_trial(xi))
    assert m.v_c == pytest.approx(v_c, abs=1e-9)
    assert (m.v_m, m.a_m, m.d_m) == pytest.approx((0.3, 0.015, -0.015), abs=1e-12)
    assert m.t == pytest.approx(t, abs=1e-9)
    assert list(m.P) == pytest.approx((*P, 50.0), abs=1e-9)


def table_2(xi: float) -> list[MotionRequest]:
    rows = ((100.0, 2.0, 0.0, 1.0), (50.0, 1.0, 1.0, 1.0), (100.0, 1.5, 1.0, 0.0))
    return [
        MotionRequest(L, V, 10.0, 10.0, V_i, V_f, theta_0=exp(-13), xi_a=xi, xi_d=xi)
        for L, V, V_i, V_f in rows
    ]


def table_3(xi: float) -> list[MotionRequest]:
    straight, turn, middle = 27.4456738787, 43.1759786068, 43.0578860213
    rows = (
        (straight, 0.4, 0.0, 0.25),
        (turn, 0.25, 0.25, 0.25),
        (middle, 0.4, 0.25, 0.25),
        (turn, 0.25, 0.25, 0.25),
        (straight, 0.4, 0.25, 0.0),
    )
    return [
        MotionRequest(L, V, 20.0, 20.0, V_i, V_f, theta_0=exp(-13), xi_a=xi, xi_d=xi)
        for L, V, V_i, V_f in rows
    ]


# ξ: v_c of each part, and begin of each part and end of the last, with T1, T4 as printed
TABLE_2 = {
    10: ((2.1990867469773816, 1.536705882123468, 2.4157387398630785),
         (15.0, 78.25926127152664, 128.25926127152664, 224.4375853612399)),
    15: ((2.2043115197061223, 1.5407682960616629, 2.431055589262825),
         (15.0, 77.95918300286205, 127.95918300286205, 224.08163277724776)),
}  # fmt: skip
TABLE_3 = {
    10: ((0.3741934753230682, 0.45766412995487993, 0.5449653325514894, 0.45766412995487993,
          0.4902712646349123),
         (50.0, 140.60814531161773, 313.3120597390148, 430.76927479230136, 603.4731892196985,
          731.467770539564)),
    15: ((0.3747507167229247, 0.4591360563621992, 0.5469373345899711, 0.4591360563621992,
          0.4934981362621763),
         (50.0, 140.0042480618396, 312.70816248923666, 430.0760918282375, 602.7800062556346,
          730.6454679993908)),
}  # fmt: skip
RUNS = [(table_2(xi), *TABLE_2[xi]) for xi in TABLE_2] + [
    (table_3(xi), *TABLE_3[xi]) for xi in TABLE_3
]


@pytest.mark.parametrize(("requests", "v_c", "times"), RUNS)
def test_the_cruise_speed_is_the_exact_one(
    requests: list[MotionRequest], v_c: tuple[float, ...], times: tuple[float, ...]
) -> None:
    parts = [advanced_as_printed(request) for request in requests]
    chain = sequence(parts)
    assert [part.v_c for part in parts] == pytest.approx(v_c, abs=1e-9)
    begins = [times[0] + begin for begin in (*chain.begins, chain.duration)]
    assert begins == pytest.approx(times, abs=1e-9)
