"""Two streams are compared field by field; nothing that differs is passed over."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.runtime.config.errors import LindyError
from tools.replay.differences import (
    REAL_TIME,
    FieldComparison,
    Pair,
    Told,
    Tolerance,
    by_cause,
    by_seq,
    fields,
    in_words,
    parsed,
)

NUMBER = st.floats(-1e6, 1e6)
TREE = st.recursive(
    NUMBER
    | st.integers(-(2**50), 2**50)
    | st.booleans()
    | st.none()
    | st.sampled_from(["", "a", "b"]),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from("abcd"), inner, max_size=3)
    ),
    max_leaves=8,
)
BODY = st.dictionaries(st.sampled_from(["depth", "thrust", "x"]), TREE, min_size=1, max_size=3)


def told(body: object, seq: int = 0, stamp: int = 0, sample: int | None = None) -> Told:
    return Told("state", seq, stamp, msgspec.json.encode(body), sample)


@given(BODY)
def test_the_same_is_no_difference(body: dict[str, object]) -> None:
    comparison = FieldComparison(())
    comparison.compare(Pair(told(body), told(body)))
    assert comparison.differences == []


@given(BODY, BODY)
def test_what_is_not_the_same_is_one(a: dict[str, object], b: dict[str, object]) -> None:
    comparison = FieldComparison(())
    comparison.compare(Pair(told(a), told(b)))
    assert bool(comparison.differences) == (dict(fields(a)) != dict(fields(b)))


@given(NUMBER, NUMBER, st.floats(0.0, 10.0))
def test_a_tolerance_allows_just_so_much(a: float, b: float, most: float) -> None:
    comparison = FieldComparison((Tolerance("state.depth", absolute=most),))
    comparison.compare(Pair(told({"depth": a, "x": a}), told({"depth": b, "x": b})))
    found = {one.field for one in comparison.differences}
    assert ("x" in found) == (a != b)
    assert ("depth" in found) == (abs(a - b) > most)


def test_a_field_is_named_as_it_is_printed() -> None:
    assert Tolerance("control/thrusters.thrust[3]").covers("control/thrusters.thrust[3]")
    assert Tolerance("control/*.thrust[*").covers("control/thrusters.thrust[3]")
    assert not Tolerance("control/thrusters.thrust[3]").covers("control/thrusters.thrust3")


def test_first_count_and_worst_are_said() -> None:
    comparison = FieldComparison(())
    for k, (a, b) in enumerate([(1.0, 1.0), (1.0, 1.5), (1.0, 3.0), (1.0, 2.0)]):
        at = k * 10**9
        comparison.compare(Pair(told({"depth": a}, k, at), told({"depth": b}, k, at)))
    (found,) = comparison.differences
    assert (found.first_ns, found.count, found.worst, found.worst_ns) == (10**9, 3, 2.0, 2 * 10**9)
    line = in_words(found, 0)
    assert line == (
        "state: depth: first at 1.000 s: recorded 1.0, now 1.5, 0.5 apart; in 3 messages, "
        "worst 2 at 2.000 s"
    )


def test_a_field_that_one_has_is_compared_unless_the_messages_were_others() -> None:
    pair = Pair(told({"depth": 1.0}), told({"depth": 1.0, "new": 2.0}))
    strict, common = FieldComparison(()), FieldComparison((), common_only=True)
    strict.compare(pair)
    common.compare(pair)
    assert [one.field for one in strict.differences] == ["new"]
    assert common.differences == []


@given(st.sets(st.integers(0, 40), min_size=1), st.sets(st.integers(0, 40)))
def test_every_message_has_a_partner_or_is_said_to_have_none(
    recorded: set[int], today: set[int]
) -> None:
    then = [told({}, seq, seq) for seq in sorted(recorded)]
    now = [told({}, seq, seq) for seq in sorted(today)]
    pairs = [*by_seq(then, now, -1, 100)]
    assert sum(p.today is None for p in pairs) == len(recorded - today)
    assert sum(p.recorded is None for p in pairs) == len(today - recorded)
    assert all(p.recorded.seq == p.today.seq for p in pairs if p.recorded and p.today)


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(-3, 3)), unique_by=lambda row: row[0]))
def test_on_a_real_clock_partners_are_near_each_other(rows: list[tuple[int, int]]) -> None:
    rows.sort()
    then = [told({}, k, 100 * at) for k, (at, _) in enumerate(rows)]
    now = [told({}, k + 7, 100 * at + late) for k, (at, late) in enumerate(rows)]
    assert [(p.recorded, p.today) for p in by_cause(then, now, 10)] == list(
        zip(then, now, strict=True)
    )
    assert all(p.today is None for p in by_cause(then, [], 10))


def test_partners_have_the_same_sensor_sample_however_late_they_are() -> None:
    then = [told({}, 0, 100, 5), told({}, 1, 200, 6)]
    now = [told({}, 3, 10_000, 6), told({}, 4, 20_000, 7)]
    assert list(by_cause(then, now, 1)) == [Pair(then[0], None), Pair(then[1], now[0])]


def test_tolerances_as_they_are_typed() -> None:
    assert parsed(["state.depth.*=1e-6", "control/wrench.*=1%"]) == (
        Tolerance("state.depth.*", absolute=1e-6),
        Tolerance("control/wrench.*", relative=0.01),
    )


@pytest.mark.parametrize("text", ["state", "=1", "state.depth=x", "state.depth=-1", "a=nan"])
def test_a_wrong_tolerance_is_explained(text: str) -> None:
    with pytest.raises(LindyError, match=r"expected TOPIC.FIELD=NUMBER"):
        parsed([text])


@pytest.mark.parametrize(
    ("key", "name", "recorded", "today", "same"),
    [
        ("control/thrusters", "epoch", 35071433529, 35071433530, False),
        ("control/thrusters", "armed_ns", 35081315374258, 35081315374258 + 10**8, False),
        ("control/wrench", "stamp_ns", 35081315374258, 35081315374258 + 10**7, True),
        ("control/wrench", "wanted[2]", 8.0, 8.05, True),
        ("control/wrench", "wanted[2]", 8.0, 8.5, False),
        ("state", "seq", 3, 4, True),
        ("state", "depth.value", 1.0, 1.1, False),
        ("reference", "armed", True, False, False),
    ],
)
def test_what_a_real_clock_may_change(
    key: str, name: str, recorded: object, today: object, same: bool
) -> None:
    comparison = FieldComparison(REAL_TIME)
    then, now = (
        Told(key, 0, 0, msgspec.json.encode(_nested(name, x)), None) for x in (recorded, today)
    )
    comparison.compare(Pair(then, now))
    assert (comparison.differences == []) == same


def _nested(name: str, value: object) -> object:
    """`wanted[2]` and `depth.value` as they stand in a message."""
    if name.endswith("[2]"):
        return {name.removesuffix("[2]"): [0.0, 0.0, value]}
    head, dot, tail = name.partition(".")
    return {head: {tail: value}} if dot else {head: value}
