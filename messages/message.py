"""Base types of all messages."""

import msgspec

from messages.units import Count, Finite, Name, NotNegative, Stamp


class Message(msgspec.Struct, frozen=True, kw_only=True):
    """Base of everything that is published on the bus.

    `seq` is the sequence number, written by the publisher (one count per topic and process), so
    that a receiver notices lost messages. `stamp_ns` is the time at which the content was valid:
    the sampling instant of a sensor, the moment of decision of everything else.
    """

    seq: Count = 0
    stamp_ns: Stamp


class Request(Message, frozen=True, kw_only=True):
    """Something to be done once. Repeated with the same `id` until an `Answer` names that id."""

    id: Name


class Answer(Message, frozen=True, kw_only=True):
    """The answer to the request with this `id`."""

    id: Name
    accepted: bool


class Estimate(msgspec.Struct, frozen=True):
    """A value with its uncertainty."""

    value: Finite  # unit of the field that holds it
    std: NotNegative  # one standard deviation, same unit
    valid: bool = True
