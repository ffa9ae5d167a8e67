"""The driver of a Ping1D as a pure state machine: it is asked, and its echoes become altitudes.

Frames of the Ping protocol: `BR`, numbers little-endian, the sum of all bytes at the end. From Blue
Robotics' pages docs/index.md and src/definitions/{common,ping1d}.json in
github.com/bluerobotics/ping-protocol.
"""

import struct
from collections.abc import Iterable, Sequence
from functools import reduce
from operator import add
from typing import Annotated, NamedTuple

import msgspec

from messages import events
from messages.events import Outbox
from messages.sensors import AltitudeSample
from messages.units import Ns
from services.instruments.core import InstrumentWatch

NACK, DEVICE, REQUEST = 2, 4, 6
SET_SPEED_OF_SOUND, SET_PING_ENABLE, DISTANCE, PROFILE = 1002, 1006, 1212, 1300
START = b"BR"
HEAD = struct.Struct("<2sHHBB")  # start, length of the payload, message, sender, receiver
SUM = struct.Struct("<H")
LONGEST = 300  # [bytes] of a payload; a profile has about 230
# Distance [mm], confidence [%], pulse [µs], number of the ping, start and length of the scan [mm],
# gain. A profile begins with the same, and its echo follows.
ECHO = struct.Struct("<IHHIIII")


class PingEcho(NamedTuple):
    distance: float  # [m]
    confidence: int  # [%]
    number: int  # of the ping, since it was powered


def frame(message: int, payload: bytes) -> bytes:
    data = HEAD.pack(START, len(payload), message, 0, 0) + payload
    return data + SUM.pack(_sum(data))


def request(message: int) -> bytes:
    """Asks for one message."""
    return frame(REQUEST, SUM.pack(message))


def echo_of(payload: bytes) -> PingEcho | None:
    """None: it is too short."""
    if len(payload) < ECHO.size:
        return None
    distance, confidence, _, number, *_ = ECHO.unpack_from(payload)
    return PingEcho(distance / 1000.0, confidence, number)


def firmware_of(payload: bytes) -> str | None:
    """None: it is too short."""
    return "firmware {}.{}.{}".format(*payload[2:5]) if len(payload) >= 5 else None


def nack_of(payload: bytes) -> tuple[int, str]:
    """The message that is refused, and why."""
    return int.from_bytes(payload[:2], "little"), payload[2:202].decode("ascii", "replace")


class PingCutter:
    """Keeps the rest of an unfinished frame; never more than one."""

    def __init__(self) -> None:
        self._rest = b""

    def frames(self, pieces: Iterable[bytes]) -> tuple[list[tuple[int, bytes]], bool]:
        """Messages with their payloads, in order; and whether anything else arrived."""
        data, at, garbage = self._rest + b"".join(pieces), 0, False
        found = list[tuple[int, bytes]]()
        while (begin := data.find(START, at)) >= 0:
            garbage |= begin > at
            at = begin
            if len(data) - at < HEAD.size:
                break
            _, length, message, _, _ = HEAD.unpack_from(data, at)
            end = at + HEAD.size + length
            if length <= LONGEST and len(data) < end + SUM.size:
                break
            if length > LONGEST or SUM.unpack_from(data, end) != (_sum(data[at:end]),):
                garbage, at = True, at + len(START)
                continue
            found.append((message, data[at + HEAD.size : end]))
            at = end + SUM.size
        else:
            half = data.endswith(START[:1]) and at < len(data)
            garbage |= len(data) - half > at
            at = len(data) - half
        self._rest = data[at:]
        return found, garbage


def _sum(data: bytes) -> int:
    return reduce(add, data, 0) & 0xFFFF


S = 1_000_000_000  # [ns]
FARTHEST = 150.0  # [m] beyond the reach of any of them


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [ping] of a vehicle file."""

    # serial:DEVICE:115200, or udpout:HOST:PORT where BlueOS has the cable; empty: there is none.
    url: Annotated[str, msgspec.Meta(max_length=200)] = ""
    rate: Annotated[float, msgspec.Meta(ge=0.5, le=10.0)] = 10.0  # [1/s] asked for
    confidence: Annotated[int, msgspec.Meta(ge=0, le=100)] = 70  # [%] less is no altitude
    # [m/s] set whenever it is there anew; None: as it is set up.
    sound_speed: Annotated[float, msgspec.Meta(ge=1000.0, le=2000.0)] | None = None
    # [s] from the echo to the arrival: it answers with its newest echo.
    latency: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.05


class PingDriver:
    """Bytes in; samples, requests and events out. Each ping gives one sample, however often it is
    told."""

    def __init__(self, settings: Settings, outbox: Outbox) -> None:
        self.watch = InstrumentWatch("altimeter", outbox)
        self.told = ""
        self._settings, self._outbox = settings, outbox
        self._cutter = PingCutter()
        self._number: int | None = None  # of the newest ping
        self._firmware = "firmware not told"
        self._ask_ns: Ns = 0
        self._anew = False  # it is there anew, and has to be set up

    def heard(self, pieces: Iterable[bytes], arrival: Ns) -> Sequence[AltitudeSample]:
        messages, garbage = self._cutter.frames(pieces)
        self.watch.garbled(int(garbage))
        samples = [self._heard_one(m, payload, arrival) for m, payload in messages]
        return [sample for sample in samples if sample is not None]

    def due(self, now: Ns) -> Sequence[bytes]:
        sent = list[bytes]()
        if self._anew:
            sent += [request(DEVICE)]
            sent += () if self.watch.only_asks else self._set_up()
        self._anew = False
        period = round(S / self._settings.rate)
        if now >= self._ask_ns - period // 10:  # it is looked at 10 times a second, more or less
            self._ask_ns = (self._ask_ns if now < self._ask_ns + period else now) + period
            sent.append(request(DISTANCE))
        return sent

    def _set_up(self) -> Sequence[bytes]:
        wanted = [frame(SET_PING_ENABLE, b"\x01")]
        if self._settings.sound_speed is not None:
            speed = round(self._settings.sound_speed * 1000.0)  # [mm/s]
            wanted.append(frame(SET_SPEED_OF_SOUND, speed.to_bytes(4, "little")))
        return wanted

    def _heard_one(self, message: int, payload: bytes, arrival: Ns) -> AltitudeSample | None:
        if message in (DISTANCE, PROFILE):
            return self._sample(payload, arrival)
        if message == DEVICE:
            self._firmware = firmware_of(payload) or self._firmware
        elif message == NACK:
            refused, why = nack_of(payload)
            if refused != DEVICE:  # which older firmware does not know
                self._outbox.tell(events.NOT_CONFIGURED("altimeter", detail=f"{refused}: {why}"))
        return None

    def _sample(self, payload: bytes, arrival: Ns) -> AltitudeSample | None:
        if (echo := echo_of(payload)) is None:
            self.watch.garbled()
            return None
        self._anew |= self.watch.reported(arrival)
        self.told = f"{self._firmware}, {echo.confidence} % sure of {echo.distance:.2f} m"
        again, self._number = echo.number == self._number, echo.number
        if again or echo.confidence < self._settings.confidence or echo.distance == 0.0:
            self.watch.measured_nothing(arrival, events.NO_BOTTOM_ALTIMETER())
            return None
        if echo.distance > FARTHEST or echo.confidence > 100:
            self._outbox.tell(events.IMPLAUSIBLE("altitude"))
            return None
        self.watch.measured()
        stamp = arrival - round(self._settings.latency * S)
        return AltitudeSample(stamp_ns=stamp, altitude=echo.distance)
