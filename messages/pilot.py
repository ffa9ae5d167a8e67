"""What the pilot says. From `gamepad`, topside; heard on board by `reference`."""

from typing import Literal

from messages.message import Message, Ns, Positive, Stick, Ttl

TTL_MS = 300.0  # [ms] a stick position older than this moves nothing


class PilotCommand(Message, frozen=True, kw_only=True):
    """Where the sticks are, after dead-band, expo and gain. SNAME signs."""

    surge: Stick  # [-] + forward
    sway: Stick  # [-] + starboard
    heave: Stick  # [-] + down
    yaw: Stick  # [-] + clockwise seen from above
    pilot: Literal["present", "lost"] = "present"  # lost: the pad is gone, which is not "centred"
    source: str = ""  # which pad, keyboard or script
    device_age_ms: Positive = 0.0  # [ms] since the device itself last answered
    ttl_ms: Ttl = TTL_MS  # [ms] after stamp_ns this command must not move anything
    epoch: int = 0  # authority epoch; a command of another epoch is refused


RequestKind = Literal["arm", "disarm", "stop", "light"]


class PilotRequest(Message, frozen=True, kw_only=True):
    """Something to be done once. Repeated with the same id until a `PilotAnswer` names that id."""

    id: str
    kind: RequestKind
    value: Stick | None = None  # light: brightness 0 … 1
    epoch: int = 0


class PilotAnswer(Message, frozen=True, kw_only=True):
    """The drone's word on a request."""

    id: str
    accepted: bool
    reason: str = ""  # why not, in words for the pilot
    cause_ns: Ns | None = None  # [ns] stamp of the request
