"""The topic table: every topic in the system, once.

Keys are relative to the session's namespace, `lindy/@v1/<name of the drone>`, so many drones can
use one table and one network. Publishers, the tether, the recorder, the visualizer, the freshness
checks and `docs/topics.md` all read these rows.
"""

from messages.control import ThrusterCommand, Wrench
from messages.health import Health, LogLine
from messages.identity import SideIdentity
from messages.link import (
    Clock,
    ClockPing,
    ClockPong,
    LatencyBudget,
    LinkAnswer,
    LinkRequest,
    LinkStatus,
    Shown,
)
from messages.pilot import PilotAnswer, PilotCommand, PilotRequest
from messages.reference import Reference
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
from messages.state import AidSource, Prediction, VehicleState
from messages.topic import AnyTopic, Direction, Qos, Topic, rows
from messages.vehicle import Actuation, Truth, VehicleEstimate, VehicleStatus
from messages.video import (
    CameraChoice,
    CameraShares,
    FilmAnswer,
    FilmRequest,
    PictureAge,
    VideoPart,
)

REALTIME, LIVE, EVENT, BULK = Qos.REALTIME, Qos.LIVE, Qos.EVENT, Qos.BULK
DOWN, UP, BOTH, STAY = Direction.DOWN, Direction.UP, Direction.BOTH, Direction.STAY

# fmt: off
#                      key                    type                Hz  QoS profile  way  weight floor
PILOT_COMMAND  = Topic("pilot/command",       PilotCommand,       50, REALTIME,    DOWN)
PILOT_REQUEST  = Topic("pilot/request",       PilotRequest,        0, EVENT,       DOWN)
PILOT_ANSWER   = Topic("pilot/answer",        PilotAnswer,         0, EVENT,       UP)
IMU            = Topic("sensor/imu",          ImuSample,         100, LIVE,        STAY)
MAGNETOMETER   = Topic("sensor/magnetometer", MagnetometerSample, 100, LIVE,        STAY)
PRESSURE       = Topic("sensor/pressure",     PressureSample,     42, LIVE,        STAY)
DVL            = Topic("sensor/dvl",          DvlSample,           1, LIVE,        STAY)
ALTITUDE       = Topic("sensor/altitude",     AltitudeSample,     10, LIVE,        STAY)
USBL           = Topic("sensor/usbl",         UsblSample,        0.5, LIVE,        STAY)
BATTERY        = Topic("sensor/battery",      BatterySample,       1, BULK,        UP)
LEAK           = Topic("sensor/leak",         LeakSample,          1, BULK,        UP)
TEMPERATURE    = Topic("sensor/temperature",  TemperatureSample,   1, BULK,        UP)
AIDING         = Topic("aiding/*",            AidSource,          10, BULK,        STAY)
STATE          = Topic("state",               VehicleState,      100, LIVE,        UP,     50,   10)
REFERENCE      = Topic("reference",           Reference,         100, LIVE,        UP,     25,    1)
WRENCH         = Topic("control/wrench",      Wrench,            100, LIVE,        UP,      5,  0.5)
HANDED_ON      = Topic("control/request",     PilotRequest,        0, EVENT,       STAY)
THRUSTERS      = Topic("control/thrusters",   ThrusterCommand,   100, REALTIME,    UP,     10,    1)
ACTUATION      = Topic("vehicle/actuation",   Actuation,         100, LIVE,        UP,      5,  0.5)
STATUS         = Topic("vehicle/status",      VehicleStatus,       5, EVENT,       UP)
ESTIMATE       = Topic("vehicle/estimate",    VehicleEstimate,    10, BULK,        STAY)
TRUTH          = Topic("simulator/truth",     Truth,             100, BULK,        UP,      1,    0)
FAULT_REQUEST  = Topic("simulator/request",   FaultRequest,        0, EVENT,       DOWN)
FAULT_ANSWER   = Topic("simulator/answer",    FaultAnswer,         0, EVENT,       UP)
LINK           = Topic("link/status",         LinkStatus,          5, BULK,        BOTH)
LINK_REQUEST   = Topic("link/request",        LinkRequest,         0, EVENT,       DOWN)
LINK_ANSWER    = Topic("link/answer",         LinkAnswer,          0, EVENT,       BOTH)
LATENCY        = Topic("link/latency",        LatencyBudget,       2, BULK,        DOWN)
SHOWN          = Topic("shown/*",             Shown,               4, BULK,        DOWN)
CLOCK          = Topic("link/clock",          Clock,               5, LIVE,        DOWN)
CLOCK_PING     = Topic("clock/ping",          ClockPing,           5, REALTIME,    DOWN)
CLOCK_PONG     = Topic("clock/pong",          ClockPong,           5, REALTIME,    UP)
PREDICTION     = Topic("prediction",          Prediction,         25, LIVE,        DOWN)
VIDEO          = Topic("camera/video",        VideoPart,          25, BULK,        UP)
FILM_REQUEST   = Topic("film/request",        FilmRequest,         0, EVENT,       DOWN)
FILM_ANSWER    = Topic("film/answer",         FilmAnswer,          0, EVENT,       UP)
PICTURE_AGE    = Topic("camera/age",          PictureAge,          5, BULK,        DOWN)
FURTHER_VIDEO  = Topic("camera/video/*",      VideoPart,          25, BULK,        UP)
FURTHER_AGE    = Topic("camera/age/*",        PictureAge,          5, BULK,        DOWN)
CAMERA_CHOICE  = Topic("camera/choice",       CameraChoice,        0, EVENT,       DOWN)
CAMERA_SHARES  = Topic("camera/shares/*",     CameraShares,        5, BULK,        UP)
IDENTITY       = Topic("identity/*",          SideIdentity,        0, BULK,        BOTH)
HEALTH         = Topic("health/*",            Health,              1, BULK,        BOTH)
LOG            = Topic("log/*",               LogLine,             0, BULK,        BOTH)
# fmt: on

ALL: tuple[AnyTopic, ...] = rows(globals())
_SINGLE = {topic.key: topic for topic in ALL if not topic.is_family}
_FAMILIES = [topic for topic in ALL if topic.is_family]

# For the simulator, the emulated link and a pilot's own program: never let through from one machine
# to another, so that nobody breaks a part, cuts a cable or changes the drone from elsewhere.
WITHIN_ONE_MACHINE: tuple[AnyTopic, ...] = (
    FAULT_REQUEST,
    FAULT_ANSWER,
    LINK_REQUEST,
    LINK_ANSWER,
)


def find(key: str) -> AnyTopic | None:
    """The topic that a key belongs to, or None for a key that is not in the table."""
    return _SINGLE.get(key) or next((topic for topic in _FAMILIES if topic.covers(key)), None)
