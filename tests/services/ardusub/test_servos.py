"""Lights, lasers and a gripper on the board: DO_SET_SERVO until it is acknowledged."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.control import ThrusterCommand
from messages.events import Outbox
from messages.pilot import PilotRequest
from messages.units import Outputs
from messages.vehicle import VehicleStatus
from services.ardusub.commands import BoardServos
from services.ardusub.core import ArdusubDriver, Settings
from services.ardusub.settings import DriverOutbox
from services.marine.outputs import Output
from services.mavlink_io.packet import MavlinkPacket
from services.simulator.core import Settings as SimulatorSettings
from tests.support.ardusub_double.board import BoardDouble
from tests.support.ardusub_double.cable import MS, STACK, VEHICLE, Cable, S

LASERS = Output("lasers", "switch", servo=14, off_after=5.0)
GRIPPER = Output("gripper", "gripper", servo=15, low=1000, high=2000)
OUTPUTS = (Output("light", "dimmer", servo=13), LASERS, GRIPPER)
REST = (0.0,) * 8


class Bench(Cable):
    """A cable to a vehicle with three outputs."""

    def __init__(self, version: str = "4.8", **params: float) -> None:
        super().__init__(version)
        vehicle = msgspec.structs.replace(VEHICLE, output=OUTPUTS)
        place = STACK.section("simulator", SimulatorSettings)
        self.board = BoardDouble(vehicle, place, version=version, params=params)
        self.driver = ArdusubDriver(vehicle, Settings(), self.outbox)

    def shown(self, *, armed: bool = True, **outputs: float) -> "Bench":
        status = VehicleStatus(stamp_ns=self.now, activity="piloted", armed=armed, outputs=outputs)
        self.driver.show(status, 0.0)
        return self

    def grip(self, gripper: float, *, armed: bool = True, ttl_ms: float = 200.0) -> "Bench":
        self.driver.obey(
            ThrusterCommand(
                stamp_ns=self.now,
                sensor_ns=None,
                pilot_ns=None,
                thrust=REST,
                armed=armed,
                armed_ns=1 if armed else None,
                ttl_ms=ttl_ms,
                gripper=gripper,
            ),
            self.now,
        )
        self.run(0.02)
        return self

    def servos(self) -> list[MavlinkPacket]:
        return [p for p in self.of("COMMAND_LONG") if p.fields["command"] == 183]


def ready(version: str = "4.8", **params: float) -> Bench:
    bench = Bench(version, **params)
    bench.accepted()
    return bench


def test_what_the_status_says_reaches_each_servo_and_is_then_not_repeated() -> None:
    bench = ready().shown(light=0.25, lasers=1.0)
    bench.run(0.3)
    assert bench.board.set_servos == {13: 1300, 14: 1900, 15: 1500}
    sent = len(bench.servos())
    bench.run(2.0)
    assert len(bench.servos()) == sent == 3
    assert bench.driver.actuation(bench.now).outputs == {
        "light": 0.25, "lasers": 1.0, "gripper": 0.0
    }  # fmt: skip


def test_nothing_is_set_before_a_status_says_what() -> None:
    bench = ready()
    bench.run(1.0)
    assert bench.board.set_servos == {15: 1500}  # but the gripper, which stands still


def test_the_light_of_4_5_is_a_channel_and_the_others_are_servos() -> None:
    bench = ready("4.5").shown(light=0.5, lasers=1.0)
    bench.run(0.3)
    assert bench.board.light == 1500
    assert bench.board.set_servos == {14: 1900, 15: 1500}


@pytest.mark.parametrize("end", ["silence", "disarm", "pilot disarms"])
def test_a_gripper_stands_still_at_once_when_its_commands_end(end: str) -> None:
    bench = ready().shown(light=0.0)
    bench.run(0.5)
    for _ in range(20):
        bench.grip(1.0)
    assert bench.board.set_servos[15] == 2000
    ended = bench.now
    if end == "disarm":
        bench.grip(0.0, armed=False)
    elif end == "pilot disarms":
        request = PilotRequest(stamp_ns=bench.now, id="1", kind="disarm")
        bench.driver.hear_pilot(request, bench.now)
    while bench.board.set_servos[15] != 1500:
        assert bench.now - ended < S, end
        bench.run(0.001)
    assert bench.now - ended <= (210 if end == "silence" else 25) * MS


def test_a_gripper_waits_for_no_acknowledgement() -> None:
    bench = ready().shown(light=0.0)
    bench.run(0.5)
    bench.grip(1.0)
    bench.dumb = True
    bench.shown(light=1.0)  # … whose acknowledgement does not come
    bench.run(0.02)
    bench.grip(0.0)
    assert bench.board.set_servos[15] == 1500


def test_a_refused_servo_is_said_with_its_name() -> None:
    bench = ready(SERVO14_FUNCTION=59.0).shown(light=1.0, lasers=1.0)
    bench.run(1.0)
    assert bench.board.set_servos == {13: 1900, 15: 1500}
    [said] = [line for line in bench.said if "refuses to move an output" in line]
    assert "lasers, servo 14" in said
    assert len([p for p in bench.servos() if p.fields["param1"] == 14]) == 1  # not at once again
    bench.board.params["SERVO14_FUNCTION"] = 0.0
    bench.run(2.5)
    assert bench.board.set_servos[14] == 1900


def test_a_servo_without_an_answer_is_said_and_asked_again() -> None:
    bench = ready()
    bench.run(0.5)
    bench.deaf = True
    bench.shown(light=1.0)
    bench.run(1.2)
    assert [line for line in bench.said if "light, servo 13" in line]
    bench.deaf = False
    bench.run(1.0)
    assert bench.board.set_servos[13] == 1900


def test_lasers_go_off_when_reference_has_hung_for_longer_than_they_may() -> None:
    bench = ready().shown(lasers=1.0)
    bench.run(4.9)
    assert bench.board.set_servos[14] == 1900
    bench.run(0.3)
    assert bench.board.set_servos[14] == 1100


def test_lasers_are_off_in_a_disarmed_drone_whatever_its_status_says() -> None:
    bench = ready().shown(armed=False, light=1.0, lasers=1.0)
    bench.run(0.5)
    assert bench.board.set_servos == {13: 1900, 14: 1100, 15: 1500}


def test_a_board_whose_motor_an_output_would_move_is_refused() -> None:
    bench = Bench(SERVO14_FUNCTION=36.0)
    bench.run(3.0)
    assert bench.driver.stage == "refused"
    [said] = [line for line in bench.said if "SERVO14_FUNCTION" in line]
    assert "36" in said
    assert "lasers" in said


def test_after_a_reboot_of_the_board_everything_is_set_again() -> None:
    bench = ready().shown(light=1.0, lasers=1.0)
    bench.run(0.5)
    bench.board.set_servos.clear()
    bench.board.reboot(bench.now)
    bench.run(3.0)
    assert bench.board.set_servos == {13: 1900, 14: 1900, 15: 1500}


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["light", "lasers", "gripper", "deaf", "dumb", "heard"]),
            st.sampled_from([-1.0, 0.0, 0.5, 1.0]),
        ),
        max_size=12,
    )
)
def test_whatever_was_lost_every_servo_ends_where_it_belongs(
    story: list[tuple[str, float]],
) -> None:
    outbox = DriverOutbox(Outbox())
    servos, board = BoardServos(OUTPUTS, Settings(), outbox), dict[int, float]()
    values: Outputs = {"light": 0.0, "lasers": 0.0, "gripper": 0.0}
    hears = answers = True
    now = 0

    def step() -> None:
        nonlocal now
        now += 50 * MS
        servos.due(values, now, lights=False)
        for packet in outbox.take(None).packets:
            if hears:
                board[int(packet.fields["param1"])] = packet.fields["param2"]
                if answers:
                    servos.acknowledged(0, now)

    for what, value in story:
        if what in values:
            values[what] = value if what == "gripper" else abs(value)
        hears, answers = what != "deaf", what not in ("deaf", "dumb")
        step()
    hears = answers = True
    for _ in range(40):
        step()
    assert board == {o.servo: o.pulse(values[o.name]) for o in OUTPUTS}
