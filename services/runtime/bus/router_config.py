"""The configuration of a Zenoh router (zenohd) between many drones and pilots. Pure.

The rows of the topic table say who may say and hear what, and how urgent it is. Who is who is in
the certificates: a drone speaks by its own name only, a pilot may call every drone and says no row
that goes up, an observer says nothing, and another router passes on whatever the table has. Without
certificates everybody may do what pilots and drones together may.
"""

from collections.abc import Sequence
from typing import Any

from messages import topics
from messages.topic import Way
from services.runtime.bus.access_control import ASK_WHO, LOCAL, NETWORK, WITH_KEYS, keys, rule
from services.runtime.bus.key_files import Door, tls_settings
from services.runtime.bus.qos import QOS_PROFILES
from services.runtime.bus.spaces import EVERY_SPACE, here_key, namespace
from services.runtime.bus.zenoh_bus import common_settings

PUTS = ("put", "delete")
DRONE = "drone:"  # of the common name of a drone
Rules = list[dict[str, Any]]


def router_config(
    listen: Sequence[str],
    connect: Sequence[str] = (),
    door: Door | None = None,
    thin: Sequence[str] = (),
    drones: Sequence[str] = (),
) -> dict[str, Any]:
    """Zenoh's whole configuration, as its JSON5 file.

    Args:
        listen: endpoints for drones, pilots and other routers.
        connect: endpoints of other routers; retried while they cannot be reached.
        door: this router's keys, and whom it lets in; None: whoever reaches it.
        thin: network interfaces of links with little room.
        drones: names of the drones that are thinned there, besides those that `door` lets in.
    """
    tree: dict[str, Any] = {}
    for place, value in common_settings("router", listen, connect).items():
        _put(tree, place, value)
    if door is not None:
        _put(tree, "transport/link/tls", tls_settings(door.keys))
    tree["access_control"] = _access_control(door)
    tree["qos"] = {"network": _priorities()}
    tree["downsampling"] = [_thinned(thin, thinned_drones(door, drones))] if thin else []
    return tree


def thinned_drones(door: Door | None, named: Sequence[str] = ()) -> list[str]:
    """Names of the drones whose streams a thin link thins."""
    admitted = () if door is None else door.admitted
    own = [name.removeprefix(DRONE) for name in admitted if name.startswith(DRONE)]
    return sorted({*own, *named})


def _access_control(door: Door | None) -> dict[str, Any]:
    if door is None:
        subject = {"id": "network", "link_protocols": [LOCAL, *NETWORK]}
        granted = [(subject, _everything("network"))]
    else:
        granted = _granted(door)
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [each for _, rules in granted for each in rules],
        "subjects": [subject for subject, _ in granted],
        "policies": [
            {"rules": [each["id"] for each in rules], "subjects": [subject["id"]]}
            for subject, rules in granted
        ],
    }


def _granted(door: Door) -> list[tuple[dict[str, Any], Rules]]:
    """A subject for every drone, and one for every other role that somebody has."""
    granted: list[tuple[dict[str, Any], Rules]] = []
    for name in door.admitted:
        role, _, own = name.partition(":")
        if role == "drone":
            granted.append((_subject(f"drone_{own}", [name]), _drone(f"drone_{own}", own)))
    for role, rules in (("pilot", _pilot()), ("observer", _hearer("observer"))):
        if names := [name for name in door.admitted if name.startswith(f"{role}:")]:
            granted.append((_subject(role, names), rules))
    if names := [name for name in door.admitted if name.startswith("router:")]:
        granted.append((_subject("router", names), _everything("router")))
    return granted


def _subject(name: str, admitted: list[str]) -> dict[str, Any]:
    return {"id": name, "link_protocols": [WITH_KEYS], "cert_common_names": admitted}


def _drone(who: str, name: str) -> Rules:
    """It says what goes up, by its own name; who watches several drones asks for that of all."""
    space = namespace(name)
    return [
        rule(f"{who}_says", ["ingress"], PUTS, keys(space, Way.UP)),
        rule(f"{who}_hears", ["egress"], PUTS, keys(space, Way.DOWN)),
        rule(f"{who}_asks", ["ingress"], ("declare_subscriber",), keys(space, Way.DOWN)),
        rule(f"{who}_is_asked", ["egress"], ("declare_subscriber",), keys(EVERY_SPACE, Way.UP)),
        rule(f"{who}_is_here", ["ingress"], ("liveliness_token",), [here_key(space, "drone")]),
        rule(f"{who}_sees", ["egress"], ("liveliness_token",), [here_key(space)]),
        _who(who),
    ]


def _pilot() -> Rules:
    """It says what goes down, to every drone; whom a drone obeys is the drone's own affair."""
    down = keys(EVERY_SPACE, Way.DOWN)
    here = [here_key(EVERY_SPACE, "topside")]
    return [
        *_hearer("pilot"),
        rule("pilot_says", ["ingress"], PUTS, down),
        rule("pilot_is_asked", ["egress"], ("declare_subscriber",), down),
        rule("pilot_is_here", ["ingress"], ("liveliness_token",), here),
    ]


def _hearer(who: str) -> Rules:
    up = keys(EVERY_SPACE, Way.UP)
    return [
        rule(f"{who}_hears", ["egress"], PUTS, up),
        rule(f"{who}_asks", ["ingress"], ("declare_subscriber",), up),
        rule(f"{who}_sees", ["egress"], ("liveliness_token",), [here_key(EVERY_SPACE)]),
        _who(who),
    ]


def _everything(who: str) -> Rules:
    """Every row of the table that leaves its machine, in both directions."""
    rows = sorted({*keys(EVERY_SPACE, Way.UP), *keys(EVERY_SPACE, Way.DOWN)})
    here, flows = [here_key(EVERY_SPACE)], ["ingress", "egress"]
    return [
        rule(f"{who}_rows", flows, (*PUTS, "declare_subscriber"), rows),
        rule(f"{who}_here", flows, ("liveliness_token",), here),
        _who(who),
    ]


def _who(who: str) -> dict[str, Any]:
    return rule(f"{who}_asks_who", ["ingress", "egress"], ASK_WHO, [here_key(EVERY_SPACE)])


def _priorities() -> list[dict[str, Any]]:
    """What a row's QoS profile is on every link, whatever its sender says it is."""
    return [
        {
            "id": profile.value,
            "messages": list(PUTS),
            "key_exprs": [
                f"{EVERY_SPACE}/{topic.key}" for topic in topics.ALL if topic.qos is profile
            ],
            "overwrite": {
                "priority": _word(qos.priority),
                "congestion_control": _word(qos.congestion_control),
                "express": qos.express,
            },
        }
        for profile, qos in QOS_PROFILES.items()
    ]


def _word(setting: object) -> str:
    """As Zenoh's configuration spells it."""
    return str(setting).rpartition(".")[2].lower()


def _thinned(interfaces: Sequence[str], drones: Sequence[str]) -> dict[str, Any]:
    """Fast streams that go up, fewer times a second. What a pilot says is never thinned.

    A rule for every drone: Zenoh counts per rule, so that of all drones that one rule matches, one
    alone would be let through.
    """
    fast = [topic for topic in topics.ALL if topic.way is Way.UP and topic.hz > topics.THIN_HZ]
    return {
        "id": "thin",
        "interfaces": list(interfaces),
        "messages": ["put"],
        "flows": ["egress"],
        "rules": [
            {"key_expr": f"{namespace(drone)}/{topic.key}", "freq": topics.THIN_HZ}
            for drone in drones
            for topic in fast
        ],
    }


def _put(tree: dict[str, Any], place: str, value: Any) -> None:
    """Put a value in its place, such as `transport/link/tls`."""
    *rooms, last = place.split("/")
    for room in rooms:
        tree = tree.setdefault(room, {})
    tree[last] = value
