"""The bounded number types of messages and settings: one name, one range.

The decoder checks every limit, at no extra cost. A NaN, an infinity or an absurd value makes the
whole message malformed: it is counted and dropped on arrival, and no service sees it. In a settings
file it is refused with one sentence. Types that only one settings module needs, such as the rates
of a sensor, are defined there.
"""

from typing import Annotated

import msgspec

# In messages: far beyond anything a vehicle does, far below where arithmetic overflows. NaN fails
# every limit.
Finite = Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)]
NotNegative = Annotated[float, msgspec.Meta(ge=0.0, le=1e9)]
Stick = Annotated[float, msgspec.Meta(ge=-1.0, le=1.0)]  # [-] full deflection is 1
Ttl = Annotated[float, msgspec.Meta(ge=0.0, le=1000.0)]  # [ms] longest allowed time-to-live

# In settings: up to a million, which is far beyond any vehicle.
Positive = Annotated[float, msgspec.Meta(gt=0.0, le=1e6)]
NotNegativeSetting = Annotated[float, msgspec.Meta(ge=0.0, le=1e6)]
FiniteSetting = Annotated[float, msgspec.Meta(ge=-1e6, le=1e6)]
PathQuantity = Annotated[
    float, msgspec.Meta(ge=1e-6, le=1e6)
]  # no drone is smaller, slower or faster
WithinAnHour = Annotated[float, msgspec.Meta(gt=0.0, le=3600.0)]  # [s]

# In both.
Share = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]  # [-] from nothing to all
OpenShare = Annotated[float, msgspec.Meta(gt=0.0, lt=1.0)]  # [-] neither nothing nor all

# A stamp is a time of the sender's clock. A receiver on another machine converts it to its own
# clock, wherever in a message it is. A duration is the same on every machine.
STAMP, DURATION = {"ns": "stamp"}, {"ns": "duration"}  # they distinguish the two types
FARTHEST_NS = 4_000_000_000_000_000_000  # [ns] 127 years; the sum of two still fits into 64 bits
Stamp = Annotated[int, msgspec.Meta(ge=-FARTHEST_NS, le=FARTHEST_NS, extra=STAMP)]  # [ns]
DurationNs = Annotated[int, msgspec.Meta(ge=-FARTHEST_NS, le=FARTHEST_NS, extra=DURATION)]  # [ns]
Ns = int  # [ns] in code: of the process's own clock

# Whatever counts, and whatever is written in words: far more than Lindy sends, and little enough
# that no message fills the memory of a receiver or overflows its sums.
MOST_COUNTED = 2**53  # exact in every language's numbers
Count = Annotated[int, msgspec.Meta(ge=0, le=MOST_COUNTED)]
Name = Annotated[str, msgspec.Meta(max_length=128)]  # of a service, a part, a file, a request
Text = Annotated[str, msgspec.Meta(max_length=2000)]  # in words, for people
Names = Annotated[tuple[Name, ...], msgspec.Meta(max_length=64)]
Counts = Annotated[dict[Name, Count], msgspec.Meta(max_length=1000)]
Outputs = Annotated[dict[Name, Stick], msgspec.Meta(max_length=32)]  # [-] by name
Thrusts = Annotated[tuple[Finite, ...], msgspec.Meta(max_length=32)]  # [N] per thruster

Vec3 = tuple[Finite, Finite, Finite]
Vec6 = tuple[Finite, Finite, Finite, Finite, Finite, Finite]
Quaternion = tuple[Finite, Finite, Finite, Finite]  # [-] w, x, y, z (scalar first)
