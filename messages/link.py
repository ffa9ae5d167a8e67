"""The tether as it is, not as it is hoped to be. From `tether`, in both realms."""

import msgspec

from messages.message import Message, Positive


class Direction(msgspec.Struct, frozen=True):
    """One direction of the link over the last report period."""

    delay_p50_ms: Positive | None  # [ms] None: nothing passed
    delay_p99_ms: Positive | None  # [ms]
    forwarded: int  # messages since start
    dropped: int  # messages since start
    queued: int  # messages on the way now


class LinkStatus(Message, frozen=True, kw_only=True):
    """Both directions, as measured by the tether itself."""

    profile: str
    up: bool  # the link is there
    down_link: Direction  # topside to drone
    up_link: Direction  # drone to topside
    rtt_ms: Positive | None  # [ms] sum of both medians
