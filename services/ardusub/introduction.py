"""A board is introduced step by step: heartbeat, version, parameters, clock.

Only one that passed all of them is listened to and may be armed. A refused one is introduced again
after a while: what is wrong may have been put right.
"""

from collections.abc import Callable
from typing import Any, Literal

from messages import events
from messages.units import Ns
from services.ardusub import parameters
from services.ardusub.board_clock import BoardClock
from services.ardusub.mixer import Mixer
from services.ardusub.outbox import DriverOutbox
from services.ardusub.servos import servos_of
from services.ardusub.settings import Settings
from services.marine.outputs import LIGHT
from services.marine.vehicle import Vehicle
from services.mavlink_io.numbers import ARDUPILOT, MESSAGE_IDS, SUBMARINE, MavCommand
from services.mavlink_io.packet import command

S = 1_000_000_000  # [ns]
ASK_NS = S // 2  # [ns] before the version is asked for again
REFUSED_NS = 5 * S  # [ns] before a refused board is checked again
Stage = Literal["silent", "version", "parameters", "clock", "accepted", "refused"]


class BoardIntroduction:
    def __init__(
        self,
        vehicle: Vehicle,
        settings: Settings,
        clock: BoardClock,
        outbox: DriverOutbox,
        end: Callable[[], None],
    ) -> None:
        """
        Args:
            end: called before a board is refused, for it may be armed.

        Raises:
            ValueError: of `servos_of`.
        """
        self._vehicle, self._settings, self._clock = vehicle, settings, clock
        self._servos = servos_of(vehicle.output, settings, len(vehicle.thruster))
        self._outbox, self._end = outbox, end
        self._now: Ns = 0
        self._again_ns: Ns = 0  # a refused board is checked
        self.forget()

    def forget(self) -> None:
        self.stage: Stage = "silent"
        self.version: tuple[int, int] = (0, 0)
        self.mixer: Mixer | None = None
        self.accepted_ns: Ns | None = None
        self._asked_ns: Ns | None = None  # for the version
        self._reader = parameters.ParameterReader(self._settings.board, [])

    def may_begin_again(self, now: Ns) -> bool:
        """Has it been refused for long enough?"""
        self._now = now
        return self.stage == "refused" and now >= self._again_ns

    def ask(self, now: Ns) -> None:
        """Send what is due now."""
        if self.stage == "version" and (self._asked_ns is None or now - self._asked_ns >= ASK_NS):
            self._asked_ns = now
            wanted = MESSAGE_IDS["AUTOPILOT_VERSION"]
            self._outbox.send(command(self._settings.board, MavCommand.REQUEST_MESSAGE, wanted))
        if self.stage == "parameters":
            self._outbox.packets += self._reader.due(now)
            if self._reader.complete:  # without those that are optional
                self._check()
            for name in self._reader.given_up:
                what = "could not be set" if name in self._reader.to_set else "is not answered"
                self.refuse(f"{name} {what}")

    def refuse(self, why: str) -> None:
        self._end()
        self.stage = "refused"
        self._again_ns = self._now + REFUSED_NS
        self._outbox.tell(events.REFUSED_BOARD(detail=why))

    # What the board says.

    def heard_heartbeat(self, fields: dict[str, Any]) -> None:
        kind, autopilot = fields["type"], fields["autopilot"]
        if autopilot != ARDUPILOT:
            self.refuse(f"its autopilot is {autopilot}; allowed: 3 (ArduPilot)")
        elif kind != SUBMARINE:
            self.refuse(f"it flies a vehicle of type {kind}; allowed: 12 (submarine)")
        elif self.stage == "silent":
            self.stage = "version"

    def heard_version(self, fields: dict[str, Any]) -> None:
        if self.stage != "version":
            return
        packed = int(fields["flight_sw_version"])
        self.version = packed >> 24 & 0xFF, packed >> 16 & 0xFF
        if self.version < parameters.OLDEST:
            found = ".".join(map(str, self.version))
            self.refuse(f"it has ArduSub {found}; allowed: 4.5 and newer")
            return
        self.stage = "parameters"
        self._reader.wanted = parameters.names(self.version, len(self._vehicle.thruster))
        functions = (f"SERVO{servo}_FUNCTION" for servo in self._servos.values())
        self._reader.optional = (
            *parameters.optional(self.version), *parameters.ADVISED, *functions
        )  # fmt: skip

    def heard_parameter(self, fields: dict[str, Any]) -> None:
        name, value = fields["param_id"], float(fields["param_value"])
        if self.stage == "accepted" and self._has_changed(name, value):
            self._reader.heard(name, value)
            self._check()
        if self.stage != "parameters":
            return
        self._reader.heard(name, value)
        if (most := self._settings.set_pilot_timeout) is not None:
            self._reader.lower("FS_PILOT_TIMEOUT", most)
        if self._reader.complete:
            self._check()

    def heard_clock(self, now: Ns) -> None:
        """The board answered a question for its time."""
        if self.stage != "clock" or not self._clock.known:
            return
        self.stage, self.accepted_ns = "accepted", now
        version = ".".join(map(str, self.version))
        bound = self._clock.bound_ns / 1e6
        self._outbox.say(
            "info", f"ArduSub {version} accepted; its clock is known to {bound:.1f} ms"
        )
        for output in self._vehicle.output:
            channel = output.name == LIGHT and not parameters.is_new(self.version)
            if not channel and output.name not in self._servos:
                text = f"output {output.name} has no servo in the vehicle file: it does nothing"
                self._outbox.say("info", text)

    def _has_changed(self, name: str, value: float) -> bool:
        """Somebody set a parameter since it was checked."""
        return abs(self._reader.values.get(name, value) - value) > parameters.EXACT

    def _check(self) -> None:
        values = self._reader.values
        wrong = parameters.problems(values, self.version, self._settings, self._vehicle)
        wrong += parameters.moved_motors(values, self._servos)
        if wrong:
            for sentence in wrong:
                self.refuse(sentence)
            return
        for sentence in parameters.advice(values):
            self._outbox.say("warning", sentence)
        self.mixer = parameters.mixer_of(values, self._vehicle)
        self.stage = "accepted" if self.stage == "accepted" else "clock"
