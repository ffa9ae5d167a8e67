"""Drivers on real sockets and pseudo-terminals: unplugged, silent, back under another name.

Each look is taken by the test, so that nothing here waits for a clock but the operating system."""

import time
from collections.abc import Generator
from contextlib import closing, contextmanager
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from messages.events import Outbox
from messages.sensors import AltitudeSample
from services.instruments.io.shell import Instrument, exchange, limits_of
from services.instruments.watch import AGAIN_NS, OTHER_NS, FirstOfTwo
from services.mavlink_io.io.links import Links
from services.ping.core import PingDriver
from services.ping.core import Settings as PingSettings
from services.waterlinked.core import DvlDriver
from services.waterlinked.core import Settings as WaterlinkedSettings
from tests.support.instruments import ping1d
from tests.support.instruments.ports import SerialInstrument, TcpInstrument
from tests.support.instruments.truth import SeenMotion
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
