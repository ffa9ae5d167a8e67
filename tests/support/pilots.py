"""The simulated vehicle on virtual time, flown over connections of which a test holds both ends: by
a page, by a ground station, by a node of ROS 2."""

import json
from collections import Counter, deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Self, cast

import numpy as np

from messages import topics
from messages.pilot import PilotCommand
from messages.vehicle import Truth, VehicleStatus
from services.cockpit.core import Settings as CockpitSettings
from services.cockpit.page_messages import PageClosed, PageEvent, PageOpened, PageSaid, parsed
from services.cockpit.service import CockpitPages
from services.marine.vehicle import Vehicle
from services.mavlink.core import Settings as MavlinkSettings
from services.mavlink.pilot import Addressed
from services.mavlink.service import GroundStations
from services.mavlink_io.io.endpoint import MavlinkEndpoint
from services.mavlink_io.packet import GroundStation, MavlinkPacket
from services.ros2.core import Settings as RosSettings
from services.ros2.mapping import JOY, RosMessage, ros
from services.ros2.service import connected
from services.runtime.bus.other_network import OtherNetwork, OtherPublisher
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.node import Node
from tests.support.ros_document import attachment

MS, S = 1_000_000, 1_000_000_000  # [ns]
DRONE = ("simulator", "estimation", "reference", "control", "tether")


class PilotedDive:
    """The whole chain with a pilot of a kind, and perhaps a gamepad's script beside him."""

    service: str  # of the pilot
    called: str  # as the status names him
    malformed: str  # event that counts rubbish
    outranked: str  # event that counts what a second one asks
    hz: float  # at which he says his sticks

    def __init__(self, folder: Path, script: str | None = None, name: str = "") -> None:
        self.rows, pilot = Registry.read(), self.service
        if script is not None:
            (folder / "script.csv").write_text("t,surge,sway,heave,yaw\n" + script)
            pilot = f"script:{folder / 'script.csv'}"
        quick = ["estimation.calibration.still_time=1"]  # [s] less to wait for
        self.stack = Stack(pilot=pilot, out=str(folder), overrides=quick, name=name)
        self.host = VirtualHost()
        for each in DRONE if script is None else (*DRONE, "gamepad"):
            self.host.add(each, self.rows[each], self.stack)
        self.node: Node
        self.notify: Callable[[], None] = lambda: None
        self.start()
        self.truth, self.statuses = list[Truth](), list[VehicleStatus]()
        self.commands, self.asked = list[PilotCommand](), list[str]()
        observer = self.host.node("observer", ["drone"])
        observer.each(topics.TRUTH, lambda m, _: self.truth.append(m))
        observer.each(topics.STATUS, lambda m, _: self.statuses.append(m))
        observer.each(topics.PILOT_COMMAND, lambda m, _: self.commands.append(m))
        observer.each(topics.PILOT_REQUEST, lambda m, _: self.asked.append(m.kind))

    def start(self) -> None:
        """The pilot's service, or again."""

        def wired(node: Node, stack: Stack) -> None:
            self.node = node
            self.wire(node, stack)

        self.host.add(self.service, self.rows["gamepad"], self.stack, wired)

    def wire(self, node: Node, stack: Stack) -> None:
        raise NotImplementedError

    def sticks(self, who: int, **sticks: float) -> None:
        """`who` [0, 1] says where its sticks are: of 1, positive ahead, starboard, down, right."""
        raise NotImplementedError

    def arm(self, who: int = 0) -> None:
        """Also: resume."""
        raise NotImplementedError

    def disarm(self, who: int = 0) -> None:
        raise NotImplementedError

    def rubbish(self) -> None:
        """One message that nobody understands."""
        raise NotImplementedError

    def steer(
        self, seconds: float, who: int = 0, *, hz: float | None = None, **sticks: float
    ) -> Self:
        every = hz or self.hz
        for _ in range(round(seconds * every)):
            self.sticks(who, **sticks)
            self.run(1.0 / every)
        return self

    def run(self, seconds: float) -> Self:
        self.host.run(self.host.now + round(seconds * S))
        return self

    def ready(self) -> Self:
        self.steer(0.1)
        while self.status.activity != "ready":
            self.steer(0.5)
        return self

    def armed(self) -> Self:
        self.ready().arm()
        self.steer(0.5)
        assert self.status.armed
        return self

    @property
    def counts(self) -> Counter[str]:
        return self.node.outbox.counts

    @property
    def status(self) -> VehicleStatus:
        return self.statuses[-1]

    @property
    def depth(self) -> float:
        return self.truth[-1].position[2]


# A page.


class Browsers:
    """Connections of pages."""

    def __init__(self) -> None:
        self.waiting: deque[PageEvent] = deque()
        self.pictures: dict[int, dict[str, Any]] = {}  # the newest of each page
        self.shown: Counter[int] = Counter()
        self.confirmed: Counter[int] = Counter()
        self.cut: set[int] = set()  # pages that nothing reaches
        self.hear: Callable[[PageEvent], None] = lambda _: None

    def received(self) -> list[PageEvent]:
        events = list(self.waiting)
        self.waiting.clear()
        return events

    def show(self, texts: Mapping[int, str]) -> None:
        for page, text in texts.items():
            self.shown[page] += 1
            if page in self.cut:
                continue
            number = (picture := json.loads(text))["n"]
            # The log comes now and then.
            self.pictures[page] = {**self.pictures.get(page, {}), **picture}
            if number - self.confirmed[page] >= 5:  # as the page does
                self.confirmed[page] = number
                self.hear(PageSaid(page, parsed(f'{{"kind":"seen","seen":{number},"held_ms":0}}')))


class PageDive(PilotedDive):
    """The first page has the sticks."""

    service, called, hz = "cockpit", "ann", 50.0
    malformed, outranked = "malformed:page", "not_the_holder:page"

    def wire(self, node: Node, stack: Stack) -> None:
        self.browsers = Browsers()
        self.browsers.hear = self.event
        vehicle = stack.section("vehicle", Vehicle)
        pages = CockpitPages(node, CockpitSettings(pilot="ann"), vehicle, self.browsers)
        self.notify = node.from_outside(pages.receive)

    def event(self, event: PageEvent) -> None:
        self.browsers.waiting.append(event)
        self.notify()

    def open(self, page: int = 0, *, watcher: bool = False) -> Self:
        self.event(PageOpened(page + 1, watcher))
        self.run(0.1)
        return self

    def close(self, page: int = 0) -> None:
        self.event(PageClosed(page + 1))

    def say(self, kind: str, page: int = 0, **fields: Any) -> None:
        seen = self.browsers.pictures.get(page + 1, {}).get("n", 0)
        message = {"kind": kind, "seen": seen, "held_ms": 0.0, **fields}
        self.event(PageSaid(page + 1, parsed(json.dumps(message))))

    def wish(self, what: str, page: int = 0, **more: Any) -> Self:
        self.say("wish", page, what=what, **more)
        self.run(0.1) if page else self.steer(0.1)
        return self

    def sticks(self, who: int, **sticks: float) -> None:
        self.say("sticks", who, **{"surge": 0.0, "sway": 0.0, "heave": 0.0, "yaw": 0.0, **sticks})

    def ready(self) -> Self:
        self.open().wish("take")
        super().ready()
        return self

    def arm(self, who: int = 0) -> None:
        self.wish("resume" if self.status.failsafe != "none" else "arm", who)

    def disarm(self, who: int = 0) -> None:
        self.wish("disarm", who)

    def rubbish(self) -> None:
        self.event(PageSaid(1, parsed(b"\xff garbage")))

    def view(self, page: int = 0) -> dict[str, Any]:
        return self.browsers.pictures[page + 1]["view"]

    def you(self, page: int = 0) -> dict[str, Any]:
        return self.browsers.pictures[page + 1]["you"]


# A ground station.

STATIONS = GroundStation("udp a", 255, 190), GroundStation("tcp b", 254, 190)


class MavlinkAir:
    """Links of two ground stations."""

    def __init__(self) -> None:
        self.names = [station.link for station in STATIONS]
        self.sent: list[Addressed] = []
        self.waiting: deque[MavlinkPacket] = deque()

    def receive(self) -> list[MavlinkPacket]:
        packets = list(self.waiting)
        self.waiting.clear()
        return packets

    def send(self, packet: MavlinkPacket, link: str | None) -> None:
        self.sent.append(Addressed(link, packet))

    def of(self, name: str, link: str = STATIONS[0].link) -> list[dict[str, Any]]:
        here = (None, link)
        return [
            dict(a.packet.fields) for a in self.sent if a.packet.name == name and a.link in here
        ]


class GroundStationDive(PilotedDive):
    service, called, hz = "mavlink", "ground station 255/190", 25.0
    malformed, outranked = "wrong_target:mavlink", "not_the_holder:sticks"

    def wire(self, node: Node, stack: Stack) -> None:  # noqa: ARG002
        self.air = MavlinkAir()
        air = cast(MavlinkEndpoint, self.air)
        self.notify = node.from_outside(GroundStations(node, MavlinkSettings(), air).receive)

    def hear(self, name: str, who: int = 0, **fields: Any) -> None:
        link, system, component = STATIONS[who]
        self.air.waiting.append(MavlinkPacket(name, fields, system, component, link))
        self.notify()

    def command(self, number: int, *params: float, who: int = 0) -> None:
        padded = [*params, *[0.0] * 7][:7]
        target = {"target_system": 1, "target_component": 1}
        values = {f"param{k + 1}": value for k, value in enumerate(padded)}
        self.hear("COMMAND_LONG", who, command=number, **target, **values)

    def sticks(self, who: int, **sticks: float) -> None:
        x, y, r = (round(1000 * sticks.get(name, 0.0)) for name in ("surge", "sway", "yaw"))
        z = round(500 - 500 * sticks.get("heave", 0.0))
        self.hear("MANUAL_CONTROL", who, target=1, x=x, y=y, z=z, r=r, buttons=0)

    def arm(self, who: int = 0) -> None:
        self.command(400, 1.0, who=who)

    def disarm(self, who: int = 0) -> None:
        self.command(400, 0.0, who=who)

    def rubbish(self) -> None:
        self.hear("COMMAND_LONG", command=400, target_system=2, target_component=1, param1=0.0)

    @property
    def acks(self) -> list[tuple[int, int]]:
        return [(ack["command"], ack["result"]) for ack in self.air.of("COMMAND_ACK")]


# A node of ROS 2.

LEFT_X, LEFT_Y, RIGHT_X, RIGHT_Y = range(4)  # axes
BACK, START = 4, 6  # buttons


class RosHeard(OtherPublisher):
    """Somebody listens to the odometry alone."""

    def __init__(self, key: str) -> None:
        super().__init__()
        self.heard, self.sent = "/odom/" in key, list[tuple[bytes, bytes]]()

    def put(self, payload: bytes, attachment: bytes) -> None:
        self.sent.append((payload, attachment))


class RosAir:
    """A ROS network."""

    session_id, connected, too_long = "1f", True, 0

    def __init__(self) -> None:
        self.tokens: list[str] = []
        self.published: dict[str, RosHeard] = {}
        self.subscribed: dict[str, Callable[[str, bytes, bytes], None]] = {}

    def publisher(self, key: str) -> OtherPublisher:
        self.published[key] = RosHeard(key)
        return self.published[key]

    def keep(self, key: str, payload: bytes, attachment: bytes) -> None:
        """Nobody here asks where the sensors sit."""

    def hear(self, key: str, takes: Callable[[str, bytes, bytes], None]) -> None:
        self.subscribed[key] = takes

    def announce(self, token: str) -> None:
        self.tokens.append(token)

    def say(self, kind: str, payload: bytes, attached: bytes) -> None:
        dds = f"/{kind.replace('/msg/', '::msg::dds_::')}_/"
        (key,) = (key for key in self.subscribed if dds in key)
        self.subscribed[key](key, payload, attached)


class RosDive(PilotedDive):
    service, called, hz = "ros2", "ROS 2", 20.0  # as game_controller_node repeats itself
    malformed, outranked = "malformed:ros", "not_the_holder:ros"
    flies = True  # as its settings say

    def wire(self, node: Node, stack: Stack) -> None:
        self.air, self.count = RosAir(), 0
        connected(node, stack, RosSettings(sticks=self.flies), cast(OtherNetwork, self.air))

    def joy(self, who: int = 0, *buttons: int, age_ns: int = 0, **sticks: float) -> None:
        """Axes as of game_controller_node: up and left are positive. `age_ns`: sent so long ago."""
        values, down = np.zeros(6, np.float32), np.zeros(15, np.int32)
        for axis, stick in ((LEFT_X, "yaw"), (LEFT_Y, "heave"), (RIGHT_X, "sway")):
            values[axis] = -sticks.get(stick, 0.0)
        values[RIGHT_Y] = sticks.get("surge", 0.0)
        down[list(buttons)] = 1
        header = ros.std_msgs__msg__Header(ros.builtin_interfaces__msg__Time(0, 0), "")
        said: Any = ros.sensor_msgs__msg__Joy(header, values, down)
        self.count += 1
        attached = attachment(self.count, self.host.now - age_ns, bytes([97 + who]) * 16)
        self.air.say(JOY, RosMessage("", JOY, said).cdr(), attached)

    def sticks(self, who: int, **sticks: float) -> None:
        self.joy(who, age_ns=0, **sticks)

    def pressed(self, who: int, button: int) -> None:
        for _ in range(10):
            self.joy(who, button)
            self.run(0.05)
        self.steer(0.3, who)

    def arm(self, who: int = 0) -> None:
        self.pressed(who, START)

    def disarm(self, who: int = 0) -> None:
        self.pressed(who, BACK)

    def rubbish(self) -> None:
        self.air.say(JOY, b"\0\1\0\0" + b"\xff" * 60, attachment(1, 0, b"a" * 16))
