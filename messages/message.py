"""Base types of all messages."""

from typing import Annotated

import msgspec

from messages.units import Count, Finite, Name, Names, NotNegative, Stamp, Text


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


# What a pilot has to know now, as a code with numbers: each screen makes a sentence of it.

Numbers = Annotated[dict[Name, Finite], msgspec.Meta(max_length=8)]


class Notice(msgspec.Struct, frozen=True, omit_defaults=True):
    """`messages.events.told` has the English of it."""

    code: Name  # an event of the event table, such as `notice:leak`, or a code of `events.TOLD`
    numbers: Numbers = {}  # by their names, which say what they are: `events.AMOUNTS`
    about: Names = ()  # services, or events, that it is about
    more: Text = ""  # English text of what has no code


Notices = Annotated[tuple[Notice, ...], msgspec.Meta(max_length=64)]  # the gravest first
