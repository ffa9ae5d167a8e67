"""Drivers on real sockets and pseudo-terminals: unplugged, silent, back under another name.

Each look is taken by the test, so that nothing here waits for a clock but the operating system."""

import time
from collections.abc import Generator
from contextlib import closing, contextmanager
from math import cos, hypot, radians, sin, sqrt
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.events import Outbox
from messages.sensors import AltitudeSample
from services.instruments.core import (
    AGAIN_NS,
    ECCENTRICITY2,
    OTHER_NS,
    SEMI_MAJOR,
    FirstOfTwo,
    GeoPoint,
    north_east,
)
from services.instruments.io.shell import Instrument, exchange, limits_of, local_fixes
from services.mavlink_io.io.links import Links
from services.ping.core import PingDriver
from services.ping.core import Settings as PingSettings
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.virtual_host import VirtualHost
from services.waterlinked.core import DvlDriver
from services.waterlinked.core import Settings as WaterlinkedSettings
from tests.support.dive import Dive
from tests.support.instruments import ping1d
from tests.support.instruments.ping1d import Ping1dDouble
from tests.support.instruments.ports import SerialInstrument, TcpInstrument
from tests.support.instruments.truth import SeenMotion, latitude_longitude
from tests.support.patience import until

SWIMS = SeenMotion(velocity=(0.5, 0.0, 0.0))


@contextmanager
def linked(url: str, name: str, outbox: Outbox) -> Generator[Links]:
    links = Links([url], "test.url", limits_of(name), outbox)
    with closing(links):
        yield links


def test_one_that_went_without_a_word_is_connected_anew() -> None:
    """As of a pulled cable: the connection stands, and nothing arrives."""
    instrument, outbox = TcpInstrument(), Outbox()
    driver = DvlDriver(WaterlinkedSettings(), outbox)
    with linked(f"tcp:127.0.0.1:{instrument.port}", "dvl", outbox) as links:
        until(lambda: instrument.says(b"\n"), meanwhile=links.receive)
        now = time.monotonic_ns()
        exchange(Instrument(driver, links), lambda: now, now)
        exchange(Instrument(driver, links), lambda: now, now + AGAIN_NS)
        assert links.trouble == "silent"
    instrument.power_off()


def test_a_cable_that_comes_back_under_another_number_is_found(tmp_path: Path) -> None:
    outbox, samples = Outbox(), list[AltitudeSample]()
    driver, now = PingDriver(PingSettings(), outbox), 0
    with linked(f"serial:{tmp_path}/ttyUSB*:115200", "altimeter", outbox) as links:
        exchange(Instrument(driver, links), lambda: now, now)  # it is not there yet, and is awaited
        assert links.trouble
        for number in (0, 1):
            instrument = SerialInstrument(tmp_path / f"ttyUSB{number}")
            samples.clear()

            def pings(instrument: SerialInstrument = instrument) -> bool:
                nonlocal now
                now += 100_000_000
                instrument.says(ping1d.distance(SWIMS, now // 100_000_000, 0))
                samples.extend(exchange(Instrument(driver, links), lambda: now, now))
                return bool(samples)

            until(pings)
            instrument.unplug()
            until(lambda: bool(links.trouble), meanwhile=links.receive)


@given(st.lists(st.tuples(st.integers(0, 1), st.integers(1, 4 * OTHER_NS)), max_size=60))
def test_of_two_the_first_is_used_until_it_is_silent(reports: list[tuple[int, int]]) -> None:
    """Whoever reports when: never are two used within the time in which one counts."""
    outbox, now, newest = Outbox(), 0, [-10 * OTHER_NS] * 2
    both = FirstOfTwo("dvl", outbox), FirstOfTwo("dvl", outbox)
    for who, after in reports:
        now += after
        if both[who].uses_own(now):
            both[1 - who].heard_other(now)
            assert now - newest[1 - who] > OTHER_NS
            newest[who] = now
        else:
            assert now - newest[1 - who] <= OTHER_NS


def test_one_that_measures_nothing_gives_way() -> None:
    outbox = Outbox()
    first = FirstOfTwo("dvl", outbox)
    assert first.uses_own(0)
    assert first.uses_own(2 * OTHER_NS, measured=False)
    first.heard_other(2 * OTHER_NS)
    assert not first.uses_own(2 * OTHER_NS + 1)
    assert outbox.counts == {"second_instrument:dvl": 1}


def test_of_two_positions_it_is_said_which_is_used_and_nothing_to_be_left_out() -> None:
    outbox = Outbox()
    FirstOfTwo("gnss", outbox, "ugps").heard_other(0)
    assert outbox.counts == {"second_position:gnss": 1}
    ((level, text, _),) = outbox.said
    assert level == "info"
    assert "now ugps" in text


# Where north and east count from is one place: for two instruments, and after a crash.


HERE, THERE = (63.4220, 10.4240), (63.4230, 10.4240)
BOTH = ("nmea.url=udpin:127.0.0.1:0", "ugps.url=http://box")
GIVEN = ("nmea.origin=[63.4220, 10.4240]", "ugps.origin=[63.4220, 10.4240]")


@pytest.mark.parametrize(
    "overrides", [(), GIVEN[:1], (*GIVEN[:1], "ugps.origin=[63.4230, 10.4240]")]
)
def test_two_instruments_without_one_origin_are_refused(overrides: tuple[str, ...]) -> None:
    stack = Stack(overrides=[*BOTH, *overrides])
    with pytest.raises(LindyError, match=r"found nmea\.origin .*; allowed with two .* the same or"):
        local_fixes(stack, "ugps", "ugps", Outbox(), None)


@pytest.mark.parametrize(
    "stack",
    [
        Stack(overrides=[*BOTH, *GIVEN]),
        Stack(overrides=[*BOTH], running=["ugps"]),
        Stack(overrides=[*BOTH[1:]]),
    ],
)
def test_one_origin_or_one_instrument_is_enough(stack: Stack) -> None:
    fixes = local_fixes(stack, "ugps", "ugps", Outbox(), None)
    first, second = (fixes.sample(*at, 1.0, n) for n, at in enumerate((HERE, THERE)))
    assert first is not None
    assert second is not None
    assert (first.north, first.east) == (0.0, 0.0)
    assert second.north == pytest.approx(111.5, abs=0.2)


def test_after_a_crash_the_first_position_is_still_the_origin() -> None:
    host, stack, outbox = VirtualHost(), Stack(), Outbox()
    local_fixes(stack, "nmea", "gnss", outbox, host.node("nmea", ["drone"])).sample(*HERE, 1.0, 1)
    host.kill("nmea")
    again = local_fixes(stack, "nmea", "gnss", outbox, host.node("nmea", ["drone"]))
    sample = again.sample(*THERE, 1.0, 2)
    assert sample is not None
    assert sample.north == pytest.approx(111.5, abs=0.2)
    assert outbox.counts == {"origin:gnss": 1}


# Metres north and east of an origin, against the way over the axes of the earth.


def earth(place: GeoPoint) -> tuple[float, float, float]:
    """[m] ECEF of a point on the ellipsoid."""
    phi, lam = map(radians, place)
    n = SEMI_MAJOR / sqrt(1.0 - ECCENTRICITY2 * sin(phi) ** 2)
    z = n * (1.0 - ECCENTRICITY2) * sin(phi)
    return n * cos(phi) * cos(lam), n * cos(phi) * sin(lam), z


def tangent(origin: GeoPoint, place: GeoPoint) -> tuple[float, float]:
    """[m] North and east in the plane that touches the earth at the origin."""
    x, y, z = (p - o for p, o in zip(earth(place), earth(origin), strict=True))
    phi, lam = map(radians, origin)
    north = -sin(phi) * cos(lam) * x - sin(phi) * sin(lam) * y + cos(phi) * z
    return north, -sin(lam) * x + cos(lam) * y


@given(
    st.floats(-70.0, 70.0),
    st.floats(-180.0, 180.0),
    st.floats(-1_000.0, 1_000.0),
    st.floats(-1_000.0, 1_000.0),
)
def test_within_a_kilometre_it_is_off_by_less_than_half_a_metre(
    latitude: float, longitude: float, north: float, east: float
) -> None:
    origin = (latitude, longitude)
    place = latitude_longitude(origin, north, east)
    found, true = north_east(origin, *place), tangent(origin, place)
    assert hypot(found[0] - true[0], found[1] - true[1]) < 0.5


def test_the_date_line_is_no_border() -> None:
    assert abs(north_east((0.0, 179.9999), 0.0, -179.9999)[1]) < 23.0


# Truth of the simulator → double → driver → the bus → what estimation and reference make of it.


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
    driver, node = PingDriver(PingSettings(), outbox), dive.host.node("instrument", ["drone"])
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
