"""Which drone a pilot flies: the order to change it, to the program `lindy fly` on his machine."""

from messages.message import Answer, Request
from messages.units import Name, Text


class FlyRequest(Request, frozen=True, kw_only=True):
    """Leave the drone that is flown, and fly this one."""

    drone: Name


class FlyAnswer(Answer, frozen=True, kw_only=True):
    """Sent when the other drone is this pilot's to fly, or when it cannot be."""

    reason: Text = ""  # why it stays with the drone that is flown
    left: Text = ""  # what becomes of the drone that was left
