"""A port of this computer that nobody has."""

import socket


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def free_endpoint() -> str:
    return f"tcp/127.0.0.1:{free_port()}"
