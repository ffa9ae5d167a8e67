"""What the screen is told, with a node that plays the whole stack."""

import math
from typing import Any

from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from messages import topics
from messages.cameras import age
from messages.health import Health, LogLine
from messages.link import DirectionReport, LinkStatus
from messages.message import Message, Notice
from messages.pilot import PilotAnswer, PilotCommand, PilotRequest
from messages.reference import Motion, Reference
from messages.vehicle import VehicleStatus
from messages.video import PictureAge
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.node import Node
from services.vehicle_view.words import notes
from tests.support import said
from tools.live.dive_timeline import DiveTimeline
from tools.live.screen import ServiceView, View, plain
from tools.live.session import Disarming, OwnPilot
from tools.live.watch import Watch

SECOND = 1_000_000_000  # [ns]


class Scene:
    """A watch, and a neighbour that says what a test wants said."""

    def __init__(self) -> None:
        self.host = VirtualHost()
        self.shown: list[LogLine] = []
        node = self.host.node("supervisor", ["topside"])
        self.timeline = DiveTimeline(None)
        self.watch = Watch(
            node,
            ["toy"],
            self.timeline,
            lambda line, _: self.shown.append(line),
            cameras=("front", "down"),
        )
        self.stack = self.host.node("drone", ["topside"])
        self.node = node

    def view(self) -> View:
        return self.watch.view("x", self.host.now, [], {"toy": 2})


def reference_at(heading: float, now: int) -> Reference:
    return said.reference(now, heading=Motion(heading, 0.0, 0.0, 0.0))


def health(sent: int, now: int) -> Health:
    counts = {"stale:state": 2, "saturated:vertical": 5}
    return said.health("toy", stamp_ns=now, sent=sent, counts=counts)


def test_an_empty_bus_gives_a_screen_of_unknowns():
    scene = Scene()
    scene.host.run(SECOND)
    view = scene.view()
    assert view.depth_m is None
    assert view.rtt_ms is None
    assert view.services[0].sent_hz is None
    assert not view.armed


@settings(max_examples=50, deadline=None)
@given(st.floats(-100.0, 100.0))
@example(math.radians(359.96))
@example(math.radians(-0.01))
def test_an_accumulated_heading_is_shown_as_a_compass_reads_it(heading: float):
    scene = Scene()
    scene.stack.publisher(topics.REFERENCE).put(reference_at(heading, 0))
    scene.host.run(SECOND // 20)
    shown = scene.view().heading_wanted_deg
    assert shown is not None
    assert 0.0 <= float(f"{shown:.1f}") < 360.0
    off = math.remainder(math.radians(shown) - heading, math.tau)
    assert abs(off) <= math.radians(0.05) + 1e-9


def test_a_stream_that_falls_silent_disappears_from_the_screen():
    scene = Scene()
    scene.stack.publisher(topics.REFERENCE).put(reference_at(1.0, 0))
    scene.host.run(SECOND // 20)
    assert scene.view().heading_wanted_deg is not None
    scene.host.run(4 * SECOND)
    assert scene.view().heading_wanted_deg is None


def test_rates_are_messages_per_second_and_a_restart_gives_no_negative_rate():
    scene = Scene()
    says = scene.stack.publisher(topics.HEALTH.of("toy"))
    rows: list[ServiceView] = []
    for sent, at in ((100, 2 * SECOND), (300, 4 * SECOND), (3, 5 * SECOND)):
        scene.host.run(at)
        says.put(health(sent, at))
        scene.host.run(at + SECOND // 20)
        rows += scene.view().services
    assert [row.sent_hz for row in rows] == [None, 100.0, 100.0]
    assert (rows[0].restarts, rows[0].troubles) == (2, 7)


def test_link_status_and_log_lines_of_others_and_of_our_own_are_shown():
    scene = Scene()
    below, above = DirectionReport(2.0, 3.0, 10, 1, 0), DirectionReport(5.0, 6.0, 10, 2, 0)
    link = LinkStatus(stamp_ns=0, profile="x", up=True, down_link=below, up_link=above, rtt_ms=7.0)
    scene.stack.publisher(topics.LINK).put(link)
    status = VehicleStatus(stamp_ns=0, activity="ready", armed=False, notices=(Notice("sea"),))
    scene.stack.publisher(topics.STATUS).put(status)
    scene.stack.log("warning", "theirs")
    scene.node.log("error", "ours")
    scene.host.run(SECOND // 20)
    view = scene.view()
    assert (view.down_ms, view.up_ms, view.rtt_ms) == (2.0, 5.0, 7.0)
    assert (view.activity, view.notices) == ("ready", (Notice("sea"),))
    assert sorted(told.line.text for told in view.lines) == ["ours", "theirs"]
    assert sorted(line.text for line in scene.shown) == ["ours", "theirs"]


def test_what_is_wrong_with_each_cameras_picture_is_shown():
    scene = Scene()
    for camera, ms in {"front": 40.0, "down": 3200.0}.items():
        scene.stack.publisher(age(camera)).put(PictureAge(stamp_ns=0, age_ms=ms))
    scene.host.run(SECOND // 20)
    assert scene.view().picture == "down camera: the picture is 3.2 s old"
    scene.host.run(10 * SECOND)
    assert scene.view().picture == ""  # nobody says so any more


def test_between_two_lines_nothing_piles_up_in_any_port():
    """Off a terminal the view is made every five seconds, and some streams come a hundred times a
    second."""
    scene = Scene()
    centred = PilotCommand(stamp_ns=0, surge=0.0, sway=0.0, heave=0.0, yaw=0.0)
    streams: list[tuple[Any, Message]] = [
        (topics.STATUS, VehicleStatus(stamp_ns=0, activity="ready", armed=False)),
        (topics.PICTURE_AGE, PictureAge(stamp_ns=0)),
        (topics.REFERENCE, reference_at(0.0, 0)),
        (topics.PILOT_COMMAND, centred),
    ]
    for topic, message in streams:
        publisher = scene.stack.publisher(topic)

        def say(now: int, publisher: Any = publisher, message: Message = message) -> None:
            publisher.put(replace(message, stamp_ns=now))

        scene.stack.every(topic.hz, say)
    scene.host.run(5 * SECOND)
    assert scene.view().activity == "ready"
    assert [name for name in scene.node.counts if name.startswith("overflowed")] == []


def drone(host: VirtualHost, deaf_for: int, heard: list[PilotRequest]) -> Node:
    """Hears requests and answers all but the first few."""
    node = host.node("reference", ["topside"])
    answers = node.publisher(topics.PILOT_ANSWER)

    def on_request(request: PilotRequest, now: int) -> None:
        heard.append(request)
        if len(heard) > deaf_for:
            answers.put(PilotAnswer(stamp_ns=now, id=request.id, accepted=True))

    node.each(topics.PILOT_REQUEST, on_request)
    return node


def test_the_end_of_a_dive_is_asked_in_the_name_of_this_sides_pilot():
    host, heard = VirtualHost(), list[PilotRequest]()
    node = host.node("supervisor", ["topside"])
    own = OwnPilot(node)
    disarming = Disarming(node, own, ("disarm", "release"))
    gamepad = host.node("gamepad", ["topside"])
    commands = gamepad.publisher(topics.PILOT_COMMAND)
    gamepad.every(
        50.0,
        lambda now: commands.put(
            PilotCommand(stamp_ns=now, surge=0, sway=0, heave=0, yaw=0, source="ann", epoch=3)
        ),
    )
    drone(host, 0, heard)
    host.run(SECOND // 5)
    node.every(50.0, disarming.ask)
    host.run(SECOND, lambda: disarming.done)
    assert [(r.kind, r.source, r.epoch) for r in heard] == [
        ("disarm", "ann", 3), ("release", "ann", 3)
    ]  # fmt: skip
    mine = VehicleStatus(stamp_ns=0, activity="piloted", armed=True, epoch=3)
    theirs = VehicleStatus(stamp_ns=0, activity="piloted", armed=True, epoch=4)
    assert own.in_control(mine)
    assert not own.in_control(theirs)


def test_a_status_that_is_not_repeated_is_said_to_be_old():
    scene = Scene()
    status = VehicleStatus(stamp_ns=0, activity="piloted", armed=True, notices=(Notice("sea"),))
    scene.stack.publisher(topics.STATUS).put(status)
    scene.host.run(SECOND)
    assert scene.view().notices == (Notice("sea"),)
    assert "last known" not in plain(scene.view())
    scene.host.run(4 * SECOND)
    view = scene.view()
    assert notes(view) == ["no status from the drone for 4 s"]
    assert view.armed  # as far as anybody knows
    assert view.last_known
    assert (view.flight_mode, view.light) == ("", None)
    assert "last known: armed piloted" in plain(view)
