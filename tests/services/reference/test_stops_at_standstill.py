"""The depth is held where the vehicle comes to a standstill, unless it was asked for."""

import pytest
from msgspec import UNSET
from msgspec.structs import replace

from messages.events import Outbox
from messages.pilot import PilotCommand, PilotRequest
from messages.reference import Reference
from messages.state import VehicleState
from services.reference.core import ReferenceGenerator, Settings
from services.reference.settings import FailsafeSettings
from tests.support.said import state

DT = 10_000_000  # [ns]
DEPTH, HEADING = 0.02, 0.006  # [m], [rad] by which the vehicle runs past every stop


class Pilot:
    """Of a vehicle that is a little deeper and further round than the reference was planned."""

    def __init__(self, *, late: bool = False, limit: float = 100.0) -> None:
        failsafe = FailsafeSettings(depth_limit=limit)
        self.generator = ReferenceGenerator(Settings(failsafe=failsafe), Outbox())
        self.now = 0
        self.late = late
        self.depth, self.heading = 1.0, 0.0
        self.off = 0.0  # [-] of DEPTH and HEADING
        self.fly(0.1)
        self.ask("arm")
        self.fly(0.1)

    def ask(self, kind: str, **more: object) -> None:
        request = PilotRequest(stamp_ns=self.now, id=str(self.now), kind=kind, **more)  # type: ignore[arg-type]
        answer = self.generator.answer(request, sticks(self.now), self.now)
        assert answer.accepted, answer.reason

    def fly(self, seconds: float, heave: float = 0.0, yaw: float = 0.0) -> Reference:
        out: Reference | None = None
        for _ in range(round(seconds * 100)):
            self.now += DT
            command = sticks(self.now, heave, yaw)
            out = self.generator.step(self.state(), command, self.now)
            assert out is not None
            if out.depth.velocity != 0.0:
                self.depth = out.depth.position + self.off * DEPTH
            if out.heading.velocity != 0.0:
                self.heading = out.heading.position + self.off * HEADING
        assert out is not None
        return out

    def state(self) -> VehicleState:
        late = ("depth_acceleration",) if self.late else ()
        return state(self.now, invalid=late, depth=self.depth, heading=self.heading)

    @property
    def moved(self) -> object:
        return self.generator.status(self.now).depth_moved


def sticks(now: int, heave: float = 0.0, yaw: float = 0.0) -> PilotCommand:
    return PilotCommand(stamp_ns=now, surge=0.0, sway=0.0, heave=heave, yaw=yaw)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_stop_of_the_sticks_ends_where_the_vehicle_is_and_says_by_how_much(sign: float) -> None:
    pilot = Pilot()
    pilot.off = sign
    moving = pilot.fly(2.0, heave=0.5, yaw=0.5)
    assert moving.depth.velocity != 0.0
    assert pilot.moved == UNSET
    held = pilot.fly(4.0)
    assert held.depth.velocity == 0.0 == held.depth.acceleration
    assert held.depth.position == pytest.approx(pilot.depth, abs=1e-12)
    assert held.heading.position == pytest.approx(pilot.heading - sign * HEADING, abs=1e-5)
    assert pilot.moved == pytest.approx(sign * DEPTH, abs=1e-5)
    assert pilot.fly(5.0) == replace(
        held, stamp_ns=pilot.now, sensor_ns=pilot.now, pilot_ns=pilot.now
    )


def test_a_depth_and_a_heading_that_were_asked_for_are_held() -> None:
    pilot = Pilot()
    pilot.off = 1.0
    pilot.ask("goto", depth=2.5, heading=0.4)
    held = pilot.fly(15.0)
    assert held.depth.position == pytest.approx(2.5)
    assert held.heading.position == pytest.approx(0.4)
    assert pilot.moved == UNSET


def test_without_the_accelerometer_a_standstill_is_known_too_late() -> None:
    pilot = Pilot(late=True)
    pilot.off = 1.0
    pilot.fly(2.0, heave=0.5, yaw=0.5)
    held = pilot.fly(4.0)
    assert held.depth.position == pytest.approx(pilot.depth - DEPTH)


def test_the_depth_limit_is_not_passed_and_a_stick_held_down_there_moves_nothing() -> None:
    pilot = Pilot(limit=3.0)
    pilot.off = 1.0
    at_limit = pilot.fly(15.0, heave=1.0)
    assert at_limit.depth.position == pytest.approx(3.0)
    for held in (pilot.fly(3.0, heave=1.0), pilot.fly(3.0)):
        assert held.depth.position <= 3.0 + 1e-9
        assert held.depth.position == pytest.approx(3.0)
