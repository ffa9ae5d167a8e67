"""What the board measures: asked for, put on our clock, and made samples of, in SI units.

The board stamps with the time since its boot. An answer to TIMESYNC was stamped after the question
was sent and before the answer arrived, and any message was stamped before it arrived: each bounds
the offset, and it lies within all bounds (Marzullo and Owicki 1983). Crystals differ, so a bound
widens with its age. Where bounds contradict each other, the clock was shifted, and the newest bound
holds: the clock of ArduSub's own simulator stands still and catches up whenever its computer is
busy. By more, or where the board's time runs backwards, the clock jumped.

An acknowledgement does not say which message it is about, so one is asked for at a time."""

from collections.abc import Hashable
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any

from messages import events, topics
from messages.message import Message
from messages.sensors import BatterySample, ImuSample, MagnetometerSample, PressureSample
from messages.units import Ns, Vec3
from services.ardusub.settings import DriverOutbox, Settings
from services.mavlink_io.packet import MavCommand, MavlinkPacket, MavResult, command

DRIFT = 100e-6  # [-] greatest difference of two crystals
ROUNDING_NS = 2_000_000  # [ns] contradictions up to this come from stamps in whole milliseconds
SHIFT_NS = 1_000_000_000  # [ns] contradictions beyond this are of a board that was started anew
BACKWARDS_NS = 500_000_000  # [ns] messages are out of order by far less


@dataclass(slots=True)
class BoardClock:
    """Offset = our clock - board's clock [ns]."""

    jumps: int = 0
    went_back: bool = False  # at the newest jump: as a restart of the board does
    shifts: int = 0
    _least: float = -inf
    _most: float = inf
    _as_of: Ns | None = None  # of our clock, when the bounds were widened last
    _newest: Ns | None = None  # of the board's clock

    @property
    def known(self) -> bool:
        return self._least > -inf and self._most < inf

    @property
    def bound_ns(self) -> float:
        """[ns] Largest error of `ours`."""
        return (self._most - self._least) / 2

    def heard(self, board: Ns, arrival: Ns) -> bool:
        """A message stamped at `board` [ns] arrived. False: the clock has jumped since."""
        return self._bounded(board, arrival, -inf, arrival - board)

    def answered(self, sent: Ns, board: Ns, arrival: Ns) -> bool:
        """An answer to a question that was sent at `sent` [ns]. False: the clock has jumped."""
        return self._bounded(board, arrival, sent - board, arrival - board)

    def ours(self, board: Ns, now: Ns) -> Ns | None:
        """[ns] Of our clock, never after now; None while the offset is not known."""
        if not self.known:
            return None
        return min(now, board + round((self._least + self._most) / 2))

    def forget(self) -> None:
        self._least, self._most, self._as_of, self._newest = -inf, inf, None, None

    def _bounded(self, board: Ns, now: Ns, least: float, most: float) -> bool:
        if self._as_of is not None:
            wider = DRIFT * max(0, now - self._as_of)
            self._least, self._most = self._least - wider, self._most + wider
        self._as_of = now
        backwards = self._newest is not None and board < self._newest - BACKWARDS_NS
        gap = max(self._least - most, least - self._most)  # [ns] between old and new bounds
        jumped = backwards or gap > SHIFT_NS
        if jumped:
            self.jumps += 1
            self.went_back = backwards or least > self._most
            self.forget()
            self._as_of = now
        elif gap > 0:
            self._shift(least, most, gap)
        self._newest = board if self._newest is None else max(board, self._newest)
        self._least, self._most = max(self._least, least), min(self._most, most)
        return not jumped

    def _shift(self, least: float, most: float, gap: float) -> None:
        """Move the interval, as wide as it is, to where it agrees with the newest bound."""
        self.shifts += gap > ROUNDING_NS
        width = self._most - self._least
        if most < self._least:
            self._least, self._most = most - width, most
        else:
            self._least, self._most = least, least + width


NUMBERS = {"HIGHRES_IMU": 105, "RAW_IMU": 27, "SCALED_PRESSURE2": 137, "SYS_STATUS": 1,
           "SCALED_PRESSURE": 29}  # fmt: skip
AGAIN_NS = 500_000_000  # [ns] before a request without an answer is repeated
WINDOW_NS = 5_000_000_000  # [ns] over which a rate is judged
ENOUGH = 0.9  # [-] of the rate that was asked for
STOPPED = 0.5  # [-] less than this, and it is asked for again


@dataclass(slots=True)
class TelemetryStream:
    """One kind of measurement, by the first of these messages that the board has."""

    messages: tuple[str, ...]
    hz: float
    granted: bool = False
    refused: int = 0  # of the messages, from the first
    heard: int = 0  # in this window

    @property
    def message(self) -> str | None:
        return self.messages[self.refused] if self.refused < len(self.messages) else None


@dataclass(slots=True)
class TelemetryStreams:
    board: int  # system
    streams: list[TelemetryStream]
    _asked: Ns | None = None
    _since: Ns | None = None  # begin of the window

    def counts(self, name: str) -> bool:
        """Note an arrival. Is this message the one in use?"""
        for stream in self.streams:
            if stream.message == name:
                stream.heard += 1
                return True
        return False

    def heard_ack(self, result: int) -> str | None:
        """The answer to the newest request. Returns the name of what the board cannot give."""
        stream = self._next
        if stream is None or self._asked is None:
            return None
        self._asked = None
        if result == MavResult.ACCEPTED:
            stream.granted = True
            return None
        stream.refused += 1
        return stream.messages[-1] if stream.message is None else None

    def due(self, now: Ns) -> list[MavlinkPacket]:
        """Requests to send now."""
        stream = self._next
        if stream is None or stream.message is None:
            return []
        if self._asked is not None and now - self._asked < AGAIN_NS:
            return []
        self._asked = now
        interval = round(1e6 / stream.hz)  # [µs]
        return [
            command(self.board, MavCommand.SET_MESSAGE_INTERVAL, NUMBERS[stream.message], interval)
        ]

    def judge(self, now: Ns) -> list[tuple[str, float, float]]:
        """At the end of a window: message, rate and the rate asked for [1/s] of what is slow."""
        if self._next is not None:
            self.pause()
            return []
        if self._since is None:
            self._restart(now)
        if self._since is None or now - self._since < WINDOW_NS:
            return []
        seconds, found = (now - self._since) / 1e9, list[tuple[str, float, float]]()
        for stream in self.streams:
            rate = stream.heard / seconds
            least = ENOUGH * stream.hz * seconds - 1  # one may just have missed the window
            if stream.message is not None and stream.heard < least:
                found.append((stream.message, rate, stream.hz))
                stream.granted = rate >= STOPPED * stream.hz
        self._restart(now)
        return found

    def pause(self) -> None:
        """Nothing is judged of this window."""
        self._since = None

    def _restart(self, now: Ns) -> None:
        self._since = now
        for stream in self.streams:
            stream.heard = 0

    @property
    def _next(self) -> TelemetryStream | None:
        return next((s for s in self.streams if not s.granted and s.message is not None), None)


G = 9.80665  # [m/s²] of a milli-g
TESLA_PER_GAUSS = 1e-4
TEXT, MOST_TEXT = 50, 1000  # characters of one STATUSTEXT; of a long one, that is shown as it is
# Builds on the way to 4.7 multiply milligauss by 1000 in HIGHRES_IMU, where they should divide.
MISSCALED, TOO_MUCH = 1e-6, 1000.0  # [-] and [G] more than a compass measures
IMU_MESSAGES = ("HIGHRES_IMU", "RAW_IMU")  # best first; the first is new in 4.8
PRESSURE_MESSAGE, BATTERY_MESSAGE = "SCALED_PRESSURE2", "SYS_STATUS"
ENCLOSURE_MESSAGE, ENCLOSURE_HZ = "SCALED_PRESSURE", 1.0  # the barometer inside
MESSAGES = (*IMU_MESSAGES, PRESSURE_MESSAGE, BATTERY_MESSAGE, ENCLOSURE_MESSAGE)


PERIOD_NS = 100_000_000  # [ns] between two values of the depth sensor, and of the compass


def imu(name: str, fields: dict[str, Any], stamp_ns: Ns) -> ImuSample | None:
    """None where a number is not finite."""
    fine = name == "HIGHRES_IMU"
    force = _vector(fields, "acc", 1.0 if fine else 1e-3 * G)
    rate = _vector(fields, "gyro", 1.0 if fine else 1e-3)
    if force is None or rate is None:
        return None
    return ImuSample(stamp_ns=stamp_ns, specific_force=force, angular_rate=rate)


def field_of(fields: dict[str, Any]) -> Vec3:
    """What an IMU message says of the compass, in its own unit."""
    return fields["xmag"], fields["ymag"], fields["zmag"]


def magnetometer(name: str, fields: dict[str, Any], stamp_ns: Ns) -> MagnetometerSample | None:
    gauss = 1.0 if name == "HIGHRES_IMU" else 1e-3
    if name == "HIGHRES_IMU" and max(map(abs, field_of(fields))) > TOO_MUCH:
        gauss = MISSCALED
    field = _vector(fields, "mag", gauss * TESLA_PER_GAUSS)
    return None if field is None else MagnetometerSample(stamp_ns=stamp_ns, field=field)


def pressure(fields: dict[str, Any], stamp_ns: Ns) -> PressureSample | None:
    pascal = 100.0 * fields["press_abs"]
    if not isfinite(pascal) or not 0.0 <= pascal < 1e9:
        return None
    celsius = fields["temperature"] / 100.0
    return PressureSample(stamp_ns=stamp_ns, pressure=pascal, temperature=celsius)


class BatteryMeter:
    """The board knows voltage and current; the energy is summed up here."""

    def __init__(self) -> None:
        self.power = 0.0  # [W]
        self._used_wh: float | None = None  # None: no current was ever measured
        self._at: Ns | None = None

    def sample(self, fields: dict[str, Any], now: Ns) -> BatterySample | None:
        """None without a battery monitor."""
        voltage = fields["voltage_battery"] / 1000.0
        if not 0.0 < voltage < 65.0:
            return None
        raw = fields["current_battery"]
        current = None if raw == -1 else max(0.0, raw / 100.0)
        self.power = voltage * (current or 0.0)
        if current is not None:
            seconds = 0.0 if self._at is None else min(10.0, (now - self._at) / 1e9)
            self._used_wh = (self._used_wh or 0.0) + self.power * seconds / 3600.0
        self._at = now
        return BatterySample(stamp_ns=now, voltage=voltage, current=current, used_wh=self._used_wh)


@dataclass(slots=True)
class LongText:
    """STATUSTEXT in several packets, of which the last is not full (MAVLink 2)."""

    _id: int = 0
    _begun: str = ""

    def whole(self, text: str, number: int) -> str | None:
        """The text that ends with this packet; None: more of it comes. `number`: 0 for a text of
        one packet. Of a text whose end was lost nothing is said."""
        if number == 0:
            return text
        begun = self._begun if number == self._id else ""
        self._id, self._begun = number, begun + text
        if len(text) == TEXT and len(self._begun) < MOST_TEXT:
            return None
        done, self._id, self._begun = self._begun, 0, ""
        return done


@dataclass(slots=True)
class BoardUpdates:
    """Which of the many messages that repeat a value of one sensor bring a new one, and when it was
    measured.

    ArduSub takes over what its depth sensor and its compass have measured ten times a second
    (`update_altitude`, `update_batt_compass`), sends the same value until the next time, and stamps
    it when it is sent: at 1 m/s as much as 0.1 m late. A new value was taken over between the last
    message with the old one and this one; it is the mean since the time before
    (`AP_Baro_MS56XX::update`, `AP_Compass_Backend::drain_accumulated_samples`), so half of a period
    older.
    """

    age_ns: Ns  # of a value that has just been taken over
    same_ns: Ns  # a value that stays for longer is passed on: it was measured again, or is frozen
    _value: Hashable = None
    _sent_ns: Ns = 0  # stamp of the newest message
    _used_ns: Ns = 0  # … of the newest that brought something

    def measured_at(self, value: Hashable, sent_ns: Ns) -> Ns | None:
        """[ns] Middle of the time over which the value was measured; None: nothing new.

        Args:
            sent_ns: stamp of the message, which rises.
        """
        before, previous_ns = self._value, self._sent_ns
        self._value, self._sent_ns = value, sent_ns
        if value == before and sent_ns - self._used_ns < self.same_ns:
            return None
        self._used_ns = sent_ns
        if before is None or value == before:
            return sent_ns - self.age_ns
        return sent_ns - self.age_ns - min(sent_ns - previous_ns, PERIOD_NS) // 2


def _vector(fields: dict[str, Any], part: str, unit: float) -> Vec3 | None:
    x, y, z = (unit * fields[f"{axis}{part}"] for axis in "xyz")
    return (x, y, z) if isfinite(x + y + z) and max(abs(x), abs(y), abs(z)) < 1e6 else None


S = 1_000_000_000  # [ns]
# A value that stays for as long is passed on. A field is more often the same again, in the steps of
# 1 mG of RAW_IMU and in still water: it must not look as if it came too seldom.
PRESSURE_SAME_NS, FIELD_SAME_NS = 250_000_000, 115_000_000  # [ns]
LEAK = "Leak Detected"  # text of the board
LEAK_HOLDS_NS = 45 * S  # [ns] it is said every 20 s; one may be lost


class BoardMeasurements:
    def __init__(self, settings: Settings, clock: BoardClock, outbox: DriverOutbox) -> None:
        self._settings, self._clock, self._outbox = settings, clock, outbox
        self._battery = BatteryMeter()
        self._leak_ns: Ns | None = None
        self.enclosure: float | None = None  # [°C] inside, newest
        self.water: float | None = None  # [°C] newest
        self.forget()

    def forget(self) -> None:
        """Another board, or the same one rebooted: nothing is granted, and its clock is another."""
        self._streams = TelemetryStreams(
            self._settings.board,
            [
                TelemetryStream(IMU_MESSAGES, topics.IMU.hz),
                TelemetryStream((PRESSURE_MESSAGE,), self._settings.pressure_rate),
                TelemetryStream((BATTERY_MESSAGE,), topics.BATTERY.hz),
                TelemetryStream((ENCLOSURE_MESSAGE,), ENCLOSURE_HZ),
            ],
        )
        self._stamps: dict[str, Ns] = {}
        self._pressures = BoardUpdates(round(self._settings.pressure_age * S), PRESSURE_SAME_NS)
        self._fields = BoardUpdates(round(self._settings.compass_age * S), FIELD_SAME_NS)
        self._clock.forget()

    @property
    def power(self) -> float:
        """[W] of the battery."""
        return self._battery.power

    def ask(self, now: Ns, *, there: bool) -> None:
        """Send what is due now, and say what comes too slowly of a board that is there."""
        self._outbox.packets += self._streams.due(now)
        if not there:
            self._streams.pause()
        for name, rate, asked in self._streams.judge(now):
            detail = f"{rate:.1f} times a second; asked for {asked:g}"
            self._outbox.tell(events.SLOW(name.lower(), detail=detail))

    def heard_ack(self, result: int) -> None:
        """The answer to the newest request."""
        if (missing := self._streams.heard_ack(result)) is not None:
            self._outbox.tell(events.NOT_GIVEN(missing.lower()))

    def heard_leak(self, now: Ns) -> None:
        self._leak_ns = now
        self._outbox.tell(events.LEAK_FOUND("board"))

    def leaked(self, now: Ns) -> bool:
        """Was a leak said lately?"""
        return self._leak_ns is not None and now - self._leak_ns <= LEAK_HOLDS_NS

    def heard(self, name: str, fields: dict[str, Any], now: Ns) -> bool:
        """One measurement at its arrival [ns]. False: the board's clock has jumped."""
        if not self._streams.counts(name):
            return True
        if name == BATTERY_MESSAGE:
            self._keep(self._battery.sample(fields, now), name)
            return True
        if name == ENCLOSURE_MESSAGE:
            self.enclosure = fields["temperature"] / 100.0
            return True
        is_imu = name in IMU_MESSAGES
        board = fields["time_usec"] * 1000 if is_imu else fields["time_boot_ms"] * 1_000_000
        if not self._clock.heard(board, now):
            return False
        stamp = self._clock.ours(board, now)
        if stamp is not None:
            self._stamped(name, fields, stamp)
        return True

    def _stamped(self, name: str, fields: dict[str, Any], stamp: Ns) -> None:
        if stamp <= self._stamps.get(name, -(2**62)):
            self._outbox.tell(events.NOT_NEWER(name.lower()))
            return
        self._stamps[name] = stamp
        if name == PRESSURE_MESSAGE:
            measured = self._pressures.measured_at(fields["press_abs"], stamp)
            if measured is not None:
                sample = pressure(fields, measured)
                self.water = None if sample is None else sample.temperature
                self._keep(sample, name)
        else:
            measured = self._fields.measured_at(field_of(fields), stamp)
            if measured is not None:
                self._keep(magnetometer(name, fields, measured), name)
            self._keep(imu(name, fields, stamp), name)  # last: it triggers estimation

    def _keep(self, sample: Message | None, name: str) -> None:
        if sample is None:
            self._outbox.tell(events.IMPLAUSIBLE(name.lower()))
        else:
            self._outbox.samples.append(sample)
