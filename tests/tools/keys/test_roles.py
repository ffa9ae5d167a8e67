"""Names in certificates and in lists of names."""

from datetime import UTC, datetime

import pytest
from cryptography.hazmat.primitives.asymmetric import ec
from hypothesis import given, settings
from hypothesis import strategies as st

from services.runtime.bus.spaces import NAME as NAME_RULE
from services.runtime.bus.spaces import checked_name
from services.runtime.config.errors import LindyError
from tools.keys.certificates import issue, read
from tools.keys.credentials import (
    LETS_IN,
    ROLES,
    Identity,
    Role,
    parse,
    parse_list,
    with_one,
    without,
)

KEY = ec.generate_private_key(ec.SECP256R1())
LETTERS = "[A-Za-z0-9_.-]"
NAME = st.from_regex(rf"{LETTERS}{{0,27}}[A-Za-z0-9]{LETTERS}{{0,27}}", fullmatch=True)
ANY = st.one_of(NAME, st.text(max_size=80), st.text("aZ0_.-é/*#", max_size=70))
WHO = st.builds(Identity, st.sampled_from(ROLES), NAME)
NOTE = st.sampled_from(["", "# a remark", "   ", "#pilot:ann"])
LINE = st.one_of(NOTE, WHO.map(str), st.tuples(WHO, NOTE).map(lambda two: f" {two[0]} {two[1]}"))
LIST = st.lists(LINE, max_size=6).flatmap(
    lambda lines: st.sampled_from(["\n".join(lines), "".join(f"{line}\n" for line in lines)])
)


@given(WHO)
def test_a_name_is_read_as_it_is_written_and_fits_a_certificate(who: Identity) -> None:
    assert parse(str(who)) == who
    assert len(str(who)) <= 64  # the longest common name of X.509


@given(WHO)
@settings(max_examples=20)
def test_a_certificate_holds_every_name(who: Identity) -> None:
    made = issue(who, KEY.public_key(), KEY, datetime.now(UTC), 1)
    assert read(made).who == who


@given(st.sampled_from(ROLES), ANY)
def test_keys_can_be_made_for_whatever_a_drone_may_be_called_and_for_nothing_else(
    role: Role, name: str
) -> None:
    try:
        allowed = checked_name(name, "--name") == name
    except LindyError:
        allowed = False
    try:
        taken = parse(f"{role}:{name}") == (role, name)
    except ValueError:
        taken = False
    assert taken == allowed


@given(st.text(max_size=12))
def test_whatever_is_not_a_role_and_a_name_is_refused(text: str) -> None:
    role, _, name = text.partition(":")
    if role in ROLES and NAME_RULE.fullmatch(name):
        assert str(parse(text)) == text
        return
    with pytest.raises(ValueError):
        parse(text)


@pytest.mark.parametrize(
    "text", ["pilot", "pilot:", "pilot:*", "pilot:Ännchen", "pilot:..", "king:ann", "pilot:a b"]
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


def test_a_drone_lets_in_who_calls_and_a_caller_speaks_to_drones_and_routers_alone() -> None:
    assert {*LETS_IN["drone"]} == {"pilot", "observer", "router"}
    assert {*LETS_IN["pilot"]} == {*LETS_IN["observer"]} == {"drone", "router"}
    for one in ROLES:
        for other in ROLES:
            assert (other in LETS_IN[one]) == (one in LETS_IN[other])
