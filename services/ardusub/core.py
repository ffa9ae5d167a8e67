"""A board with ArduSub as a pure state machine: packets, thruster commands and time in; packets,
samples and what is to be said out.

What a board must pass before it is listened to is in `introduction`, who has the vehicle in
`authority`, the way of a command in `thrust_path`, that of a measurement in `measurements`.
"""

from collections import deque
from collections.abc import Callable
from typing import Any

from messages.control import ThrusterCommand
from messages.pilot import PilotRequest
from messages.units import Ns
from messages.vehicle import Actuation
from services.ardusub import parameters, readings
from services.ardusub.authority import BoardAuthority, TakenCheckpoint
from services.ardusub.board_clock import BoardClock
from services.ardusub.introduction import BoardIntroduction, Stage
from services.ardusub.measurements import LEAK, BoardMeasurements
from services.ardusub.mixer import MixedSticks
from services.ardusub.outbox import DriverOutbox, DriverOutput
from services.ardusub.packet import (
    ARM_DISARM,
    ARMED_BIT,
    AUTOPILOT,
    SET_INTERVAL,
    MavlinkPacket,
    command,
    heartbeat,
)
from services.ardusub.settings import Settings as Settings
from services.ardusub.thrust_path import ThrustPath
from services.marine.vehicle import Vehicle

S = 1_000_000_000  # [ns]
HEARTBEAT_NS = S
STICKS_NS = 20_000_000  # [ns] the board takes its inputs at 50 Hz
TIMESYNC_NS = S // 5
NEUTRAL_FIRST_NS = S // 5  # [ns] of neutral sticks before arming
PATIENCE_NS = 3 * S  # [ns] before the silence of a board is said
STRANGER_NS = 5 * S  # [ns] for which a stranger is remembered
# All that is looked at of what a board says.
HEARD = ("HEARTBEAT", "AUTOPILOT_VERSION", "PARAM_VALUE", "TIMESYNC", "COMMAND_ACK", "STATUSTEXT",
         *readings.MESSAGES)  # fmt: skip


class ArdusubDriver:
    """Call `take` after each of the others."""

    def __init__(
        self, vehicle: Vehicle, settings: Settings, before: TakenCheckpoint | None = None
    ) -> None:
        """
        Args:
            before: of the process that this one replaces in mid-dive.
        """
        self._settings, self._outbox, clock = settings, DriverOutbox(), BoardClock()
        self._clock = clock
        self._measurements = BoardMeasurements(settings, clock, self._outbox)
        self._introduction = BoardIntroduction(
            vehicle, settings, clock, self._outbox, self._give_up
        )
        self._path = ThrustPath(vehicle, settings, self._outbox)
        self.authority = BoardAuthority(settings.board, round(settings.disarm_after * S), before)
        self._taken: bool | None = None  # as it was remembered last
        self._questions: deque[Ns] = deque(maxlen=16)  # TIMESYNC under way
        self._began: Ns | None = None
        self._now: Ns = 0
        self._due: dict[str, Ns] = {}
        self._stranger: Ns | None = None
        self._garbage = self._is_silent = False
        self._handlers: dict[str, Callable[[dict[str, Any], Ns], None]] = {
            "HEARTBEAT": self._on_heartbeat,
            "AUTOPILOT_VERSION": lambda fields, _: self._introduction.heard_version(fields),
            "PARAM_VALUE": lambda fields, _: self._introduction.heard_parameter(fields),
            "TIMESYNC": self._on_timesync,
            "COMMAND_ACK": self._on_ack,
            "STATUSTEXT": self._on_text,
        }

    def take(self) -> DriverOutput:
        """What there is to send, publish, count and say; it is then forgotten here."""
        taken, self._taken = self._taken, self.authority.taken
        return self._outbox.take(self._taken if self._taken != taken else None)

    @property
    def stage(self) -> Stage:
        return self._introduction.stage

    @property
    def mixed(self) -> MixedSticks:
        """The sticks that are sent at present."""
        return self._path.mixed

    # Commands from above.

    def obey(self, asked: ThrusterCommand, now: Ns) -> None:
        self._wish(self._path.obey(asked, now), now)

    def hear_pilot(self, request: PilotRequest, now: Ns) -> None:
        """A disarm by the pilot is obeyed here too, whatever becomes of the services above."""
        self._wish(self._path.hear(request, now), now)

    def lapse(self, now: Ns) -> None:
        """The very instant after the last command has ended."""
        self._path.lapse(now)
        self._wish(None, now)

    @property
    def ends_ns(self) -> Ns | None:
        """[ns] Last instant of the command in force."""
        return self._path.ends_ns

    def show(self, light: float, tilt: float) -> None:
        """Brightness 0 … 1 and camera tilt [rad], upwards."""
        if self.stage == "accepted" and parameters.is_new(self._introduction.version):
            self._path.light_by_servo(light)
        self._path.show(light, tilt)

    def _wish(self, armed: bool | None, now: Ns) -> None:
        if armed is not None:
            self.authority.wish(armed, now)
        self._mix(now)
        self._send_sticks(now)

    # What the board says.

    def heard_garbage(self, wrong: int, left_out: int = 0) -> None:
        """Bytes and frames that are no MAVLink, and frames of a flood that were not looked at."""
        self._garbage = self._garbage or wrong > 0
        self._outbox.count("malformed:mavlink", wrong)
        self._outbox.count("overflowed:mavlink", left_out)

    def link_lost(self, strangers: int, unsent: int) -> None:
        """Datagrams of others than the board, and packets that could not be sent."""
        self._outbox.count("stranger:mavlink", strangers)
        self._outbox.count("dropped:mavlink", unsent)

    def hear(self, packet: MavlinkPacket, now: Ns) -> None:
        """One packet at its arrival [ns]; whatever is in it."""
        if packet.system == self._settings.system:
            self._meet_stranger(now)
        if (packet.system, packet.component) != (self._settings.board, AUTOPILOT):
            return
        if packet.name in self._handlers:
            self._handlers[packet.name](packet.fields, now)
        elif self.stage == "accepted" and not self._measurements.heard(
            packet.name, packet.fields, now
        ):
            self._jumped(now)

    def _on_heartbeat(self, fields: dict[str, Any], now: Ns) -> None:
        self._introduction.heard_heartbeat(fields)
        armed = bool(fields["base_mode"] & ARMED_BIT)
        self.authority.heartbeat(armed, int(fields["custom_mode"]), now)

    def _on_timesync(self, fields: dict[str, Any], now: Ns) -> None:
        sent, board = int(fields["ts1"]), int(fields["tc1"])
        if board == 0 or sent not in self._questions:
            return
        self._questions.remove(sent)
        if not self._clock.answered(sent, board, now):
            self._jumped(now)
        self._introduction.heard_clock(now)

    def _on_ack(self, fields: dict[str, Any], now: Ns) -> None:
        number, result = int(fields["command"]), int(fields["result"])
        if number == SET_INTERVAL:
            self._measurements.heard_ack(result)
        elif not self.authority.acknowledged(number, result, now):
            self._outbox.count("refused:arm")
            why = self.authority.reason(now) or f"result {result}"
            self._outbox.say("error", f"the board refuses to arm: {why}")

    def _on_text(self, fields: dict[str, Any], now: Ns) -> None:
        text = str(fields["text"])
        if text == LEAK:
            self._measurements.heard_leak(now)
        if int(fields["severity"]) <= 4:
            level = "error" if text == LEAK else "warning"
            self._outbox.say(level, f"the board says: {text}")
        self.authority.text(text, now)

    def _meet_stranger(self, now: Ns) -> None:
        """Somebody else speaks as our system; the board would obey the sticks of both."""
        self._stranger = now
        self._outbox.count("stranger:mavlink")
        self._outbox.say(
            "warning",
            f"somebody else speaks as system {self._settings.system}, and the board would obey "
            f"both; give one of the two another system (ardusub.system and the board's parameter)",
        )

    def _jumped(self, now: Ns) -> None:
        """The board's clock jumped: most often because it was started anew."""
        self._outbox.count("jumped:board_clock")
        self._outbox.may_repeat()
        self._is_silent = False
        back = self._clock.went_back
        what = (
            "the board was restarted (its clock went back)" if back else "the board's clock jumped"
        )
        self._outbox.say("error", f"{what}; it is checked again: disarm and arm to go on")
        self.disarm()
        self.authority.rebooted()
        self._forget_board()
        self._path.rest()
        self._began = now

    def _forget_board(self) -> None:
        self._introduction.forget()
        self._measurements.forget()

    def _give_up(self) -> None:
        """The board is about to be refused."""
        if self.authority.ours:
            self.disarm()
            self.authority.rebooted()

    # What it knows.

    @property
    def enclosure(self) -> float | None:
        """[°C] Inside, newest."""
        return self._measurements.enclosure

    def wet(self, now: Ns) -> bool | None:
        """Was a leak said lately? None: nobody is there to say it."""
        if self.stage != "accepted" or not self.authority.heard(now):
            return None
        return self._measurements.leaked(now)

    def actuation(self, now: Ns) -> Actuation:
        return self._path.actuation(now, self._measurements.power)

    # Time.

    def tick(self, now: Ns) -> None:
        """Everything that is due at `now` [ns]; at least a hundred times a second."""
        self._now = now
        if self._began is None:
            self._began = now
        if self._introduction.may_begin_again(now):
            self._forget_board()
        if self._is_due("heartbeat", HEARTBEAT_NS, now):
            self._outbox.send(heartbeat())
        self._watch(now)
        if self.stage in ("clock", "accepted") and self._is_due("timesync", TIMESYNC_NS, now):
            self._questions.append(now)
            self._outbox.send(MavlinkPacket("TIMESYNC", {"tc1": 0, "ts1": now}))
        self._introduction.ask(now)
        if self.stage == "accepted":
            self._work(now)
        if said := self.authority.to_say(now):
            self._outbox.say("warning", said)
            self._outbox.count("outdone:ardusub")

    def _work(self, now: Ns) -> None:
        self._measurements.ask(now)
        accepted = self._introduction.accepted_ns
        waited = accepted is not None and now - accepted >= NEUTRAL_FIRST_NS
        alone = self._stranger is None or now - self._stranger > STRANGER_NS
        self._outbox.packets += self.authority.due(now, may_arm=waited and alone)
        self._mix(now)
        if self._is_due("sticks", STICKS_NS, now):
            self._send_sticks(now)

    def _watch(self, now: Ns) -> None:
        """Is the board there at all?"""
        if self.authority.heard(now):
            if self._is_silent:
                self._is_silent = False
                for sentence in self._silences:
                    self._outbox.may_repeat(sentence)
            return
        since = self._began if self._began is not None else now
        if now - since < PATIENCE_NS:
            return
        if self._is_due("silence", S, now):  # every second of it is counted
            self._outbox.count("silent:board")
        if self._is_silent:
            return
        self._is_silent = True
        nothing, unreadable = self._silences
        no_mavlink = self._garbage and self.stage == "silent"
        self._outbox.say("error", unreadable if no_mavlink else nothing)

    @property
    def _silences(self) -> tuple[str, str]:
        where = f"ardusub.url {self._settings.url}:"
        return (
            f"{where} no heartbeat of ArduSub arrives",
            f"{where} bytes arrive that are no MAVLink: is the speed of the serial port right?",
        )

    def _mix(self, now: Ns) -> None:
        """From the permitted thrust to the sticks."""
        mixer = self._introduction.mixer if self.authority.flies(now) else None
        self._path.mix(mixer, now, spooled=self.authority.spooled(now))

    def _send_sticks(self, now: Ns) -> None:
        if self.stage != "accepted" or not self.authority.sends_sticks:
            return
        self._due["sticks"] = now + STICKS_NS
        lights = not parameters.is_new(self._introduction.version)
        self._outbox.send(self._path.sticks(lights=lights))

    def disarm(self) -> None:
        """The service ends in order: neutral, and disarmed if it was armed by Lindy."""
        if self.authority.ours and not self.authority.taken:
            self._path.rest()
            self._send_sticks(self._now)
            self._outbox.send(command(self._settings.board, ARM_DISARM, 0))

    def _is_due(self, what: str, period: Ns, now: Ns) -> bool:
        if now < self._due.get(what, now):
            return False
        self._due[what] = now + period
        return True
