"""What the board measures: asked for, put on our clock, and made samples of."""

from typing import Any

from messages import events, topics
from messages.message import Message
from messages.units import Ns
from services.ardusub import readings
from services.ardusub.board_clock import BoardClock
from services.ardusub.outbox import DriverOutbox
from services.ardusub.settings import Settings
from services.ardusub.streams import TelemetryStream, TelemetryStreams

S = 1_000_000_000  # [ns]
# A value that stays for as long is passed on. A field is more often the same again, in the steps of
# 1 mG of RAW_IMU and in still water: it must not look as if it came too seldom.
PRESSURE_SAME_NS, FIELD_SAME_NS = 250_000_000, 115_000_000  # [ns]
LEAK = "Leak Detected"  # text of the board
LEAK_HOLDS_NS = 45 * S  # [ns] it is said every 20 s; one may be lost


class BoardMeasurements:
    def __init__(self, settings: Settings, clock: BoardClock, outbox: DriverOutbox) -> None:
        self._settings, self._clock, self._outbox = settings, clock, outbox
        self._battery = readings.BatteryMeter()
        self._leak_ns: Ns | None = None
        self.enclosure: float | None = None  # [°C] inside, newest
        self.water: float | None = None  # [°C] newest
        self.forget()

    def forget(self) -> None:
        """Another board, or the same one rebooted: nothing is granted, and its clock is another."""
        self._streams = TelemetryStreams(
            self._settings.board,
            [
                TelemetryStream(readings.IMU_MESSAGES, topics.IMU.hz),
                TelemetryStream((readings.PRESSURE_MESSAGE,), self._settings.pressure_rate),
                TelemetryStream((readings.BATTERY_MESSAGE,), topics.BATTERY.hz),
                TelemetryStream((readings.ENCLOSURE_MESSAGE,), readings.ENCLOSURE_HZ),
            ],
        )
        self._stamps: dict[str, Ns] = {}
        self._pressures = readings.BoardUpdates(
            round(self._settings.pressure_age * S), PRESSURE_SAME_NS
        )
        self._fields = readings.BoardUpdates(round(self._settings.compass_age * S), FIELD_SAME_NS)
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
        if name == readings.BATTERY_MESSAGE:
            self._keep(self._battery.sample(fields, now), name)
            return True
        if name == readings.ENCLOSURE_MESSAGE:
            self.enclosure = fields["temperature"] / 100.0
            return True
        board = readings.stamp_of(fields)
        if board is None:
            return True
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
        if name == readings.PRESSURE_MESSAGE:
            measured = self._pressures.measured_at(fields["press_abs"], stamp)
            if measured is not None:
                sample = readings.pressure(fields, measured)
                self.water = None if sample is None else sample.temperature
                self._keep(sample, name)
        else:
            measured = self._fields.measured_at(readings.field_of(fields), stamp)
            if measured is not None:
                self._keep(readings.magnetometer(name, fields, measured), name)
            self._keep(readings.imu(name, fields, stamp), name)  # last: it triggers estimation

    def _keep(self, sample: Message | None, name: str) -> None:
        if sample is None:
            self._outbox.tell(events.IMPLAUSIBLE(name.lower()))
        else:
            self._outbox.samples.append(sample)
