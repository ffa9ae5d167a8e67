"""In the loop: any one thruster dies or turns the wrong way, and the vehicle stays where it is."""

from dataclasses import dataclass, field

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.events import Outbox
from messages.message import Estimate
from messages.reference import Motion, Reference
from messages.simulator import FaultKind as Kind
from messages.state import VehicleState
from messages.vehicle import Actuation
from services.control.core import Controller, Settings
from services.marine.attitude import to_euler, to_world
from services.marine.vehicle import Lag, Vehicle
from services.simulator.faults import Fault
from services.simulator.settings import Settings as Place
from services.simulator.vessel import Vessel
from tests.support.told import told

TICK = 0.01  # [s]
DEPTH, HEADING = 3.0, 0.0


@dataclass
class Dive:
    """A controller with a perfect estimate above a simulated vehicle with faults."""

    vehicle: Vehicle
    faults: dict[str, Fault] = field(default_factory=dict[str, Fault])
    deaf: bool = False  # nobody listens to what the driver says
    tick: int = 0
    counted: list[str] = field(default_factory=list[str])

    def __post_init__(self) -> None:
        at_rest = (0.0, 0.0, DEPTH, 1.0, 0.0, 0.0, 0.0, *[0.0] * 6)
        self.vessel = Vessel(self.vehicle, Place(), at_rest, [0.0] * len(self.vehicle.thruster))
        self.vessel.propulsion.set_faults(self.faults)
        self.controller = Controller(Settings(), self.vehicle, Outbox())
        self.thrust: tuple[float, ...] = ()

    @property
    def depth(self) -> float:
        return self.vessel.state[2]

    @property
    def heading(self) -> float:
        return to_euler(self.vessel.attitude)[2]

    @property
    def speed(self) -> float:
        """[m/s] ahead."""
        return self.vessel.velocity[0]

    def run(self, seconds: float, surge: float = 0.0, sway: float = 0.0) -> float:
        """Largest error seen: [m] of depth plus [rad] of heading."""
        worst = 0.0
        for _ in range(round(seconds / TICK)):
            self.step(surge, sway)
            worst = max(worst, abs(self.depth - DEPTH) + abs(self.heading - HEADING))
        return worst

    def step(self, surge: float, sway: float) -> None:
        now, state = self.tick * 10_000_000, self.state()
        self.tick += 1
        if self.thrust and not self.deaf:
            self.controller.heard(self.actuation(now), state)
        self.wrench, command = self.controller.step(self.reference(surge, sway), state, now)
        self.counted += told(self.controller.outbox)
        self.thrust = command.thrust
        self.vessel.propulsion.drive(command.thrust)
        self.vessel.advance(TICK)

    def actuation(self, now: int) -> Actuation:
        return Actuation(
            stamp_ns=now,
            thrust=tuple(self.vessel.propulsion.produced),
            measured=True,
            actuated_ns=now - 10_000_000,
            sensor_ns=now - 10_000_000,
            pilot_ns=None,
            stale=False,
            power=0.0,
        )

    def state(self) -> VehicleState:
        depth, attitude = self.depth, self.vessel.attitude
        u, v, w, _, _, r = self.vessel.velocity
        roll, pitch, heading = to_euler(attitude)
        return VehicleState(
            stamp_ns=self.tick * 10_000_000,
            sensor_ns=self.tick * 10_000_000,
            phase="running",
            depth=Estimate(depth, 0.01),
            depth_rate=Estimate(to_world(attitude, (u, v, w))[2], 0.01),
            depth_acceleration=Estimate(0.0, 0.01),
            attitude=attitude,
            roll=Estimate(roll, 0.01),
            pitch=Estimate(pitch, 0.01),
            heading=Estimate(heading, 0.01),
            heading_navigation=None,
            yaw_rate=Estimate(r, 0.01),
        )

    def reference(self, surge: float, sway: float) -> Reference:
        return Reference(
            stamp_ns=self.tick * 10_000_000,
            sensor_ns=self.tick * 10_000_000,
            pilot_ns=None,
            armed=True,
            depth=Motion(DEPTH, 0.0, 0.0, 0.0),
            heading=Motion(HEADING, 0.0, 0.0, 0.0),
            surge_force=surge,
            sway_force=sway,
        )


@pytest.mark.parametrize("kind", ["dead", "reversed"])
@pytest.mark.parametrize("index", range(8))
def test_eight_thrusters_hold_depth_and_heading_without_any_one(
    heavy: Vehicle, index: int, kind: Kind
) -> None:
    """While the pilot moves about, which is what makes a fault show."""
    name = heavy.thruster[index].name
    dive = Dive(heavy, {name: Fault(kind)})
    assert dive.run(5.0, surge=25.0, sway=-15.0) < 1.0
    assert dive.run(2.0, surge=25.0, sway=-15.0) < 0.2
    dive.run(2.0)
    assert dive.run(1.0) < 0.15
    assert dive.wrench.distrusted == (name,)
    assert dive.counted.count(f"distrusted:{name}") == 1
    assert not any(what.startswith("lost_axis:") for what in dive.counted)


@pytest.mark.parametrize("kind", ["dead", "reversed"])
def test_a_vehicle_of_four_loses_only_sway_with_its_lateral_thruster(
    pioneer: Vehicle, kind: Kind
) -> None:
    dive = Dive(pioneer, {"lateral": Fault(kind)})
    dive.run(3.0, sway=10.0)
    assert dive.run(4.0, surge=20.0, sway=10.0) < 0.1
    assert dive.wrench.achieved[0] == pytest.approx(20.0)
    assert dive.speed > 0.5
    if kind == "dead":
        assert dive.wrench.achieved[1] == 0.0
        assert dive.counted.count("lost_axis:sway") == 1
    else:
        assert dive.wrench.achieved[1] == pytest.approx(10.0)
        assert "lost_axis:sway" not in dive.counted


@pytest.mark.parametrize("name", ["port", "starboard"])
def test_a_vehicle_of_four_comes_home_on_one_of_its_two_forward_thrusters(
    pioneer: Vehicle, name: str
) -> None:
    """Crabwise, for the lateral thruster keeps the heading."""
    dive = Dive(pioneer, {name: Fault("dead")})
    dive.run(3.0, surge=10.0)
    assert dive.run(5.0, surge=10.0) < 0.2
    assert dive.speed > 0.3
    assert dive.counted.count("lost_axis:sway") == 1


def test_a_reversed_thruster_that_is_trusted_costs_heading_and_way(pioneer: Vehicle) -> None:
    """What the watch is there for: the same dive with nobody listening to the driver."""
    deaf = Dive(pioneer, {"port": Fault("reversed")}, deaf=True)
    deaf.run(3.0, surge=10.0)
    lost = deaf.run(4.0, surge=10.0)
    heard = Dive(pioneer, {"port": Fault("reversed")})
    heard.run(3.0, surge=10.0)
    held = heard.run(4.0, surge=10.0)
    assert lost > 0.5
    assert held < 0.1
    assert heard.speed > 0.4 > deaf.speed  # backwards


def test_a_mended_thruster_is_counted_on_again(pioneer: Vehicle) -> None:
    dive = Dive(pioneer, {"lateral": Fault("dead")})
    dive.run(3.0, sway=10.0)
    assert dive.wrench.distrusted == ("lateral",)
    dive.vessel.propulsion.set_faults({})
    assert dive.run(8.0, surge=10.0) < 0.1
    assert dive.wrench.distrusted == ()


@settings(max_examples=6, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(0.1, 2.0), st.floats(-60.0, 60.0), st.floats(-40.0, 40.0)),
        min_size=3,
        max_size=6,
    )
)
def test_nobody_is_suspected_in_a_sound_dive(
    pioneer: Vehicle, sticks: list[tuple[float, float, float]]
) -> None:
    dive = Dive(pioneer)
    for seconds, surge, sway in sticks:
        dive.run(seconds, surge, sway)
    assert not [what for what in dive.counted if what.startswith(("distrusted", "lost_axis"))]
    assert dive.wrench.distrusted == ()


def test_a_lag_of_third_order_is_known_to_the_watch(heavy: Vehicle) -> None:
    """The one that von Benzon et al. 2022 identified."""
    lag = Lag([6136.0, 108_700.0], [1.0, 89.0, 9258.0, 108_700.0])
    swinging = msgspec.structs.replace(
        heavy, thruster=[msgspec.structs.replace(t, lag=lag) for t in heavy.thruster]
    )
    dive = Dive(swinging)
    for k in range(30):
        dive.run(0.1, surge=25.0 if k % 2 else -25.0)
    assert dive.wrench.distrusted == ()
    dive.vessel.propulsion.set_faults({"flat_front_left": Fault("weak", 0.3)})
    dive.run(3.0, surge=25.0)
    assert dive.wrench.distrusted == ("flat_front_left",)


def test_stopped_means_stopped_for_a_distrusted_thruster_too(pioneer: Vehicle) -> None:
    dive = Dive(pioneer, {"lateral": Fault("dead")})
    dive.run(3.0, sway=10.0)
    commands = [dive.controller.step(None, None, k * 10_000_000)[1].thrust for k in range(900)]
    assert set(commands) == {(0.0, 0.0, 0.0, 0.0)}


def test_a_demand_that_cannot_be_met_is_counted_once(pioneer: Vehicle) -> None:
    no_sway = msgspec.structs.replace(
        pioneer, thruster=[t for t in pioneer.thruster if t.name != "lateral"]
    )
    dive = Dive(no_sway)
    dive.run(1.0, surge=5.0, sway=5.0)
    assert dive.counted == ["undriven:sway"]


def test_a_vehicle_that_nobody_can_fly_is_refused(pioneer: Vehicle) -> None:
    grounded = msgspec.structs.replace(pioneer, thruster=pioneer.thruster[:3])
    with pytest.raises(ValueError, match="cannot drive heave independently"):
        Controller(Settings(), grounded, Outbox())
