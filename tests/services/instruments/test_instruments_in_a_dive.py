"""Truth of the simulator → double → driver → the bus → what estimation and reference make of it."""

import pytest

from messages import topics
from messages.events import Outbox
from services.ping.core import PingDriver, Settings
from tests.support.dive import Dive
from tests.support.instruments.ping1d import Ping1dDouble
from tests.support.instruments.truth import SeenMotion

S = 1_000_000_000
FLOOR, SLOPE = 10.0, -0.1  # [m] deep at the start, and deeper by so much for each metre north
SCRIPT = """t,surge,sway,heave,yaw,event
0,0,0,0,0,goto depth=7 heading=0
25,0,0,0,0,mode altitude_hold
28,0.5,0,0,0,
58,0,0,0,0,
63,0,0,0,0,mode depth_hold
64,0,0,1,0,
84,0,0,0,0,
89,0,0,0,0,
"""


@pytest.mark.slow
def test_with_an_echo_sounder_the_height_is_held_and_the_bottom_not_met() -> None:
    floor = f"simulator.floor_depth={FLOOR}", f"simulator.slope_north={SLOPE}"
    dive = Dive(SCRIPT, vehicle="bluerov2_heavy", link="perfect", still_s=10.0, overrides=floor)
    truth, said = dive.heard(topics.TRUTH), dive.heard(topics.LOG)
    outbox, double = Outbox(), Ping1dDouble()
    driver, node = PingDriver(Settings(), outbox), dive.host.node("instrument", ["drone"])
    altitudes = node.publisher(topics.ALTITUDE)

    def look(now: int) -> None:
        if truth:
            north, east, depth = truth[-1].position
            above = FLOOR + SLOPE * north - depth
            double.motion = SeenMotion(north=north, east=east, depth=depth, altitude=above)
            for sample in driver.heard([double.answers(b"".join(driver.due(now)))], now):
                altitudes.put(sample)

    node.every(10.0, look)
    dive.run(110.0)
    heights = [FLOOR + SLOPE * t.position[0] - t.position[2] for t in truth]
    held = [h for h, t in zip(heights, truth, strict=True) if 45 * S < t.stamp_ns < 72 * S]
    over = [t.position[0] for t in truth if 45 * S < t.stamp_ns < 72 * S]
    assert over[-1] - over[0] > 5.0  # [m] of the slope
    assert all(abs(height - 3.0) < 0.3 for height in held)
    assert min(heights) > 0.5  # [m] floor_distance, with the stick full down for 20 s
    lines = [line.text for line in said]
    assert "the bottom is close: the stick leads no deeper; 0.5 m" in lines
    assert outbox.counts == {"answering:altimeter": 1}
