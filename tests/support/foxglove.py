"""The service that shows a dive live, on virtual time, with somebody to show."""

from messages import topics
from messages.health import LogLine
from messages.sensors import PressureSample
from services.foxglove.service import wire
from services.runtime.config.stack import Stack
from services.runtime.hosts.virtual_host import VirtualHost
from tests.support.doors import free_port

SECOND = 1_000_000_000
UTC = 1_700_000_000 * SECOND
SIDES = ["topside", "drone"]


def stack(*settings: str, virtual: bool = False) -> Stack:
    return Stack(overrides=[f"foxglove.{s}" for s in settings], virtual=virtual)


class Watched:
    """A neighbour on the drone's side, a pilot's side that logs, and the service."""

    def __init__(self, *settings: str) -> None:
        self.port = free_port()
        self.host = VirtualHost()
        drone, topside = self.host.node("drone", ["drone"]), self.host.node("pilot", ["topside"])
        say, log = drone.publisher(topics.PRESSURE), topside.publisher(topics.LOG.of("pilot"))
        drone.every(40, lambda now: say.put(PressureSample(stamp_ns=now, pressure=101_325.0)))
        topside.every(
            5,
            lambda now: log.put(LogLine(stamp_ns=now, service="pilot", level="info", text="hi")),
        )
        self.node = self.host.node("foxglove", SIDES)
        self.node.wall_offset_ns = UTC
        self.lines: list[LogLine] = []
        self.node.show = self.lines.append
        wire(self.node, stack(f"port={self.port}", "host=127.0.0.1", *settings))

    def run_on(self) -> None:
        self.host.run(self.host.now + SECOND // 10)
