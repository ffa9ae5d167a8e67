"""Names in certificates and in lists of names."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tools.keys.roles import (
    LETS_IN,
    ROLES,
    Identity,
    identity,
    let_in,
    parse,
    parse_list,
    with_one,
    without,
)

WHO = st.builds(identity, st.sampled_from(ROLES), st.from_regex(r"[a-z0-9_]{1,32}", fullmatch=True))
NOTE = st.sampled_from(["", "# a remark", "   ", "#pilot:ann"])
LINE = st.one_of(NOTE, WHO.map(str), st.tuples(WHO, NOTE).map(lambda two: f" {two[0]} {two[1]}"))
LIST = st.lists(LINE, max_size=6).flatmap(
    lambda lines: st.sampled_from(["\n".join(lines), "".join(f"{line}\n" for line in lines)])
)


@given(WHO)
def test_a_name_is_read_as_it_is_written_and_fits_a_certificate(who: Identity) -> None:
    assert parse(str(who)) == who
    assert len(str(who)) <= 64  # the longest common name of X.509


@given(st.text(max_size=12))
def test_whatever_is_no_name_is_refused(text: str) -> None:
    role, _, name = text.partition(":")
    if role in ROLES and re.fullmatch(r"[a-z0-9_]{1,32}", name):
        assert str(parse(text)) == text
        return
    with pytest.raises(ValueError):
        parse(text)


@pytest.mark.parametrize(
    "text", ["pilot", "pilot:", "pilot:*", "pilot:Ann", "king:ann", "pilot:a b"]
)
def test_a_line_that_names_nobody_is_refused_with_its_number(text: str) -> None:
    with pytest.raises(ValueError, match="line 3: "):
        parse_list(f"# names\npilot:ann\n{text}\n")


@given(LIST, WHO)
def test_a_name_that_is_put_on_a_list_is_on_it_and_nothing_else_changes(
    text: str, who: Identity
) -> None:
    after = with_one(text, who)
    assert after.startswith(text)
    before = parse_list(text)
    assert parse_list(after) == (before if who in before else (*before, who))
    assert with_one(after, who) == after


@given(LIST, WHO)
def test_a_name_that_is_taken_off_is_off_and_nothing_else_changes(text: str, who: Identity) -> None:
    listed = with_one(text, who)
    after = without(listed, who)
    assert parse_list(after) == tuple(one for one in parse_list(text) if one != who)
    remarks = [line for line in text.splitlines() if not parse_list(line)]
    assert [line for line in after.splitlines() if not parse_list(line)] == remarks
    assert without(after, who) == after


@given(st.lists(WHO, max_size=8))
def test_a_drone_lets_in_who_calls_and_a_caller_speaks_to_drones_and_routers_alone(
    others: list[Identity],
) -> None:
    assert {who.role for who in let_in("drone", others)} <= {"pilot", "observer", "router"}
    for role in ("pilot", "observer"):
        assert {who.role for who in let_in(role, others)} <= {"drone", "router"}
    for one in ROLES:
        for other in ROLES:
            assert (other in LETS_IN[one]) == (one in LETS_IN[other])
