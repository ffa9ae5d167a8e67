"""The driver against the double, packet by packet: what it accepts, refuses, sends and says."""

from itertools import pairwise
from math import hypot, inf, nan
from typing import Any

import pytest

from messages import events
from messages.sensors import BatterySample, ImuSample, MagnetometerSample, PressureSample
from messages.vehicle import VehicleStatus
from services.ardusub.core import Settings
from services.mavlink_io.packet import MavlinkPacket
from tests.support.ardusub_double.cable import DOWN, MS, Cable, S

BOTH = pytest.mark.parametrize("version", ["4.5", "4.8"])


# A board that is right.


@BOTH
def test_neutral_is_sent_before_while_and_after_arming(version: str) -> None:
    """At least 50 times a second, never released, and with a heartbeat each second."""
    cable = Cable(version).accepted()
    assert len(cable.sticks()) >= 10
    assert all(sticks == [1500] * 6 for sticks in cable.sticks())
    cable.thrust = DOWN
    armed = cable.now
    cable.run(0.3)
    assert cable.board.armed
    cable.run(2.0)
    assert any(sticks[2] < 1450 for sticks in cable.sticks(armed))
    assert len(cable.sticks(armed)) >= 115
    cable.armed, stopped = False, cable.now
    cable.run(1.0)
    assert not cable.board.armed
    after = cable.sticks(stopped + 20 * MS)
    assert len(after) >= 45
    assert all(sticks == [1500] * 6 for sticks in after)
    assert all(1100 <= pulse <= 1900 for sticks in cable.sticks() for pulse in sticks)
    beats = [at for at, packet in cable.sent if packet.name == "HEARTBEAT"]
    assert all(abs(after - before - S) <= 20 * MS for before, after in pairwise(beats))


@BOTH
def test_the_motors_give_the_wrench_that_was_asked_for(version: str) -> None:
    cable = Cable(version).flying()
    assert sum(cable.driver.path.mixed.thrust) == pytest.approx(40.0, rel=0.02)
    assert sum(cable.board.hull.simulator.actuation().thrust) == pytest.approx(40.0, rel=0.05)


@BOTH
def test_a_command_ends_with_its_time_to_live(version: str) -> None:
    cable = Cable(version).flying()
    cable.thrust, silent = None, cable.now
    cable.run(0.25)
    assert cable.board.servo == [1500] * 8
    first = next(at for at, p in cable.sent if p.name == "RC_CHANNELS_OVERRIDE" and at > silent
                 and p.fields["chan3_raw"] == 1500)  # fmt: skip
    assert first - silent <= 202 * MS
    cable.run(1.0)
    assert cable.board.armed
    cable.run(1.5)
    assert not cable.board.armed
    assert "Lost manual control" not in cable.board.texts


@BOTH
def test_samples_come_at_their_rates_in_si_units_and_on_our_clock(version: str) -> None:
    cable = Cable(version).accepted()
    began = cable.now
    cable.run(4.0)
    # The board takes a pressure and a field over ten times a second, however often it sends them.
    for kind, hz, oldest_ms in (
        (ImuSample, 100, 8),
        (PressureSample, 10, 70),
        (MagnetometerSample, 10, 70),
        (BatterySample, 1, 8),
    ):
        got = [(at, m) for at, m in cable.samples if isinstance(m, kind) and at > began]
        assert len(got) == pytest.approx(4 * hz, abs=2), kind
        assert all(0 <= at - m.stamp_ns <= oldest_ms * MS for at, m in got), kind
    imu = [m for _, m in cable.samples if isinstance(m, ImuSample)][-1]
    assert imu.specific_force[2] == pytest.approx(-9.81, abs=0.3)
    pressure = [m for _, m in cable.samples if isinstance(m, PressureSample)][-1]
    assert pressure.pressure == pytest.approx(101_800, abs=1500)
    assert pressure.temperature == pytest.approx(8.0)


def test_the_finer_imu_message_is_used_where_there_is_one() -> None:
    for version, name in (("4.5", "RAW_IMU"), ("4.8", "HIGHRES_IMU")):
        cable = Cable(version).accepted().run(1.0)
        assert name in cable.board.streams, version


def status(cable: Cable, *, armed: bool = True, **outputs: float) -> VehicleStatus:
    return VehicleStatus(stamp_ns=cable.now, activity="piloted", armed=armed, outputs=outputs)


@BOTH
def test_lights_and_tilt_as_the_version_allows(version: str) -> None:
    cable = Cable(version).accepted()
    cable.driver.show(status(cable, light=0.5), 0.785 / 2)
    cable.run(0.1)
    [last] = cable.of("RC_CHANNELS_OVERRIDE")[-1:]
    assert last.fields["chan8_raw"] == 1700
    if version == "4.5":
        assert cable.board.light == 1500
    else:
        assert last.fields["chan9_raw"] == 0


def test_a_build_on_the_way_to_the_new_names_is_flown() -> None:
    cable = Cable("4.7-early").run(1.5).flying()
    assert cable.counts["refused:board"] == 0
    fields = [m.field for _, m in cable.samples if isinstance(m, MagnetometerSample)]
    assert 2e-5 < hypot(*fields[-1]) < 7e-5, "its HIGHRES_IMU says a million times as much"


# A board that is not.


def test_a_board_that_names_no_arming_checks_is_not_armed() -> None:
    cable = Cable("4.7-early")
    del cable.board.params["ARMING_CHECK"]
    cable.run(6.0)
    assert cable.driver.stage == "refused"
    assert "ARMING_SKIPCHK and ARMING_CHECK are not answered" in cable.said[-1]


@pytest.mark.parametrize(
    ("board", "words"),
    [
        ({"autopilot": 12}, "autopilot is 12; allowed: 3"),
        ({"kind": 1}, "vehicle of type 1; allowed: 12"),
        ({"version": "4.1"}, "ArduSub 4.1; allowed: 4.5 and newer"),
        ({"params": {"FRAME_CONFIG": 1}}, "FRAME_CONFIG is 1; allowed: the frame of BlueROV2"),
        ({"params": {"FRAME_CONFIG": inf}}, "FRAME_CONFIG is inf; allowed: 0 to 7"),
        ({"params": {"MAV_GCS_SYSID": 254}}, "MAV_GCS_SYSID is 254; allowed: 255"),
        ({"params": {"FS_PILOT_INPUT": 0}}, "FS_PILOT_INPUT is 0; allowed: 2"),
        ({"params": {"FS_GCS_ENABLE": 1}}, "FS_GCS_ENABLE is 1; allowed: 2, 3 or 4"),
        ({"params": {"FS_LEAK_ENABLE": 0}}, "FS_LEAK_ENABLE is 0; allowed: 1 or 2"),
        ({"params": {"RC_OVERRIDE_TIME": 0}}, "RC_OVERRIDE_TIME is 0; allowed: 0.1 to 10"),
        ({"params": {"RC3_TRIM": 1100}}, "RC3_TRIM is 1100; allowed: 1500"),
        ({"params": {"ARMING_SKIPCHK": -1}}, "ARMING_SKIPCHK is -1; allowed: not -1"),
        ({"params": {"ACRO_YAW_P": 0}}, "ACRO_YAW_P is 0; allowed: 0.5 to 10"),
        ({"params": {"RCMAP_FORWARD": 6}}, "RCMAP_FORWARD is 6; allowed: 5, its override channel"),
        ({"params": {"RCMAP_ROLL": nan}}, "RCMAP_ROLL is nan; allowed: 2"),
        ({"params": {"MOT_BAT_CURR_MAX": 30}}, "MOT_BAT_CURR_MAX is 30; allowed: 0"),
        ({"version": "4.5", "params": {"SYSID_MYGCS": 1}}, "SYSID_MYGCS is 1; allowed: 255"),
        ({"version": "4.5", "params": {"RC3_TRIM": 1500}}, "RC3_TRIM is 1500; allowed: RC3_MIN"),
        ({"version": "4.5", "params": {"ARMING_CHECK": 0}}, "ARMING_CHECK is 0; allowed: not 0"),
        ({"version": "4.7-early", "params": {"ARMING_CHECK": 0}}, "ARMING_CHECK is 0; allowed"),
    ],
)
def test_a_board_that_is_wrong_is_named_and_never_armed(board: dict[str, Any], words: str) -> None:
    cable = Cable(**board)
    cable.thrust = DOWN
    cable.run(4.0)
    assert not cable.board.armed
    assert not cable.sticks()
    assert not cable.samples
    assert [text for text in cable.said if words in text], cable.said
    assert len(cable.said) == len(set(cable.said)) <= 2
    assert cable.counts["refused:board"] >= 1


def test_no_board_is_said_once() -> None:
    cable = Cable()
    cable.dumb = True
    cable.run(20.0)
    assert len(cable.said) == 1
    assert "no heartbeat of ArduSub arrives" in cable.said[0]
    cable.dumb = False
    cable.accepted()


def test_bytes_that_are_no_mavlink_hint_at_the_speed_of_the_port() -> None:
    cable = Cable()
    cable.dumb = True
    cable.outbox.tell(events.MALFORMED("mavlink"), 500)
    cable.run(5.0)
    assert "is the speed of the serial port right" in cable.said[0]
    assert cable.counts["malformed:mavlink"] == 500


def test_the_pilot_timeout_is_lowered_only_where_the_settings_say_so() -> None:
    plain = Cable().accepted()
    assert plain.board.params["FS_PILOT_TIMEOUT"] == 3.0
    assert "recommended: at most 1 s" in plain.said[0]
    allowed = Cable(settings=Settings(set_pilot_timeout=0.8)).accepted()
    assert allowed.board.params["FS_PILOT_TIMEOUT"] == pytest.approx(0.8)
    assert {p.fields["param_id"] for p in allowed.of("PARAM_SET")} == {"FS_PILOT_TIMEOUT"}


def test_a_parameter_that_will_not_set_is_named_and_the_board_is_not_armed() -> None:
    cable = Cable(settings=Settings(set_pilot_timeout=0.8))
    cable.board.stuck = {"FS_PILOT_TIMEOUT"}
    cable.thrust = DOWN
    cable.run(8.0)
    assert "the board is not armed: FS_PILOT_TIMEOUT could not be set" in cable.said
    assert not cable.board.armed


@pytest.mark.parametrize("acts", [2.0, 0.0])
def test_a_failsafe_that_would_stop_the_motors_in_mid_dive_is_said(acts: float) -> None:
    names = ("BATT_FS_LOW_ACT", "BATT_FS_CRT_ACT", "FS_EKF_ACTION", "FS_CRASH_CHECK")
    cable = Cable(params={"FS_PILOT_TIMEOUT": 1.0, **dict.fromkeys(names, acts)}).accepted()
    said = [name for name in names for text in cable.said if text.startswith(f"{name} is 2: ")]
    assert said == (list(names) if acts else [])


def test_an_axis_on_another_channel_is_found_however_many_answers_are_lost() -> None:
    """Half of them and all of the first seconds, in which a board may still start."""
    cable = Cable(params={"RCMAP_YAW": 6.0})
    rightly, asked = cable.board.hear, 0

    def seldom(packet: MavlinkPacket, now: int) -> None:
        nonlocal asked
        asked += packet.name == "PARAM_REQUEST_READ"
        if packet.name != "PARAM_REQUEST_READ" or (asked > 110 and asked % 2):
            rightly(packet, now)

    cable.board.hear = seldom
    cable.thrust = DOWN
    cable.run(6.0)
    assert not cable.board.armed
    assert any("RCMAP_YAW is 6; allowed: 4" in text for text in cable.said), cable.said


def test_a_board_without_a_sensor_is_said_and_the_others_come() -> None:
    cable = Cable()
    cable.board.missing = {"SCALED_PRESSURE2"}
    cable.accepted().run(1.0)
    assert any("asked for (scaled_pressure2)" in text for text in cable.said)
    assert cable.counts["not_given:scaled_pressure2"] == 1
    assert {type(m) for _, m in cable.samples} >= {ImuSample, BatterySample}


def test_a_slow_stream_is_said_with_its_rate() -> None:
    cable = Cable("4.5")
    cable.board.slowest_us = {"RAW_IMU": 20_000}
    cable.accepted().run(12.0)
    assert any("(raw_imu): 50.0 times a second; asked for 100" in text for text in cable.said)
    assert cable.counts["slow:raw_imu"] >= 1


def test_a_refusal_to_arm_is_said_in_the_boards_own_words() -> None:
    cable = Cable().accepted()
    cable.deaf = True
    cable.thrust = DOWN
    cable.run(0.5)
    cable.deaf = False
    cable.board.refuses = "PreArm: Battery 1 below minimum arming voltage"
    cable.run(1.5)
    assert not cable.board.armed
    assert [t for t in cable.said if t.endswith("arm: PreArm: Battery 1 below minimum arming "
                                                "voltage")], cable.said  # fmt: skip
    cable.board.refuses = ""
    cable.run(2.0)
    assert cable.board.armed


# Under way.


@BOTH
def test_a_reboot_in_mid_dive_needs_a_deliberate_arming(version: str) -> None:
    cable = Cable(version).flying()
    cable.board.reboot(cable.now)
    cable.run(8.0)
    assert not cable.board.armed
    assert cable.driver.stage == "accepted"
    assert cable.counts["jumped:board_clock"] == 1
    assert any("the board was restarted" in text for text in cable.said)
    assert not any("not by Lindy" in text for text in cable.said)
    cable.armed = False
    cable.run(0.5)
    cable.armed = True
    cable.run(1.0)
    assert cable.board.armed


@pytest.mark.parametrize("silence", [0.0, 10.0])
def test_a_board_that_restarts_is_nobody_else_s(silence: float) -> None:
    """Its heartbeat says that it is disarmed before its clock says why."""
    cable = Cable().flying()
    cable.board.reboot(cable.now)
    cable.dumb = True
    cable.run(silence)
    cable.dumb = False
    cable.run(6.0)
    assert cable.counts["outdone:ardusub"] == 0
    assert [text for text in cable.said if "the board was restarted" in text]
    assert not [text for text in cable.said if "not by Lindy" in text]


def test_an_old_text_of_the_board_is_no_reason() -> None:
    cable = Cable().flying().run(4.0)
    assert "Arming motors" in cable.board.texts
    cable.another(400, 0)
    cable.run(1.5)
    [said] = [text for text in cable.said if "was disarmed, not by Lindy" in text]
    assert "Arming motors" not in said


@pytest.mark.parametrize("seconds", [-0.8, 30.0])
def test_a_jump_of_the_boards_clock_stops_the_vehicle(seconds: float) -> None:
    cable = Cable().flying()
    cable.board.clock_ahead_ns += round(seconds * S)
    began = cable.now
    cable.run(4.0)
    assert cable.counts["jumped:board_clock"] == 1
    assert not cable.board.armed
    late = [m for at, m in cable.samples if at > began + S]
    assert late
    assert all(at - m.stamp_ns < 70 * MS for at, m in cable.samples if at > began + 2 * S)


@pytest.mark.parametrize("what", ["disarm", "mode"])
def test_another_station_is_obeyed_until_a_deliberate_arming(what: str) -> None:
    cable = Cable().flying()
    cable.another(*((400, 0) if what == "disarm" else (176, 1, 2)))
    cable.run(1.1)  # a change of mode is seen with the next heartbeat
    taken = cable.now
    cable.run(5.0)
    assert not cable.sticks(taken)
    assert not cable.of("COMMAND_LONG", taken)
    assert cable.counts["outdone:ardusub"] == 1
    cable.armed = False
    cable.run(0.5)
    assert not cable.of("COMMAND_LONG", taken), "nor is it disarmed: it is theirs"
    cable.armed = True
    cable.run(1.5)
    assert cable.board.armed
    assert cable.board.mode == 19
    assert cable.board.servo[4] > 1600


def test_a_restarted_service_goes_on_with_its_own_vehicle() -> None:
    cable = Cable().flying()
    cable.restart(taken=False)
    cable.run(3.5)
    assert cable.board.armed
    assert cable.board.servo[4] > 1600
    assert not cable.counts["outdone:ardusub"]


def test_a_restarted_service_does_not_take_the_vehicle_back() -> None:
    cable = Cable().flying()
    cable.another(400, 0)
    cable.run(1.0)
    cable.restart(taken=True)
    cable.run(5.0)
    assert not cable.board.armed
    cable.armed = False
    cable.run(0.5)
    cable.armed = True
    cable.run(1.5)
    assert cable.board.armed


def test_a_board_that_others_armed_before_the_start_is_theirs() -> None:
    cable = Cable()
    cable.another(400, 1)
    cable.run(1.5)
    assert cable.driver.authority.taken
    taken = cable.now
    cable.run(2.0)
    assert not cable.sticks(taken)
    assert "was armed, not by Lindy" in "".join(cable.said)


def test_while_the_board_surfaces_neutral_goes_on() -> None:
    cable = Cable().flying()
    cable.another(176, 1, 9)
    cable.run(1.1)
    since = cable.now
    cable.run(5.0)
    assert set(map(tuple, cable.sticks(since))) == {(1500,) * 6}
    assert cable.board.armed, "the failsafe for silent sticks does not stop the ascent"


def test_a_stranger_with_our_system_is_said_and_prevents_arming() -> None:
    cable = Cable().accepted()
    stranger = MavlinkPacket("HEARTBEAT", {"type": 6, "autopilot": 8}, 255, 190)
    cable.thrust = DOWN
    for _ in range(4):
        cable.driver.hear(stranger, cable.now)
        cable.run(1.0)
    assert not cable.board.armed
    assert len([t for t in cable.said if "in Lindy's name: as system 255" in t]) == 1
    assert cable.counts["stranger:system"] == 4
    cable.run(5.0)
    assert cable.board.armed


def test_a_cable_cut_in_flight_ends_in_the_boards_failsafe() -> None:
    cable = Cable().flying()
    cable.deaf = cable.dumb = True
    cable.run(4.0)
    assert not cable.board.armed
    assert cable.board.servo == [1500] * 8
    silent = cable.counts["silent:board"]
    assert silent >= 1
    cable.run(5.0)
    assert cable.counts["silent:board"] == silent + 5, "one for each second"
    slow = [name for name in cable.counts if name.startswith("slow")]
    assert not slow, "nobody asks a board that is away to send faster"
    cable.deaf = cable.dumb = False
    cable.run(3.0)
    assert not cable.board.armed, "it comes back without arming by itself"
    assert cable.counts["outdone:ardusub"] == 1


@pytest.mark.parametrize(("name", "value"), [("FS_PILOT_INPUT", 0.0), ("RCMAP_YAW", 6.0)])
def test_a_parameter_made_wrong_in_flight_ends_it(name: str, value: float) -> None:
    cable = Cable().flying()
    set_by_them = MavlinkPacket("PARAM_SET", {"param_id": name, "param_value": value}, 254, 190)
    cable.board.hear(set_by_them, cable.now)
    cable.run(0.5)
    assert not cable.board.armed
    assert any(f"{name} is {value:g}" in text for text in cable.said)


def test_a_leak_is_said_and_counted() -> None:
    cable = Cable().accepted()
    cable.board.leaking = True
    cable.run(25.0)
    assert "the board says: Leak Detected" in cable.said
    assert cable.counts["leak:board"] == 1
    assert cable.driver.wet(cable.now) is True
    cable.board.leaking = False
    cable.run(46.0)
    assert cable.driver.wet(cable.now) is False
    cable.dumb = True
    cable.run(4.0)
    assert cable.driver.wet(cable.now) is None


def test_an_answer_to_another_ground_station_is_not_ours() -> None:
    """Both are system 255 behind one router; the components tell them apart."""
    cable = Cable("4.8")
    answer = {"command": 511, "result": 3, "target_system": 255, "target_component": 190}
    for _ in range(250):
        cable.driver.hear(MavlinkPacket("COMMAND_ACK", answer, 1, 1), cable.now)
        cable.run(0.02)
    asked = {p.fields["param1"] for _, p in cable.sent if p.name == "COMMAND_LONG"}
    assert 105.0 in asked
    assert 27.0 not in asked  # RAW_IMU: HIGHRES_IMU was not refused to us
    before = len(cable.said)
    denied = {"command": 400, "result": 4, "target_system": 254, "target_component": 190}
    cable.driver.hear(MavlinkPacket("COMMAND_ACK", denied, 1, 1), cable.now)
    cable.run(0.5)
    assert cable.said[before:] == []


def test_a_long_text_of_the_board_is_one_line() -> None:
    cable = Cable().accepted()
    words = "PreArm: " + "the compass is not calibrated, and " * 4
    for k in range(0, len(words), 50):
        part = {"severity": 4, "text": words[k : k + 50], "id": 7, "chunk_seq": k // 50}
        cable.driver.hear(MavlinkPacket("STATUSTEXT", part, 1, 1), cable.now)
    cable.run(0.1)
    assert f"the board says: {words}" in cable.said


def test_the_temperature_inside_is_that_of_the_boards_own_barometer() -> None:
    assert Cable().accepted().run(3.0).driver.measurements.enclosure == pytest.approx(31.5)


def test_the_end_of_the_service_disarms() -> None:
    cable = Cable().flying()
    cable.driver.disarm()
    cable.thrust = None
    cable.run(0.1)
    assert not cable.board.armed
