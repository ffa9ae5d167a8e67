"""Two drones and their topsides on one Zenoh router that runs deploy/router.json5, as zenohd does:
every hub and every service is a real session, in this process.

That nothing came is only believed after a message that was sent later has come.
"""

import json
import time
from collections.abc import Generator
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh

from messages import topics
from messages.pilot import PilotAnswer, PilotRequest
from messages.topic import Direction, Side
from services.reference.service import wire
from services.runtime.bus.access_control import Credentials, HubSide
from services.runtime.bus.access_control import keys as keys_of
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.spaces import EVERY_SPACE, here_key, namespace
from services.runtime.bus.zenoh_bus import (
    ZenohBus,
    announce_here,
    config,
    connected,
    listening,
    open_network,
)
from services.runtime.config.stack import Stack
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.loop_stats import Instance
from services.runtime.node.node import Node
from tests.support.doors import CROSS, FILE, free_endpoint, one, router_tree, say
from tests.support.patience import PATIENCE_S, until
from tools.keys.authority import KeyAuthority, own_keys
from tools.keys.credentials import Role, parse

NOW = datetime.now(UTC)
AWAY_S = 0.2  # [s] a router that is back within 0.05 s is not found again by all (docs/fleet.md)
DRONES = here_key(EVERY_SPACE, "drone")
LAST = "log/last"  # said behind everything else: what has not come when it has, never comes
SAID_BY: dict[Side, tuple[Direction, Direction]] = {
    "drone": (Direction.UP, Direction.BOTH),
    "topside": (Direction.DOWN, Direction.BOTH),
}


def zenohd(folder: Path, tree: dict[str, Any], name: str = "router") -> zenoh.Session:
    """What zenohd does with such a file."""
    path = folder / f"{name}-{time.monotonic_ns()}.json5"
    path.write_text("// as it is written\n" + json.dumps(tree))
    settings = zenoh.Config.from_file(path)
    return zenoh.open(settings)


class Half:
    """A side of a drone: its hub, and a service on it that hears everything."""

    def __init__(
        self,
        side: Side,
        name: str,
        router: str,
        folder: Path,
        exits: ExitStack,
        credentials: Credentials | None = None,
    ) -> None:
        space = namespace(name)
        private = f"unixsock-stream/{folder}/{side}-{name}.sock"
        border = HubSide(side, space, credentials)
        self.side: Side = side
        self.hub = exits.enter_context(listening(private, connect=[router], hub_side=border))
        self._here = announce_here(self.hub, here_key(space, side, "1"))
        self.session = exits.enter_context(connected(private, space, PATIENCE_S))
        self.bus, self.heard = ZenohBus(self.session), list[Envelope]()
        self.bus.hear("**", self.heard.append)
        for topic in topics.ALL:  # a row is asked for across the network, `**` is not
            self.bus.hear(topic.key, lambda _: None)

    def keys(self) -> set[str]:
        return {e.key for e in self.heard if not e.key.startswith("log/")}


def meet(talker: Half, ear: Half) -> None:
    """Talk until it is heard: a subscription takes a moment to come round."""

    def met() -> bool:
        say(talker.session, "log/meet")
        return any(e.key == "log/meet" for e in ear.heard)

    ear.heard.clear()
    until(met)


def quiet(talker: Half, ear: Half) -> None:
    """Wait until all that was said before has come. A message of low priority is the last one."""
    ear.heard[:] = [e for e in ear.heard if e.key != LAST]
    talker.session.put(
        LAST, b"", priority=zenoh.Priority.BACKGROUND,
        congestion_control=zenoh.CongestionControl.BLOCK,
    )  # fmt: skip
    until(lambda: any(e.key == LAST for e in ear.heard))


class Fleet:
    """A router, drones a and b with their topsides, and a stranger."""

    def __init__(self, folder: Path, exits: ExitStack) -> None:
        self.endpoint = free_endpoint()
        self.router = exits.enter_context(zenohd(folder, router_tree([self.endpoint])))
        self.drone = {n: Half("drone", n, self.endpoint, folder, exits) for n in "ab"}
        self.desk = {n: Half("topside", n, self.endpoint, folder, exits) for n in "ab"}
        self.stranger = exits.enter_context(zenoh.open(config("client", connect=[self.endpoint])))
        self.all = [*self.drone.values(), *self.desk.values()]

    def fresh(self) -> None:
        """Everybody has met its other side, and nobody has heard anything else."""
        for name in "ab":
            meet(self.drone[name], self.desk[name])
            meet(self.desk[name], self.drone[name])
        self.settle()
        for half in self.all:
            half.heard.clear()

    def settle(self) -> None:
        for name in "ab":
            quiet(self.drone[name], self.desk[name])
            quiet(self.desk[name], self.drone[name])


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Generator[Fleet]:
    with ExitStack() as exits:
        yield Fleet(tmp_path_factory.mktemp("f"), exits)


def test_what_is_said_to_or_by_one_drone_reaches_its_other_side_and_no_other_drone(
    fleet: Fleet,
) -> None:
    fleet.fresh()
    halves = fleet.drone["a"], fleet.desk["a"]
    for half in halves:
        for topic in topics.ALL:
            say(half.session, one(topic).key, b"a")
    fleet.settle()
    for half, other in (halves, halves[::-1]):
        crossed = {one(t).key for t in CROSS if t.way in SAID_BY[half.side]}
        assert other.keys() == {key for key in crossed if not key.startswith("log/")}, half.side
    for other in (fleet.drone["b"], fleet.desk["b"]):
        assert other.keys() == set()


WILD = [
    "**", "lindy/**", "lindy/@v1/**", "lindy/@v1/*/**", "lindy/@v1/*/pilot/command",
    "lindy/@v1/a/**",
    "lindy/@v1/a/pilot/*", "lindy/@v1/a/*", "*/@v1/*/pilot/command", "lindy/@v1/**/command",
    "lindy/@v1/a*/pilot/command", "lindy/@v1/$*a/pilot/command", "lindy/@v1/a/control/thrusters",
    "lindy/@v1/a/sensor/imu", "lindy/@v1/a/simulator/request", "lindy/@v2/a/pilot/command",
    "a/pilot/command", "lindy/@v1//pilot/command", "lindy/@v1/a/state",
]  # fmt: skip


def test_wild_keys_and_rows_of_the_other_direction_reach_no_service_on_board(fleet: Fleet) -> None:
    fleet.fresh()
    refused = 0
    for key in WILD:
        try:
            say(fleet.stranger, key, b"x")
            fleet.stranger.delete(key)
        except zenoh.ZError:  # no key at all
            refused += 1
    assert refused < len(WILD)
    say(fleet.stranger, "lindy/@v1/a/log/stranger", b"behind all of it")
    until(lambda: any(e.key == "log/stranger" for e in fleet.drone["a"].heard))
    fleet.settle()
    for half in fleet.drone.values():
        assert half.keys() == set()


def test_who_is_there_is_seen_and_a_watcher_gets_a_row_of_all(fleet: Fleet) -> None:
    fleet.fresh()
    with open_network(fleet.endpoint, PATIENCE_S) as network:
        until(lambda: len(network.tokens(DRONES)) == 2)
        a, b, c = map(namespace, "abc")
        assert sorted(network.tokens(DRONES)) == [here_key(space, "drone", "1") for space in (a, b)]
        assert network.tokens(here_key(a, "topside")) == [here_key(a, "topside", "1")]
        assert network.tokens(here_key(c, "drone")) == []
        rows = list[str]()
        network.hear(f"{EVERY_SPACE}/{topics.STATUS.key}", lambda each: rows.append(each.key))

        def seen() -> bool:
            for half in fleet.drone.values():
                say(half.session, topics.STATUS.key)
            return len(set(rows)) == 2

        until(seen)
        assert set(rows) == {f"{namespace(n)}/{topics.STATUS.key}" for n in "ab"}


def test_a_router_that_is_started_again_is_joined_again_by_everybody(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    tree = router_tree([endpoint])
    with ExitStack() as exits:
        router = zenohd(tmp_path, tree)
        drone = Half("drone", "a", endpoint, tmp_path, exits)
        desk = Half("topside", "a", endpoint, tmp_path, exits)
        meet(drone, desk)
        router.close()  # type: ignore[no-untyped-call]
        desk.heard.clear()
        say(drone.session, topics.STATE.key, b"into the void")
        time.sleep(AWAY_S)
        router = exits.enter_context(zenohd(tmp_path, tree))
        meet(drone, desk)
        meet(desk, drone)
        assert topics.STATE.key not in {e.key for e in desk.heard}
        with open_network(endpoint, PATIENCE_S) as network:
            until(lambda: network.tokens(DRONES) == [here_key(namespace("a"), "drone", "1")])


class Keys:
    """Keys for two drones, a pilot, an observer and a router, all of one authority."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        KeyAuthority(folder).make(NOW)
        for name in ("drone:a", "drone:b", "pilot:ann", "observer:eve", "router:base"):
            KeyAuthority(folder).add(parse(name), NOW, 10)

    def credentials(self, bundle: str, role: Role) -> Credentials:
        return own_keys(self.folder / bundle, (role,), NOW)[1]


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Keys:
    return Keys(tmp_path_factory.mktemp("keys"))


def test_with_keys_a_drone_speaks_by_its_own_name_and_each_role_says_its_own_rows(
    keys: Keys, tmp_path: Path
) -> None:
    endpoint = free_endpoint().replace("tcp/", "tls/")
    tree = router_tree([endpoint], credentials=keys.credentials("router-base", "router"))
    with ExitStack() as exits:
        exits.enter_context(zenohd(tmp_path, tree))
        drone = Half("drone", "a", endpoint, tmp_path, exits, keys.credentials("drone-a", "drone"))
        desk = Half(
            "topside", "a", endpoint, tmp_path, exits, keys.credentials("pilot-ann", "pilot")
        )
        meet(drone, desk)
        meet(desk, drone)
        ann = keys.credentials("pilot-ann", "pilot").keys
        listener = exits.enter_context(open_network(endpoint, PATIENCE_S, keys=ann))
        until(lambda: listener.tokens(DRONES) == [here_key(namespace("a"), "drone", "1")])
        for half in (drone, desk):
            half.heard.clear()
        own = list[str]()
        listener.hear(f"{EVERY_SPACE}/{topics.STATE.key}", lambda each: own.append(each.key))
        roles: tuple[tuple[str, Role], ...] = (("observer-eve", "observer"), ("drone-b", "drone"))
        others = list[zenoh.Session]()
        for bundle, role in roles:
            files = keys.credentials(bundle, role).keys
            other = exits.enter_context(connected(endpoint, None, PATIENCE_S, keys=files))
            _token = announce_here(other, here_key(namespace("a"), "drone", "2"))
            for topic in topics.ALL:
                say(other, f"{namespace('a')}/{one(topic).key}", b"false")
            others.append(other)

        def all_was_said() -> bool:
            say(others[-1], f"{namespace('b')}/{topics.STATE.key}", b"behind all of it")
            return bool(own)

        until(all_was_said)
        assert set(own) == {f"{namespace('b')}/{topics.STATE.key}"}
        quiet(drone, desk)
        quiet(desk, drone)
        assert drone.keys() == desk.keys() == set()
        own_here = here_key(namespace("a"), "drone", "1")
        until(lambda: listener.tokens(DRONES) == [own_here])  # a busy router may answer late
        for half, other in ((drone, desk), (desk, drone)):
            for topic in topics.ALL:
                say(half.session, one(topic).key)
            quiet(half, other)
            rows = {one(t).key for t in CROSS if t.way in SAID_BY[half.side]}
            assert other.keys() == {key for key in rows if not key.startswith("log/")}


def test_whoever_is_on_no_list_may_do_nothing_and_the_rows_are_those_of_the_table() -> None:
    table = json.loads(zenoh.Config.from_file(FILE).get_json("access_control"))
    assert table["default_permission"] == "deny"
    for subject in table["subjects"]:  # without names it would be everybody
        assert subject["link_protocols"] == ["tls"]
        assert len(subject["cert_common_names"]) == 1
    rows = {rule["id"]: set(rule["key_exprs"]) for rule in table["rules"]}
    up, down = (set(keys_of(EVERY_SPACE, way)) for way in (Direction.UP, Direction.DOWN))
    assert rows["up"] == rows["ask_up"] == up
    assert rows["down"] == down


@pytest.mark.slow
def test_of_two_drones_of_one_name_that_meet_later_none_arms(tmp_path: Path) -> None:
    """A router that was away when the second one started could not be asked."""
    endpoint, nodes = free_endpoint(), list[Node]()
    with ExitStack() as exits:
        exits.enter_context(zenohd(tmp_path, router_tree([endpoint])))
        halves = [Half("topside", "a", endpoint, tmp_path, exits)]
        for number in (1, 2):
            (folder := tmp_path / f"{number}").mkdir()
            halves.append(Half("drone", "a", endpoint, folder, exits))
            bus = {"drone": halves[-1].bus}
            node = Node("reference", bus, time.monotonic_ns, VolatileCheckpoint())
            node.instance = Instance(number, number)
            wire(node, Stack(name="a"))
            nodes.append(node)
        desk, *drones = halves
        ask, decode = desk.bus.say(topics.PILOT_REQUEST), msgspec.msgpack.Decoder(PilotAnswer)

        def reasons() -> list[str]:
            answers = [e for e in desk.heard if e.key == topics.PILOT_ANSWER.key]
            return [decode.decode(e.payload).reason for e in answers]

        def both_refuse() -> bool:
            now = time.monotonic_ns()
            request = PilotRequest(id=f"ann-{now}", kind="arm", source="ann", stamp_ns=now)
            ask(msgspec.msgpack.encode(request))
            return sum("two services call themselves reference" in why for why in reasons()) >= 2

        def step() -> None:
            for node in nodes:
                node.step()

        until(both_refuse, meanwhile=step)
        assert "" not in reasons()
        for drone in drones:
            said = {e.key for e in drone.heard if e.key.startswith(("pilot/", "link/"))}
            assert said - {topics.PILOT_ANSWER.key} == {topics.PILOT_REQUEST.key}
