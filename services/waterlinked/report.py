"""What a DVL A50 or A125 says over TCP, and what is asked of it.

Lines of JSON, one for each object, as Water Linked's page "DVL protocol" has them (docs/dvl/
dvl-protocol.md in github.com/waterlinked/waterlinked.github.io, protocol 2.3, json_v3). Older
firmware sends json_v1 and v2, without covariance and times, v1 without `type`.
"""

from math import isfinite, sqrt
from typing import Any

import msgspec

from messages.payload import UNDECODABLE
from messages.units import Finite, Vec3

KNOWN = ("json_v1", "json_v2", "json_v3", "json_v3.1")
LONGEST = 16_384  # [bytes] of a line; a report has about 1,200
LEAST_STD = 0.001  # [m/s] what its maker promises at best; a figure of merit may be far below
LONGEST_AGE = 1.0  # [s] from the echo to the report; beyond, its clock is not believed


class DvlReport(msgspec.Struct, frozen=True):
    """One line, whichever kind it is."""

    type: str = "velocity"
    format: str = ""
    # Of a velocity.
    vx: Finite | None = None  # [m/s] forward, of the instrument
    vy: Finite | None = None  # [m/s] starboard
    vz: Finite | None = None  # [m/s] down
    fom: Finite | None = None  # [m/s]
    covariance: list[list[float]] | None = None  # [m²/s²]
    altitude: Finite | None = None  # [m] negative: none
    velocity_valid: bool | None = None
    status: int = 0  # 0: no trouble; 1: too hot
    time_of_validity: int | None = None  # [µs] of its own clock: middle of the echo
    time_of_transmission: int | None = None  # [µs] the same: before the report was sent
    # Of an answer.
    response_to: str = ""
    success: bool = False
    error_message: str = ""
    result: dict[str, Any] | None = None

    @property
    def velocity(self) -> Vec3 | None:
        """[m/s] None: it has no lock on the bottom."""
        if self.vx is None or self.vy is None or self.vz is None or not self.velocity_valid:
            return None
        return self.vx, self.vy, self.vz

    @property
    def is_whole(self) -> bool:
        """Does a velocity report say what each firmware says?"""
        return None not in (self.vx, self.vy, self.vz, self.velocity_valid)

    @property
    def std(self) -> float:
        """[m/s] The largest of what the covariance says of the horizontal components, of the figure
        of merit, and of the least that its maker promises. A covariance of zeros says nothing."""
        return max(LEAST_STD, abs(self.fom or 0.0), _horizontal(self.covariance or []))

    @property
    def age(self) -> float | None:
        """[s] From the echo to the report, by its own clock; None: it does not say, or nothing that
        can be."""
        if not self.time_of_validity or not self.time_of_transmission:
            return None
        age = (self.time_of_transmission - self.time_of_validity) / 1e6
        return age if 0.0 <= age <= LONGEST_AGE else None


def _horizontal(covariance: list[list[float]]) -> float:
    if len(covariance) != 3 or any(len(row) != 3 for row in covariance):
        return 0.0
    largest = max(covariance[0][0], covariance[1][1])
    return sqrt(largest) if isfinite(largest) and largest > 0.0 else 0.0


_DECODER = msgspec.json.Decoder(DvlReport)


def read(line: bytes) -> DvlReport | None:
    """None for what is no report: no JSON, a NaN, another shape."""
    try:
        return _DECODER.decode(line)
    except UNDECODABLE:
        return None


def command(name: str, **parameters: object) -> bytes:
    asked: dict[str, object] = {"command": name}
    return msgspec.json.encode(asked | ({"parameters": parameters} if parameters else {})) + b"\n"
