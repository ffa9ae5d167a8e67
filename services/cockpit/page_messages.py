"""What a page may send, as JSON, and how it is checked.

Every message says which picture of the drone its sender had seen, and how long ago that arrived.
The service knows when it sent that picture, so the true age of a message is bounded without a
common clock, and what waited in a network is recognised as old.
"""

from typing import Annotated, Literal, NamedTuple

import msgspec

from messages.payload import UNDECODABLE
from messages.pilot import FlightMode
from messages.units import Count, Name, NotNegative, Share, Stick
from services.piloting.pilot_intents import DEEPEST, FARTHEST, TURN

LONGEST = 1024  # [B] of one message
# take: the sticks of this cockpit, and control of the drone unless another pilot has it;
# force: control from whoever has it; give_back: both; offer: control, to any other pilot. What is
# held says what stood on the button when that began: arm never resumes, and resume never arms.
# film: begin one, or end it; camera: make it the large one
Wish = Literal[
    "arm", "resume", "disarm", "stop", "light", "light_2", "laser", "output", "mode", "goto",
    "home", "unwind", "take", "force", "offer", "give_back", "film", "snapshot", "camera",
]  # fmt: skip
Absence = Literal["hidden", "closed", "unplugged"]
Way = Annotated[float, msgspec.Meta(ge=-FARTHEST, le=FARTHEST)]


class PageMessage(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="kind"
):
    seen: Count  # number of the newest picture it had; 0: none yet
    held_ms: NotNegative  # [ms] since that picture arrived


class PageSticks(PageMessage, frozen=True, kw_only=True, tag="sticks"):
    """Stick positions, 50 times a second while the page can be seen. SNAME signs."""

    surge: Stick  # [-] + forward
    sway: Stick  # [-] + starboard
    heave: Stick  # [-] + down
    yaw: Stick  # [-] + clockwise seen from above
    tilt: Stick = 0.0  # [-] camera, + upwards
    gripper: Stick = 0.0  # [-] + opens, while it is held
    device: Name = ""  # touch, keyboard or the name of a pad
    device_ms: NotNegative = 0.0  # [ms] since a pad last reported anything


class PageWish(PageMessage, frozen=True, kw_only=True, tag="wish"):
    """A button was pressed."""

    what: Wish
    flight_mode: FlightMode | None = None  # mode
    value: Share | None = None  # light, output; None: on or off, whichever it is not
    output: Name = ""  # output: which one
    depth: Annotated[float, msgspec.Meta(ge=0.0, le=DEEPEST)] | None = None  # [m] goto
    heading_deg: Annotated[float, msgspec.Meta(ge=-TURN, le=TURN)] | None = None  # goto
    north: Way | None = None  # [m] goto, with east
    east: Way | None = None  # [m]
    camera: Name = ""  # camera


class PageAbsence(PageMessage, frozen=True, kw_only=True, tag="absent"):
    """The pilot cannot steer from this page now."""

    why: Absence


class PageSeen(PageMessage, frozen=True, kw_only=True, tag="seen"):
    """Pictures arrive; nothing else to say."""


AnyPageMessage = PageSticks | PageWish | PageAbsence | PageSeen
_DECODER = msgspec.json.Decoder(AnyPageMessage)


def parsed(raw: str | bytes) -> AnyPageMessage | None:
    """The message; None: not one that a page of this version sends."""
    if len(raw) > LONGEST:
        return None
    try:
        return _DECODER.decode(raw)
    except UNDECODABLE:
        return None


class PageOpened(NamedTuple):
    page: int
    watcher: bool


class PageClosed(NamedTuple):
    page: int


class PageSaid(NamedTuple):
    page: int
    message: AnyPageMessage | None  # None: it could not be read


PageEvent = PageOpened | PageClosed | PageSaid
