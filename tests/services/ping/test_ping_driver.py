"""What a Ping1D says becomes altitudes; its frames are those of its maker's page."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.events import Outbox
from messages.sensors import AltitudeSample
from services.ping.core import (
    DEVICE,
    DISTANCE,
    LONGEST,
    PingCutter,
    PingDriver,
    Settings,
    frame,
    request,
)
from tests.support.instruments.ping1d import Fault, Ping1dDouble, distance, packed
from tests.support.instruments.truth import SeenMotion

S = 1_000_000_000
FLIES = SeenMotion(altitude=3.2)


def dialogue(
    double: Ping1dDouble, seconds: int = 10, settings: Settings | None = None
) -> tuple[list[AltitudeSample], Outbox]:
    """Driver and double, looked at 10 times a second."""
    outbox, samples = Outbox(), list[AltitudeSample]()
    driver, now = PingDriver(settings or Settings(), outbox), 100 * S
    double.motion = FLIES
    for _ in range(seconds * 10):
        now += S // 10
        asked = b"".join(driver.due(now))
        samples += driver.heard([double.answers(asked)], now + 10_000_000)
    return samples, outbox


def test_the_example_of_the_makers_page_byte_by_byte() -> None:
    asked = bytes([0x42, 0x52, 2, 0, 6, 0, 0, 0, 5, 0, 0xA1, 0])
    told = bytes([0x42, 0x52, 4, 0, 5, 0, 0, 0, 1, 2, 3, 0, 0xA3, 0])
    assert request(5) == asked
    assert PingCutter().frames([told]) == ([(5, bytes([1, 2, 3, 0]))], False)


def test_each_ping_is_an_altitude_with_the_time_of_its_echo() -> None:
    samples, outbox = dialogue(Ping1dDouble())
    assert len(samples) == 100
    assert outbox.counts == {"answering:altimeter": 1}
    assert all(abs(sample.altitude - 3.2) < 0.05 for sample in samples)
    assert samples[0].stamp_ns == 100 * S + S // 10 + 10_000_000 - 50_000_000


def test_the_rate_is_that_of_the_settings() -> None:
    assert len(dialogue(Ping1dDouble(), settings=Settings(rate=2.0))[0]) in (20, 21)


@pytest.mark.parametrize(("fault", "samples"), [("air", 0), ("off", 1)])
def test_without_a_bottom_or_a_new_ping_there_is_no_altitude(fault: Fault, samples: int) -> None:
    found, outbox = dialogue(Ping1dDouble(faults=frozenset({fault})))
    assert len(found) == samples
    assert outbox.counts == {"answering:altimeter": 1, "no_bottom:sensor/altitude": 1}


def test_a_bottom_that_comes_and_goes_is_said_once_each_time_it_is_gone_for_long() -> None:
    outbox, now = Outbox(), 100 * S
    driver = PingDriver(Settings(), outbox)
    for number in range(400):
        now += S // 10
        gone = number // 10 % 2 == 1 or number >= 300  # for 1 s, and for 10 s
        faults = frozenset[Fault]({"air"} if gone else ())
        driver.heard([distance(FLIES, number, 0, faults)], now)
    assert outbox.counts["no_bottom:sensor/altitude"] == 1


def test_an_altitude_that_cannot_be_is_counted() -> None:
    samples, outbox = dialogue(Ping1dDouble(faults=frozenset({"absurd"})))
    assert samples == []
    assert outbox.counts["implausible:altitude"] == 100


def test_it_is_switched_on_and_the_sound_speed_is_set() -> None:
    double = Ping1dDouble()
    double.on = False
    dialogue(double, settings=Settings(sound_speed=1482.0))
    assert double.sound_speed == 1_482_000
    assert double.on


def test_a_doctor_only_asks() -> None:
    double, now = Ping1dDouble(), 100 * S
    driver = PingDriver(Settings(sound_speed=1482.0), Outbox())
    driver.watch.only_asks = True
    double.on, double.motion = False, FLIES
    for _ in range(10):
        now += S // 10
        driver.heard([double.answers(b"".join(driver.due(now)))], now)
    assert (double.on, double.sound_speed) == (False, 1_500_000)
    assert driver.told.startswith("firmware 3.29.0, 98 % sure of 3.2")


def test_a_refusal_is_said_in_its_words() -> None:
    outbox = Outbox()
    PingDriver(Settings(), outbox).heard([packed(2, b"\xea\x03not in this mode")], S)
    assert "1002: not in this mode" in outbox.said[0][1]


def test_older_firmware_that_does_not_tell_its_version_is_no_trouble() -> None:
    outbox = Outbox()
    PingDriver(Settings(), outbox).heard([packed(2, bytes([DEVICE, 0]) + b"unknown")], S)
    assert outbox.counts == {}


def test_a_profile_that_somebody_else_asked_for_is_as_good() -> None:
    (sample,) = PingDriver(Settings(), Outbox()).heard([distance(FLIES, 1, 0, echo=200)], S)
    assert sample.altitude == pytest.approx(3.2, abs=0.05)


@given(st.binary(max_size=40), st.lists(st.integers(1, 30), max_size=10))
def test_a_frame_is_found_in_any_pieces_behind_any_bytes(before: bytes, cuts: list[int]) -> None:
    """Behind what looks like the start of a frame, once as much as that promises has arrived."""
    data = before + frame(DISTANCE, bytes(24)) * 2 + bytes(LONGEST + 10)
    data += frame(DISTANCE, bytes(24))
    cutter, found = PingCutter(), list[tuple[int, bytes]]()
    for cut in (*cuts, len(data)):
        found += cutter.frames([data[:cut]])[0]
        data = data[cut:]
    assert found[-1] == (DISTANCE, bytes(24))
    assert len(found) == 3 or before


def test_a_wrong_speed_of_the_cable_is_said_once() -> None:
    outbox = Outbox()
    driver = PingDriver(Settings(), outbox)
    again = [driver.watch.gives_up(0)]
    for n in range(1, 200):
        driver.heard([b"\xf0\x00\x80\xf8" * 8], n * S // 10)
        again.append(driver.watch.gives_up(n * S // 10))
    said = [text for _, text, _ in outbox.said]
    assert len(said) == 1
    assert "speed of the cable" in said[0]
    assert again.count(True) == 3  # after 8, 13 and 18 s
