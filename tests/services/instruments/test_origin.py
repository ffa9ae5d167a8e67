"""Where north and east count from is one place: for two instruments, and after a crash."""

import pytest

from messages.events import Outbox
from services.instruments.io.shell import local_fixes
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.virtual_host import VirtualHost

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
