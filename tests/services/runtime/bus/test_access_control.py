"""What may pass between two machines: the rows of the topic table that cross, and nothing else."""

from typing import Any

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.topic import AnyTopic, Side, Way
from services.runtime.bus.access_control import (
    ALL_MESSAGES,
    LOCAL,
    NETWORK,
    HubSide,
    access_control,
)
from services.runtime.bus.zenoh_bus import namespace

SPACE = namespace("pioneer")
OTHER: dict[Side, Side] = {"topside": "drone", "drone": "topside"}
SAID_AT: dict[Side, set[Way]] = {  # what one side says that the other may hear
    "topside": {Way.DOWN, Way.BOTH},
    "drone": {Way.UP, Way.BOTH},
}
SIDES = st.sampled_from(["topside", "drone"])
FLOWS = st.sampled_from(["ingress", "egress"])
CHUNK = st.from_regex(r"[a-z0-9_]{1,12}", fullmatch=True)
STRANGE = st.lists(CHUNK, min_size=1, max_size=4).map("/".join)


def passes(side: Side, link: str, flow: str, message: str, key: str) -> bool:
    """As Zenoh judges: a rule covers a message when one of its keys includes the message's."""
    table: dict[str, Any] = access_control(HubSide(side, SPACE))
    assert table["enabled"]
    assert table["default_permission"] == "deny"
    subjects = {s["id"] for s in table["subjects"] if link in s["link_protocols"]}
    policies = [p for p in table["policies"] if subjects & set(p["subjects"])]
    named = {name for policy in policies for name in policy["rules"]}
    return any(
        rule["permission"] == "allow"
        and flow in rule["flows"]
        and message in rule["messages"]
        and any(zenoh.KeyExpr(k).includes(zenoh.KeyExpr(key)) for k in rule["key_exprs"])
        for rule in table["rules"]
        if rule["id"] in named
    )


def member(key: str, name: str) -> str:
    return key.replace("*", name)


@given(SIDES, st.sampled_from(topics.ALL), CHUNK, st.sampled_from(NETWORK))
def test_a_row_passes_the_network_in_its_own_way_only(
    side: Side, topic: AnyTopic, name: str, link: str
) -> None:
    key = f"{SPACE}/{member(topic.key, name)}"
    for message in ("put", "delete"):
        assert passes(side, link, "egress", message, key) == (topic.way in SAID_AT[side])
        assert passes(side, link, "ingress", message, key) == (topic.way in SAID_AT[OTHER[side]])


@given(SIDES, st.sampled_from(topics.ALL), st.sampled_from(NETWORK))
def test_a_row_may_be_asked_for_by_those_who_may_hear_it(
    side: Side, topic: AnyTopic, link: str
) -> None:
    key, ask = f"{SPACE}/{topic.key}", "declare_subscriber"
    assert passes(side, link, "ingress", ask, key) == (topic.way in SAID_AT[side])
    assert passes(side, link, "egress", ask, key) == (topic.way in SAID_AT[OTHER[side]])


@given(SIDES, FLOWS, st.sampled_from(ALL_MESSAGES), STRANGE)
def test_nothing_that_is_not_in_the_table_passes_the_network(
    side: Side, flow: str, message: str, key: str
) -> None:
    ours = topics.find(key) is not None
    assert ours or not passes(side, "tcp", flow, message, f"{SPACE}/{key}")
    assert not passes(side, "tcp", flow, message, key)  # outside the vehicle's namespace
    other_vehicle = f"{namespace('another')}/{key}"
    assert not passes(side, "tcp", flow, message, other_vehicle)


@given(SIDES, FLOWS, st.sampled_from(["query", "reply", "liveliness_token", "liveliness_query"]))
def test_whether_a_service_is_alive_is_no_concern_of_the_other_machine(
    side: Side, flow: str, message: str
) -> None:
    for key in ("alive/control", *(topic.key for topic in topics.ALL)):
        assert not passes(side, "tcp", flow, message, f"{SPACE}/{key}")


@given(SIDES, FLOWS, st.sampled_from(ALL_MESSAGES), STRANGE)
def test_own_services_may_say_and_hear_everything(
    side: Side, flow: str, message: str, key: str
) -> None:
    assert passes(side, LOCAL, flow, message, f"{SPACE}/{key}")


@pytest.mark.parametrize("message", ["put", "delete", "declare_subscriber"])
@pytest.mark.parametrize("key", [topic.key for topic in topics.ALL])
def test_both_sides_are_mirror_images(key: str, message: str) -> None:
    key = f"{SPACE}/{member(key, 'x')}"
    for one, two in (("ingress", "egress"), ("egress", "ingress")):
        assert passes("drone", "tcp", one, message, key) == passes(
            "topside", "tcp", two, message, key
        )
