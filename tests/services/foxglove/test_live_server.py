"""A dive is shown live to a client of Foxglove's own, which can command nothing."""

import importlib.util
import socket
import sys
from collections.abc import Callable
from typing import Any

import pytest

from messages import topics
from messages.health import LogLine
from messages.sensors import PressureSample
from services.foxglove.service import wire
from services.runtime.bus.envelope import Envelope
from services.runtime.config.errors import LindyError, NeedsRealTimeError
from services.runtime.config.stack import Stack
from services.runtime.hosts.virtual_host import VirtualHost

SECOND = 1_000_000_000
UTC = 1_700_000_000 * SECOND
SIDES = ["topside", "drone"]
needs_sdk = pytest.mark.skipif(
    importlib.util.find_spec("foxglove") is None, reason="the foxglove extra is not installed"
)


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return free.getsockname()[1]


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


@needs_sdk
def test_foxglove_s_client_sees_the_dive_and_can_command_nothing(
    foxglove_program: Callable[..., Any],
):
    watched = Watched()
    client = foxglove_program("watch_live.cjs", str(watched.port))
    while client.runs:
        watched.run_on()
    seen = client.told()
    watched.host.close()
    assert seen["info"]["name"] == "lindy pioneer"
    assert set(seen["info"]["capabilities"]) == {"parameters", "parametersSubscribe"}
    assert seen["channels"]["sensor/pressure"] == "PressureSample"
    assert seen["channels"]["foxglove/log"] == "foxglove.Log"
    assert seen["first"]["sensor/pressure"]["pressure"] == 101_325.0
    assert seen["first"]["foxglove/log"]["message"] == "hi"
    stamp = seen["first"]["sensor/pressure"]["stamp_ns"]
    assert int(seen["times"]["sensor/pressure"]) == UTC + stamp
    # What it tried to command.
    kp = seen["parameters"]["all"]["control.depth.kp"]
    assert kp != 99
    assert seen["parameters"]["set"] == {"control.depth.kp": kp}
    assert any("clientPublish" in status for status in seen["statuses"])
    assert any("ervice" in status for status in seen["statuses"]), seen["statuses"]
    assert "pilot/command" not in seen["channels"]
    assert set(watched.node.published) <= {
        topics.HEALTH.of("foxglove"), topics.LOG.of("foxglove")
    }  # fmt: skip


@needs_sdk
def test_garbage_on_the_bus_is_counted_and_shown_to_nobody():
    watched = Watched()
    foreign = watched.host.side("topside")
    foreign.forward(Envelope("who/is/this", b"{}", ""))
    foreign.forward(Envelope("state", b"\xff", topics.STATE.encoding))
    watched.run_on()
    watched.node.wall_offset_ns = -10 * SECOND  # a clock before 1970
    watched.run_on()
    watched.host.close()
    assert watched.node.counts["unknown_key"] == 1
    assert watched.node.counts["malformed:state"] == 1
    assert watched.node.counts["malformed:sensor/pressure"] > 0


@needs_sdk
def test_a_port_that_is_taken_is_one_sentence():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(LindyError, match=rf"cannot listen on 127\.0\.0\.1:{port}.*in use"):
            wire(VirtualHost().node("foxglove", SIDES), stack(f"port={port}"))


@needs_sdk
def test_only_this_machine_is_listened_to_unless_told_and_then_it_is_said():
    quiet = Watched()
    assert [line.level for line in quiet.lines] == ["info"]
    quiet.host.close()
    loud = Watched("host=0.0.0.0")
    assert [line.level for line in loud.lines] == ["info", "warning"]
    loud.host.close()


def test_without_the_sdk_the_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch):
    for name in [n for n in sys.modules if n.split(".")[0] == "foxglove"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(sys.modules, "services.foxglove.io.server", raising=False)
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(LindyError, match=r"foxglove-sdk, which is not installed.*--extra foxglove"):
        wire(VirtualHost().node("foxglove", SIDES), stack())


def test_on_virtual_time_nobody_can_watch():
    with pytest.raises(NeedsRealTimeError):
        wire(VirtualHost().node("foxglove", SIDES), stack(virtual=True))
