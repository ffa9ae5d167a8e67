"""Access control of a hub: only topics of the topic table may pass to and from another machine.

Services connect to the hub over a private socket, the other machine over the network; the hub
tells them apart by the protocol. From the network, only topics that the table sends in this
direction are let in, and only those of the other direction are let out (Zenoh's access control,
denied by default).
"""

from typing import Any, NamedTuple

from messages import topics
from messages.topic import Side, Way

LOCAL, NETWORK = "unixsock-stream", ("tcp", "tls", "quic", "udp")
MESSAGES = ("put", "delete", "declare_subscriber")
ALL_MESSAGES = (
    *MESSAGES,
    *("query", "reply", "declare_queryable"),
    *("liveliness_token", "declare_liveliness_subscriber", "liveliness_query"),
)


class HubSide(NamedTuple):
    """Which side of the tether a hub is on, and the namespace of its vehicle's keys."""

    side: Side
    space: str


def access_control(hub_side: HubSide) -> dict[str, Any]:
    """Zenoh's `access_control` for this hub."""
    inward, outward = (Way.UP, Way.DOWN) if hub_side.side == "topside" else (Way.DOWN, Way.UP)
    here, there = _keys(hub_side.space, outward), _keys(hub_side.space, inward)
    rules = [
        _rule("own", ["ingress", "egress"], ALL_MESSAGES, ["**", "**/@v1/**"]),
        _rule("in", ["ingress"], ("put", "delete"), there),
        _rule("out", ["egress"], ("put", "delete"), here),
        _rule("may_ask_for", ["ingress"], ("declare_subscriber",), here),
        _rule("asks_for", ["egress"], ("declare_subscriber",), there),
    ]
    subjects = [
        {"id": "services", "link_protocols": [LOCAL]},
        {"id": "network", "link_protocols": list(NETWORK)},
    ]
    policies = [
        {"rules": ["own"], "subjects": ["services"]},
        {"rules": ["in", "out", "may_ask_for", "asks_for"], "subjects": ["network"]},
    ]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _keys(space: str, way: Way) -> list[str]:
    rows = [topic for topic in topics.ALL if topic.way in (way, Way.BOTH)]
    return [f"{space}/{topic.key}" for topic in rows]


def _rule(
    name: str, flows: list[str], messages: tuple[str, ...], keys: list[str]
) -> dict[str, Any]:
    return {
        "id": name,
        "permission": "allow",
        "flows": flows,
        "messages": list(messages),
        "key_exprs": keys,
    }
