"""The driver of a Ping1D as a pure state machine: it is asked, and its echoes become altitudes."""

from collections.abc import Iterable, Sequence
from typing import Annotated

import msgspec

from messages import events
from messages.events import Outbox
from messages.sensors import AltitudeSample
from messages.units import Ns
from services.instruments.watch import InstrumentWatch
from services.ping.frames import (
    DEVICE,
    DISTANCE,
    NACK,
    PROFILE,
    SET_PING_ENABLE,
    SET_SPEED_OF_SOUND,
    PingCutter,
    echo_of,
    firmware_of,
    frame,
    nack_of,
    request,
)

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
