"""Which drone a pilot flies: those that can be reached, and the order to change it. From and to the
program `lindy fly` on his machine."""

from typing import Annotated

import msgspec

from messages.message import Answer, Message, Request
from messages.units import Count, Name, Text


class FlyRequest(Request, frozen=True, kw_only=True):
    """Leave the drone that is flown, and fly this one."""

    drone: Name


class FlyAnswer(Answer, frozen=True, kw_only=True):
    """Sent when the other drone is this pilot's to fly, or when it cannot be."""

    reason: Text = ""  # why it stays with the drone that is flown
    left: Text = ""  # what becomes of the drone that was left
    folder: Text = ""  # of the new drone's recording, on the pilot's machine


class ReachableDrone(msgspec.Struct, frozen=True, kw_only=True):
    """A drone that can be reached. Its texts are what it says of itself, shortened."""

    name: Name
    vehicle: Name = ""  # name of its vehicle file; empty: it has not said so
    activity: Name = ""  # empty: not known
    armed: bool = False
    pilot: Name = ""  # who has control of it; empty: nobody
    failsafe: bool = False  # a failsafe acts
    alarms: Text = ""  # in words, the gravest first; empty: none
    misfit: Text = ""  # why it cannot be flown from here; empty: it can


MOST_DRONES = 64  # in one list
ReachableDrones = Annotated[tuple[ReachableDrone, ...], msgspec.Meta(max_length=MOST_DRONES)]


class DroneList(Message, frozen=True, kw_only=True):
    """The drones that can be reached, once a second, from the program `lindy fly`."""

    flown: Name  # the drone that he flies now
    drones: ReachableDrones  # by name, the flown one among them; those that say nothing come last
    more: Count = 0  # that can be reached, and are not in the list
    left: Text = ""  # what has become of the drone that was left last
