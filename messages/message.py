"""What every message is made of.

Every limit below is checked by the decoder itself, at no extra cost: a NaN, an infinity or an
absurd value in a float field makes the whole message malformed, so it is counted and dropped at
the door and no service ever sees it.
"""

from typing import Annotated

import msgspec

# Far beyond anything a vehicle does, far below where arithmetic breaks. NaN fails both limits.
Finite = Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)]
Positive = Annotated[float, msgspec.Meta(ge=0.0, le=1e9)]
Stick = Annotated[float, msgspec.Meta(ge=-1.0, le=1.0)]  # [-] full deflection is 1
Ttl = Annotated[float, msgspec.Meta(ge=0.0, le=1000.0)]  # [ms] nobody may claim a longer life
Ns = int  # [ns] of the vehicle's monotonic clock

Vec3 = tuple[Finite, Finite, Finite]
Vec6 = tuple[Finite, Finite, Finite, Finite, Finite, Finite]
Quaternion = tuple[Finite, Finite, Finite, Finite]  # [-] w, x, y, z (scalar first)


class Message(msgspec.Struct, frozen=True, kw_only=True):
    """Base of everything that crosses the bus.

    `seq` is written by the publisher (one count per topic and process), so that a receiver can
    tell a lost message from a slow one. `stamp_ns` is the moment the content was true: the
    sampling instant of a sensor, the decision instant of everything else.
    """

    seq: int = 0
    stamp_ns: Ns


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
    std: Positive  # one standard deviation, same unit
    valid: bool = True
