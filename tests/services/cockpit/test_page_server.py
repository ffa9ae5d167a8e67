"""The web server with real sockets: who is let in, what is served, who is left out."""

import asyncio
import json
import socket
import ssl
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import ExitStack, nullcontext, suppress
from datetime import UTC, datetime
from pathlib import Path

import pytest

from tests.support.doors import free_port

pytest.importorskip("websockets", reason="the extra cockpit is not installed")

from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from messages.events import Outbox
from services.cockpit.core import Settings
from services.cockpit.handshake import Access
from services.cockpit.io import server as server_module
from services.cockpit.io.access import VARIABLE, access_to
from services.cockpit.io.server import (
    MOST_CONNECTIONS,
    MOST_PAGES,
    MOST_PER_SECOND,
    MOST_WATCHERS,
    PageServer,
)
from services.cockpit.page_messages import PageAbsence, PageClosed, PageEvent, PageOpened, PageSaid
from services.cockpit.service import wire
from services.cockpit.video import PageUnit
from services.runtime.config.errors import LindyError, NeedsRealTimeError
from services.runtime.config.stack import Stack
from services.runtime.hosts.virtual_host import VirtualHost
from tests.support.patience import PATIENCE_S, until

STICKS = {"kind": "sticks", "seen": 0, "held_ms": 0, "surge": 0, "sway": 0, "heave": 0, "yaw": 0}


class Served:
    """A server on loopback, and clients of it."""

    def __init__(self, exits: ExitStack) -> None:
        self.settings = Settings(port=free_port())
        self.base = f"http://127.0.0.1:{self.settings.port}"
        self.outbox = Outbox()
        self.server = PageServer(self.settings, access_to(self.settings), self.outbox)
        self.events: list[PageEvent] = []
        self.server.start(lambda: None)
        self._exits = exits
        exits.callback(self.server.close)
        text = self.get("/").decode()
        self.version = text.partition('name="version" content="')[2].partition('"')[0]

    def get(self, path: str, **headers: str) -> bytes:
        asked = urllib.request.Request(self.base + path, headers=headers)
        with urllib.request.urlopen(asked, timeout=PATIENCE_S) as answer:
            return answer.read()

    def page(
        self, path: str = "/ws/pilot", origin: str = "", version: str = ""
    ) -> ClientConnection:
        url = f"{self.base.replace('http', 'ws')}{path}?version={version or self.version}"
        return self._exits.enter_context(
            connect(url, origin=origin or self.base, compression=None)  # type: ignore[arg-type]
        )

    def until(self, true: Callable[[], bool]) -> None:
        self._receive()
        until(true, lambda: (self.events, self.outbox.counts), self._receive)

    def _receive(self) -> None:
        self.events += self.server.received()

    def of(self, kind: type) -> list[PageEvent]:
        return [event for event in self.events if isinstance(event, kind)]


@pytest.fixture
def served() -> Iterator[Served]:
    with ExitStack() as exits:
        yield Served(exits)


def test_the_page_and_its_modules_are_served_and_nothing_else(served: Served):
    html = served.get("/").decode()
    assert served.get("/watch").decode() == html
    for path in Path(server_module.__file__).parents[1].joinpath("page").iterdir():
        assert served.get(f"/{path.name}")
    assert served.get("/keys.json")
    for path in ("/nothing.js", "/../core.py", "/%2e%2e/core.py", "/service.py", "//"):
        with pytest.raises(urllib.error.HTTPError, match="404"):
            served.get(path)
    with pytest.raises(urllib.error.HTTPError, match="403"):
        served.get("/", Host="evil.example")


def test_what_pages_say_arrives_in_order_and_of_sticks_the_newest(served: Served):
    ann, _eve = served.page(), served.page("/ws/watch")
    for k in range(20):
        ann.send(json.dumps(STICKS | {"seen": k}))
    ann.send(json.dumps({"kind": "absent", "seen": 1, "held_ms": 0, "why": "hidden"}))
    ann.send("garbage")
    ann.send(b"\x00\xff")
    ann.close()
    served.until(lambda: bool(served.of(PageClosed)))
    assert served.of(PageOpened) == [PageOpened(1, False), PageOpened(2, True)]
    said = [event for event in served.events if isinstance(event, PageSaid) and event.page == 1]
    assert said[-1].message is None
    assert said[-2].message is None
    assert isinstance(said[-3].message, PageAbsence)
    assert len(said) <= 23


def test_each_page_gets_its_own_picture_and_a_slow_one_costs_nothing(served: Served):
    ann, eve = served.page(), served.page("/ws/watch")
    served.until(lambda: len(served.of(PageOpened)) == 2)
    served.server.show({1: "for ann", 2: "for eve", 99: "for nobody"})
    assert ann.recv(timeout=PATIENCE_S) == "for ann"
    assert eve.recv(timeout=PATIENCE_S) == "for eve"
    big = "x" * 500_000  # nobody reads: it fills the system's buffers
    while not served.outbox.counts["dropped:page"]:
        served.server.show({2: big})
        served.server.show({1: "still here"})
        assert ann.recv(timeout=PATIENCE_S) == "still here"


def test_pages_get_the_picture_and_a_slow_one_costs_nothing_but_its_own(served: Served):
    units = [PageUnit(n, n % 25 == 1, bytes([n]) * 20_000) for n in range(1, 200)]
    served.server.show_video(units[0])
    ann, eve, late = (served.page("/ws/video") for _ in range(3))
    for page in (ann, eve, late):  # opened after it: what there is since the keyframe
        assert page.recv(timeout=PATIENCE_S) == units[0].message
    late.send("0")
    late.send("garbage")
    late.send("²")
    served.until(lambda: served.outbox.counts["malformed:page"] == 3)
    late.close()
    for unit in units[1:]:
        ann.send(str(unit.number - 1))
        served.server.show_video(unit)
        assert ann.recv(timeout=PATIENCE_S) == unit.message
        time.sleep(0.005)  # eve confirms nothing, for 0.6 s at least
    assert served.outbox.counts["dropped:page_video"] > 0
    assert not served.of(PageOpened)  # it is no page of its own
    with suppress(TimeoutError):
        while eve.recv(timeout=0.2):  # what was sent before she was too slow; else she cannot close
            pass


def test_foreign_pages_and_other_versions_are_refused(served: Served):
    for origin in ("http://evil.example", "null", served.base.replace("127.0.0.1", "localhost")):
        with pytest.raises(InvalidStatus, match="403"):
            served.page(origin=origin)
    assert served.outbox.counts["refused:page"] == 3
    old = served.page(version="old")
    with pytest.raises(ConnectionClosed, match=r"4001.*another version: load it again"):
        old.recv(timeout=PATIENCE_S)
    assert not served.server.received()


def test_huge_and_too_many_messages_end_that_page_alone(served: Served):
    ann, bob, eve = served.page(), served.page(), served.page()
    served.until(lambda: len(served.of(PageOpened)) == 3)
    bob.send("x" * 5000)
    served.until(lambda: PageClosed(2) in served.events)
    assert served.outbox.counts["oversized:page"] == 1
    with suppress(ConnectionClosed):
        for _ in range(20 * MOST_PER_SECOND):
            eve.send("[]")
    served.until(lambda: PageClosed(3) in served.events)
    assert served.outbox.counts["too_many:page_messages"] == 1
    ann.send(json.dumps(STICKS))
    served.until(lambda: any(isinstance(e, PageSaid) and e.page == 1 for e in served.events))


def test_a_flood_of_connections_leaves_the_pilot_alone(served: Served):
    ann = served.page()
    flood = [socket.create_connection(("127.0.0.1", served.settings.port)) for _ in range(300)]
    try:
        served.until(lambda: served.outbox.counts["too_many:connection"] >= 300 - MOST_CONNECTIONS)
        served.until(lambda: bool(served.of(PageOpened)))
        served.server.show({1: "still here"})
        assert ann.recv(timeout=PATIENCE_S) == "still here"
    finally:
        for one in flood:
            one.close()


@pytest.mark.parametrize(
    "path",
    ["/", "/ws/none", "//ws/pilot", "//ws/video", "/x/../ws/video", "/ws/pilot/", "/main.js"],
)
def test_no_other_path_becomes_a_websocket(served: Served, path: str):
    for origin in ("http://evil.example", served.base):
        with pytest.raises(InvalidStatus):
            served.page(path, origin=origin)
    served.until(lambda: True)
    assert served.of(PageOpened) == []


def test_more_pages_than_there_may_be_are_told_so_and_watchers_leave_room_for_pilots(
    served: Served,
):
    for _ in range(MOST_WATCHERS):
        served.page("/ws/watch")
    served.until(lambda: len(served.of(PageOpened)) == MOST_WATCHERS)
    with pytest.raises(ConnectionClosed, match=r"4002.*24 watchers' pages are open already"):
        served.page("/ws/watch").recv(timeout=PATIENCE_S)
    for _ in range(MOST_PAGES - MOST_WATCHERS):
        served.page()
    served.until(lambda: len(served.of(PageOpened)) == MOST_PAGES)
    with pytest.raises(ConnectionClosed, match=r"4002.*32 pages are open already"):
        served.page().recv(timeout=PATIENCE_S)
    assert served.outbox.counts["too_many:page"] == 2


def test_a_camera_that_is_not_there_is_said(served: Served):
    with pytest.raises(ConnectionClosed, match=r"4002.*no such camera"):
        served.page("/ws/video", version=f"{served.version}&camera=aft").recv(timeout=PATIENCE_S)


def stack(*settings: str, virtual: bool = False) -> Stack:
    return Stack(overrides=[f"cockpit.{s}" for s in settings], virtual=virtual)


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (("host=0.0.0.0",), r"reached by other machines.*cockpit.certificate.*ssh -L"),
        (("host=192.168.2.1",), r"reached by other machines"),
        (("certificate=/x.pem",), r"certificate and key go together"),
        (
            ("certificate=/x.pem", "key=/y.pem"),
            r"cockpit.certificate '/x.pem': there is no such file",
        ),
    ],
)
def test_a_wrong_setting_is_one_sentence(settings: tuple[str, ...], sentence: str):
    with pytest.raises(LindyError, match=sentence):
        wire(VirtualHost().node("cockpit", ["topside"]), stack(*settings))


def test_a_port_that_is_taken_is_one_sentence():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(LindyError, match=rf"cannot listen on 127\.0\.0\.1:{port}.*in use"):
            wire(VirtualHost().node("cockpit", ["topside"]), stack(f"port={port}"))


def test_on_virtual_time_nobody_can_fly_by_page():
    with pytest.raises(NeedsRealTimeError):
        wire(VirtualHost().node("cockpit", ["topside"]), stack(virtual=True))


def test_the_token_is_new_at_each_start_unless_it_is_given(monkeypatch: pytest.MonkeyPatch):
    away = Settings(host="0.0.0.0", certificate="c.pem", key="k.pem")
    monkeypatch.delenv(VARIABLE, raising=False)
    tokens = {access_to(away).token for _ in range(3)}
    assert len(tokens) == 3
    assert min(map(len, tokens)) >= 20
    monkeypatch.setenv(VARIABLE, "given")
    assert access_to(away) == Access("https", "0.0.0.0", away.port, False, "given")
    assert access_to(Settings()).token == ""


async def _opened(address: str, origin: str, trusting: ssl.SSLContext) -> None:
    """By one thread: the other client reads and writes with two, which TLS of Python does not bear
    (now and then the request never leaves)."""
    from websockets.asyncio.client import connect as opening

    async with opening(address, origin=Origin(origin), ssl=trusting, open_timeout=PATIENCE_S):
        pass


def test_with_a_certificate_the_page_is_served_by_https_and_asks_for_the_token(tmp_path: Path):
    pytest.importorskip("cryptography", reason="the extra keys is not installed")
    from cryptography.hazmat.primitives.asymmetric import ec

    from tools.keys import certificates

    key = ec.generate_private_key(ec.SECP256R1())
    now = datetime.now(UTC)
    files = tmp_path / "certificate.pem", tmp_path / "key.pem"
    files[0].write_bytes(certificates.authority(key, now))
    files[1].write_bytes(certificates.key_pem(key))
    certificate, private = map(str, files)
    settings = Settings("127.0.0.1", free_port(), certificate=certificate, key=private)
    # As to other machines, which this address is not.
    access = Access("https", settings.host, settings.port, local=False, token="secret")
    server = PageServer(settings, access, Outbox())
    server.start(lambda: None)
    trusting = ssl.create_default_context()  # whom a browser trusts is its own affair
    trusting.check_hostname, trusting.verify_mode = False, ssl.CERT_NONE
    address = access.address.rstrip("/")
    with ExitStack() as exits:
        exits.callback(server.close)
        with urllib.request.urlopen(address, timeout=PATIENCE_S, context=trusting) as answer:
            version = answer.read().decode().partition('name="version" content="')[2][:12]
        secure = f"{address.replace('https', 'wss')}/ws/pilot?version={version}"
        for token, welcome in (("wrong", False), ("secret", True)):
            with nullcontext() if welcome else pytest.raises(InvalidStatus, match="403"):
                asyncio.run(_opened(f"{secure}&token={token}", address, trusting))
