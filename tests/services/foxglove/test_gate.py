"""Who is let in to Foxglove's server: viewers of this machine, and no web page of strangers."""

import base64
import importlib.util
import os
import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.foxglove.core import parameters
from services.foxglove.handshake import refusal

from .test_live_server import Watched

needs_sdk = pytest.mark.skipif(
    importlib.util.find_spec("foxglove") is None, reason="the foxglove extra is not installed"
)
PORT = 8765
HEAD = "GET / HTTP/1.1\r\nHost: {host}\r\n{more}\r\n"


def refused(host: str, *origins: str, local: bool = True) -> str:
    more = "".join(f"Origin: {origin}\r\n" for origin in origins)
    return refusal(HEAD.format(host=host, more=more).encode(), PORT, local=local)


@pytest.mark.parametrize("host", ["localhost:8765", "127.0.0.1:8765", "[::1]:8765"])
@pytest.mark.parametrize(
    "origin",
    ["https://app.foxglove.dev", "file://", "app://bundle", "http://localhost:8080",
     "http://127.0.0.1", None],
)  # fmt: skip
def test_viewers_of_this_machine_are_let_in(host: str, origin: str | None) -> None:
    assert refused(host, *(() if origin is None else (origin,))) == ""


@pytest.mark.parametrize(
    "origin",
    ["https://evil.example", "http://evil.example:8765", "null", "http://localhost.evil.example",
     "https://app.foxglove.dev.evil.example", "http://127.0.0.1.evil.example:80", ""],
)  # fmt: skip
def test_a_page_of_strangers_is_not(origin: str) -> None:
    assert refused("localhost:8765", origin).startswith("wrong Origin")
    assert refused("localhost:8765", "file://", origin).startswith("wrong Origin")


@pytest.mark.parametrize(
    "host", ["evil.example:8765", "localhost:80", "localhost", "", "a\tb:8765"]
)
def test_a_name_that_leads_here_for_a_while_is_not(host: str) -> None:
    """DNS rebinding: the page's own name is looked up anew, as an address of this machine."""
    assert refused(host).startswith("wrong Host")
    assert refused(host, local=False) == ""


@given(st.binary(max_size=300))
def test_whatever_comes_is_let_in_or_refused(head: bytes) -> None:
    assert isinstance(refusal(head, PORT, local=True), str)


@needs_sdk
def test_no_viewer_is_shown_a_password() -> None:
    from services.foxglove.io.server import ShownParameters

    tree = {"camera": {"source": "rtsp://ann:secret@10.0.0.2/live?token=x", "rate": 25}}
    shown = ShownParameters(parameters(tree)).on_get_parameters(None, [])  # type: ignore[arg-type]
    values = {each.name: each.get_value() for each in shown}
    assert values == {"camera.source": "rtsp://…@10.0.0.2/live?…", "camera.rate": 25}


def answered(watched: Watched, origin: str) -> bytes:
    key = base64.b64encode(os.urandom(16)).decode()
    head = (
        f"GET / HTTP/1.1\r\nHost: localhost:{watched.port}\r\nUpgrade: websocket\r\n"
        f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
        f"Sec-WebSocket-Protocol: foxglove.sdk.v1\r\nOrigin: {origin}\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", watched.port), 10.0) as client:
        client.sendall(head.encode())
        return client.recv(200)


@needs_sdk
def test_the_server_upgrades_for_a_viewer_and_for_no_foreign_page() -> None:
    watched = Watched()
    assert answered(watched, "https://app.foxglove.dev").startswith(b"HTTP/1.1 101")
    assert answered(watched, "https://evil.example").startswith(b"HTTP/1.1 403")
    watched.run_on()
    said = [line.text for line in watched.lines if line.level == "warning"]
    watched.host.close()
    assert said == [
        "somebody was not let in: wrong Origin: only Foxglove and Lichtblick may connect"
    ]
