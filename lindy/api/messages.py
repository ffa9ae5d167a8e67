"""The topics, every message that is sent on one, and what these consist of: msgspec Structs with
units and limits at their fields. docs/topics.md"""

from messages import events, topics
from messages.aiding import AidSource
from messages.control import ThrusterCommand, Wrench
from messages.film import FilmAnswer, FilmKind, FilmRequest
from messages.health import Health, LogLine
from messages.identity import SideIdentity
from messages.link import (
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
from messages.message import Answer, Estimate, Message, Request
from messages.notice import Notice
from messages.pilot import (
    Course,
    FlightMode,
    PilotAnswer,
    PilotCommand,
    PilotRequest,
    RequestKind,
    StopDistance,
)
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
from messages.simulator import FaultAnswer, FaultKind, FaultRequest
from messages.state import VehicleState
from messages.topic import Direction, Qos, Side, Topic
from messages.units import Quaternion, Vec3, Vec6
from messages.vehicle import (
    Activity,
    Actuation,
    Failsafe,
    PlaceAhead,
    Reaction,
    Truth,
    VehicleEstimate,
    VehicleStatus,
)
from messages.video import CameraChoice, CameraShares, PictureAge, VideoPart

__all__ = [
    "Activity",
    "Actuation",
    "AidSource",
    "AltitudeSample",
    "Answer",
    "BatterySample",
    "CameraChoice",
    "CameraShares",
    "Clock",
    "ClockPing",
    "ClockPong",
    "Course",
    "Direction",
    "DirectionReport",
    "DvlSample",
    "Estimate",
    "Failsafe",
    "FaultAnswer",
    "FaultKind",
    "FaultRequest",
    "FilmAnswer",
    "FilmKind",
    "FilmRequest",
    "FlightMode",
    "Health",
    "ImuSample",
    "LatencyBudget",
    "LeakSample",
    "LinkAnswer",
    "LinkRequest",
    "LinkStatus",
    "LogLine",
    "MagnetometerSample",
    "Message",
    "Miss",
    "Motion",
    "Notice",
    "PictureAge",
    "PilotAnswer",
    "PilotCommand",
    "PilotRequest",
    "PlaceAhead",
    "Prediction",
    "PressureSample",
    "Qos",
    "Quaternion",
    "Reaction",
    "Reference",
    "Request",
    "RequestKind",
    "Shown",
    "Side",
    "SideIdentity",
    "Stage",
    "StopDistance",
    "TemperatureSample",
    "ThrusterCommand",
    "Topic",
    "Truth",
    "UsblSample",
    "Vec3",
    "Vec6",
    "VehicleEstimate",
    "VehicleState",
    "VehicleStatus",
    "VideoPart",
    "Wrench",
    "events",
    "topics",
]
