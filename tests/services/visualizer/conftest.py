from collections.abc import Callable

import pytest

from messages import topics
from messages.aiding import AidSource
from messages.control import ThrusterCommand, Wrench
from messages.film import FilmAnswer, FilmRequest
from messages.health import Health, LogLine
from messages.identity import SideIdentity
from messages.link import (
    DOWN_STAGES,
    UP_STAGES,
    Clock,
    ClockPing,
    ClockPong,
    DirectionReport,
    LatencyBudget,
    LinkAnswer,
    LinkRequest,
    LinkStatus,
    Shown,
    Stage,
)
from messages.message import Estimate, Message
from messages.pilot import PilotAnswer, PilotCommand, PilotRequest
from messages.prediction import Miss, Prediction
from messages.reference import Motion, Reference
from messages.sensors import (
    AltitudeSample,
    BatterySample,
    DvlSample,
    ImuSample,
    LeakSample,
    MagnetometerSample,
    PressureSample,
    TemperatureSample,
    UsblSample,
)
from messages.simulator import FaultAnswer, FaultRequest
from messages.state import VehicleState
from messages.vehicle import Actuation, Truth, VehicleEstimate, VehicleStatus
from messages.video import PICTURE_STAGES, CameraChoice, CameraShares, PictureAge, VideoPart

Sample = Callable[[str, int], Message]


@pytest.fixture
def sample() -> Sample:
    """A message of a row of the table, by key and stamp."""

    def make(key: str, now: int) -> Message:
        makers = dict(zip((topic.key for topic in topics.ALL), _all(now), strict=True))
        return makers[key]

    return make


def _all(now: int) -> list[Message]:
    """One message per row of the table, in its order."""
    here, leg = Estimate(1.0, 0.1), DirectionReport(10.0, 20.0, 5, 0, 1)
    motion = Motion(1.0, 0.5, 0.1, 0.0)
    messages: list[Message] = [
        PilotCommand(stamp_ns=now, surge=0.1, sway=0.2, heave=0.3, yaw=0.4),
        PilotRequest(stamp_ns=now, id=str(now), kind="arm"),
        PilotAnswer(stamp_ns=now, id=str(now), accepted=True),
        ImuSample(stamp_ns=now, specific_force=(0.0, 0.0, -9.81), angular_rate=(0.0, 0.0, 0.1)),
        MagnetometerSample(stamp_ns=now, field=(2e-5, 0.0, 4e-5)),
        PressureSample(stamp_ns=now, pressure=1e5),
        DvlSample(stamp_ns=now, velocity=(0.5, 0.1, 0.0), std=0.01, altitude=3.0),
        AltitudeSample(stamp_ns=now, altitude=2.9),
        UsblSample(stamp_ns=now, north=1.0, east=2.0, std=0.5),
        BatterySample(stamp_ns=now, voltage=16.0, current=1.0, used_wh=0.1),
        LeakSample(stamp_ns=now, wet=False),
        TemperatureSample(stamp_ns=now, temperature=23.0),
        AidSource(
            stamp_ns=now,
            unit="m",
            samples=1,
            value=1.0,
            innovation=0.1,
            variance=0.01,
            test_ratio=0.5,
            weight=1.0,
        ),
        VehicleState(
            stamp_ns=now,
            sensor_ns=now,
            phase="running",
            depth=here,
            depth_rate=here,
            depth_acceleration=here,
            attitude=(1.0, 0.0, 0.0, 0.0),
            roll=here,
            pitch=here,
            heading=here,
            heading_navigation=None,
            yaw_rate=here,
        ),
        Reference(
            stamp_ns=now,
            sensor_ns=now,
            pilot_ns=None,
            armed=True,
            depth=motion,
            heading=motion,
            surge_force=1.0,
            sway_force=0.0,
        ),
        Wrench(
            stamp_ns=now,
            sensor_ns=now,
            wanted=(1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
            achieved=(1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
            depth_integral=0.0,
            heading_integral=0.0,
            saturated=False,
        ),
        PilotRequest(stamp_ns=now, id=f"{now} again", kind="disarm"),
        ThrusterCommand(stamp_ns=now, sensor_ns=now, pilot_ns=now, thrust=(1.0, 2.0, 3.0, 4.0)),
        Actuation(
            stamp_ns=now,
            thrust=(1.0, 2.0, 3.0, 4.0),
            actuated_ns=now,
            sensor_ns=now - 2_000_000,
            pilot_ns=now - 40_000_000,
            stale=False,
            power=10.0,
        ),
        VehicleStatus(stamp_ns=now, activity="piloted", armed=True),
        VehicleEstimate(stamp_ns=now, roll=0.1, depth=1.0, angular_rate=(0.0, 0.0, 0.1)),
        Truth(
            stamp_ns=now,
            position=(now * 1e-9, 0.0, 1.0),
            attitude=(1.0, 0.0, 0.0, 0.0),
            velocity=(1.0, 0.0, 0.0),
            angular_rate=(0.0, 0.0, 0.0),
            depth_rate=0.0,
            roll=0.0,
            pitch=0.0,
            heading=1.0,
            on_floor=False,
        ),
        FaultRequest(stamp_ns=now, id=str(now), part="port", fault="dead"),
        FaultAnswer(stamp_ns=now, id=str(now), accepted=True),
        LinkStatus(
            stamp_ns=now, profile="tether", up=True, down_link=leg, up_link=leg, rtt_ms=20.0
        ),
        LinkRequest(stamp_ns=now, id=str(now), kind="down"),
        LinkAnswer(stamp_ns=now, id=str(now), accepted=True, kind="down", change="link down"),
        LatencyBudget(
            stamp_ns=now,
            down=tuple(Stage(name, 1.0, 2.0) for name in DOWN_STAGES),
            up=tuple(Stage(name, 1.0, 2.0) for name in UP_STAGES),
            stick_to_thruster_ms=3.0,
            sensor_to_screen_ms=1.0,
            bound_ms=0.1,
        ),
        Shown(stamp_ns=now, sensor_ns=now - 30_000_000),
        Clock(
            stamp_ns=now,
            offset_ns=5_000_000,
            bound_ns=100_000,
            drift_ppm=1.0,
            rtt_ms=2.0,
            rtt_min_ms=1.0,
            answered_ms=10.0,
        ),
        ClockPing(stamp_ns=now),
        ClockPong(stamp_ns=now, ping_ns=now, heard_ns=now),
        Prediction(
            stamp_ns=now,
            state_ns=now,
            ahead_ms=100.0,
            depth=1.0,
            heading=0.0,
            depth_rate=0.5,
            yaw_rate=0.0,
            forward=0.1,
            starboard=0.0,
            missed=Miss(0.01, 0.01),
            delayed=Miss(0.05, 0.02),
        ),
        VideoPart(
            stamp_ns=now,
            picture=1,
            keyframe=True,
            width=640,
            height=360,
            captured_ns=now,
            encoded_ns=now,
            budget_kbit=300.0,
            data=b"a picture",
        ),
        FilmRequest(stamp_ns=now, id=str(now), kind="snapshot", light_ns=now - 40_000_000),
        FilmAnswer(stamp_ns=now, id=str(now), accepted=True),
        PictureAge(
            stamp_ns=now,
            age_ms=30.0,
            stages=tuple(Stage(name, 1.0, 2.0) for name in PICTURE_STAGES),
            total=Stage("light to picture", 20.0, 30.0),
        ),
        VideoPart(
            stamp_ns=now,
            picture=1,
            keyframe=True,
            width=640,
            height=360,
            captured_ns=now,
            encoded_ns=now,
            budget_kbit=300.0,
            data=b"a picture",
        ),
        PictureAge(
            stamp_ns=now,
            age_ms=30.0,
            stages=tuple(Stage(name, 1.0, 2.0) for name in PICTURE_STAGES),
            total=Stage("light to picture", 20.0, 30.0),
        ),
        CameraChoice(stamp_ns=now, camera="down"),
        CameraShares(stamp_ns=now, large="down", total_kbit=400.0, kbit={"down": 400.0}),
        SideIdentity(stamp_ns=now, side="drone", version="1.0"),
        Health(
            stamp_ns=now,
            service="control",
            loop_hz=100.0,
            lateness_p50_ms=0.1,
            lateness_p99_ms=0.4,
            cpu_percent=5.0,
            rss_mb=40.0,
            sent=1,
            received=1,
            counts={"stale:state": 2},
        ),
        LogLine(stamp_ns=now, service="control", level="info", text="hello"),
    ]
    return messages
