"""Our numbers of MAVLink are those of the dialect, and what we send fits its messages."""

from enum import IntEnum
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import (  # pyright: ignore[reportMissingTypeStubs]
    ardupilotmega as dialect,
)

from messages.message import Estimate
from messages.pilot import FlightMode
from messages.sensors import BatterySample
from messages.state import VehicleState
from messages.vehicle import Activity, Failsafe, VehicleStatus
from services.mavlink import telemetry
from services.mavlink.telemetry import TABLE, Snapshot, made
from services.mavlink_io import packet as numbers
from services.mavlink_io.io.endpoint import FrameReader, MavlinkCodec

CODEC = MavlinkCodec(1, 1, "ardupilotmega")
PREFIXES: dict[type[IntEnum], str] = {
    numbers.MavCommand: "MAV_CMD",
    numbers.MavResult: "MAV_RESULT",
    numbers.MavSeverity: "MAV_SEVERITY",
    numbers.MavState: "MAV_STATE",
    numbers.MavModeFlag: "MAV_MODE_FLAG",
    numbers.MavLandedState: "MAV_LANDED_STATE",
    numbers.MavSensor: "MAV_SYS_STATUS",
    numbers.MavCapability: "MAV_PROTOCOL_CAPABILITY",
    numbers.MavDataStream: "MAV_DATA_STREAM",
    numbers.MavMissionResult: "MAV_MISSION",
}  # type: ignore[dict-item]
ALIASES = {
    "MAV_SYS_STATUS_ABSOLUTE_PRESSURE": "MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE",
    "MAV_SYS_STATUS_MOTOR_OUTPUTS": "MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS",
    "MAV_SYS_STATUS_BATTERY": "MAV_SYS_STATUS_SENSOR_BATTERY",
}
finite = st.floats(-1e9, 1e9)
estimates = st.builds(Estimate, value=finite, std=st.just(0.0), valid=st.booleans())


def test_every_number_is_that_of_the_dialect() -> None:
    for kind, prefix in PREFIXES.items():
        for one in kind:
            name = f"{prefix}_{one.name}"
            assert getattr(dialect, ALIASES.get(name, name)) == one.value, name
    for name, number in {
        "MAV_AUTOPILOT_ARDUPILOTMEGA": numbers.ARDUPILOT,
        "MAV_TYPE_SUBMARINE": numbers.SUBMARINE,
        "MAV_TYPE_GCS": numbers.GROUND_STATION,
        "MAV_AUTOPILOT_INVALID": numbers.NO_AUTOPILOT,
        "MAV_COMP_ID_AUTOPILOT1": numbers.AUTOPILOT,
        "MAVLINK_MSG_ID_SET_MODE": numbers.SET_MODE,
        **{f"SUB_MODE_{mode}": number for number, mode in telemetry.NAMES.items()},
    }.items():
        assert getattr(dialect, name) == number, name


def test_every_message_that_can_be_asked_for_is_made_and_has_its_number() -> None:
    numbered = {name: CODEC.types[name].id for name in numbers.MESSAGE_IDS}
    assert numbered == numbers.MESSAGE_IDS
    assert set(TABLE) == set(numbers.MESSAGE_IDS)


def test_every_mode_that_can_be_chosen_is_shown_as_chosen() -> None:
    for number, hold in telemetry.CHOSEN.items():
        assert telemetry.SHOWN[hold] == number
    assert set(telemetry.SHOWN) - set(telemetry.CHOSEN.values()) == {"depth_hold"}


statuses = st.builds(
    VehicleStatus,
    stamp_ns=st.just(0),
    activity=st.sampled_from(list(Activity.__args__)),
    armed=st.booleans(),
    flight_mode=st.sampled_from(list(FlightMode.__args__)),
    failsafe=st.sampled_from(list(Failsafe.__args__)),
    light=st.floats(-1.0, 1.0),
)
states = st.builds(
    VehicleState,
    stamp_ns=st.just(0),
    sensor_ns=st.just(0),
    phase=st.just("running"),
    depth=estimates,
    depth_rate=estimates,
    depth_acceleration=estimates,
    attitude=st.just((1.0, 0.0, 0.0, 0.0)),
    roll=estimates,
    pitch=estimates,
    heading=estimates,
    heading_navigation=st.none() | estimates,
    yaw_rate=estimates,
    surge_velocity=st.none() | estimates,
    sway_velocity=st.none() | estimates,
    north=st.none() | estimates,
    east=st.none() | estimates,
)
batteries = st.builds(
    BatterySample,
    stamp_ns=st.just(0),
    voltage=st.floats(0.0, 1e9),
    current=st.none() | finite,
    used_wh=st.none() | st.floats(0.0, 1e9),
    capacity_wh=st.none() | st.floats(0.0, 1e9),
)


@given(
    known=st.builds(
        Snapshot,
        now=st.integers(0, 2**62),
        boot_ns=st.just(0),
        utc_ns=st.integers(0, 2**62),
        status=st.none() | statuses,
        state=st.none() | states,
        battery=st.none() | batteries,
        tilt=st.none() | finite,
        gain=st.floats(0.0, 1.0),
    )
)
def test_whatever_the_drone_says_fits_into_frames(known: Snapshot) -> None:
    ours = MavlinkCodec(1, 1, "ardupilotmega")
    theirs = FrameReader(MavlinkCodec(255, 1, "ardupilotmega"))
    for packet in (packet for name in TABLE for packet in made(name, known)):
        (received,) = theirs.read([ours.encode(packet)])
        assert received.name == packet.name


@given(state=states)
def test_depth_is_the_altitude_downwards_in_every_packet(state: VehicleState) -> None:
    known = Snapshot(0, 0, 0, state=state)

    def of(name: str) -> dict[str, Any]:
        (packet,) = made(name, known)
        return packet.fields

    assert of("VFR_HUD")["alt"] == -state.depth.value
    assert of("AHRS2")["altitude"] == -state.depth.value
    height = of("GLOBAL_POSITION_INT")["relative_alt"]
    assert height == pytest.approx(max(-(2**31), min(2**31, -1e3 * state.depth.value)), abs=1.0)
    assert 0 <= of("VFR_HUD")["heading"] < 360


def test_without_the_drones_status_there_is_no_heartbeat() -> None:
    assert telemetry.heartbeat(Snapshot(0, 0, 0)) is None
