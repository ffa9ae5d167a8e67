"""The bounded numbers that messages and settings are made of: one name, one range.

Every limit is checked by the decoder itself, at no extra cost: a NaN, an infinity or an absurd
value makes the whole message malformed, so it is counted and dropped at the door and no service
ever sees it; in a settings file it is refused with a sentence. What belongs to one file of
settings only, such as the rates a sensor can have, stands there under a name of its own.
"""

from typing import Annotated

import msgspec

# In messages: far beyond anything a vehicle does, far below where arithmetic breaks. NaN fails
# every limit.
Finite = Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)]
NotNegative = Annotated[float, msgspec.Meta(ge=0.0, le=1e9)]
Stick = Annotated[float, msgspec.Meta(ge=-1.0, le=1.0)]  # [-] full deflection is 1
Ttl = Annotated[float, msgspec.Meta(ge=0.0, le=1000.0)]  # [ms] nobody may claim a longer life

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

# A moment of the clock of the machine that says it: one that hears it on another machine turns it
# into its own time, wherever in a message it stands. A duration is the same everywhere.
STAMP, DURATION = {"ns": "stamp"}, {"ns": "duration"}  # by which the types are told apart
Stamp = Annotated[int, msgspec.Meta(extra=STAMP)]  # [ns]
DurationNs = Annotated[int, msgspec.Meta(extra=DURATION)]  # [ns]
Ns = int  # [ns] in code: of the process's own clock

Vec3 = tuple[Finite, Finite, Finite]
Vec6 = tuple[Finite, Finite, Finite, Finite, Finite, Finite]
Quaternion = tuple[Finite, Finite, Finite, Finite]  # [-] w, x, y, z (scalar first)
