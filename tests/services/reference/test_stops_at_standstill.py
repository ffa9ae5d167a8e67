"""The depth is held where the vehicle comes to a standstill, unless it was asked for."""

import pytest
from msgspec import UNSET
from msgspec.structs import replace

from messages.pilot import PilotCommand
from messages.state import VehicleState
from services.reference.core import Settings
from services.reference.settings import FailsafeSettings
from tests.services.reference.drone import Drone
from tests.support.said import state

DT = 10_000_000  # [ns]
DEPTH, HEADING = 0.02, 0.006  # [m], [rad] by which the vehicle runs past every stop


class Pilot(Drone):
    """Of a vehicle that is a little deeper and further round than the reference was planned."""

    late = False
    off = 0.0  # [-] of DEPTH and HEADING

    def step(self, state: VehicleState | None, command: PilotCommand | None) -> None:
        depth, heading = self.depth, self.heading
        super().step(state, command)
        out = self.flown[-1]
        moves = out.depth.velocity != 0.0, out.heading.velocity != 0.0
        self.depth = out.depth.position + self.off * DEPTH if moves[0] else depth
        self.heading = out.heading.position + self.off * HEADING if moves[1] else heading

    def state(self) -> VehicleState:
        late = ("depth_acceleration",) if self.late else ()
        return state(self.now, invalid=late, depth=self.depth, heading=self.heading)

    @property
    def moved(self) -> object:
        return self.status.depth_moved


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_stop_of_the_sticks_ends_where_the_vehicle_is_and_says_by_how_much(sign: float) -> None:
    pilot = Pilot().armed()
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
    pilot = Pilot().armed()
    pilot.off = 1.0
    pilot.ask("goto", depth=2.5, heading=0.4)
    held = pilot.fly(15.0)
    assert held.depth.position == pytest.approx(2.5)
    assert held.heading.position == pytest.approx(0.4)
    assert pilot.moved == UNSET


def test_without_the_accelerometer_a_standstill_is_known_too_late() -> None:
    pilot = Pilot().armed()
    pilot.late = True
    pilot.off = 1.0
    pilot.fly(2.0, heave=0.5, yaw=0.5)
    held = pilot.fly(4.0)
    assert held.depth.position == pytest.approx(pilot.depth - DEPTH)


def test_the_depth_limit_is_not_passed_and_a_stick_held_down_there_moves_nothing() -> None:
    pilot = Pilot(Settings(failsafe=FailsafeSettings(depth_limit=3.0))).armed()
    pilot.off = 1.0
    at_limit = pilot.fly(15.0, heave=1.0)
    assert at_limit.depth.position == pytest.approx(3.0)
    for held in (pilot.fly(3.0, heave=1.0), pilot.fly(3.0)):
        assert held.depth.position <= 3.0 + 1e-9
        assert held.depth.position == pytest.approx(3.0)
