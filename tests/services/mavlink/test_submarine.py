"""What ground stations may ask, and what they are answered: the state machine alone."""

import math
from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.events import Outbox
from messages.health import LogLine
from messages.pilot import PilotAnswer, PilotRequest
from messages.state import VehicleState
from messages.vehicle import VehicleStatus
from services.marine.outputs import OUTPUTS, Output
from services.mavlink.core import Settings, Submarine
from services.mavlink.parameters import NAMES, TABLE
from services.mavlink.pilot import Reaction
from services.mavlink.telemetry import CHOSEN, DEFAULT_HZ, STREAMS, Snapshot
from services.mavlink_io.packet import (
    FORCE,
    MESSAGE_IDS,
    GroundStation,
    MavCommand,
    MavlinkPacket,
    MavResult,
)
from services.piloting.pilot import Pilot, Progress
from tests.support.messages import example
from tests.support.told import told

S, MS = 1_000_000_000, 1_000_000
ANN, BOB = GroundStation("udp a", 255, 190), GroundStation("tcp b", 254, 190)
HERE: dict[str, Any] = {"target_system": 1, "target_component": 1}
anything = st.floats(allow_nan=True, allow_infinity=True, width=32)
STATE = example(VehicleState)


class Drone:
    """Answers what a submarine asks, at once."""

    def __init__(
        self, *, accepts: bool = True, reason: str = "", has: tuple[Output, ...] = OUTPUTS
    ) -> None:
        self.outbox = Outbox()
        pilot = Pilot(Progress(), self.outbox, arms=False, has=has)
        self.submarine = Submarine(Settings(), pilot, 0)
        self.accepts, self.reason = accepts, reason
        self.asked: list[str] = []
        self.epoch, self.holder, self.armed, self.now = 0, "", False, 0

    def status(self) -> VehicleStatus:
        return VehicleStatus(
            stamp_ns=self.now,
            activity="ready",
            armed=self.armed,
            pilot=self.holder,
            epoch=self.epoch,
        )

    def hear(self, name: str, sender: GroundStation = ANN, **fields: Any) -> Reaction:
        packet = MavlinkPacket(name, fields, sender.system, sender.component, sender.link)
        return self.answer(self.submarine.received(packet, self.now))

    def answer(self, reaction: Reaction) -> Reaction:
        """Answer its requests; what that causes is added."""
        for request in reaction.requests:
            self.asked.append(request.kind)
            accepted = self.accepts or request.kind == "lease"
            if accepted and request.kind == "lease":
                self.epoch, self.holder = self.epoch + 1, request.source
            if accepted and request.kind in ("arm", "disarm"):
                self.armed = request.kind == "arm"
            more = self.answer(self.submarine.answered(request, self._answer(request, accepted), 0))
            reaction.packets += more.packets
        return reaction

    def _answer(self, request: PilotRequest, accepted: bool) -> PilotAnswer:
        epoch = self.epoch if request.kind == "lease" else None
        reason = "" if accepted else self.reason
        return PilotAnswer(stamp_ns=0, id="", accepted=accepted, reason=reason, epoch=epoch)

    def tick(self, ms: int = 20, links: Sequence[str] = (ANN.link, BOB.link)) -> Reaction:
        self.now += ms * MS
        known = Snapshot(self.now, 0, self.now, self.status(), STATE)
        return self.answer(self.submarine.tick(links, known, self.now))

    def sticks(self, sender: GroundStation = ANN, **sticks: int) -> Reaction:
        fields: dict[str, Any] = {"target": 1, "x": 0, "y": 0, "z": 500, "r": 0, "buttons": 0}
        fields |= sticks
        reaction = self.hear("MANUAL_CONTROL", sender, **fields)
        self.answer(self.submarine.status(self.status(), self.now))
        return reaction

    def command(self, number: int, *params: float, sender: GroundStation = ANN) -> Reaction:
        padded = [*params, *[0.0] * 7][:7]
        fields = {f"param{k + 1}": value for k, value in enumerate(padded)}
        return self.hear("COMMAND_LONG", sender, command=number, confirmation=0, **HERE, **fields)

    def set(self, name: str, value: float, sender: GroundStation = ANN) -> Reaction:
        fields: dict[str, Any] = {"param_id": name, "param_value": value, "param_type": 9}
        return self.hear("PARAM_SET", sender, **fields, **HERE)

    def flown(self) -> "Drone":
        """Ann has the sticks and has armed."""
        self.sticks()
        assert acks(self.command(MavCommand.COMPONENT_ARM_DISARM, 1.0)) == [MavResult.ACCEPTED]
        self.answer(self.submarine.status(self.status(), self.now))
        return self


def sent(reaction: Reaction, name: str) -> list[dict[str, Any]]:
    return [dict(a.packet.fields) for a in reaction.packets if a.packet.name == name]


def acks(reaction: Reaction) -> list[int]:
    return [fields["result"] for fields in sent(reaction, "COMMAND_ACK")]


def texts(reaction: Reaction) -> str:
    return b"".join(fields["text"] for fields in sent(reaction, "STATUSTEXT")).decode()


def test_an_armed_ground_station_steers() -> None:
    drone = Drone().flown()
    command = drone.sticks(z=0, x=1000).command
    assert command is not None
    assert (command.heave, command.surge, command.epoch) == (0.5, 0.5, 1)
    assert command.source == "ground station 255/190"


@given(
    number=st.integers(0, 65535) | st.sampled_from(list(MavCommand)),
    params=st.lists(anything | st.sampled_from([0.0, 1.0, FORCE]), min_size=7, max_size=7),
)
def test_every_command_of_anybody_is_acknowledged_exactly_once(
    number: int, params: list[float]
) -> None:
    drone = Drone().flown()
    for sender in (ANN, BOB):
        reaction = drone.command(number, *params, sender=sender)
        [(link, ack)] = [
            (a.link, a.packet.fields) for a in reaction.packets if a.packet.name == "COMMAND_ACK"
        ]
        assert (link, ack["command"], ack["target_system"]) == (sender.link, number, sender.system)


def test_what_the_drone_refuses_is_acknowledged_as_failed_with_its_reason() -> None:
    drone = Drone(accepts=False, reason="the sticks are not centred")
    drone.sticks()
    reaction = drone.command(MavCommand.COMPONENT_ARM_DISARM, 1.0)
    assert acks(reaction) == [MavResult.FAILED]
    assert "the sticks are not centred" in texts(reaction)


@pytest.mark.parametrize("given_up", [True, False])
def test_a_command_that_the_drone_does_not_answer_fails_at_last(given_up: bool) -> None:
    """When its request is given up, or after a while whatever happens."""
    drone = Drone().flown()
    fields = {"command": 193, **HERE} | {f"param{k}": 0.0 for k in range(1, 8)}
    packet = MavlinkPacket("COMMAND_LONG", fields, 255, 190, "udp a")
    reaction = drone.submarine.received(packet, drone.now)
    assert acks(reaction) == []
    if given_up:
        reaction = drone.submarine.given_up(reaction.requests[0], drone.now)
    else:
        assert acks(drone.tick(5900)) == []
        reaction = drone.tick(200)
    assert acks(reaction) == [MavResult.FAILED]


def test_nobody_arms_without_sticks_or_by_force() -> None:
    drone = Drone()
    for params in ((1.0,), (1.0, FORCE), (math.nan,), (2.0,)):
        reaction = drone.command(MavCommand.COMPONENT_ARM_DISARM, *params)
        assert acks(reaction)[0] in (MavResult.FAILED, MavResult.DENIED)
        assert texts(reaction)
    drone.sticks(z=900)
    assert acks(drone.command(MavCommand.COMPONENT_ARM_DISARM, 1.0)) == [MavResult.FAILED]
    assert "arm" not in drone.asked


def test_a_ground_station_without_sticks_asks_in_its_own_name() -> None:
    drone = Drone()
    request = drone.command(MavCommand.DO_SET_MODE, 1.0, 19.0, sender=BOB).requests[0]
    assert (request.kind, request.flight_mode, request.source) == (
        "mode", "manual", "ground station 254/190",
    )  # fmt: skip


def test_a_second_ground_station_is_told_and_not_obeyed() -> None:
    drone = Drone().flown()
    drone.asked.clear()
    told(drone.outbox)
    reaction = drone.sticks(BOB, z=0)
    assert reaction.command is None
    assert "ground station 255/190 has the sticks" in texts(reaction)
    assert told(drone.outbox) == ["not_the_holder:sticks"]
    for number, params in ((400, (0.0,)), (400, (1.0,)), (176, (1.0, 19.0))):
        assert acks(drone.command(number, *params, sender=BOB)) == [MavResult.DENIED]
    assert drone.asked == []
    assert acks(drone.command(193, 0.0, sender=BOB)) == [MavResult.ACCEPTED]
    assert acks(drone.command(400, 0.0, FORCE, sender=BOB)) == [MavResult.ACCEPTED]
    assert (drone.asked, drone.armed) == (["stop", "stop"], True)  # but it may stop the drone
    told(drone.outbox)
    reaction = drone.set("JS_GAIN_DEFAULT", 0.25, BOB)
    assert told(drone.outbox) == ["not_the_holder:parameter"]
    assert sent(reaction, "PARAM_VALUE")[0]["param_value"] == 0.5


@given(custom=st.integers(0, 2**32 - 1) | st.sampled_from(sorted(CHOSEN)), base=st.integers(0, 255))
def test_a_mode_is_asked_for_if_it_is_known_and_fails_if_not(custom: int, base: int) -> None:
    drone = Drone().flown()
    known = custom in CHOSEN and base & 1
    for reaction in (
        drone.command(MavCommand.DO_SET_MODE, float(base), float(custom)),
        drone.hear("SET_MODE", target_system=1, base_mode=base, custom_mode=custom),
    ):
        assert acks(reaction) == [MavResult.ACCEPTED if known else MavResult.FAILED]
    assert drone.asked.count("mode") == (2 if known else 0)


def test_silent_sticks_are_said_to_be_lost_once_and_then_nothing_is_said() -> None:
    drone = Drone().flown()
    drone.sticks(z=400)
    said = [drone.tick(20).command for _ in range(30)]
    present = [c for c in said if c is not None and c.pilot == "present"]
    lost = [c for c in said if c is not None and c.pilot == "lost"]
    assert len(present) == 15
    assert all(c.stamp_ns + c.ttl_ms * MS == 300 * MS for c in present)
    assert len(lost) == 1
    assert said[16:] == [None] * 14


def test_while_another_pilot_has_control_a_ground_station_says_nothing() -> None:
    drone = Drone()
    drone.epoch, drone.holder = 7, "script"
    for _ in range(20):
        assert drone.sticks(z=0).command is None
        assert drone.tick().command is None
    assert drone.asked == []


def test_the_idle_service_asks_for_no_control() -> None:
    drone = Drone()
    for _ in range(50):
        drone.tick()
        drone.answer(drone.submarine.status(drone.status(), drone.now))
    assert drone.asked == []


@pytest.mark.parametrize(
    "fields",
    [{"target_system": 2, "target_component": 1}, {"target_system": 1, "target_component": 154}],
)
def test_what_is_for_others_is_counted_and_not_answered(fields: dict[str, Any]) -> None:
    drone = Drone()
    reaction = drone.hear("COMMAND_LONG", command=400, param1=1.0, param2=0.0, **fields)
    assert (reaction.packets, told(drone.outbox)) == ([], ["wrong_target:mavlink"])
    drone.hear("PARAM_REQUEST_LIST", GroundStation("udp a", 1, 1), **HERE)
    assert told(drone.outbox) == ["wrong_target:mavlink"]
    sticks: dict[str, Any] = {"target": 0, "x": 0, "y": 0, "z": 500, "r": 0, "buttons": 0}
    drone.hear("MANUAL_CONTROL", **sticks)
    assert told(drone.outbox) == ["wrong_target:mavlink"]


# Parameters.


def test_the_list_of_parameters_is_whole_and_goes_to_who_asked() -> None:
    drone = Drone()
    drone.hear("PARAM_REQUEST_LIST", **HERE)
    drone.tick()
    drone.hear("PARAM_REQUEST_LIST", **HERE)  # asked again: from the beginning, not twice
    reactions = [drone.tick() for _ in range(20)]
    values = [fields for reaction in reactions for fields in sent(reaction, "PARAM_VALUE")]
    assert [fields["param_index"] for fields in values] == list(range(len(NAMES)))
    assert {fields["param_id"].decode() for fields in values} == set(NAMES)
    assert {fields["param_count"] for fields in values} == {len(NAMES)}
    assert all(len(name) <= 16 for name in NAMES)
    links = {a.link for r in reactions for a in r.packets if a.packet.name == "PARAM_VALUE"}
    assert links == {ANN.link}
    for index in (-1, len(NAMES)):
        drone.hear("PARAM_REQUEST_READ", param_id="NOBODY", param_index=index, **HERE)
    assert drone.outbox.counts["unknown_parameter:mavlink"] == 2


@given(name=st.sampled_from(NAMES), value=anything)
def test_a_parameter_keeps_its_limits_and_the_answer_is_the_value_in_force(
    name: str, value: float
) -> None:
    drone = Drone()

    def in_force() -> float:
        read = drone.hear("PARAM_REQUEST_READ", param_id=name, param_index=-1, **HERE)
        return sent(read, "PARAM_VALUE")[0]["param_value"]

    before = in_force()
    (answer,) = sent(drone.set(name, value), "PARAM_VALUE")
    limits = TABLE[name].limits
    assert answer["param_value"] == in_force()
    if limits is None or not limits[0] <= value <= limits[1]:
        assert in_force() == before
        assert "refused:parameter" in drone.outbox.counts
    else:
        assert in_force() == pytest.approx(value, abs=0.5 if TABLE[name].kind != 9 else 1e-6)


# Streams.


def rates(drone: Drone, link: str, seconds: int = 4) -> dict[str, float]:
    """[1/s] Of each message on a link."""
    drone.tick(2000)  # a moment, so that none is due for the first time
    count: dict[str, float] = {}
    for _ in range(50 * seconds):
        for addressed in drone.tick(20).packets:
            if addressed.link == link:
                name = addressed.packet.name
                count[name] = count.get(name, 0) + 1 / seconds
    return count


def test_every_message_comes_at_its_rate_and_each_link_has_rates_of_its_own() -> None:
    drone = Drone()
    drone.command(MavCommand.SET_MESSAGE_INTERVAL, MESSAGE_IDS["ATTITUDE"], 40_000.0)
    drone.command(MavCommand.SET_MESSAGE_INTERVAL, MESSAGE_IDS["VFR_HUD"], -1.0)
    drone.command(MavCommand.SET_MESSAGE_INTERVAL, MESSAGE_IDS["HOME_POSITION"], 1e6)
    ann, bob = rates(drone, ANN.link), rates(drone, BOB.link)
    assert ann["ATTITUDE"] == pytest.approx(25.0, rel=0.1)
    assert "VFR_HUD" not in ann
    assert ann["HOME_POSITION"] == pytest.approx(1.0, abs=0.3)
    for name in ("HEARTBEAT", "ATTITUDE", "VFR_HUD", "GLOBAL_POSITION_INT"):
        assert bob[name] == pytest.approx(DEFAULT_HZ[name], rel=0.15)
    assert "HOME_POSITION" not in bob


def test_data_streams_of_old_are_obeyed() -> None:
    for stream, names in STREAMS.items():
        drone = Drone()
        asked: dict[str, Any] = {"req_stream_id": stream, "req_message_rate": 10, "start_stop": 1}
        assert acks(drone.hear("REQUEST_DATA_STREAM", **HERE, **asked)) == []
        seen = rates(drone, ANN.link, 2)
        for name in set(names) & {"ATTITUDE", "VFR_HUD", "SYS_STATUS", "AHRS2"}:
            assert seen[name] == pytest.approx(10.0, rel=0.1)
        drone.hear("REQUEST_DATA_STREAM", ANN, **HERE, **asked | {"start_stop": 0})
        assert not set(rates(drone, ANN.link, 1)) & set(names)


@given(period_us=anything, number=st.sampled_from(sorted(MESSAGE_IDS.values())))
def test_no_interval_floods_a_link_or_ends_the_heartbeat(period_us: float, number: int) -> None:
    drone = Drone()
    drone.command(MavCommand.SET_MESSAGE_INTERVAL, float(number), period_us)
    most = max(len(drone.tick(1).packets) for _ in range(100))
    assert most <= 2 * (len(DEFAULT_HZ) + 5)
    interval = drone.command(MavCommand.GET_MESSAGE_INTERVAL, 0.0)
    assert sent(interval, "MESSAGE_INTERVAL")[0]["interval_us"] > 0


def test_an_interval_that_is_none_is_denied() -> None:
    for period_us in (-5.0, -0.5, math.nan, math.inf):
        drone, number = Drone(), MESSAGE_IDS["ATTITUDE"]
        denied = drone.command(MavCommand.SET_MESSAGE_INTERVAL, number, period_us)
        assert acks(denied) == [MavResult.DENIED]
        assert rates(drone, ANN.link, 1)["ATTITUDE"] == pytest.approx(
            DEFAULT_HZ["ATTITUDE"], rel=0.15
        )


def test_a_message_is_sent_once_by_request_if_it_is_known() -> None:
    for name, number in MESSAGE_IDS.items():
        drone = Drone()
        drone.tick()
        reaction = drone.command(MavCommand.REQUEST_MESSAGE, float(number))
        known = name not in ("LOCAL_POSITION_NED", "BATTERY_STATUS")  # this drone says neither
        assert bool(sent(reaction, name)) == known
        assert acks(reaction) == [MavResult.ACCEPTED if known else MavResult.FAILED]


# The rest of what ground stations ask when they connect.


def test_questions_have_answers() -> None:
    drone = Drone()
    drone.tick()
    drone.now += 19 * MS  # between two ticks
    for name, fields, answer in (
        ("TIMESYNC", {"tc1": 0, "ts1": 7}, {"ts1": 7, "tc1": drone.now}),
        ("PING", {"time_usec": 3, "seq": 4, **HERE}, {"seq": 4, "target_system": 255}),
        ("MISSION_REQUEST_LIST", {"mission_type": 1, **HERE}, {"count": 0, "mission_type": 1}),
        ("LOG_REQUEST_LIST", {"start": 0, "end": 9, **HERE}, {"num_logs": 0}),
    ):
        (addressed,) = drone.hear(name, ANN, **fields).packets
        assert addressed.link == ANN.link
        assert answer.items() <= dict(addressed.packet.fields).items()
    assert drone.hear("TIMESYNC", tc1=5, ts1=7).packets == []  # an answer


@given(payload=st.lists(st.integers(0, 255), max_size=251))
def test_files_are_refused_at_once(payload: list[int]) -> None:
    reaction = Drone().hear("FILE_TRANSFER_PROTOCOL", target_network=0, payload=payload, **HERE)
    (answer,) = sent(reaction, "FILE_TRANSFER_PROTOCOL")
    assert len(answer["payload"]) == 251
    assert answer["payload"][3] == 129


def test_the_last_chunk_of_a_text_is_not_full() -> None:
    """So a ground station knows that it is the last, and shows the text at once."""
    for size in (50, 51, 97, 99, 100, 147, 150, 200, 249, 250, 400):
        line = LogLine(stamp_ns=0, service="a", level="warning", text="x" * (size - 3))
        chunks = [c["text"] for c in sent(Drone().submarine.log(line, 0), "STATUSTEXT")]
        assert b"".join(chunks) == (b"a: " + b"x" * size)[: min(size, 249)]
        assert all(len(chunk) == 50 for chunk in chunks[:-1])
        assert len(chunks[-1]) < 50 or len(chunks) == 1


def test_a_channel_alone_leaves_the_sticks_beside_it() -> None:
    drone = Drone().flown()
    unsaid = {f"chan{n}_raw": 65535 for n in range(1, 19)}
    drone.sticks(x=1000)
    gain = drone.submarine.gain
    out = drone.tick()
    for _ in range(5):
        drone.hear("RC_CHANNELS_OVERRIDE", **unsaid | {"chan8_raw": 1900}, **HERE)
        drone.sticks(x=1000)
        out = drone.tick()
        assert out.command is not None
        assert out.command.surge == pytest.approx(gain)
    assert out.command is not None
    assert out.command.tilt == 1.0


def test_warnings_become_texts_and_too_many_are_counted() -> None:
    drone = Drone()
    long = "x" * 120
    reaction = drone.submarine.log(LogLine(stamp_ns=0, service="a", level="warning", text=long), 0)
    chunks = sent(reaction, "STATUSTEXT")
    assert texts(reaction) == f"a: {long}"
    assert [c["chunk_seq"] for c in chunks] == [0, 1, 2]
    assert {c["id"] for c in chunks} != {0}
    info = drone.submarine.log(LogLine(stamp_ns=0, service="a", level="info", text="y"), 0)
    assert info.packets == []
    flood = [
        drone.submarine.log(LogLine(stamp_ns=0, service="a", level="error", text="z"), k * MS)
        for k in range(1000)
    ]
    assert sum(len(reaction.packets) for reaction in flood) < 30
    assert drone.outbox.counts["dropped:statustext"] > 950


def test_a_failsafe_is_told_once() -> None:
    drone = Drone()
    failed = VehicleStatus(stamp_ns=0, activity="piloted", armed=True, failsafe="pilot_lost")
    assert "failsafe: pilot lost" in texts(drone.submarine.status(failed, 0))
    assert texts(drone.submarine.status(failed, 1)) == ""


# Buttons.


def test_buttons_arm_choose_modes_and_light_when_they_go_down() -> None:
    drone = Drone()
    drone.sticks()
    drone.sticks(buttons=1 << 6)
    drone.sticks(buttons=1 << 6)
    assert drone.asked.count("arm") == 1
    drone.sticks(buttons=1 << 1)
    drone.sticks(buttons=1 << 14)
    drone.sticks(buttons=1 << 4)
    assert drone.asked[-3:] == ["mode", "light", "disarm"]


def test_a_button_beyond_sixteen_counts_and_one_of_a_tool_that_is_not_there_does_not() -> None:
    drone = Drone()
    drone.sticks()
    for button, function in ((16, 3), (0, 51)):
        drone.set(f"BTN{button}_FUNCTION", function)
    drone.sticks(buttons2=1)
    assert drone.asked.count("arm") == 1
    assert drone.sticks(buttons=1).requests == []


def test_a_held_button_tilts_the_camera_and_one_changes_the_gain() -> None:
    drone = Drone().flown()
    command = drone.sticks(buttons=1 << 10).command
    assert command is not None
    assert (drone.sticks(buttons=1 << 10).command or command).tilt == 1.0
    drone.sticks(buttons=1 << 11)
    command = drone.sticks(x=1000).command
    assert command is not None
    assert command.surge == 0.75


def test_buttons_that_are_down_when_the_sticks_are_taken_were_not_pressed() -> None:
    drone = Drone()
    drone.sticks(buttons=1 << 6)
    drone.sticks(buttons=1 << 6)
    assert "arm" not in drone.asked


def test_buttons_move_the_gripper_while_they_are_down_and_switch_tools() -> None:
    """By the functions that ArduSub has for servo 1, relay 1 and the second lights."""
    has = (
        Output("light", "dimmer"), Output("light_2", "dimmer"), Output("lasers", "switch"),
        Output("jaw", "gripper"),
    )  # fmt: skip
    drone = Drone(has=has).flown()
    for button, function in enumerate((76, 77, 53, 35, 51, 52)):
        drone.set(f"BTN{button}_FUNCTION", function)
    for buttons, moves in ((0b01, -1.0), (0b10, 1.0), (0b11, 0.0), (0b00, 0.0)):
        drone.tick(40)
        command = drone.sticks(buttons=buttons).command or drone.tick(40).command
        assert command is not None
        command = drone.tick(40).command
        assert command is not None
        assert command.gripper == moves, buttons
    asked = list[tuple[str, float | None]]()
    for button in (2, 3, 4, 5):
        for down in (1 << button, 0):
            requests = drone.sticks(buttons=down).requests
            asked += [(r.output, r.value) for r in requests if r.kind == "output"]
    assert asked == [("lasers", 1.0), ("light_2", 0.125), ("lasers", 1.0), ("lasers", 0.0)]
    drone.sticks(buttons=0b10)
    silent = [drone.tick(20).command for _ in range(40)]
    assert silent[-1] is None  # the sticks are lost, and nothing is sent any more
    assert [c.gripper for c in silent if c is not None and c.pilot == "lost"] == [0.0]
