"""Who comes to a hub from another machine, and who is cut off there. The hub is real, with TLS."""

import os
import select
import socket
import subprocess
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path

import msgspec
import pytest
import zenoh

from messages import topics
from messages.health import LogLine
from messages.payload import PayloadDecoder
from services.runtime.bus.access_control import HubSide
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.spaces import namespace
from services.runtime.bus.tcp_links import Ends, TcpLinks, let_callers_speak_first
from services.runtime.bus.zenoh_bus import ZenohBus, connected
from services.runtime.hosts.doorkeeper import Doorkeeper
from services.runtime.hosts.process_host import HubLaunch
from services.runtime.launch.process_plan import PYTHON
from tests.support.patience import PATIENCE_S, until
from tools.keys import authority
from tools.keys.key_folder import own_keys
from tools.keys.roles import parse

SPACE, NOW = namespace("pioneer"), datetime.now(UTC)
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="only Linux counts and cuts")


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return free.getsockname()[1]


def said_by(who: Envelope) -> LogLine:
    line = PayloadDecoder(topics.LOG).read(who.key, who.encoding, who.payload)
    assert isinstance(line, LogLine)
    return line


class Door:
    """A drone's hub as a process, and a service on board that hears everything."""

    def __init__(self, folder: Path) -> None:
        self.keys = folder / "keys"
        authority.new(self.keys, NOW)
        for name in ("drone:pioneer", "pilot:ann", "observer:eve"):
            authority.add(self.keys, parse(name), NOW, 10)
        drone = own_keys(self.keys / "drone-pioneer", ("drone",), NOW).credentials
        self.address = f"tls/127.0.0.1:{free_port()}"
        private, self._log = f"unixsock-stream/{folder}/hub.sock", folder / "hub.log"
        launch = HubLaunch(
            listen=[self.address, private],
            hub_side=HubSide("drone", SPACE, drone),
            parent=os.getpid(),
        )
        with self._log.open("wb") as log:
            command = [*PYTHON, "hub", msgspec.json.encode(launch).decode()]
            self.process = subprocess.Popen(command, stderr=log)
        self.heard: list[Envelope] = []
        self.board = connected(private, SPACE, PATIENCE_S)
        self.bus = ZenohBus(self.board)
        self.bus.hear("**", self.heard.append)

    def session(self, folder: str) -> zenoh.Session:
        role = parse(folder.replace("-", ":", 1)).role
        keys = own_keys(self.keys / folder, (role,), NOW).credentials.keys
        return connected(self.address, SPACE, PATIENCE_S, keys=keys)

    @property
    def log(self) -> str:
        return self._log.read_text()

    def close(self) -> None:
        self.board.close()
        self.process.terminate()
        self.process.wait()


@pytest.fixture
def door(tmp_path: Path) -> Generator[Door]:
    door = Door(tmp_path)
    yield door
    door.close()


Act = Callable[[zenoh.Session, int], object]
LONG = "x" * 500  # so that it is a flood on a busy computer, too


def junk(session: zenoh.Session, number: int) -> object:
    for _ in range(200):
        session.put("pilot/command", bytes(60), congestion_control=zenoh.CongestionControl.BLOCK)
    return number


def tokens(session: zenoh.Session, number: int) -> object:
    names = (f"here/topside/{LONG}{number:x}{each:x}" for each in range(50))
    return [session.liveliness().declare_token(name) for name in names]


def subscriptions(session: zenoh.Session, number: int) -> object:
    names = (f"health/{LONG}{number}_{each}" for each in range(50))
    return [session.declare_subscriber(name, lambda _: None) for name in names]


@contextmanager
def cut_off_at_last(session: zenoh.Session) -> Generator[zenoh.Session]:
    """Nobody hears it take its leave."""
    try:
        yield session
    finally:
        with suppress(zenoh.ZError):
            session.close()


@LINUX
@pytest.mark.system
@pytest.mark.parametrize("act", [junk, tokens, subscriptions])
def test_an_observer_that_floods_is_warned_cut_off_and_named_and_the_pilot_goes_on(
    door: Door, act: Act
) -> None:
    with door.session("pilot-ann") as pilot, cut_off_at_last(door.session("observer-eve")) as eve:
        kept: list[object] = []

        def cut_off() -> bool:
            kept.append(act(eve, len(kept)))
            return "observer:eve sends too much: it is cut off for 10 s" in door.log

        until(cut_off)
        assert "observer:eve sends too much: it is cut off if it goes on" in door.log

        def flies() -> bool:
            pilot.put("pilot/request", b"flies")
            return any(envelope.payload == b"flies" for envelope in door.heard)

        until(flies)
        lines = [said_by(each) for each in door.heard if each.key == "log/hub_drone"]
        assert [line.level for line in lines] == ["warning", "warning"]
        assert "observer:eve" in lines[-1].text
        assert "pilot:ann left" not in door.log


@LINUX
def test_a_connection_on_which_nobody_speaks_never_reaches_the_hub() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = server.getsockname()
        let_callers_speak_first()
        with socket.create_connection(address), socket.create_connection(address) as speaks:
            speaks.send(b"hello")
            accepted, caller = server.accept()
            with accepted:
                assert caller == speaks.getsockname()
                server.setblocking(False)
                with pytest.raises(BlockingIOError):
                    server.accept()


@LINUX
def test_what_came_on_a_connection_is_counted_and_the_connection_can_be_ended() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        socket.create_connection(server.getsockname()) as there,
    ):
        here, _ = server.accept()
        with here:
            there.sendall(bytes(1000))
            ends = Ends(*("{}:{}".format(*each.getsockname()) for each in (here, there)))
            links = TcpLinks()
            until(lambda: links.received([ends]) == {ends: 1000})
            assert links.received([Ends("127.0.0.1:1", "127.0.0.1:2")]) == {}
            before = len(os.listdir("/proc/self/fd"))  # noqa: PTH208
            links.cut([Ends("127.0.0.1:1", "127.0.0.1:2")])
            assert here.recv(2000) == bytes(1000)
            links.cut([ends])
            assert (there.recv(1), here.recv(1)) == (b"", b"")
            assert len(os.listdir("/proc/self/fd")) == before  # noqa: PTH208


def send_for_ever(link: socket.socket) -> None:
    while True:
        link.send(bytes(100_000))


@LINUX
def test_nothing_arrives_any_more_on_a_connection_that_is_ignored() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        socket.create_connection(server.getsockname()) as there,
    ):
        here, _ = server.accept()
        with here:
            there.sendall(b"heard")
            assert here.recv(10) == b"heard"
            TcpLinks().ignore([Ends(*("{}:{}".format(*e.getsockname()) for e in (here, there)))])
            there.setblocking(False)
            with pytest.raises(BlockingIOError):  # the kernel has no more room on that side
                send_for_ever(there)
            assert select.select([here], [], [], 0.05)[0] == []
            here.sendall(b"said")
            assert select.select([there], [], [], PATIENCE_S)[0] == [there]
            assert there.recv(10) == b"said"


def test_a_caller_who_tries_for_hours_does_not_fill_the_log(
    capsys: pytest.CaptureFixture[str],
) -> None:
    keeper, link = Doorkeeper("hub_drone", ["pilot:ann"], lambda _: None), Ends("a:1", "b:2")
    for _ in range(150):
        keeper.see("pilot:eve", True, link)
    keeper.see("pilot:ann", True, link)
    keeper.see("pilot:ann", False, link)
    said = capsys.readouterr().err.splitlines()
    refused = "it is not admitted, and can neither hear nor say anything"
    assert said == [
        f"warning hub: pilot:eve connected; {refused}",
        f"warning hub: pilot:eve connected (10 times); {refused}",
        f"warning hub: pilot:eve connected (100 times); {refused}",
        "info hub: pilot:ann connected",
        "info hub: pilot:ann left",
    ]
