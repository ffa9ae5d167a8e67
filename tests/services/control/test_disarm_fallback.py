"""Control in the place of a silent reference: what it answers, and what it hands on."""

from hypothesis import given
from hypothesis import strategies as st

from messages.events import Outbox
from messages.pilot import PilotRequest, RequestKind
from messages.reference import Reference
from services.control.core import AGAIN_NS, PATIENCE_NS, DisarmFallback
from services.vehicle.actuator_gate import DisarmLatch
from tests.support import said

MS = 1_000_000  # [ns]


def reference(now: int, armed_ns: int | None) -> Reference:
    return said.reference(now, armed=armed_ns is not None, armed_ns=armed_ns)


class Control:
    """As the service and its controller use them."""

    def __init__(self) -> None:
        self.outbox = Outbox()
        self.latch = DisarmLatch(self.outbox)
        self.disarm_fallback = DisarmFallback(self.latch, self.outbox)

    def heard(self, now: int, armed_ns: int | None) -> list[PilotRequest]:
        self.latch.see(0, now, armed_ns, armed=armed_ns is not None)
        return self.disarm_fallback.heard(reference(now, armed_ns), now)

    def asked(self, now: int, kind: RequestKind, name: str = "", epoch: int = 0) -> bool:
        request = PilotRequest(stamp_ns=now, id=name or f"{kind}{now}", kind=kind, epoch=epoch)
        return self.disarm_fallback.hear(request, now)[1] is not None


def test_only_disarm_and_stop_are_answered_and_only_while_reference_is_silent() -> None:
    control = Control()
    control.heard(0, 0)
    for kind in ("disarm", "stop", "arm", "goto"):
        assert not control.asked(5 * MS, kind)
    control.heard(10 * MS, 6 * MS)
    control.disarm_fallback.heard(None, 120 * MS)
    kinds: tuple[RequestKind, ...] = ("disarm", "stop", "arm", "goto", "lease")
    assert [kind for kind in kinds if control.asked(130 * MS, kind)] == ["disarm", "stop"]
    assert control.asked(330 * MS, "disarm", "disarm130000000"), "every repetition is answered"
    assert not control.asked(340 * MS, "disarm", epoch=9)
    assert control.asked(350 * MS, "stop", epoch=9), "by anybody"
    newborn = Control()
    newborn.disarm_fallback.heard(None, 100 * MS)
    assert not newborn.asked(130 * MS, "disarm")
    assert not newborn.asked(130 * MS, "stop")


def test_what_was_answered_is_handed_on_when_reference_speaks_again() -> None:
    control = Control()
    control.heard(0, 0)
    control.disarm_fallback.heard(None, 100 * MS)
    control.asked(130 * MS, "stop", "s")
    control.asked(140 * MS, "disarm", "d")
    assert [request.id for request in control.heard(900 * MS, 0)] == ["s", "d"]
    assert control.heard(910 * MS, 0) == []
    again = 900 * MS + AGAIN_NS
    assert [request.id for request in control.heard(again, 0)] == ["d"], "until it is disarmed"
    assert control.heard(again + AGAIN_NS, None) == []
    assert control.heard(again + 2 * AGAIN_NS, again) == [], "a later arming"


@given(st.integers(0, PATIENCE_NS // MS - 1))
def test_a_reference_that_disarms_in_time_is_told_nothing(late_ms: int) -> None:
    control = Control()
    control.heard(0, 0)
    control.asked(MS, "disarm")
    for now in range(2, late_ms, 10):
        assert control.heard(now * MS, 0) == []
    assert control.heard(PATIENCE_NS * 2, None) == []
    assert not control.outbox.counts
