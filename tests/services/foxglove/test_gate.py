"""Who is let in to Foxglove's server: viewers of this machine, and no web page of strangers."""

import base64
import importlib.util
import os
import socket
from collections.abc import Generator
from contextlib import ExitStack, closing, suppress
from threading import Thread

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.foxglove.core import parameters, refusal
from services.foxglove.io import gate
from tests.support.doors import free_port
from tests.support.foxglove import Watched
from tests.support.patience import PATIENCE_S, until

needs_sdk = pytest.mark.skipif(
    importlib.util.find_spec("foxglove") is None, reason="the foxglove extra is not installed"
)
PORT = 8765
HEAD = "GET / HTTP/1.1\r\nHost: {host}\r\n{more}\r\n"


def refused(host: str, *origins: str, local: bool = True) -> str:
    more = "".join(f"Origin: {origin}\r\n" for origin in origins)
    return refusal(HEAD.format(host=host, more=more).encode(), PORT, local=local)


@pytest.mark.parametrize("host", ["localhost:8765", "127.0.0.1:8765", "[::1]:8765"])
def test_viewers_of_this_machine_are_let_in(host: str) -> None:
    assert refused(host) == ""
    for origin in (
        "https://app.foxglove.dev", "file://", "app://bundle", "http://localhost:8080",
        "http://127.0.0.1",
    ):  # fmt: skip
        assert refused(host, origin) == ""


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


class Guarded:
    """A gate before a server that sends for ever."""

    def __init__(self, exits: ExitStack) -> None:
        self.port, self.refused = free_port(), list[str]()
        self._server = exits.enter_context(socket.create_server(("127.0.0.1", 0)))
        self._exits = exits
        behind = self._server.getsockname()
        Thread(target=self._send, daemon=True).start()
        front = gate.FrontGate("127.0.0.1", self.port, behind, self.refused.append, local=True)
        exits.enter_context(closing(front))

    def _send(self) -> None:
        with suppress(OSError):
            while True:
                viewer, _ = self._server.accept()
                Thread(target=self._flood, args=(viewer,), daemon=True).start()

    def _flood(self, viewer: socket.socket) -> None:
        with suppress(OSError), viewer:
            while True:
                viewer.sendall(bytes(100_000))

    def caller(self, said: str = "") -> socket.socket:
        called = socket.create_connection(("127.0.0.1", self.port), PATIENCE_S)
        with suppress(ConnectionError):  # it was ended before
            called.sendall(said.encode())
        return self._exits.enter_context(called)

    def viewer(self) -> socket.socket:
        return self.caller(HEAD.format(host=f"localhost:{self.port}", more=""))


def is_closed(called: socket.socket) -> bool:
    """Waits for it, and for nothing else where nothing is sent."""
    with suppress(ConnectionError):
        while called.recv(1_000_000):
            pass
    return True


def is_shown(viewer: socket.socket) -> bool:
    with suppress(ConnectionError):
        return bool(viewer.recv(1000))
    return False


@pytest.fixture
def guarded() -> Generator[Guarded]:
    with ExitStack() as exits:
        yield Guarded(exits)


def test_a_caller_who_says_nothing_is_ended_and_counted(
    guarded: Guarded, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gate, "HEAD_S", 0.05)
    assert is_closed(guarded.caller("GET / HTTP"))
    until(lambda: guarded.refused == ["a connection on which nothing was said"])


def test_a_viewer_who_reads_nothing_is_ended_and_counted(
    guarded: Guarded, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gate, "UNREAD_S", 0.05)
    viewer = guarded.viewer()
    until(lambda: guarded.refused == ["a viewer that does not read"])
    assert is_closed(viewer)


def test_of_too_many_silent_callers_each_is_counted_and_a_viewer_comes_in_when_they_went(
    guarded: Guarded, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gate, "MOST_CONNECTIONS", 4)
    callers = [guarded.caller() for _ in range(4)]
    further = [guarded.caller() for _ in range(3)]
    assert all(is_closed(caller) for caller in further)
    until(lambda: guarded.refused == ["too many connections"] * 3)
    for caller in callers:
        caller.close()
    until(lambda: is_shown(guarded.viewer()))


def test_more_viewers_than_there_is_room_for_are_refused_and_told_why(
    guarded: Guarded, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gate, "MOST", 2)
    for _ in range(2):
        assert guarded.viewer().recv(1000)
    assert guarded.viewer().recv(1000).startswith(b"HTTP/1.1 403")
    assert guarded.refused == ["too many viewers"]
