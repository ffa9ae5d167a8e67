"""Who may say and hear what at a hub or a router: the one place that turns the topic table into
Zenoh's access control; and the certificate files of this machine.

Services connect to their hub over a private socket, the other machine over the network; the hub
tells them apart by the protocol, and other machines by the common names of their certificates.
From the network, only topics that the table sends in this direction are let in, and only those of
the other direction are let out (Zenoh's access control, denied by default). A common name is
compared whole: Zenoh has no patterns for them, and no list of revoked certificates.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from messages import topics
from messages.topic import Direction, Side
from services.runtime.bus.spaces import EVERY_SPACE, here_key, name_in
from services.runtime.os import system


class KeyFiles(NamedTuple):
    """Paths of PEM files."""

    authority: str  # certificate of the authority that signed everybody's certificate
    certificate: str  # this machine's
    key: str  # its private key


class Credentials(NamedTuple):
    """How this machine proves who it is, and whom it lets in."""

    keys: KeyFiles
    admitted: tuple[str, ...]  # common names of certificates, `role:name`
    name: str = ""  # of this machine's own certificate, without its role


def tls_settings(keys: KeyFiles) -> dict[str, Any]:
    """Zenoh's `transport/link/tls`: both ends prove who they are.

    A certificate names a role and no address, so addresses are not compared; that only a drone's
    certificate can answer and only a pilot's or observer's can call is in its extended key usage.
    A certificate that expires during a dive does not end the dive.
    """
    return {
        "root_ca_certificate": keys.authority,
        "listen_certificate": keys.certificate,
        "listen_private_key": keys.key,
        "connect_certificate": keys.certificate,
        "connect_private_key": keys.key,
        "enable_mtls": True,
        "verify_name_on_connect": False,
        "close_link_on_expiration": False,
    }


LOCAL, NETWORK = system.LOCAL, ("tcp", "tls", "quic", "udp")
WITH_KEYS = "tls"
PUTS, SUBSCRIBE, TOKEN = ("put", "delete"), ("declare_subscriber",), ("liveliness_token",)
ASK_WHO = ("liveliness_query", "declare_liveliness_subscriber")
ALL_MESSAGES = (*PUTS, *SUBSCRIBE, "query", "reply", "declare_queryable", *TOKEN, *ASK_WHO)
EVERYBODY = (here_key(EVERY_SPACE),)  # the tokens of all vehicles and topsides


class HubSide(NamedTuple):
    """Which side of the tether a hub is on, and the namespace of its vehicle's keys."""

    side: Side
    space: str
    credentials: Credentials | None = None  # None: everybody who reaches the port is the other side
    own: tuple[str, ...] = ()  # names of what runs here, by which nobody from outside may speak


class Rights(NamedTuple):
    """What somebody may do, by keys."""

    says: Sequence[str] = ()  # messages to us
    hears: Sequence[str] = ()  # messages from us
    asks: Sequence[str] = ()  # may subscribe to
    is_asked: Sequence[str] = ()  # may be asked for
    is_here: Sequence[str] = ()  # tokens that it may show
    sees: Sequence[str] = ()  # tokens that it may see


def access_control(hub_side: HubSide) -> dict[str, Any]:
    """Zenoh's `access_control` for this hub: whatever is not granted is denied."""
    space, credentials, of_drone = hub_side.space, hub_side.credentials, hub_side.side == "drone"
    inward, outward = (Direction.DOWN, Direction.UP) if of_drone else (Direction.UP, Direction.DOWN)
    other = Rights(
        says=keys(space, inward),
        hears=keys(space, outward),
        # Whoever watches several drones subscribes to a row of all of them, and gets this one's.
        asks=keys(EVERY_SPACE, outward),
        is_asked=keys(space, inward),
        # A drone lets in its own name's tokens only, however many a stranger announces.
        is_here=[here_key(space)] if of_drone else EVERYBODY,
        sees=[here_key(space)],
    )
    # Only a router brings the token of another drone of that name.
    pilot = other._replace(is_here=[here_key(space, "topside")])
    listener = Rights(hears=other.hears, asks=other.asks, sees=other.sees)
    # A role that is not named may do nothing.
    roles = {"pilot": pilot, "observer": listener} if of_drone else {"drone": other}
    granted = list[tuple[dict[str, Any], Rights]]()  # to a subject
    if credentials is None:
        granted.append(({"id": "network", "link_protocols": list(NETWORK)}, other))
    else:
        # At a topside, of all drones on the list, only that whose name its keys have may be it.
        drone = f"drone:{name_in(f'{space}/x')}"
        believed = [
            name
            for name in credentials.admitted
            if of_drone or name == drone or not name.startswith("drone:")
        ]
        for role, rights in {**roles, "router": other}.items():
            # A subject without common names would be everybody: it is left out.
            if names := [name for name in believed if name.startswith(f"{role}:")]:
                who = {"id": role, "link_protocols": [WITH_KEYS], "cert_common_names": names}
                granted.append((who, rights))
    said = [f"{space}/{row}/{name}" for row in ("health", "log") for name in hub_side.own]
    services = {"id": "services", "link_protocols": [LOCAL]}
    ours = _rule("own", ("ingress", "egress"), ALL_MESSAGES, ["**", "**/@v1/**"])
    policies = [(services, [ours])]
    for subject, rights in granted:
        name, on = f"{subject['id']}_posing", [*said, f"{space}/identity/{hub_side.side}"]
        posing = _rule(name, ["ingress"], PUTS, on)
        posing["permission"] = "deny"  # which goes before what is allowed
        policies.append((subject, [*_rules(subject["id"], rights), posing]))
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule for _, rules in policies for rule in rules],
        "subjects": [subject for subject, _ in policies],
        "policies": [
            {"rules": [rule["id"] for rule in rules], "subjects": [subject["id"]]}
            for subject, rules in policies
        ],
    }


def _rules(who: str, rights: Rights) -> list[dict[str, Any]]:
    """Zenoh's rules for somebody with these rights."""
    acts = (
        ("says", "ingress", PUTS, rights.says),
        ("hears", "egress", PUTS, rights.hears),
        ("asks", "ingress", SUBSCRIBE, rights.asks),
        ("is_asked", "egress", SUBSCRIBE, rights.is_asked),
        ("is_here", "ingress", TOKEN, rights.is_here),
        ("sees", "egress", TOKEN, rights.sees),
        ("asks_who", "ingress", ASK_WHO, EVERYBODY if rights.sees else ()),
        ("is_asked_who", "egress", ASK_WHO, EVERYBODY if rights.is_here else ()),
    )
    return [_rule(f"{who}_{act}", [flow], what, on) for act, flow, what, on in acts if on]


def keys(space: str, way: Direction) -> list[str]:
    """Of the rows that cross in this direction, or in both.

    Args:
        space: of one vehicle, or `EVERY_SPACE`.
    """
    rows = [topic for topic in topics.ALL if topic.way in (way, Direction.BOTH)]
    return [f"{space}/{topic.key}" for topic in rows if topic not in topics.WITHIN_ONE_MACHINE]


def _rule(
    name: str, flows: Iterable[str], what: Sequence[str], on: Sequence[str]
) -> dict[str, Any]:
    return {
        "id": name,
        "permission": "allow",
        "flows": list(flows),
        "messages": list(what),
        "key_exprs": list(on),
    }
