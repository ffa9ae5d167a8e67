"""Where a test listens on this machine, and what it says over Zenoh."""

import socket

import zenoh

from messages import topics
from messages.topic import AnyTopic

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
