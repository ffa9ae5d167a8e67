"""A board with ArduSub as a pure state machine: packets, thruster commands and time in; packets,
samples and what is to be said out.

What a board must pass before it is listened to is in `board_check`, who has the vehicle in
`authority`, the way of a command in `commands`, that of a measurement in `telemetry`.
"""

from collections import deque
from collections.abc import Callable
from typing import Any

from messages import events
from messages.control import ThrusterCommand
from messages.events import Outbox
from messages.pilot import PilotRequest
from messages.units import Ns, Outputs
from messages.vehicle import Actuation, VehicleStatus
from services.ardusub import board_check, telemetry
from services.ardusub.authority import BoardAuthority, TakenCheckpoint
from services.ardusub.board_check import BoardIntroduction, Stage
from services.ardusub.commands import BoardServos, ThrustPath
from services.ardusub.settings import DriverOutbox, DriverOutput
from services.ardusub.settings import Settings as Settings
from services.ardusub.telemetry import LEAK, BoardClock, BoardMeasurements
from services.marine.outputs import LIGHT, driven
from services.marine.vehicle import Vehicle
from services.mavlink_io.packet import (
    AUTOPILOT,
    MavCommand,
    MavlinkPacket,
    MavModeFlag,
    command,
    heartbeat,
)

S = 1_000_000_000  # [ns]
HEARTBEAT_NS = S
STICKS_NS = 20_000_000  # [ns] the board takes its inputs at 50 Hz
TIMESYNC_NS = S // 5
NEUTRAL_FIRST_NS = S // 5  # [ns] of neutral sticks before arming
PATIENCE_NS = 3 * S  # [ns] before the silence of a board is said
STRANGER_NS = 5 * S  # [ns] for which a stranger is remembered
# All that is looked at of what a board says.
HEARD = ("HEARTBEAT", "AUTOPILOT_VERSION", "PARAM_VALUE", "TIMESYNC", "COMMAND_ACK", "STATUSTEXT",
         *telemetry.MESSAGES)  # fmt: skip


class ArdusubDriver:
    """Call `take` after each of the others."""

    def __init__(
        self,
        vehicle: Vehicle,
        settings: Settings,
        outbox: Outbox,
        before: TakenCheckpoint | None = None,
    ) -> None:
        """
        Args:
            outbox: is told of events.
            before: of the process that this one replaces in mid-dive.
        """
        self._settings, self._outbox, clock = settings, DriverOutbox(outbox), BoardClock()
        self._clock = clock
        self.measurements = BoardMeasurements(settings, clock, self._outbox)
        self.introduction = BoardIntroduction(vehicle, settings, clock, self._outbox, self._give_up)
        self.path = ThrustPath(vehicle, settings, self._outbox)
        self._outputs = vehicle.output
        self._servos = BoardServos(vehicle.output, settings, self._outbox)
        self._status: VehicleStatus | None = None  # newest heard
        self.authority = BoardAuthority(settings.board, round(settings.disarm_after * S), before)
        self._taken: bool | None = None  # as it was remembered last
        self._questions: deque[Ns] = deque(maxlen=16)  # TIMESYNC under way
        self._began: Ns | None = None
        self._now: Ns = 0
        self._due: dict[str, Ns] = {}
        self._stranger: Ns | None = None
        self._text = telemetry.LongText()
        self._silence = ""  # what is said of it
        self._handlers: dict[str, Callable[[dict[str, Any], Ns], None]] = {
            "HEARTBEAT": self._on_heartbeat,
            "AUTOPILOT_VERSION": lambda fields, _: self.introduction.heard_version(fields),
            "PARAM_VALUE": lambda fields, _: self.introduction.heard_parameter(fields),
            "TIMESYNC": self._on_timesync,
            "COMMAND_ACK": self._on_ack,
            "STATUSTEXT": self._on_text,
        }

    def take(self) -> DriverOutput:
        """What there is to send, publish and remember; it is then forgotten here."""
        taken, self._taken = self._taken, self.authority.taken
        return self._outbox.take(self._taken if self._taken != taken else None)

    @property
    def stage(self) -> Stage:
        return self.introduction.stage

    # Commands from above.

    def obey(self, asked: ThrusterCommand, now: Ns) -> None:
        self._wish(self.path.obey(asked, now), now)

    def hear_pilot(self, request: PilotRequest, now: Ns) -> None:
        """A disarm by the pilot is obeyed here too, whatever becomes of the services above."""
        self._wish(self.path.hear(request, now), now)

    def lapse(self, now: Ns) -> None:
        """The very instant after the last command has ended."""
        self.path.gate.lapse(now)
        self._wish(None, now)

    def show(self, status: VehicleStatus | None, tilt: float) -> None:
        """The newest status, for lights and switches, and camera tilt [rad], upwards."""
        self._status = status
        self.path.show(self._values(self._now).get(LIGHT, 0.0), tilt)

    def _values(self, now: Ns) -> Outputs:
        return driven(self._outputs, self._status, self.path.gate.gripper(now), now)

    def _set_servos(self, now: Ns) -> None:
        if self.stage == "accepted":
            lights = not board_check.is_new(self.introduction.version)
            self._servos.due(self._values(now), now, lights=lights)

    def _wish(self, armed: bool | None, now: Ns) -> None:
        if armed is not None:
            self.authority.wish(armed, now)
        self._mix(now)
        self._send_sticks(now)
        self._set_servos(now)

    # What the board says.

    def hear(self, packet: MavlinkPacket, now: Ns) -> None:
        """One packet at its arrival [ns]; whatever is in it."""
        if packet.system == self._settings.system:
            self._meet_stranger(now)
        if (packet.system, packet.component) != (self._settings.board, AUTOPILOT):
            return
        shifts = self._clock.shifts
        if packet.name in self._handlers:
            self._handlers[packet.name](packet.fields, now)
        elif self.stage == "accepted" and not self.measurements.heard(
            packet.name, packet.fields, now
        ):
            self._jumped(now)
        if self._clock.shifts > shifts:
            self._outbox.tell(events.SHIFTED_BOARD_CLOCK())

    def _on_heartbeat(self, fields: dict[str, Any], now: Ns) -> None:
        self.introduction.heard_heartbeat(fields)
        armed = bool(fields["base_mode"] & MavModeFlag.SAFETY_ARMED)
        self.authority.heartbeat(armed, int(fields["custom_mode"]), now)

    def _on_timesync(self, fields: dict[str, Any], now: Ns) -> None:
        sent, board = int(fields["ts1"]), int(fields["tc1"])
        if board == 0 or sent not in self._questions:
            return
        self._questions.remove(sent)
        if not self._clock.answered(sent, board, now):
            self._jumped(now)
        self.introduction.heard_clock(now)

    def _on_ack(self, fields: dict[str, Any], now: Ns) -> None:
        # Behind one router, the board's answers to other ground stations arrive here as well.
        to = int(fields.get("target_system") or 0), int(fields.get("target_component") or 0)
        if to[0] not in (0, self._settings.system) or to[1] not in (0, self._settings.component):
            return
        number, result = int(fields["command"]), int(fields["result"])
        if number == MavCommand.SET_MESSAGE_INTERVAL:
            self.measurements.heard_ack(result)
        elif number == MavCommand.DO_SET_SERVO:
            self._servos.acknowledged(result, now)
        elif not self.authority.acknowledged(number, result, now):
            why = self.authority.reason(now) or f"result {result}"
            self._outbox.tell(events.REFUSED_ARM(detail=why))

    def _on_text(self, fields: dict[str, Any], now: Ns) -> None:
        text = self._text.whole(str(fields["text"]), int(fields.get("id") or 0))
        if text is None:
            return
        if text == LEAK:
            self.measurements.heard_leak(now)
        if int(fields["severity"]) <= 4:
            level = "error" if text == LEAK else "warning"
            self._outbox.say(level, f"the board says: {text}")
        self.authority.text(text, now)

    def _meet_stranger(self, now: Ns) -> None:
        """Somebody else speaks as our system; the board would obey the sticks of both."""
        self._stranger = now
        detail = (
            f"as system {self._settings.system}, and it would obey both; give one of the two "
            f"another system (ardusub.system and the board's parameter)"
        )
        self._outbox.tell(events.STRANGER_SYSTEM(detail=detail))

    def _jumped(self, now: Ns) -> None:
        """The board's clock jumped: most often because it was started anew."""
        self._outbox.may_repeat()
        self._silence = ""
        why = "back, so the board was restarted; it" if self._clock.went_back else "the board"
        detail = f"{why} is checked again: disarm and arm to go on"
        self._outbox.tell(events.JUMPED_BOARD_CLOCK(detail=detail))
        self.disarm()
        self.authority.rebooted()
        self._forget_board()
        self.path.rest()
        self._began = now

    def _forget_board(self) -> None:
        self.introduction.forget()
        self.measurements.forget()
        self._servos.forget()

    def _give_up(self) -> None:
        """The board is about to be refused."""
        if self.authority.ours:
            self.disarm()
            self.authority.rebooted()

    # What it knows.

    def wet(self, now: Ns) -> bool | None:
        """Was a leak said lately? None: nobody is there to say it."""
        if self.stage != "accepted" or not self.authority.heard(now):
            return None
        return self.measurements.leaked(now)

    def actuation(self, now: Ns) -> Actuation:
        return self.path.actuation(now, self.measurements.power, self._values(now))

    # Time.

    def tick(self, now: Ns) -> None:
        """Everything that is due at `now` [ns]; at least a hundred times a second."""
        self._now = now
        if self._began is None:
            self._began = now
        if self.introduction.may_begin_again(now):
            self._forget_board()
        if self._is_due("heartbeat", HEARTBEAT_NS, now):
            self._outbox.send(heartbeat())
        self._watch(now)
        if self.stage in ("clock", "accepted") and self._is_due("timesync", TIMESYNC_NS, now):
            self._questions.append(now)
            self._outbox.send(MavlinkPacket("TIMESYNC", {"tc1": 0, "ts1": now}))
        self.introduction.ask(now)
        if self.stage == "accepted":
            self._work(now)
        if said := self.authority.to_say(now):
            self._outbox.tell(events.OUTDONE_ARDUSUB(detail=said))

    def _work(self, now: Ns) -> None:
        self.measurements.ask(now, there=self.authority.heard(now))
        accepted = self.introduction.accepted_ns
        waited = accepted is not None and now - accepted >= NEUTRAL_FIRST_NS
        alone = self._stranger is None or now - self._stranger > STRANGER_NS
        self._outbox.packets += self.authority.due(now, may_arm=waited and alone)
        self._mix(now)
        if self._is_due("sticks", STICKS_NS, now):
            self._send_sticks(now)
        self._set_servos(now)

    def _watch(self, now: Ns) -> None:
        """Is the board there at all?"""
        if self.authority.heard(now):
            self._silence = ""
            self._outbox.may_repeat(events.SILENT_BOARD())
            return
        since = self._began if self._began is not None else now
        if now - since < PATIENCE_NS or not self._is_due("silence", S, now):
            return
        if not self._silence:
            what = "no heartbeat of ArduSub arrives"
            if self.stage == "silent" and self._outbox.counted(events.MALFORMED("mavlink")):
                what = "bytes arrive that are no MAVLink: is the speed of the serial port right?"
            self._silence = f"ardusub.url {self._settings.url}: {what}"
        self._outbox.tell(events.SILENT_BOARD(detail=self._silence))  # every second of it

    def _mix(self, now: Ns) -> None:
        """From the permitted thrust to the sticks."""
        mixer = self.introduction.mixer if self.authority.flies(now) else None
        self.path.mix(mixer, now, spooled=self.authority.spooled(now))

    def _send_sticks(self, now: Ns) -> None:
        if self.stage != "accepted" or not self.authority.sends_sticks:
            return
        self._due["sticks"] = now + STICKS_NS
        lights = not board_check.is_new(self.introduction.version)
        self._outbox.send(self.path.sticks(lights=lights))

    def disarm(self) -> None:
        """The service ends in order: neutral, and disarmed if it was armed by Lindy."""
        if self.authority.ours and not self.authority.taken:
            self.path.rest()
            self._send_sticks(self._now)
            self._servos.rest(self._now)
            self._outbox.send(command(self._settings.board, MavCommand.COMPONENT_ARM_DISARM, 0))

    def _is_due(self, what: str, period: Ns, now: Ns) -> bool:
        if now < self._due.get(what, now):
            return False
        self._due[what] = now + period
        return True
