"""Access control of a hub: only topics of the topic table may pass to and from another machine.

Services connect to the hub over a private socket, the other machine over the network; the hub
tells them apart by the protocol, and other machines by the common names of their certificates.
From the network, only topics that the table sends in this direction are let in, and only those of
the other direction are let out (Zenoh's access control, denied by default). A common name is
compared whole: Zenoh has no patterns for them, and no list of revoked certificates.
"""

from typing import Any, NamedTuple

from messages import topics
from messages.topic import Side, Way
from services.runtime.bus.key_files import Door
from services.runtime.bus.spaces import EVERY_SPACE, here_key

LOCAL, NETWORK = "unixsock-stream", ("tcp", "tls", "quic", "udp")
WITH_KEYS = "tls"
MESSAGES = ("put", "delete", "declare_subscriber")
ALL_MESSAGES = (
    *MESSAGES,
    *("query", "reply", "declare_queryable"),
    *("liveliness_token", "declare_liveliness_subscriber", "liveliness_query"),
)
HEAR = ("out", "may_ask_for", "is_here", "may_ask_who")
SAY = ("in", "asks_for", "others_are_here", "asks_who")
# What each role may do at the hub of a side; a role that is not named may do nothing.
RIGHTS: dict[Side, dict[str, tuple[str, ...]]] = {
    "drone": {"pilot": (*SAY, *HEAR), "observer": HEAR, "router": (*SAY, *HEAR)},
    "topside": {"drone": (*SAY, *HEAR), "router": (*SAY, *HEAR)},
}


ASK_WHO = ("liveliness_query", "declare_liveliness_subscriber")


class HubSide(NamedTuple):
    """Which side of the tether a hub is on, and the namespace of its vehicle's keys."""

    side: Side
    space: str
    door: Door | None = None  # None: everybody who reaches the port is the other side


def access_control(hub_side: HubSide) -> dict[str, Any]:
    """Zenoh's `access_control` for this hub."""
    inward, outward = (Way.UP, Way.DOWN) if hub_side.side == "topside" else (Way.DOWN, Way.UP)
    here, there = keys(hub_side.space, outward), keys(hub_side.space, inward)
    rules = [
        rule("own", ["ingress", "egress"], ALL_MESSAGES, ["**", "**/@v1/**"]),
        rule("in", ["ingress"], ("put", "delete"), there),
        rule("out", ["egress"], ("put", "delete"), here),
        # Who watches several drones asks for a row of all of them, and gets that of this one.
        rule("may_ask_for", ["ingress"], ("declare_subscriber",), keys(EVERY_SPACE, outward)),
        rule("asks_for", ["egress"], ("declare_subscriber",), there),
        rule("is_here", ["egress"], ("liveliness_token",), [here_key(hub_side.space)]),
        rule("may_ask_who", ["ingress"], ASK_WHO, [here_key(EVERY_SPACE)]),
        rule("others_are_here", ["ingress"], ("liveliness_token",), _whose_tokens(hub_side)),
        rule("asks_who", ["egress"], ASK_WHO, [here_key(EVERY_SPACE)]),
    ]
    granted = [_services(), *_others(hub_side)]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [subject for subject, _ in granted],
        "policies": [
            {"rules": list(names), "subjects": [subject["id"]]} for subject, names in granted
        ],
    }


Granted = tuple[dict[str, Any], tuple[str, ...]]  # a subject, and the names of its rules


def _services() -> Granted:
    return {"id": "services", "link_protocols": [LOCAL]}, ("own",)


def _others(hub_side: HubSide) -> list[Granted]:
    """Who comes over the network."""
    if hub_side.door is None:
        return [({"id": "network", "link_protocols": list(NETWORK)}, (*SAY, *HEAR))]
    granted: list[Granted] = []
    for role, names in RIGHTS[hub_side.side].items():
        # A subject without common names would be everybody: it is left out.
        if admitted := [name for name in hub_side.door.admitted if name.startswith(f"{role}:")]:
            subject = {"id": role, "link_protocols": [WITH_KEYS], "cert_common_names": admitted}
            granted.append((subject, names))
    return granted


def _whose_tokens(hub_side: HubSide) -> list[str]:
    """Who is there that a hub wants to know of. A drone's wants nobody else's but its own name's,
    however many a stranger announces."""
    return [here_key(EVERY_SPACE if hub_side.side == "topside" else hub_side.space)]


def keys(space: str, way: Way) -> list[str]:
    """Of the rows that cross in this direction, or in both.

    Args:
        space: of one vehicle, or `EVERY_SPACE`.
    """
    rows = [topic for topic in topics.ALL if topic.way in (way, Way.BOTH)]
    return [f"{space}/{topic.key}" for topic in rows if topic not in topics.WITHIN_ONE_MACHINE]


def rule(name: str, flows: list[str], messages: tuple[str, ...], keys: list[str]) -> dict[str, Any]:
    return {
        "id": name,
        "permission": "allow",
        "flows": flows,
        "messages": list(messages),
        "key_exprs": keys,
    }
