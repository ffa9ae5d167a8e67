"""Looking at who is there, with real sessions on a hub of this test's own."""

import json
import socket
import threading
from collections.abc import Generator, Iterable
from contextlib import ExitStack, contextmanager

import msgspec
import pytest
import zenoh

from messages import topics
from messages.identity import SideIdentity
from messages.sensors import BatterySample
from messages.vehicle import VehicleStatus
from services.runtime.bus import zenoh_bus
from services.runtime.bus.spaces import EVERY_SPACE, here_key, namespace
from services.runtime.bus.zenoh_bus import (
    NobodyThereError,
    announce_here,
    connected,
    listening,
    open_network,
)
from services.runtime.config.errors import LindyError
from services.runtime.config.identity import messages_hash
from tests.support.doors import free_endpoint
from tests.support.patience import PATIENCE_S, until
from tools.__main__ import main
from tools.fleet import drones
from tools.fleet import network as seen
from tools.fleet.network import drone_at, look, require_only, wanted_at, who_is_there

TALK_S = 0.05  # [s] between two words of a drone here; a real one says them once a second


@pytest.fixture
def network(monkeypatch: pytest.MonkeyPatch) -> Generator["Drones"]:
    monkeypatch.setattr(seen, "PATIENCE_S", PATIENCE_S)  # a busy computer's router answers late
    monkeypatch.setattr(zenoh_bus, "QUERY_S", PATIENCE_S)
    with ExitStack() as exits:
        yield Drones(exits)


class Drones:
    """A hub, and a session that announces drones and speaks for them."""

    def __init__(self, exits: ExitStack) -> None:
        self.endpoint = free_endpoint()
        exits.enter_context(listening(self.endpoint))
        self._session = exits.enter_context(connected(self.endpoint, None, PATIENCE_S))
        self._tokens: list[object] = []
        self._exits = exits

    def announce(self, names: Iterable[str], instance: str = "1") -> None:
        """Returns when the hub knows them: a token is declared without an answer."""
        keys = {here_key(namespace(name), "drone", instance) for name in names}
        self._tokens += [announce_here(self._session, key) for key in keys]
        with open_network(self.endpoint, PATIENCE_S) as asked:
            until(lambda: keys <= set(asked.tokens(here_key(EVERY_SPACE, "drone"))))

    def speak(self, names: Iterable[str]) -> None:
        self._exits.enter_context(speaking(self._session, list(names)))


@contextmanager
def speaking(session: zenoh.Session, names: list[str]) -> Generator[None]:
    over = threading.Event()
    rows = {
        topics.IDENTITY.of("drone").key: SideIdentity(
            side="drone", vehicle="pioneer", version="1", messages=messages_hash(topics.ALL)
        ),
        topics.STATUS.key: VehicleStatus(stamp_ns=0, activity="ready", armed=False, pilot="ann"),
        topics.BATTERY.key: BatterySample(stamp_ns=0, voltage=16.0, current=1.0, used_wh=1.0),
    }
    words = {key: msgspec.msgpack.encode(row) for key, row in rows.items()}

    def talk() -> None:
        while not over.wait(TALK_S):
            for name in names:
                for key, payload in words.items():
                    encoding = f"application/msgpack;{type(rows[key]).__name__}"
                    session.put(f"{namespace(name)}/{key}", payload, encoding=encoding)

    thread = threading.Thread(target=talk, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def test_twenty_drones_are_listed_with_everything(
    network: Drones, capsys: pytest.CaptureFixture[str]
) -> None:
    names = [f"rov{k:02}" for k in range(20)]
    network.announce(names)
    network.speak(names)
    assert who_is_there(network.endpoint) == names
    roster = look(network.endpoint, longest_s=PATIENCE_S)  # returns when all have spoken
    assert roster.names == names
    assert all(d.complete and d.status is not None for d in roster.drones.values())
    assert main(["drones", "--router", network.endpoint, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in printed["drones"]] == names
    assert {(row["type"], row["pilot"], row["same_messages"]) for row in printed["drones"]} == {
        ("pioneer", "ann", True)
    }
    assert main(["drones", "--connect", network.endpoint]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 1 + len(names)


def test_a_drone_that_is_not_there_is_not_flown(
    network: Drones, capsys: pytest.CaptureFixture[str]
) -> None:
    network.announce(["rov", "~~~"])
    assert main(["fly", "nobody", "--router", network.endpoint]) == 1
    complaint = capsys.readouterr().err
    assert f"no drone is called nobody at {network.endpoint}; there are rov" in complaint
    assert complaint.count("\n") == 1


def test_a_topside_of_a_drone_that_is_not_there_is_told_who_is(
    network: Drones, capsys: pytest.CaptureFixture[str]
) -> None:
    assert wanted_at(network.endpoint, "rov2", None) == "rov2"
    assert capsys.readouterr().out == ""
    network.announce(["rov1"])
    assert wanted_at(network.endpoint, "rov1", None) == "rov1"
    assert capsys.readouterr().out == ""
    assert wanted_at(network.endpoint, "rov2", None) == "rov2"
    said = f"no drone is called rov2 at {network.endpoint}; there are rov1; waits for rov2\n"
    assert capsys.readouterr().out == said


def test_the_one_drone_that_is_there_is_taken_and_of_several_one_must_be_named(
    network: Drones,
) -> None:
    assert drone_at(network.endpoint, "pioneer-here", None) == "pioneer-here"  # of this machine
    network.announce(["rov1"])
    assert drone_at(network.endpoint, "pioneer-here", None) == "rov1"
    network.announce(["rov2"])
    with pytest.raises(LindyError, match=r"2 drones can be reached at .*: rov1, rov2; say which"):
        drone_at(network.endpoint, "pioneer-here", None)


def test_a_second_drone_of_a_name_does_not_start_and_the_first_stays(
    network: Drones, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(seen, "GONE_S", 0.1)
    monkeypatch.setattr(seen, "AGAIN_S", 0.05)
    require_only("rov1", network.endpoint, None)
    network.announce(["rov1"])
    with pytest.raises(
        LindyError, match=r"a drone called rov1 is on the network .* another --name"
    ):
        require_only("rov1", network.endpoint, None)
    require_only("rov2", network.endpoint, None)
    assert who_is_there(network.endpoint) == ["rov1"]


def test_a_router_that_is_away_or_is_none_keeps_no_drone_from_its_start(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(seen, "PATIENCE_S", 0.1)
    away = free_endpoint()
    require_only("rov1", away, None)
    assert f"no router answers at {away} yet: rov1 joins when one does" in capsys.readouterr().out
    with pytest.raises(NobodyThereError):
        who_is_there(away)
    assert drone_at(away, "pioneer-here", None) == "pioneer-here"
    with something_else() as endpoint:
        require_only("rov1", endpoint, None)
        assert "is no Zenoh router of this version" in capsys.readouterr().out
        with pytest.raises(LindyError, match="no Zenoh router of this version, or asks for keys"):
            drone_at(endpoint, "pioneer-here", None)
        assert main(["drones", "--router", endpoint]) == 1
        assert capsys.readouterr().err.count("\n") == 1


@contextmanager
def something_else() -> Generator[str]:
    """A server of another protocol: it hangs up on whatever it hears."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.05)
        over = threading.Event()

        def serve() -> None:
            while not over.is_set():
                try:
                    caller, _ = server.accept()
                except TimeoutError:
                    continue
                caller.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
                caller.close()

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        try:
            yield f"tcp/127.0.0.1:{server.getsockname()[1]}"
        finally:
            over.set()
            thread.join()


class StopsAfterTwo:
    """In the place of the signals."""

    def __init__(self) -> None:
        self._left = 2

    def __enter__(self) -> "StopsAfterTwo":
        return self

    def __exit__(self, *_: object) -> None:
        pass

    @property
    def asked(self) -> bool:
        self._left -= 1
        return self._left == 0


def test_with_watch_the_drones_are_listed_again_until_it_is_stopped(
    network: Drones, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    network.announce(["rov1", "rov2"])
    network.speak(["rov1", "rov2"])
    monkeypatch.setattr(drones, "WATCH_S", 0.01)
    monkeypatch.setattr(drones, "StopSignals", StopsAfterTwo)
    words = ["drones", "--router", network.endpoint, "--watch"]
    assert main([*words, "--json"]) == 0
    lists = [json.loads(line)["drones"] for line in capsys.readouterr().out.splitlines()]
    assert [[row["name"] for row in rows] for rows in lists] == [["rov1", "rov2"]] * 2
