"""The tether as it is, not as it is hoped to be. From `tether` and `link_monitor`."""

from typing import Literal

import msgspec

from messages.message import Answer, Message, Request
from messages.units import DurationNs, Finite, NotNegative, Share, Stamp


class Direction(msgspec.Struct, frozen=True):
    """One direction of the link over the last report period."""

    delay_p50_ms: NotNegative | None  # [ms] None: nothing passed
    delay_p99_ms: NotNegative | None  # [ms]
    forwarded: int  # messages since start
    dropped: int  # messages since start
    queued: int  # messages on the way now
    lost: dict[str, int] = {}  # messages since start that never arrived, by reason
    loss: Share | None = None  # [-] of the last period's messages; None: nothing entered
    rate_kbit: NotNegative = 0.0  # [kbit/s] carried, overhead included
    tiers: dict[str, Finite] = {}  # [1/s] topics that are thinned out, and to what rate


class Clock(Message, frozen=True, kw_only=True):
    """The drone's clock seen from the topside. From `link_monitor`."""

    offset_ns: DurationNs | None  # [ns] drone's clock minus topside's; None: not known (yet)
    bound_ns: DurationNs | None  # [ns] the true offset is no further off than this
    drift_ppm: Finite | None  # [ppm] how fast the offset grows
    rtt_ms: NotNegative | None  # [ms] newest round trip; None when pings are not answered
    rtt_min_ms: NotNegative | None  # [ms] shortest of those the offset rests on
    answered_ms: NotNegative | None  # [ms] since a ping was last answered


class LinkStatus(Message, frozen=True, kw_only=True):
    """Both directions, as measured by the tether itself."""

    profile: str
    up: bool  # the link is there
    down_link: Direction  # topside to drone
    up_link: Direction  # drone to topside
    rtt_ms: NotNegative | None  # [ms] sum of both medians
    changes: int = 0  # of the link's model since start
    clock: Clock | None = None  # newest word of the link monitor


class LinkRequest(Request, frozen=True, kw_only=True):
    """Change the emulated link. Repeated with the same id until a `LinkAnswer` names that id."""

    kind: Literal["profile", "set", "down", "up"]
    profile: str | None = None  # profile: a name in deploy/links
    settings: tuple[str, ...] = ()  # set: key=value into the profile in force, `up.delay_ms=80`


class LinkAnswer(Answer, frozen=True, kw_only=True):
    """The tether's word on it, said in both realms, so that every change is recorded."""

    kind: str
    change: str = ""  # what has changed, in words
    reason: str = ""  # why not
    cause_ns: Stamp | None = None  # [ns] stamp of the request


class ClockPing(Message, frozen=True, kw_only=True):
    """From `link_monitor`, topside; `stamp_ns` is the moment it leaves, by the topside's clock."""


class ClockPong(Message, frozen=True, kw_only=True):
    """From `link_monitor`, on board; `stamp_ns` is the moment it leaves, by the drone's clock."""

    ping_ns: Stamp  # [ns] stamp of the ping, topside's clock
    heard_ns: Stamp  # [ns] when the ping arrived, drone's clock


# The ways a latency budget is made of: from the stick to the thruster, from the sensor to the
# screen. Each is a difference of two stamps; link is the tether.
DOWN_STAGES = ("sample", "publish", "link", "reference", "control", "thruster")
UP_STAGES = ("estimation", "link", "screen")


class Stage(msgspec.Struct, frozen=True):
    """One leg of the way, over the last report period."""

    name: str
    p50_ms: NotNegative
    p99_ms: NotNegative


class LatencyBudget(Message, frozen=True, kw_only=True):
    """Where the time goes, from the stick to the thruster and from the sensor to the screen.

    From `link_monitor`. None instead of a number that would be old or guessed.
    """

    down: tuple[Stage, ...] | None  # DOWN_STAGES, in their order
    up: tuple[Stage, ...] | None  # UP_STAGES, in their order
    stick_to_thruster_ms: NotNegative | None  # [ms] median, measured end to end
    sensor_to_screen_ms: NotNegative | None  # [ms] median, measured end to end
    bound_ms: NotNegative | None  # [ms] what the clocks may be off by
    alarm: str = ""  # why the pilot should know


class Shown(Message, frozen=True, kw_only=True):
    """Somebody looks at a screen. From whoever draws one, at the moment it is drawn."""

    sensor_ns: Stamp  # [ns] sensor sample of the newest state in the picture
