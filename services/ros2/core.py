"""The settings, and a node of ROS 2 that has the sticks: a pilot like any other."""

import re
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import msgspec

from messages import events
from messages.events import Outbox
from messages.pilot import TTL_MS, PilotAnswer, PilotRequest
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.piloting.guest_pilot import GuestPilot
from services.piloting.pilot import Effects, Pilot
from services.piloting.pilot_intents import Press
from services.piloting.stick_holder import KEPT_NS
from services.piloting.sticks import Sticks

NAMESPACE = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)*")
# Every key of rmw_zenoh begins with the domain, and DDS has room for these.
Domain = Annotated[int, msgspec.Meta(ge=0, le=232)]
TTL_NS = round(TTL_MS * 1e6)  # [ns]


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [ros2] of a vehicle file."""

    router: str = "tcp/localhost:7447"  # of the ROS network: rmw_zenohd, as Zenoh writes it
    domain: Domain = 0  # [-] ROS_DOMAIN_ID
    namespace: str | None = None  # of the topics, such as /rov; None: that of the drone's name
    sticks: bool = False  # also take sticks: whoever reaches the ROS network may then fly

    def __post_init__(self) -> None:
        if self.namespace is not None and not NAMESPACE.fullmatch(self.namespace):
            raise ValueError(
                f"namespace {self.namespace!r}: expected names of letters, digits and _, each "
                f"behind a /, such as /rov; or nothing for none"
            )


class RosSticks(NamedTuple):
    """Sticks of a node of ROS 2."""

    sender: bytes  # gid of the publisher
    sent_ns: Ns  # [ns] by the sender's clock
    sticks: Sticks
    buttons: frozenset[Press] = frozenset()  # held down


@dataclass(slots=True)
class RosPilot:
    """Joins the sticks of ROS 2 with the pilot's state machine. Pure."""

    pilot: Pilot
    guest: GuestPilot[bytes] = field(init=False)
    _held: frozenset[Press] = frozenset()
    _fastest_ns: Ns = 0  # [ns] least difference between both clocks, as of the fastest message

    def __post_init__(self) -> None:
        self.pilot.source = "ROS 2"
        silent, other = events.LOST_ROS, events.NOT_THE_HOLDER_ROS()
        self.guest = GuestPilot(self.pilot, silent, other)

    @property
    def outbox(self) -> Outbox:
        return self.pilot.outbox

    def heard(self, said: RosSticks, now: Ns) -> Effects:
        """Sticks have arrived. What a button asks for happens once, when it goes down; one that was
        down when a node took the sticks was not pressed."""
        out, lag = Effects(), now - said.sent_ns
        if said.sender != self.guest.holder.sender and self.guest.holder.may_take(said.sender, now):
            self._fastest_ns, self._held = lag, said.buttons
        elif said.sender == self.guest.holder.sender:
            if self.guest.holder.age_ns(now) > KEPT_NS:  # a clock that was set is no delay
                self._fastest_ns = lag
            self._fastest_ns = min(self._fastest_ns, lag)
            if lag - self._fastest_ns > TTL_NS:
                self.outbox.tell(events.STALE("ros"))
                return out
        if not self.guest.steer(said.sender, said.sticks, now, out):
            return out
        pressed, self._held = said.buttons - self._held, said.buttons
        self.guest.press(sorted(pressed), now, out)
        return out

    def tick(self, now: Ns) -> Effects:
        out = Effects()
        self.guest.repeat(now, out)
        return out

    def status(self, status: VehicleStatus, now: Ns) -> Effects:
        out = Effects()
        self.guest.follow(status, now, out)
        return out

    def answered(self, request: PilotRequest, answer: PilotAnswer, now: Ns) -> Effects:
        out = Effects()
        self.guest.learn(request, answer, now, out)
        return out

    def given_up(self, request: PilotRequest, now: Ns) -> Effects:
        return self.pilot.given_up(request, now)


def ros_name(drone: str) -> str:
    """A drone's name as ROS allows it: letters, digits and _, from a letter on."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", drone)
    return name if name[:1].isalpha() else f"drone_{name}"


def namespace_of(settings: Settings, name: str) -> str:
    """Of its topics: empty, or from a / on."""
    return f"/{name}" if settings.namespace is None else settings.namespace
