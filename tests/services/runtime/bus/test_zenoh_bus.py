"""The bus over Zenoh, with real sessions through a hub of this test's own."""

import json
import os
import re
import socket
import struct
import sys
from collections import deque
from collections.abc import Generator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import zenoh

from messages import topics
from messages.topic import Qos
from services.runtime.bus import zenoh_bus
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.other_network import LONGEST, OtherNetwork
from services.runtime.bus.spaces import namespace
from services.runtime.bus.zenoh_bus import (
    QOS_PROFILES,
    ZenohBus,
    ZenohQos,
    close_without_waiting,
    connected,
    listening,
)
from services.runtime.config.errors import LindyError
from tests.support.doors import free_endpoint, free_port
from tests.support.no_posix import portable
from tests.support.patience import PATIENCE_S, until

SPACE = namespace("pioneer")
LAST = "log/last"  # said behind everything else: what has not come when it has, never comes


def socket_file(folder: Path, name: str = "hub") -> str:
    return f"unixsock-stream/{folder}/{name}.sock"


class Star:
    """A hub and its clients, which are closed in order at the end."""

    def __init__(self, endpoint: str, exits: ExitStack) -> None:
        self.endpoint, self._exits = endpoint, exits
        exits.enter_context(listening(endpoint))

    def client(self) -> ZenohBus:
        return ZenohBus(self.session())

    def session(self) -> zenoh.Session:
        return self._exits.enter_context(connected(self.endpoint, SPACE, PATIENCE_S))

    def qos(self) -> dict[str, ZenohQos]:
        """QoS by key of what is said from now on."""
        found: dict[str, ZenohQos] = {}

        def note(sample: zenoh.Sample) -> None:
            found[str(sample.key_expr)] = ZenohQos(
                sample.priority, sample.congestion_control, sample.express
            )

        subscriber: Any = self.session().declare_subscriber("**", note)
        self._exits.callback(subscriber.undeclare)
        return found


@pytest.fixture
def star(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Generator[Star]:
    kind = getattr(request, "param", "unixsock")
    if kind == "portable":
        monkeypatch.setattr(zenoh_bus, "system", portable())
    with ExitStack() as exits:
        yield Star(free_endpoint() if kind == "tcp" else socket_file(tmp_path), exits)


def meet(talker: ZenohBus, heard: list[Envelope]) -> None:
    """Talk until somebody listens: a subscription takes a moment to come round."""
    say = talker.say(topics.LOG.of("meet"))

    def met() -> bool:
        say(b"")
        return any(e.key == "log/meet" for e in heard)

    until(met)


def news(heard: list[Envelope]) -> list[Envelope]:
    return [e for e in heard if e.key not in ("log/meet", LAST)]


def until_all_is_there(talker: ZenohBus, heard: list[Envelope], payload: bytes = b"") -> None:
    talker.say(topics.LOG.of("last"))(payload)
    until(lambda: any(e.key == LAST for e in heard))


@pytest.mark.parametrize("star", ["unixsock", "portable", "tcp"], indirect=True)
def test_what_is_said_is_heard_once_by_the_others_with_its_encoding_and_qos(star: Star) -> None:
    talker, ear = star.client(), star.client()
    own, heard, qos = list[Envelope](), list[Envelope](), star.qos()
    talker.hear("**", own.append)
    ear.hear("**", heard.append)
    meet(talker, heard)
    rows = [topic.of("x") if topic.is_family else topic for topic in topics.ALL]
    for topic in rows:
        talker.say(topic)(topic.key.encode())
    until_all_is_there(talker, heard)
    until(lambda: len(news(heard)) >= len(rows))  # the priorities overtake each other
    by_key = {e.key: e for e in news(heard)}
    assert len(news(heard)) == len(by_key) == len(rows)
    for topic in rows:
        envelope = by_key[topic.key]
        assert envelope.payload == topic.key.encode()
        assert envelope.encoding == topic.encoding
    until(lambda: all(topic.key in qos for topic in rows))
    assert [qos[topic.key] for topic in rows] == [QOS_PROFILES[topic.qos] for topic in rows]
    ear.say(topics.STATE)(b"for the talker")
    until(lambda: bool(own))
    assert [e.payload for e in own] == [b"for the talker"]


@pytest.mark.parametrize(
    ("key", "qos_of"),
    [("reference", Qos.LIVE), ("health/control", Qos.BULK), ("not/ours", Qos.BULK)],
)
def test_an_envelope_is_passed_on_byte_for_byte_with_its_topics_qos(
    key: str, qos_of: Qos, tmp_path: Path
) -> None:
    with ExitStack() as exits:
        here = Star(socket_file(tmp_path, "here"), exits)
        there = Star(socket_file(tmp_path, "there"), exits)
        foreign = exits.enter_context(connected(socket_file(tmp_path, "here"), SPACE, PATIENCE_S))
        ear, far = here.client(), there.client()
        carrier, carried, heard = there.client(), deque[Envelope](), list[Envelope]()
        qos = there.qos()
        ear.hear("**", carried.append)
        far.hear("**", heard.append)
        payload, attachment = bytes(range(256)) * 4, b"\x00\xffwith"

        def crossed() -> bool:
            foreign.put(
                key, payload, encoding="text/plain;odd", attachment=attachment,
                priority=zenoh.Priority.DATA_LOW, express=True,
                congestion_control=zenoh.CongestionControl.DROP,
            )  # fmt: skip
            while carried:
                carrier.forward(carried.popleft())
            return bool(heard) and bool(qos)

        until(crossed)
    expected = Envelope(key, payload, "text/plain;odd", attachment)
    assert [e for e in heard if e != expected] == []
    assert qos == {key: QOS_PROFILES[qos_of]}


def test_what_is_deleted_is_no_message(tmp_path: Path) -> None:
    with ExitStack() as exits:
        star = Star(socket_file(tmp_path), exits)
        foreign = exits.enter_context(connected(socket_file(tmp_path), SPACE, PATIENCE_S))
        ear, talker, heard = star.client(), ZenohBus(foreign), list[Envelope]()
        ear.hear("**", heard.append)
        meet(talker, heard)
        foreign.delete("state", priority=zenoh.Priority.BACKGROUND)
        until_all_is_there(talker, heard)
        assert news(heard) == []


def test_a_service_is_seen_to_come_and_to_go(star: Star) -> None:
    seen: list[tuple[str, bool]] = []
    before, watcher = star.client(), star.client()
    before.announce("estimation")
    watcher.watch(lambda key, alive: seen.append((key.rpartition("/")[2], alive)))
    until(lambda: ("estimation", True) in seen)  # also who was there before
    with connected(star.endpoint, SPACE, PATIENCE_S) as session:
        ZenohBus(session).announce("control")
        until(lambda: ("control", True) in seen)
    until(lambda: ("control", False) in seen)
    assert seen == [("estimation", True), ("control", True), ("control", False)]


def test_a_client_without_a_hub_gives_up_with_a_sentence(tmp_path: Path) -> None:
    endpoint = socket_file(tmp_path, "nobody")
    with pytest.raises(LindyError) as refused:
        connected(endpoint, SPACE, 0.2)
    assert str(refused.value) == f"no hub answers at {endpoint} after 0.2 s"


# Without unix sockets: TCP of this machine, with a password.


def test_nobody_enters_without_the_password(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(zenoh_bus, "system", portable())
    endpoint, file = socket_file(tmp_path), tmp_path / "hub.sock"
    with listening(endpoint):
        assert file.stat().st_mode & 0o077 == 0
        port, _, password = file.read_text(encoding="ascii").partition(":")
        assert len(password) == 64
        with pytest.raises(LindyError, match="no hub answers"):
            connected(f"ws/127.0.0.1:{port}", None, 0.0)
        file.write_text(f"{port}:{'0' * 64}", encoding="ascii")
        with pytest.raises(LindyError, match="no hub answers"):
            connected(endpoint, None, 0.0)
        file.write_text(f"{port}:{password}", encoding="ascii")
        connected(endpoint, None, PATIENCE_S).close()
    with pytest.raises(LindyError, match="no hub answers"):
        connected(socket_file(tmp_path, "none"), None, 0.0)
    with listening(endpoint):  # a hub that starts again is found by those who know it
        assert file.read_text(encoding="ascii") == f"{port}:{password}"


def test_a_hub_with_a_password_calls_another_machines_and_lets_none_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(zenoh_bus, "system", portable())
    far, near, heard = free_endpoint(), socket_file(tmp_path), list[Envelope]()
    with (
        listening(far),
        listening(near, connect=[far]),
        connected(far, namespace("pioneer"), PATIENCE_S) as there,
        connected(near, namespace("pioneer"), PATIENCE_S) as here,
    ):
        ear = ZenohBus(here)
        ear.hear("log/*", heard.append)
        meet(ZenohBus(there), heard)
    both = f"cannot listen on {far}: to let other machines in at {far} needs linux or macos"
    with pytest.raises(LindyError, match=re.escape(both)):
        listening(near, far)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux knows a process's own sockets")
def test_no_link_of_a_hub_keeps_it_waiting_at_its_end() -> None:
    endpoint = free_endpoint()
    port = int(endpoint.rpartition(":")[2])
    with listening(endpoint) as hub, connected(endpoint, None, PATIENCE_S):
        assert lingers(port) == {True}, "Zenoh's own way, which this test is about"
        _closing = close_without_waiting(hub)
        until(lambda: lingers(port) == {False})
        with connected(endpoint, None, PATIENCE_S):
            until(lambda: lingers(port) == {False})


def lingers(port: int) -> set[bool]:
    """Of the accepted connections at this port of this process: does Linux keep waiting whoever
    closes one until all that was sent has been acknowledged?"""
    found: set[bool] = set()
    for name in os.listdir("/proc/self/fd"):  # noqa: PTH208
        with suppress(OSError), socket.socket(fileno=os.dup(int(name))) as link:
            if link.family == socket.AF_INET and link.getsockname()[1] == port:
                link.getpeername()  # it does not listen
                length = struct.calcsize("ii")
                option = link.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, length)
                found.add(bool(struct.unpack("ii", option)[0]))
    return found


# A session in somebody else's Zenoh network.


@contextmanager
def router(port: int) -> Generator[zenoh.Session]:
    """As rmw_zenohd."""
    settings = zenoh.Config()
    listen = {"listen/endpoints": [f"tcp/127.0.0.1:{port}"], "mode": "router"}
    for key, value in {**listen, "scouting/multicast/enabled": False}.items():
        settings.insert_json5(key, json.dumps(value))
    with zenoh.open(settings) as session:
        yield session


def test_what_was_declared_is_there_once_the_router_is_and_again_after_it_was_gone() -> None:
    port = free_port()
    network = OtherNetwork(f"tcp/127.0.0.1:{port}", "ros2.router")
    got: list[tuple[str, bytes, bytes]] = []
    publisher = network.publisher("0/out")
    network.hear("0/in", lambda key, payload, attached: got.append((key, payload, attached)))
    token = f"@ros2_lv/0/{network.session_id}/0/0/NN/%/%/lindy"
    network.announce(token)
    network.start()
    try:
        publisher.put(b"nobody is there", b"")
        assert not network.connected
        for _ in range(2):  # the second is another router, at the same place
            with router(port) as other:
                heard: list[zenoh.Sample] = []
                until(lambda: network.connected)
                assert not publisher.heard
                subscriber = other.declare_subscriber("0/out", heard.append)
                until(lambda publisher=publisher: publisher.heard)
                publisher.put(b"payload", b"attached")
                until(lambda heard=heard: heard)
                attached = heard[0].attachment
                assert heard[0].payload.to_bytes() == b"payload"
                assert attached is not None
                assert attached.to_bytes() == b"attached"
                there = [str(r.ok.key_expr) for r in other.liveliness().get("@ros2_lv/**") if r.ok]
                assert there == [token]
                got.clear()
                blocks = zenoh.CongestionControl.BLOCK  # else a busy computer drops it
                # Its stub calls `matching` a bool.
                sender: Any = other.declare_publisher("0/in", congestion_control=blocks)
                until(lambda sender=sender: sender.matching_status.matching)
                sender.put(b"x" * (LONGEST + 1))
                sender.put(b"hello", attachment=b"a")
                until(lambda: got)
                assert got == [("0/in", b"hello", b"a")]
                subscriber.undeclare()
                until(lambda publisher=publisher: not publisher.heard)
            until(lambda: not network.connected)
        assert network.too_long == 2
    finally:
        network.close()


def test_it_can_be_closed_while_nobody_answers() -> None:
    network = OtherNetwork(f"tcp/127.0.0.1:{free_port()}", "ros2.router")
    network.start()
    network.close()
    assert not network.connected
