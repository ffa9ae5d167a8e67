"""What an Underwater GPS answers becomes fixes."""

import pytest

from messages.events import Outbox
from messages.sensors import UsblSample
from services.instruments.core import LocalFixes
from services.instruments.io.shell import Instrument, exchange
from services.ugps.core import ACOUSTIC, PATHS, Settings, UgpsDriver
from services.ugps.io.poller import HttpPoller
from tests.support.instruments.truth import SeenMotion
from tests.support.instruments.ugps import Fault, answers, served
from tests.support.patience import until

S = 1_000_000_000
TRONDHEIM = (63.4220, 10.4240)
FLIES = SeenMotion(north=12.0, east=-7.0)


def driver_of(outbox: Outbox) -> UgpsDriver:
    return UgpsDriver(Settings(), LocalFixes("ugps", outbox, TRONDHEIM), outbox)


def asked(*faults: Fault, hz: float = 2.0, seconds: int = 10) -> tuple[list[UsblSample], Outbox]:
    outbox, found = Outbox(), list[UsblSample]()
    driver = driver_of(outbox)
    for n in range(round(seconds * hz)):
        said = answers(FLIES, n / hz, 0, TRONDHEIM, frozenset(faults))
        found += driver.heard([said[path] for path in PATHS], 100 * S + round(n * S / hz))
    return found, outbox


def test_a_fix_is_where_the_locator_is() -> None:
    samples, outbox = asked()
    assert len(samples) == 20
    assert outbox.counts == {"answering:ugps": 1}
    assert (samples[0].north, samples[0].east) == pytest.approx((12.0, -7.0), abs=1.5)
    assert (samples[0].std, samples[0].stamp_ns) == (0.7, 100 * S - S // 4)


def test_a_position_that_is_answered_twice_is_one_fix() -> None:
    samples, outbox = asked(hz=8.0)
    assert len(samples) == 40
    assert outbox.counts == {"answering:ugps": 1}


@pytest.mark.parametrize("fault", ["not_valid", "error"])
def test_without_a_position_it_is_alive_and_it_is_said_once(fault: Fault) -> None:
    samples, outbox = asked(fault)
    assert samples == []
    assert outbox.counts == {"answering:ugps": 1, "no_fix:ugps": 1}


@pytest.mark.parametrize(
    "fault", ["nan", "negative", "other_firmware", "not_found", "other_device"]
)
def test_what_is_no_answer_is_counted(fault: Fault) -> None:
    samples, outbox = asked(fault)
    assert samples == []
    assert outbox.counts == {"malformed:ugps": 20}


def test_it_is_asked_over_http_and_again_when_it_was_gone() -> None:
    pages = answers(FLIES, 0.0, 0, TRONDHEIM, frozenset())
    outbox, now, found = Outbox(), 100 * S, list[UsblSample]()
    driver = driver_of(outbox)

    def look() -> None:
        nonlocal now
        now += S // 10
        found.extend(exchange(instrument, lambda: now, now))

    with served(pages) as port:
        poller = HttpPoller(f"http://127.0.0.1:{port}", "ugps.url", PATHS, 0.01, outbox)
        instrument = Instrument(driver, poller)
        poller.start(lambda: None)
        until(lambda: bool(found), meanwhile=look)
        pages[ACOUSTIC] = b"HTTP 500"
        until(lambda: outbox.counts["no_fix:ugps"] == 1, meanwhile=look)
    until(lambda: outbox.counts["silent_instrument:ugps"] == 1, meanwhile=look)
    assert "refused" in outbox.said[-1][1]
    found.clear()
    pages |= answers(FLIES, 1.0, 0, TRONDHEIM, frozenset())
    with served(pages, port):
        until(lambda: bool(found), meanwhile=look)
        poller.close()
    assert outbox.counts["answering:ugps"] == 2


def test_answers_that_nobody_came_for_are_counted() -> None:
    """The newest are kept."""
    outbox = Outbox()
    with served(answers(FLIES, 0.0, 0, TRONDHEIM, frozenset())) as port:
        poller = HttpPoller(f"http://127.0.0.1:{port}", "ugps.url", PATHS, 0.01, outbox)
        poller.start(lambda: None)
        until(lambda: outbox.counts["overflowed:ugps"] > 0)
        poller.close()
    assert len(poller.receive()) == 4
