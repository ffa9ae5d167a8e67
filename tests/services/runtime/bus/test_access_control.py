"""What may pass between two machines: the rows of the topic table that cross, and nothing else."""

from functools import cache
from itertools import product
from typing import Any

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.topic import AnyTopic, Direction, Side
from services.runtime.bus.access_control import (
    ALL_MESSAGES,
    LOCAL,
    NETWORK,
    Credentials,
    HubSide,
    KeyFiles,
    access_control,
)
from services.runtime.bus.spaces import here_key, namespace
from services.runtime.config.stack import REPLAY

SPACE = namespace("pioneer")
OTHER: dict[Side, Side] = {"topside": "drone", "drone": "topside"}
SAID_AT: dict[Side, set[Direction]] = {  # what one side says that the other may hear
    "topside": {Direction.DOWN, Direction.BOTH},
    "drone": {Direction.UP, Direction.BOTH},
}
SIDES = st.sampled_from(["topside", "drone"])
FLOWS = st.sampled_from(["ingress", "egress"])
ROLE = st.sampled_from(["drone", "pilot", "observer", "router"])
CHUNK = st.from_regex(r"[a-z0-9_]{1,12}", fullmatch=True).filter(lambda s: s not in OTHER)
STRANGE = st.lists(CHUNK, min_size=1, max_size=4).map("/".join)
ANY_KEY = st.one_of(
    st.sampled_from(topics.ALL).map(lambda topic: f"{SPACE}/{topic.key}"),
    STRANGE.map(lambda key: f"{SPACE}/{key}"),
    st.sampled_from(["**", f"{SPACE}/**", f"{SPACE}/*/*", f"{SPACE}/alive/control", "@/**"]),
)


table_of = cache(access_control)


def passes(
    side: Side,
    link: str,
    flow: str,
    message: str,
    key: str,
    credentials: Credentials | None = None,
    caller: str | None = None,
    own: tuple[str, ...] = (),
) -> bool:
    """As Zenoh judges: a rule covers a message when one of its keys includes the message's; a
    subject without common names is anybody."""
    table: dict[str, Any] = table_of(HubSide(side, SPACE, credentials, own))
    assert table["enabled"]
    assert table["default_permission"] == "deny"
    subjects = {
        s["id"]
        for s in table["subjects"]
        if link in s["link_protocols"]
        and (not s.get("cert_common_names") or caller in s["cert_common_names"])
    }
    policies = [p for p in table["policies"] if subjects & set(p["subjects"])]
    named = {name for policy in policies for name in policy["rules"]}
    judged = {
        rule["permission"]
        for rule in table["rules"]
        if rule["id"] in named
        and flow in rule["flows"]
        and message in rule["messages"]
        and any(zenoh.KeyExpr(k).includes(zenoh.KeyExpr(key)) for k in rule["key_exprs"])
    }
    return judged == {"allow"}


def said_at(side: Side, topic: AnyTopic) -> bool:
    """Does what this side says of it cross?"""
    return topic.way in SAID_AT[side] and topic not in topics.WITHIN_ONE_MACHINE


def member(key: str, name: str) -> str:
    return key.replace("*", name)


@pytest.mark.parametrize("side", OTHER)
@pytest.mark.parametrize("link", NETWORK)
def test_a_row_passes_the_network_in_its_own_way_only(side: Side, link: str) -> None:
    """And may be asked for by those who may hear it; nobody breaks a part or cuts the cable from
    another machine, and whether a service is alive is no concern of it."""
    for topic in topics.ALL:
        key, ask = f"{SPACE}/{member(topic.key, 'x')}", f"{SPACE}/{topic.key}"
        goes, comes = said_at(side, topic), said_at(OTHER[side], topic)
        for message in ("put", "delete"):
            assert passes(side, link, "egress", message, key) == goes
            assert passes(side, link, "ingress", message, key) == comes
        assert passes(side, link, "ingress", "declare_subscriber", ask) == goes
        assert passes(side, link, "egress", "declare_subscriber", ask) == comes
        for message in ("query", "reply", "liveliness_token", "liveliness_query"):
            for flow, other in product(("ingress", "egress"), (key, f"{SPACE}/alive/control")):
                assert not passes(side, link, flow, message, other)


@given(SIDES, FLOWS, st.sampled_from(ALL_MESSAGES), STRANGE)
def test_nothing_that_is_not_in_the_table_passes_the_network(
    side: Side, flow: str, message: str, key: str
) -> None:
    ours = topics.find(key) is not None
    assert ours or not passes(side, "tcp", flow, message, f"{SPACE}/{key}")
    assert not passes(side, "tcp", flow, message, key)  # outside the vehicle's namespace
    other_vehicle = f"{namespace('another')}/{key}"
    if (flow, message) == ("ingress", "declare_subscriber"):
        return  # who watches several drones asks all of them; none answers for another
    assert not passes(side, "tcp", flow, message, other_vehicle)


@given(SIDES, st.sampled_from(NETWORK), CHUNK, st.sampled_from(["drone", "topside"]))
def test_a_side_says_that_it_is_there_by_its_own_name_only(
    side: Side, link: str, name: str, other_side: str
) -> None:
    token = "liveliness_token"
    own, others = here_key(SPACE, other_side, "1"), here_key(namespace(name), other_side, "1")
    assert passes(side, link, "egress", token, own)
    assert passes(side, link, "ingress", token, own)
    assert passes(side, link, "egress", token, others) == (name == "pioneer")
    assert passes(side, link, "ingress", token, others) == (name == "pioneer" or side == "topside")
    for act in ("put", "delete", "query", "reply", "declare_queryable", "declare_subscriber"):
        assert not passes(side, link, "ingress", act, own)


@given(SIDES, FLOWS, st.sampled_from(ALL_MESSAGES), STRANGE)
def test_own_services_say_and_hear_everything(
    side: Side, flow: str, message: str, key: str
) -> None:
    assert passes(side, LOCAL, flow, message, f"{SPACE}/{key}")


NAMES = st.tuples(ROLE, CHUNK).map(":".join)
KEYS = st.lists(NAMES, max_size=5).map(
    lambda names: Credentials(KeyFiles("", "", ""), tuple(names))
)
MESSAGE = st.sampled_from(ALL_MESSAGES)


def test_a_pilot_shows_no_token_of_a_drone_and_a_router_brings_one() -> None:
    """Else he makes both screens say that two drones have this name."""
    known = Credentials(KeyFiles("", "", ""), ("pilot:bob", "router:shore", "observer:eve"))
    for side, may in (
        ("drone", {"router:shore"}),
        ("topside", {"pilot:bob", "router:shore"}),
    ):
        token = here_key(SPACE, side, "9")
        found = {
            who
            for who in known.admitted
            if passes("drone", "tls", "ingress", "liveliness_token", token, known, who)
        }
        assert found == may


@given(SIDES, KEYS, NAMES, FLOWS, MESSAGE, ANY_KEY, st.sampled_from(["tcp", "quic", "udp", "ws"]))
def test_who_is_not_on_the_list_or_comes_without_tls_may_do_nothing(
    side: Side, credentials: Credentials, caller: str, flow: str, message: str, key: str, link: str
) -> None:
    assert not passes(side, link, flow, message, key, credentials, caller)
    others = credentials._replace(
        admitted=tuple(name for name in credentials.admitted if name != caller)
    )
    for who in (caller, None):
        assert not passes(side, "tls", flow, message, key, others, who)


@given(SIDES, NAMES, FLOWS, MESSAGE, ANY_KEY)
def test_a_role_may_do_what_the_other_side_may_or_only_hear_or_nothing(
    side: Side, caller: str, flow: str, message: str, key: str
) -> None:
    credentials, role = Credentials(KeyFiles("", "", ""), (caller,)), caller.partition(":")[0]
    whole = passes(side, "tls", flow, message, key)
    hears = (flow, message) in {
        ("egress", "put"), ("egress", "delete"), ("ingress", "declare_subscriber"),
    }  # fmt: skip
    expected = {
        ("drone", "pilot"): whole,
        ("drone", "observer"): whole and hears,
        ("topside", "drone"): whole and caller == "drone:pioneer",
        ("drone", "router"): whole,
        ("topside", "router"): whole,
    }.get((side, role), False)
    assert passes(side, "tls", flow, message, key, credentials, caller) == expected


@given(
    SIDES,
    FLOWS,
    st.sampled_from(ALL_MESSAGES),
    st.sampled_from(topics.ALL),
    st.sampled_from([*NETWORK, LOCAL]),
    st.sampled_from([None, "drone:pioneer", "pilot:ann", "observer:eve"]),
)
def test_nothing_of_a_replay_passes_the_hub_of_a_vehicle(
    side: Side, flow: str, message: str, topic: AnyTopic, link: str, caller: str | None
) -> None:
    """Not even from a service of the same machine, with keys or without."""
    names = ("drone:pioneer", "pilot:ann", "observer:eve")
    credentials = None if caller is None else Credentials(KeyFiles("", "", ""), names)
    for vehicle in ("pioneer", "another"):
        key = f"{namespace(f'{REPLAY}/{vehicle}')}/{member(topic.key, 'control')}"
        assert not passes(side, link, flow, message, key, credentials, caller)


@given(SIDES, st.sampled_from(["health", "log"]), CHUNK, st.sampled_from(["put", "delete"]))
def test_nobody_outside_speaks_by_the_name_of_what_runs_here(
    side: Side, row: str, name: str, message: str
) -> None:
    """Health counts and log lines are believed by their names."""

    def enters(link: str, key: str) -> bool:
        return passes(side, link, "ingress", message, f"{SPACE}/{key}", own=("control",))

    for link in (*NETWORK, LOCAL):
        assert enters(link, f"{row}/{name}") == (link == LOCAL or name != "control")
        for key in (f"{row}/control", f"identity/{side}"):
            assert enters(link, key) == (link == LOCAL)
            assert passes(side, link, "egress", message, f"{SPACE}/{key}", own=("control",))
        assert enters(link, f"identity/{OTHER[side]}")
