"""The settings, and a node of ROS 2 that has the sticks: a pilot like any other."""

import re
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import msgspec

from messages import events
from messages.units import Ns
from services.piloting.guest_pilot import KEPT_NS, TTL_NS, PlainGuest
from services.piloting.pilot import Effects, Pilot
from services.piloting.pilot_intents import Press
from services.piloting.sticks import Sticks

NAMESPACE = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)*")
# Every key of rmw_zenoh begins with the domain, and DDS has room for these.
Domain = Annotated[int, msgspec.Meta(ge=0, le=232)]


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
class RosPilot(PlainGuest[bytes]):
    """A node of ROS 2 as a pilot; a sender is known by the gid of its publisher. Pure."""

    _held: frozenset[Press] = frozenset()
    _fastest_ns: Ns = 0  # [ns] least difference between both clocks, as of the fastest message

    @classmethod
    def of(cls, pilot: Pilot) -> "RosPilot":
        pilot.source = "ROS 2"
        return cls(pilot, events.LOST_ROS, events.NOT_THE_HOLDER_ROS())

    def heard(self, said: RosSticks, now: Ns) -> Effects:
        """Sticks have arrived. What a button asks for happens once, when it goes down; one that was
        down when a node took the sticks was not pressed."""
        out, lag, holder = Effects(), now - said.sent_ns, self.holder
        if said.sender != holder.sender and holder.may_take(said.sender, now):
            self._fastest_ns, self._held = lag, said.buttons
        elif said.sender == holder.sender:
            if holder.age_ns(now) > KEPT_NS:  # a clock that was set is no delay
                self._fastest_ns = lag
            self._fastest_ns = min(self._fastest_ns, lag)
            if lag - self._fastest_ns > TTL_NS:
                self.pilot.outbox.tell(events.STALE("ros"))
                return out
        if self.steer(said.sender, said.sticks, now, out):
            pressed, self._held = said.buttons - self._held, said.buttons
            self.press(sorted(pressed), now, out)
        return out


def ros_name(drone: str) -> str:
    """A drone's name as ROS allows it: letters, digits and _, from a letter on."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", drone)
    return name if name[:1].isalpha() else f"drone_{name}"


def namespace_of(settings: Settings, name: str) -> str:
    """The namespace of its topics: empty, or from a / on."""
    return f"/{name}" if settings.namespace is None else settings.namespace
