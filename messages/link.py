"""The measured state of the link between topside and drone. From `tether` and `link_monitor`."""

from typing import Annotated, Literal

import msgspec

from messages.message import Answer, Message, Notices, Request
from messages.units import (
    Count,
    Counts,
    DurationNs,
    Finite,
    Name,
    NotNegative,
    Share,
    Stamp,
    Text,
)

Tiers = Annotated[dict[Name, Finite], msgspec.Meta(max_length=100)]
Changes = Annotated[tuple[Name, ...], msgspec.Meta(max_length=10)]


class DirectionReport(msgspec.Struct, frozen=True):
    """One direction of the link over the last report period."""

    delay_p50_ms: NotNegative | None  # [ms] None: no message arrived
    delay_p99_ms: NotNegative | None  # [ms]
    forwarded: Count  # messages since start
    dropped: Count  # messages since start
    queued: Count  # messages on the link now
    lost: Counts = {}  # messages lost since start, by reason
    loss: Share | None = None  # [-] of the last period's messages; None: nothing entered
    rate_kbit: NotNegative = 0.0  # [kbit/s] carried, overhead included
    tiers: Tiers = {}  # [1/s] topics whose rate is reduced, and to what rate


class Clock(Message, frozen=True, kw_only=True):
    """The drone's clock seen from the topside. From `link_monitor`."""

    offset_ns: DurationNs | None  # [ns] drone's clock minus topside's; None: not known (yet)
    bound_ns: DurationNs | None  # [ns] greatest error of offset_ns
    drift_ppm: Finite | None  # [ppm] how fast the offset grows
    rtt_ms: NotNegative | None  # [ms] newest round trip; None when pings are not answered
    rtt_min_ms: NotNegative | None  # [ms] shortest since the clocks are known
    answered_ms: NotNegative | None  # [ms] since a ping was last answered
    source: Count = 0  # whose clock: there may be two topsides
    epoch: Count = 0  # authority epoch of this topside's commands


class LinkStatus(Message, frozen=True, kw_only=True):
    """Both directions, as measured by the tether service itself."""

    profile: Text
    up: bool  # the link is not interrupted
    down_link: DirectionReport  # topside to drone
    up_link: DirectionReport  # drone to topside
    rtt_ms: NotNegative | None  # [ms] sum of both medians
    changes: Count = 0  # of the link's model since start
    clock: Clock | None = None  # newest message of the link monitor


class LinkRequest(Request, frozen=True, kw_only=True):
    """Change the emulated link. Repeated with the same id until a `LinkAnswer` names that id."""

    kind: Literal["profile", "set", "down", "up"]
    profile: Text | None = None  # profile: a name in deploy/links
    settings: Changes = ()  # set: key=value into the profile in force, `up.delay_ms=80`


class LinkAnswer(Answer, frozen=True, kw_only=True):
    """The tether's answer, published on both sides, so that every change is recorded."""

    kind: Name
    change: Text = ""  # what has changed, in words
    reason: Text = ""  # why the request was refused
    cause_ns: Stamp | None = None  # [ns] stamp of the request


class ClockPing(Message, frozen=True, kw_only=True):
    """From `link_monitor`, topside; `stamp_ns` is when it is sent, by the topside's clock."""

    source: Count = 0  # which topside: the answer names it


class ClockPong(Message, frozen=True, kw_only=True):
    """From `link_monitor`, on board; `stamp_ns` is when it is sent, by the drone's clock."""

    ping_ns: Stamp  # [ns] stamp of the ping, topside's clock
    heard_ns: Stamp  # [ns] when the ping arrived, drone's clock
    source: Count = 0  # of the ping


# The stages of a latency budget: from the stick to the thruster, from the sensor to the screen.
# Each is a difference of two stamps; `link` is the tether.
DOWN_STAGES = ("sample", "publish", "link", "reference", "control", "thruster")
UP_STAGES = ("estimation", "link", "screen")


class Stage(msgspec.Struct, frozen=True):
    """Latency of one stage, over the last report period."""

    name: Name
    p50_ms: NotNegative
    p99_ms: NotNegative


Stages = Annotated[tuple[Stage, ...], msgspec.Meta(max_length=16)]


class LatencyBudget(Message, frozen=True, kw_only=True):
    """Latency from the stick to the thruster and from the sensor to the screen, stage by stage.

    From `link_monitor`. None where it is not known now.
    """

    down: Stages | None  # DOWN_STAGES, in their order
    up: Stages | None  # UP_STAGES, in their order
    stick_to_thruster_ms: NotNegative | None  # [ms] median, measured end to end
    sensor_to_screen_ms: NotNegative | None  # [ms] median, measured end to end
    bound_ms: NotNegative | None  # [ms] greatest error of the clock offset
    lost_s: NotNegative = 0.0  # [s] in all, in pauses in which no state of the drone arrived
    alarms: Notices = ()  # what is wrong with the link


class Shown(Message, frozen=True, kw_only=True):
    """A screen was drawn. From the program that draws it, at the moment it is drawn."""

    sensor_ns: Stamp  # [ns] sensor sample of the newest state on the screen
