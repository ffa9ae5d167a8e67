"""Two drones of one name on one router: neither arms. The drones' own `reference` on real sessions,
in this process."""

import json
import time
from collections.abc import Callable, Generator
from contextlib import ExitStack
from pathlib import Path

import msgspec
import pytest
import zenoh

from messages import topics
from messages.pilot import PilotAnswer, PilotRequest
from messages.topic import Side
from services.reference.service import wire
from services.runtime.bus.access_control import HubSide
from services.runtime.bus.spaces import namespace
from services.runtime.bus.zenoh_bus import ZenohBus, connected, listening
from services.runtime.config.stack import Stack
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.loop_stats import Instance
from services.runtime.node.node import Node
from tests.support.doors import free_endpoint, router_tree
from tests.support.patience import PATIENCE_S, until


class World:
    """A router, and what is joined to it."""

    def __init__(self, folder: Path, exits: ExitStack) -> None:
        self.endpoint, self._folder, self._exits = free_endpoint(), folder, exits
        file = folder / "router.json5"
        file.write_text(json.dumps(router_tree([self.endpoint])))
        exits.enter_context(zenoh.open(zenoh.Config.from_file(file)))
        self.nodes: list[Node] = []

    def joined(self, side: Side, name: str, who: str) -> ZenohBus:
        """A service behind a hub of its own."""
        space = namespace(name)
        private = f"unixsock-stream/{self._folder}/{who}.sock"
        self._exits.enter_context(
            listening(private, connect=[self.endpoint], hub_side=HubSide(side, space))
        )
        return ZenohBus(self._exits.enter_context(connected(private, space, PATIENCE_S)))

    def until(self, happened: Callable[[], bool]) -> None:
        until(happened, meanwhile=self._step)

    def _step(self) -> None:
        for node in self.nodes:
            node.step()


class Drone:
    """A drone's `reference`, which grants control."""

    def __init__(self, world: World, name: str, number: int) -> None:
        bus = world.joined("drone", name, f"drone{number}")
        self.arrived: list[str] = []  # keys of all that pilots say
        for topic in (topics.PILOT_COMMAND, topics.PILOT_REQUEST, topics.CLOCK_PING):
            bus.hear(topic.key, lambda e: self.arrived.append(e.key))
        self.node = Node("reference", {"drone": bus}, time.monotonic_ns, VolatileCheckpoint())
        self.node.instance = Instance(number, number)
        wire(self.node, Stack(name=name))
        world.nodes.append(self.node)


@pytest.fixture
def world(tmp_path: Path) -> Generator[World]:
    with ExitStack() as exits:
        yield World(tmp_path, exits)


@pytest.mark.slow
def test_of_two_drones_of_one_name_that_meet_later_none_arms(world: World) -> None:
    """A router that was away when the second one started could not be asked."""
    first, second = Drone(world, "a", 1), Drone(world, "a", 2)
    desk, reasons = world.joined("topside", "a", "desk-ann"), list[str]()
    decode = msgspec.msgpack.Decoder(PilotAnswer).decode
    desk.hear(topics.PILOT_ANSWER.key, lambda e: reasons.append(decode(e.payload).reason))
    say = desk.say(topics.PILOT_REQUEST)

    def both_refuse() -> bool:
        now = time.monotonic_ns()
        request = PilotRequest(id=f"ann-{now}", kind="arm", source="ann", stamp_ns=now)
        say(msgspec.msgpack.encode(request))
        return sum("two services call themselves reference" in said for said in reasons) >= 2

    world.until(both_refuse)
    assert "" not in reasons
    assert set(first.arrived) == set(second.arrived) == {topics.PILOT_REQUEST.key}
