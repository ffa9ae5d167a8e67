"""What every message is made of."""

import msgspec

from messages.units import Finite, NotNegative, Stamp


class Message(msgspec.Struct, frozen=True, kw_only=True):
    """Base of everything that crosses the bus.

    `seq` is written by the publisher (one count per topic and process), so that a receiver can
    tell a lost message from a slow one. `stamp_ns` is the moment the content was true: the
    sampling instant of a sensor, the decision instant of everything else.
    """

    seq: int = 0
    stamp_ns: Stamp


class Request(Message, frozen=True, kw_only=True):
    """Something to be done once. Repeated with the same `id` until an `Answer` names that id."""

    id: str


class Answer(Message, frozen=True, kw_only=True):
    """What came of the request with this `id`."""

    id: str
    accepted: bool


class Estimate(msgspec.Struct, frozen=True):
    """A value with what is known about it."""

    value: Finite  # unit of the field that holds it
    std: NotNegative  # one standard deviation, same unit
    valid: bool = True
