"""Where a test listens on this machine, what it says over Zenoh, and deploy/router.json5 as
somebody has changed it who follows its comments."""

import json
import socket
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import zenoh

from messages import topics
from messages.topic import AnyTopic
from services.runtime.bus.access_control import LOCAL, NETWORK, Credentials, tls_settings

CROSS = [topic for topic in topics.ALL if topic not in topics.WITHIN_ONE_MACHINE]


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    """Of nobody, a moment ago."""
    with socket.socket(socket.AF_INET, kind) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def free_endpoint(protocol: str = "tcp") -> str:
    return f"{protocol}/127.0.0.1:{free_port()}"


def one(topic: AnyTopic) -> AnyTopic:
    """The row, or a member of the family."""
    return topic.of("x") if topic.is_family else topic


def say(session: zenoh.Session, key: str, payload: bytes = b"") -> None:
    """As slowly as it takes: dropping is allowed to nobody here."""
    session.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)


FILE = Path("deploy/router.json5")
PARTS = ("mode", "listen", "connect", "scouting", "transport", "access_control", "downsampling")
OF_ROLE = {"pilot": "pilots", "observer": "observers", "router": "routers"}


def router_tree(
    listen: Sequence[str], connect: Sequence[str] = (), credentials: Credentials | None = None
) -> dict[str, Any]:
    """
    Args:
        credentials: the router's keys, and whom it lets in; None: whoever reaches it.
    """
    settings = zenoh.Config.from_file(FILE)
    tree: dict[str, Any] = {part: json.loads(settings.get_json(part)) for part in PARTS}
    tree["listen"]["endpoints"], tree["connect"]["endpoints"] = [*listen], [*connect]
    access = tree["access_control"]
    rules = {rule["id"]: rule for rule in access["rules"]}
    granted = {policy["subjects"][0]: policy["rules"] for policy in access["policies"]}
    drones_own = [rules.pop("rov1"), rules.pop("rov1_here")]
    subjects: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []

    def grant(subject: dict[str, Any], ids: Sequence[str]) -> None:
        subjects.append(subject)
        policies.append({"subjects": [subject["id"]], "rules": [*ids]})

    if credentials is None:
        del tree["transport"]["link"]["tls"]
        grant({"id": "network", "link_protocols": [LOCAL, *NETWORK]}, granted["routers"])
    else:
        tree["transport"]["link"]["tls"] = tls_settings(credentials.keys)
        for name in credentials.admitted:
            role, _, own = name.partition(":")
            subject = {"id": name, "link_protocols": ["tls"], "cert_common_names": [name]}
            if role == "drone":
                for rule in drones_own:
                    changed = json.loads(json.dumps(rule).replace("rov1", own))
                    rules[changed["id"]] = changed
                grant(subject, [each.replace("rov1", own) for each in granted["rov1"]])
            else:
                grant(subject, granted[OF_ROLE[role]])
    access |= {"rules": [*rules.values()], "subjects": subjects, "policies": policies}
    return tree
