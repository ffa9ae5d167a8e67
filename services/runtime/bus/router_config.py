"""The configuration of a Zenoh router (zenohd) between many drones and pilots. Pure.

The rows of the topic table say who may say and hear what, and how urgent it is. Who is who is in
the certificates: a drone speaks by its own name only, a pilot may call every drone and says no row
that goes up, an observer says nothing, and another router passes on whatever the table has. Without
certificates everybody may do what pilots and drones together may.
"""

from collections.abc import Sequence
from typing import Any

from messages import topics
from messages.topic import Direction
from services.runtime.bus.access_control import (
    EVERYBODY,
    LOCAL,
    NETWORK,
    PUTS,
    Rights,
    anybody,
    by_role,
    enforced,
    keys,
    named,
)
from services.runtime.bus.key_files import Credentials, tls_settings
from services.runtime.bus.qos import QOS_PROFILES
from services.runtime.bus.spaces import EVERY_SPACE, here_key, namespace
from services.runtime.bus.zenoh_bus import common_settings

DRONE = "drone:"  # of the common name of a drone


def router_config(
    listen: Sequence[str],
    connect: Sequence[str] = (),
    credentials: Credentials | None = None,
    thin: Sequence[str] = (),
    drones: Sequence[str] = (),
) -> dict[str, Any]:
    """Zenoh's whole configuration, as its JSON5 file.

    Args:
        listen: endpoints for drones, pilots and other routers.
        connect: endpoints of other routers; retried while they cannot be reached.
        credentials: this router's keys, and whom it lets in; None: whoever reaches it.
        thin: network interfaces of links with little room.
        drones: names of the drones that are thinned there, besides those of `credentials`.
    """
    tree: dict[str, Any] = {}
    for place, value in common_settings("router", listen, connect).items():
        _put(tree, place, value)
    if credentials is not None:
        _put(tree, "transport/link/tls", tls_settings(credentials.keys))
    tree["access_control"] = _access_control(credentials)
    tree["qos"] = {"network": _priorities()}
    tree["downsampling"] = [_thinned(thin, thinned_drones(credentials, drones))] if thin else []
    return tree


def thinned_drones(credentials: Credentials | None, named: Sequence[str] = ()) -> list[str]:
    """Names of the drones whose streams a thin link thins."""
    admitted = () if credentials is None else credentials.admitted
    own = [name.removeprefix(DRONE) for name in admitted if name.startswith(DRONE)]
    return sorted({*own, *named})


def _access_control(credentials: Credentials | None) -> dict[str, Any]:
    up, down = keys(EVERY_SPACE, Direction.UP), keys(EVERY_SPACE, Direction.DOWN)
    both = sorted({*up, *down})  # every row of the table that leaves its machine
    everything = Rights(both, both, both, both, EVERYBODY, EVERYBODY)
    if credentials is None:
        return enforced([anybody([LOCAL, *NETWORK], everything)])
    roles = {
        # It says what goes down, to every drone; whom a drone obeys is the drone's own affair.
        "pilot": Rights(down, up, up, down, [here_key(EVERY_SPACE, "topside")], EVERYBODY),
        "observer": Rights(hears=up, asks=up, sees=EVERYBODY),
        "router": everything,
    }
    drones = [name.partition(":")[2] for name in credentials.admitted if name.startswith(DRONE)]
    own = [named(f"drone_{name}", [f"{DRONE}{name}"], _drone(namespace(name))) for name in drones]
    return enforced([*own, *by_role(credentials, roles)])


def _drone(space: str) -> Rights:
    """It says what goes up, by its own name; who watches several drones asks for that of all."""
    return Rights(
        says=keys(space, Direction.UP),
        hears=keys(space, Direction.DOWN),
        asks=keys(space, Direction.DOWN),
        is_asked=keys(EVERY_SPACE, Direction.UP),
        is_here=[here_key(space, "drone")],
        sees=[here_key(space)],
    )


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
    fast = [
        topic for topic in topics.ALL if topic.way is Direction.UP and topic.hz > topics.THIN_HZ
    ]
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
