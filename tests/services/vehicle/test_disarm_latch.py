"""After a disarm nothing is armed until a later arm, whatever old messages arrive and when."""

from math import inf

from hypothesis import given
from hypothesis import strategies as st

from messages.control import ThrusterCommand
from messages.events import Outbox
from messages.pilot import PilotRequest
from services.marine.vehicle import Thruster
from services.vehicle.actuator_gate import KNOWN, ActuatorGate, DisarmLatch
from tests.support.told import told

MS = 1_000_000  # [ns]
EPOCH = 7
THRUSTERS = [Thruster("port", (0, 0, 0), (1, 0, 0), max_thrust=30.0)]


def disarm(at: int, name: str = "d", epoch: int = EPOCH) -> PilotRequest:
    return PilotRequest(stamp_ns=at, id=name, kind="disarm", epoch=epoch)


def seen(latch: DisarmLatch, at: int, armed_ns: int | None, *, armed: bool = True) -> bool:
    return latch.see(EPOCH, at, armed_ns, armed=armed)


# Stamps of requests and messages are drawn independently of when they arrive.
instants = st.integers(0, 50)
said = st.tuples(st.just("said"), instants, st.booleans())
asked = st.tuples(st.just("disarm"), instants, st.sampled_from((EPOCH, EPOCH, EPOCH - 1)))


class Latch(DisarmLatch):
    """With an outbox of its own."""

    def __init__(self) -> None:
        self.outbox = Outbox()
        super().__init__(self.outbox)

    def counted(self, request: PilotRequest, now: int) -> list[str]:
        self.hear(request, now)
        return told(self.outbox)


@given(st.lists(st.one_of(said, asked), max_size=60))
def test_only_an_arming_later_than_every_disarm_obeyed_arms(
    events: list[tuple[str, int, int]],
) -> None:
    latch, newest = Latch(), -inf
    for now, (what, instant, value) in enumerate(events, start=1000):
        if what == "said":
            armed = seen(latch, now, instant if value else None, armed=bool(value))
            assert armed == (bool(value) and instant > newest)
            continue
        request = disarm(instant, f"d{now}", value)
        counted = latch.counted(request, now)
        if latch.obeyed(request):
            assert value == EPOCH
            newest = max(newest, instant)
        else:
            assert counted, "what is not obeyed is counted"


@given(st.lists(st.booleans(), max_size=20))
def test_a_sender_that_names_no_arming_arms_again_after_it_was_disarmed(said: list[bool]) -> None:
    latch = Latch()
    assert seen(latch, 0, None)
    latch.hear(disarm(5), 10)
    was_disarmed = False
    for k, armed in enumerate(said):
        was_disarmed = was_disarmed or not armed
        assert seen(latch, 11 + k, None, armed=armed) == (armed and was_disarmed)


def test_an_old_disarm_repeated_or_late_does_not_end_a_later_arming() -> None:
    latch = Latch()
    seen(latch, 0, 0)
    assert latch.counted(disarm(5), 10) == []
    assert not seen(latch, 9, None, armed=False)  # said before the disarm: it does not end it
    assert not seen(latch, 12, None)
    assert seen(latch, 20, 15)
    assert latch.counted(disarm(200), 200) == []  # stamped anew, the same id
    assert seen(latch, 210, 15)
    assert latch.counted(disarm(6, "late"), 220) == ["overtaken:pilot/request"]
    assert seen(latch, 230, 15)


def test_it_is_not_obeyed_before_anything_is_known_of_the_epoch() -> None:
    latch = Latch()
    assert latch.counted(disarm(5), 10) == ["wrong_epoch:pilot/request"]
    seen(latch, 11, 0)
    latch.hear(disarm(12), 12)  # the same id: its epoch is in force now
    assert not seen(latch, 20, 0)


def test_it_keeps_few_ids() -> None:
    latch = Latch()
    seen(latch, 0, 0)
    for k in range(3 * KNOWN):
        latch.hear(disarm(k, f"d{k}"), k)
    assert not latch.obeyed(disarm(0, "d0"))
    assert latch.obeyed(disarm(0, f"d{3 * KNOWN - 1}"))


def command(at: int, armed_ns: int | None) -> ThrusterCommand:
    return ThrusterCommand(
        stamp_ns=at, sensor_ns=None, pilot_ns=None, thrust=(9.0,), epoch=EPOCH,
        armed=armed_ns is not None, armed_ns=armed_ns,
    )  # fmt: skip


def test_the_gate_is_zero_from_the_instant_of_the_disarm() -> None:
    outbox = Outbox()
    gate = ActuatorGate(THRUSTERS, outbox)
    gate.obey(command(100 * MS, 50 * MS), 100 * MS)
    assert gate.output(110 * MS) == (9.0,)
    gate.hear(disarm(105 * MS), 110 * MS)
    assert told(outbox) == []
    assert gate.output(110 * MS) == (0.0,)
    assert not gate.armed(110 * MS)
    gate.obey(command(120 * MS, 50 * MS), 120 * MS)  # control has not heard it
    assert told(outbox) == ["disarmed:control/thrusters"]
    assert gate.output(120 * MS) == (0.0,)
    assert not gate.armed(120 * MS)
    gate.obey(command(130 * MS, 125 * MS), 130 * MS)
    assert gate.output(130 * MS) == (9.0,)
    assert gate.armed(130 * MS)


def test_a_disarm_of_another_epoch_is_counted_and_does_nothing() -> None:
    outbox = Outbox()
    gate = ActuatorGate(THRUSTERS, outbox)
    gate.obey(command(100 * MS, 50 * MS), 100 * MS)
    gate.hear(disarm(105 * MS, epoch=EPOCH - 1), 110 * MS)
    assert told(outbox) == ["wrong_epoch:pilot/request"]
    assert gate.output(110 * MS) == (9.0,)
