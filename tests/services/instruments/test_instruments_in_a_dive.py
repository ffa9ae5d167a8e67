"""Truth of the simulator → double → driver → the bus → what estimation and reference make of it."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

import pytest

from messages import topics
from messages.events import Outbox
from messages.message import Message
from messages.sensors import AltitudeSample
from messages.state import VehicleState
from messages.topic import Topic
from messages.vehicle import Truth
from services.ping.core import PingDriver
from services.ping.core import Settings as PingSettings
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from tests.support.dive import CHAIN
from tests.support.instruments.ping1d import Ping1dDouble
from tests.support.instruments.truth import SeenMotion

S = 1_000_000_000
FLOOR, SLOPE = 10.0, -0.1  # [m] deep at the start, and deeper by so much for each metre north
P = TypeVar("P", bound=Message)
Hears = Callable[[SeenMotion, int], Sequence[P]]  # what a driver makes of the motion at [ns]


class DiveWithInstrument:
    """A BlueROV2 without DVL and USBL over a sea floor that slopes, and an instrument on it."""

    def __init__(self, folder: Path, script: str) -> None:
        path = folder / "script.csv"
        path.write_text("t,surge,sway,heave,yaw,event\n" + script)
        floor = f"simulator.floor_depth={FLOOR}", f"simulator.slope_north={SLOPE}"
        self.stack = Stack(
            vehicle="bluerov2_heavy", pilot=f"script:{path}", out=str(folder), link="perfect",
            overrides=list(floor),
        )  # fmt: skip
        self.host, rows = VirtualHost(), Registry.read()
        for name in CHAIN:
            self.host.add(name, rows[name], self.stack)
        self.truth, self.states = list[Truth](), list[VehicleState]()
        self.said = list[str]()
        node = self.host.node("observer", ["drone"])
        node.each(topics.TRUTH, lambda message, _: self.truth.append(message))
        node.each(topics.STATE, lambda message, _: self.states.append(message))
        node.each(topics.LOG, lambda line, _: self.said.append(line.text))

    def fly(self, topic: Topic[P], hz: float, hears: Hears[P], seconds: int) -> None:
        """`seconds` after power-on."""
        node = self.host.node("instrument", ["drone"])
        publisher = node.publisher(topic)

        def look(now: int) -> None:
            if self.truth:
                north, east, depth = self.truth[-1].position
                above = FLOOR + SLOPE * north - depth
                motion = SeenMotion(north=north, east=east, depth=depth, altitude=above)
                for sample in hears(motion, now):
                    publisher.put(sample)

        node.every(hz, look)
        self.host.run(seconds * S)


@pytest.mark.slow
def test_with_an_echo_sounder_the_height_is_held_and_the_bottom_not_met(tmp_path: Path) -> None:
    script = (
        "0,0,0,0,0,goto depth=7 heading=0\n25,0,0,0,0,mode altitude_hold\n28,0.5,0,0,0,\n"
        "58,0,0,0,0,\n63,0,0,0,0,mode depth_hold\n64,0,0,1,0,\n84,0,0,0,0,\n89,0,0,0,0,\n"
    )
    dive, outbox = DiveWithInstrument(tmp_path, script), Outbox()
    driver, double = PingDriver(PingSettings(), outbox), Ping1dDouble()

    def hears(motion: SeenMotion, now: int) -> Sequence[AltitudeSample]:
        double.motion = motion
        return driver.heard([double.answers(b"".join(driver.due(now)))], now)

    dive.fly(topics.ALTITUDE, 10.0, hears, 110)
    heights = [FLOOR + SLOPE * t.position[0] - t.position[2] for t in dive.truth]
    held = [h for h, t in zip(heights, dive.truth, strict=True) if 45 * S < t.stamp_ns < 72 * S]
    over = [t.position[0] for t in dive.truth if 45 * S < t.stamp_ns < 72 * S]
    assert over[-1] - over[0] > 5.0  # [m] of the slope
    assert all(abs(height - 3.0) < 0.3 for height in held)
    assert min(heights) > 0.5  # [m] floor_distance, with the stick full down for 20 s
    assert "the bottom is close: the stick leads no deeper; 0.5 m" in dive.said
    assert outbox.counts == {"answering:altimeter": 1}
