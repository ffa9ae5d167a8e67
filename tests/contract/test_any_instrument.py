"""What every instrument's driver promises, whatever arrives and whatever its settings say."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.events import Outbox
from services.instruments.core import LocalFixes
from services.instruments.io.shell import limits_of
from services.mavlink_io.io.links import Links
from services.nmea.core import GnssDriver
from services.nmea.core import Settings as NmeaSettings
from services.nmea.io.sentences import NmeaReader
from services.ping.core import PingDriver
from services.ping.core import Settings as PingSettings
from services.runtime.config.errors import LindyError
from services.ugps.core import PATHS, UgpsDriver
from services.ugps.core import Settings as UgpsSettings
from services.ugps.io.poller import HttpPoller
from services.waterlinked.core import DvlDriver
from services.waterlinked.core import Settings as DvlSettings
from tests.support.instruments import dvl, gnss, ping1d, ugps
from tests.support.instruments.truth import SeenMotion

S = 1_000_000_000  # [ns]
HERE = (63.4220, 10.4240)
SEEN = SeenMotion(velocity=(0.5, 0.1, 0.0), altitude=3.0, north=1.0, east=2.0)


def fixes(name: str, outbox: Outbox) -> LocalFixes:
    return LocalFixes(name, outbox, HERE)


# A driver, and what its instrument says when it is well.
DRIVERS: dict[str, tuple[Callable[[Outbox], Any], list[bytes]]] = {
    "dvl": (lambda o: DvlDriver(DvlSettings(), o), [dvl.report(SEEN, 1.0, 0)]),
    "ping": (lambda o: PingDriver(PingSettings(), o), [ping1d.distance(SEEN, 1, 0)]),
    "gnss": (
        lambda o: GnssDriver(NmeaSettings(), fixes("gnss", o), o, NmeaReader().read),
        [gnss.epoch(SEEN, 1.0, 0, HERE)],
    ),
    "ugps": (
        lambda o: UgpsDriver(UgpsSettings(), fixes("ugps", o), o),
        [ugps.answers(SEEN, 1.0, 0, HERE, frozenset())[path] for path in PATHS],
    ),
}


@pytest.mark.parametrize("name", DRIVERS)
@given(pieces=st.lists(st.binary(max_size=60), max_size=20))
def test_no_bytes_end_it_and_behind_them_it_is_heard(name: str, pieces: list[bytes]) -> None:
    drives, well = DRIVERS[name]
    driver = drives(Outbox())
    driver.heard([*pieces, b"\n"] if name != "ugps" else [*pieces, b"", b""][:2], S)
    found = [sample for k in range(2, 9) for sample in driver.heard(well, k * S)]
    assert found or name == "ping"  # whose frames may begin within the rubbish


@pytest.mark.parametrize("url", ["serial:/dev/ttyNONE:123", "tcp:somewhere", "http://192.168.2.94"])
def test_a_url_that_cannot_be_is_one_sentence(url: str) -> None:
    with pytest.raises(LindyError, match=r"test\.url"):
        Links([url], "test.url", limits_of("dvl"), Outbox())


@pytest.mark.parametrize("url", ["192.168.2.94", "https://box", "http://", "http://box:port"])
def test_an_address_that_cannot_be_is_one_sentence(url: str) -> None:
    with pytest.raises(LindyError, match=r"test\.url: found"):
        HttpPoller(url, "test.url", PATHS, 1.0, Outbox())
