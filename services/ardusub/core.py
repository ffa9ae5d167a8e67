"""A board with ArduSub as a pure state machine: packets, thruster commands and time in; packets,
samples and what is to be said out.

It is introduced step by step: heartbeat, version, parameters, clock. Only a board that passed all
of them is listened to and may be armed. A board that reboots is introduced again.
"""

from collections import deque
from collections.abc import Callable
from typing import Any, Literal, NamedTuple

from messages import topics
from messages.control import ThrusterCommand
from messages.message import Message
from messages.pilot import PilotRequest
from messages.units import Ns
from messages.vehicle import Actuation
from services.ardusub import parameters, readings
from services.ardusub.authority import BoardAuthority, TakenCheckpoint
from services.ardusub.board_clock import BoardClock
from services.ardusub.mixer import Mixer, at_rest
from services.ardusub.packet import (
    ARDUPILOTMEGA,
    ARM_DISARM,
    ARMED_BIT,
    AUTOPILOT,
    REQUEST_MESSAGE,
    SET_INTERVAL,
    SET_SERVO,
    SUBMARINE,
    UNUSED,
    MavlinkPacket,
    command,
    heartbeat,
)
from services.ardusub.pressure_updates import PressureUpdates
from services.ardusub.rc_channels import NEUTRAL
from services.ardusub.settings import Settings as Settings
from services.ardusub.streams import TelemetryStream, TelemetryStreams
from services.marine.vehicle import Vehicle
from services.vehicle.actuation import OpenLoopThrust
from services.vehicle.actuator_gate import ActuatorGate

S = 1_000_000_000  # [ns]
HEARTBEAT_NS = S
STICKS_NS = 20_000_000  # [ns] the board takes its inputs at 50 Hz
TIMESYNC_NS = S // 5
ASK_NS = S // 2  # [ns] before the version is asked for again
NEUTRAL_FIRST_NS = S // 5  # [ns] of neutral sticks before arming
PATIENCE_NS = 3 * S  # [ns] before the silence of a board is said
REFUSED_NS = 5 * S  # [ns] before a refused board is checked again
STRANGER_NS = 5 * S  # [ns] for which a stranger is remembered
VERSION_MESSAGE = 148
LEAK = "Leak Detected"
LEAK_HOLDS_NS = 45 * S  # [ns] it is said every 20 s; one may be lost
# All that is looked at of what a board says.
HEARD = ("HEARTBEAT", "AUTOPILOT_VERSION", "PARAM_VALUE", "TIMESYNC", "COMMAND_ACK", "STATUSTEXT",
         *readings.MESSAGES)  # fmt: skip
Level = Literal["info", "warning", "error"]
Stage = Literal["silent", "version", "parameters", "clock", "accepted", "refused"]


class DriverOutput(NamedTuple):
    """What the driver has for others since the last time."""

    packets: list[MavlinkPacket]  # to the board
    samples: list[Message]  # to publish
    events: list[str]  # to count
    lines: list[tuple[Level, str]]  # to log
    taken: bool | None  # to remember, where it has changed


class ArdusubDriver:
    """Call `take` after each of the others."""

    def __init__(
        self, vehicle: Vehicle, settings: Settings, before: TakenCheckpoint | None = None
    ) -> None:
        """
        Args:
            before: of the process that this one replaces in mid-dive.
        """
        self.out: list[MavlinkPacket] = []
        self.samples: list[Message] = []
        self.events: list[str] = []
        self.lines: list[tuple[Level, str]] = []
        self.stage: Stage = "silent"
        self.clock = BoardClock()
        self.authority = BoardAuthority(settings.board, round(settings.disarm_after * S), before)
        self._rest = at_rest(len(vehicle.thruster))
        self.mixed = self._rest
        self._mixed_for: tuple[bool, tuple[float, ...]] | None = None
        self._vehicle, self._settings = vehicle, settings
        self._gate = ActuatorGate(vehicle.thruster)
        self._believed = OpenLoopThrust(vehicle.thruster)
        self._battery = readings.BatteryMeter()
        self._taken: bool | None = None  # as it was remembered last
        self._said: set[str] = set()
        self._questions: deque[Ns] = deque(maxlen=16)  # TIMESYNC under way
        self._began: Ns | None = None
        self._now: Ns = 0
        self._due: dict[str, Ns] = {}
        self._stranger: Ns | None = None
        self._garbage = 0
        self._leak_ns: Ns | None = None
        self.enclosure: float | None = None  # [°C] inside, newest
        self._light, self._tilt = 0.0, 0.0
        self._handlers: dict[str, Callable[[dict[str, Any], Ns], None]] = {
            "HEARTBEAT": self._on_heartbeat,
            "AUTOPILOT_VERSION": self._on_version,
            "PARAM_VALUE": self._on_parameter,
            "TIMESYNC": self._on_timesync,
            "COMMAND_ACK": self._on_ack,
            "STATUSTEXT": self._on_text,
        }
        self._forget_board()

    def take(self) -> DriverOutput:
        """What there is to send, publish, count and say; it is then forgotten here."""
        taken, self._taken = self._taken, self.authority.taken
        changed = self._taken if self._taken != taken else None
        done = DriverOutput(self.out, self.samples, self.events, self.lines, changed)
        self.out, self.samples, self.events, self.lines = [], [], [], []
        return done

    def _forget_board(self) -> None:
        self.stage = "silent"
        self._version: tuple[int, int] = (0, 0)
        self._mixer: Mixer | None = None
        self._accepted_ns: Ns | None = None
        self._reader = parameters.ParameterReader(self._settings.board, [])
        rates = self._settings.pressure_rate
        self._streams = TelemetryStreams(
            self._settings.board,
            [
                TelemetryStream(readings.IMU_MESSAGES, topics.IMU.hz),
                TelemetryStream((readings.PRESSURE_MESSAGE,), rates),
                TelemetryStream((readings.BATTERY_MESSAGE,), topics.BATTERY.hz),
                TelemetryStream((readings.ENCLOSURE_MESSAGE,), readings.ENCLOSURE_HZ),
            ],
        )
        self._stamps: dict[str, Ns] = {}
        self._pressures = PressureUpdates(round(self._settings.pressure_age * S))
        self.clock.forget()

    # Commands from above.

    def obey(self, asked: ThrusterCommand, now: Ns) -> None:
        self.events += self._gate.obey(asked, now)
        if self._gate.command is asked:
            self.authority.wish(self._gate.armed(now), now)
        self._mix(now)
        self._send_sticks(now)

    def hear_pilot(self, request: PilotRequest, now: Ns) -> None:
        """A disarm by the pilot is obeyed here too, whatever becomes of the services above."""
        self.events += self._gate.hear(request, now)
        if self._gate.command is not None and self._gate.ends_ns is not None:
            self.authority.wish(self._gate.armed(now), now)
        self._mix(now)
        self._send_sticks(now)

    def lapse(self, now: Ns) -> None:
        """The very instant after the last command has ended."""
        self.events += self._gate.lapse(now)
        self._mix(now)
        self._send_sticks(now)

    @property
    def ends_ns(self) -> Ns | None:
        """[ns] Last instant of the command in force."""
        return self._gate.ends_ns

    def show(self, light: float, tilt: float) -> None:
        """Brightness 0 … 1 and camera tilt [rad], upwards."""
        if self._version >= parameters.RENAMED and light != self._light:
            self._light_by_servo(light)
        self._light, self._tilt = light, tilt

    # What the board says.

    def heard_garbage(self, wrong: int, left_out: int = 0) -> None:
        """Bytes and frames that are no MAVLink, and frames of a flood that were not looked at."""
        self._garbage += wrong
        self.events += ["malformed:mavlink"] * (wrong > 0) + ["overflowed:mavlink"] * (left_out > 0)

    def link_lost(self, strangers: int, unsent: int) -> None:
        """Datagrams of others than the board, and packets that could not be sent."""
        self.events += ["stranger:mavlink"] * min(strangers, 100)
        self.events += ["dropped:mavlink"] * min(unsent, 100)

    def hear(self, packet: MavlinkPacket, now: Ns) -> None:
        """One packet at its arrival [ns]; whatever is in it."""
        if packet.system == self._settings.system:
            self._meet_stranger(now)
        if (packet.system, packet.component) != (self._settings.board, AUTOPILOT):
            return
        if packet.name in self._handlers:
            self._handlers[packet.name](packet.fields, now)
        elif self.stage == "accepted" and self._streams.counts(packet.name):
            self._measure(packet.name, packet.fields, now)

    def _on_heartbeat(self, fields: dict[str, Any], now: Ns) -> None:
        kind, autopilot = fields["type"], fields["autopilot"]
        if autopilot != ARDUPILOTMEGA:
            self._refuse(f"the board's autopilot is {autopilot}; allowed: 3 (ArduPilot)")
        elif kind != SUBMARINE:
            self._refuse(f"the board flies a vehicle of type {kind}; allowed: 12 (submarine)")
        elif self.stage == "silent":
            self.stage = "version"
        armed = bool(fields["base_mode"] & ARMED_BIT)
        self.authority.heartbeat(armed, int(fields["custom_mode"]), now)

    def _on_version(self, fields: dict[str, Any], _: Ns) -> None:
        if self.stage != "version":
            return
        packed = int(fields["flight_sw_version"])
        self._version = packed >> 24 & 0xFF, packed >> 16 & 0xFF
        if self._version < parameters.OLDEST:
            found = ".".join(map(str, self._version))
            self._refuse(f"the board has ArduSub {found}; allowed: 4.5 and newer")
            return
        self.stage = "parameters"
        self._reader.wanted = parameters.names(self._version, len(self._vehicle.thruster))

    def _on_parameter(self, fields: dict[str, Any], _: Ns) -> None:
        if self.stage == "accepted":
            self._on_change(fields["param_id"], float(fields["param_value"]))
        if self.stage != "parameters":
            return
        self._reader.heard(fields["param_id"], float(fields["param_value"]))
        if (most := self._settings.set_pilot_timeout) is not None:
            self._reader.lower("FS_PILOT_TIMEOUT", most)
        if self._reader.complete:
            self._check()

    def _on_change(self, name: str, value: float) -> None:
        """Somebody set a parameter since it was checked."""
        if abs(self._reader.values.get(name, value) - value) > parameters.EXACT:
            self._reader.heard(name, value)
            self._check()

    def _check(self) -> None:
        values = self._reader.values
        wrong = parameters.problems(values, self._version, self._settings, self._vehicle)
        if wrong:
            for sentence in wrong:
                self._refuse(f"the board is not armed: {sentence}")
            return
        for sentence in parameters.advice(values):
            self._say("warning", sentence)
        self._mixer, self._mixed_for = parameters.mixer_of(values, self._vehicle), None
        self.stage = "accepted" if self.stage == "accepted" else "clock"

    def _on_timesync(self, fields: dict[str, Any], now: Ns) -> None:
        sent, board = int(fields["ts1"]), int(fields["tc1"])
        if board == 0 or sent not in self._questions:
            return
        self._questions.remove(sent)
        if not self.clock.answered(sent, board, now):
            self._jumped(now)
        if self.stage == "clock" and self.clock.known:
            self._accept(now)

    def _accept(self, now: Ns) -> None:
        self.stage, self._accepted_ns = "accepted", now
        version = ".".join(map(str, self._version))
        bound = self.clock.bound_ns / 1e6
        self._say("info", f"ArduSub {version} accepted; its clock is known to {bound:.1f} ms")
        if parameters.is_new(self._version) and self._settings.light_servo is None:
            self._say("info", "the lights of this version need ardusub.light_servo")

    def _on_ack(self, fields: dict[str, Any], now: Ns) -> None:
        number, result = int(fields["command"]), int(fields["result"])
        if number == SET_INTERVAL:
            if (missing := self._streams.heard_ack(result)) is not None:
                self._say("error", f"the board does not give {missing}")
                self.events.append(f"refused:{missing.lower()}")
        elif not self.authority.acknowledged(number, result, now):
            self.events.append("refused:arm")
            why = self.authority.last_text or f"result {result}"
            self._say("error", f"the board refuses to arm: {why}")

    def _on_text(self, fields: dict[str, Any], now: Ns) -> None:
        text = str(fields["text"])
        if text == LEAK:
            self._leak_ns = now
            self.events.append("leak:board")
        if int(fields["severity"]) <= 4:
            self._say("error" if text == LEAK else "warning", f"the board says: {text}")
        self.authority.text(text)

    def _meet_stranger(self, now: Ns) -> None:
        """Somebody else speaks as our system; the board would obey the sticks of both."""
        self._stranger = now
        self.events.append("stranger:mavlink")
        self._say(
            "warning",
            f"somebody else speaks as system {self._settings.system}, and the board would obey "
            f"both; give one of the two another system (ardusub.system and the board's parameter)",
        )

    # Measurements.

    def _measure(self, name: str, fields: dict[str, Any], now: Ns) -> None:
        if name == readings.BATTERY_MESSAGE:
            self._keep(self._battery.sample(fields, now), name)
            return
        if name == readings.ENCLOSURE_MESSAGE:
            self.enclosure = fields["temperature"] / 100.0
            return
        board = readings.stamp_of(fields)
        if board is None:
            return
        shifts = self.clock.shifts
        if not self.clock.heard(board, now):
            self._jumped(now)
            return
        if self.clock.shifts > shifts:
            self.events.append("shifted:board_clock")
        stamp = self.clock.ours(board, now)
        if stamp is None:
            return
        if stamp <= self._stamps.get(name, -(2**62)):
            self.events.append(f"not_newer:{name.lower()}")
            return
        self._stamps[name] = stamp
        if name == readings.PRESSURE_MESSAGE:
            measured = self._pressures.measured_at(fields["press_abs"], stamp)
            if measured is not None:
                self._keep(readings.pressure(fields, measured), name)
        else:
            self._keep(readings.magnetometer(name, fields, stamp), name)
            self._keep(readings.imu(name, fields, stamp), name)  # last: it triggers estimation

    def _keep(self, sample: Message | None, name: str) -> None:
        if sample is None:
            self.events.append(f"implausible:{name.lower()}")
        else:
            self.samples.append(sample)

    def _jumped(self, now: Ns) -> None:
        """The board's clock jumped: most often because it was started anew."""
        self.events.append("jumped:board_clock")
        self._said.clear()
        self._say("error", "the board's clock jumped: it is taken as rebooted, and checked again")
        self.disarm()
        self.authority.rebooted()
        self._forget_board()
        self.mixed = self._rest
        self._began = now

    def wet(self, now: Ns) -> bool | None:
        """Was a leak said lately? None: nobody is there to say it."""
        if self.stage != "accepted" or not self.authority.heard(now):
            return None
        return self._leak_ns is not None and now - self._leak_ns <= LEAK_HOLDS_NS

    def actuation(self, now: Ns) -> Actuation:
        cause = self._gate.command
        return Actuation(
            stamp_ns=now,
            thrust=self._believed.believed(now),
            measured=False,
            actuated_ns=self._gate.obeyed_ns,
            sensor_ns=cause.sensor_ns if cause else None,
            pilot_ns=cause.pilot_ns if cause else None,
            stale=self._gate.ends_ns is None,
            power=self._battery.power,
        )

    # Time.

    def tick(self, now: Ns) -> None:
        """Everything that is due at `now` [ns]; at least a hundred times a second."""
        self._now = now
        if self._began is None:
            self._began = now
        if self.stage == "refused" and now >= self._due["again"]:
            self._forget_board()
        if self._is_due("heartbeat", HEARTBEAT_NS, now):
            self.out.append(heartbeat())
        self._watch(now)
        if self.stage in ("clock", "accepted") and self._is_due("timesync", TIMESYNC_NS, now):
            self._questions.append(now)
            self.out.append(MavlinkPacket("TIMESYNC", {"tc1": 0, "ts1": now}))
        if self.stage == "version" and self._is_due("version", ASK_NS, now):
            self.out.append(command(self._settings.board, REQUEST_MESSAGE, VERSION_MESSAGE))
        if self.stage == "parameters":
            self._ask_parameters(now)
        if self.stage == "accepted":
            self._work(now)
        if self.authority.said:
            self._say("warning", self.authority.said)
            self.events.append("outdone:ardusub")
            self.authority.said = ""

    def _work(self, now: Ns) -> None:
        self.out += self._streams.due(now)
        for name, rate, asked in self._streams.judge(now):
            self.events.append(f"rate:{name.lower()}")
            self._say("warning", f"{name} comes {rate:.1f} times a second; asked for {asked:g}")
        waited = self._accepted_ns is not None and now - self._accepted_ns >= NEUTRAL_FIRST_NS
        alone = self._stranger is None or now - self._stranger > STRANGER_NS
        self.out += self.authority.due(now, may_arm=waited and alone)
        self._mix(now)
        if self._is_due("sticks", STICKS_NS, now):
            self._send_sticks(now)

    def _ask_parameters(self, now: Ns) -> None:
        self.out += self._reader.due(now)
        for name in self._reader.given_up:
            what = "could not be set" if name in self._reader.to_set else "is not answered"
            self._refuse(f"the board is not armed: {name} {what}")

    def _watch(self, now: Ns) -> None:
        """Is the board there at all?"""
        if self.authority.heard(now):
            self._said.discard("silent")
            return
        since = self._began if self._began is not None else now
        if now - since < PATIENCE_NS or "silent" in self._said:
            return
        self._said.add("silent")
        self.events.append("silent:board")
        if self._garbage and self.stage == "silent":
            what = "bytes arrive that are no MAVLink: is the speed of the serial port right?"
        else:
            what = "no heartbeat of ArduSub arrives"
        self.lines.append(("error", f"ardusub.url {self._settings.url}: {what}"))

    def _mix(self, now: Ns) -> None:
        """From the permitted thrust to the sticks."""
        flies, thrust = self.authority.flies(now), self._gate.output(now)
        if (flies, thrust) != self._mixed_for:
            self._mixed_for = flies, thrust
            mixer = self._mixer if flies else None
            self.mixed = self._rest if mixer is None else mixer.mix(thrust)
            if self.mixed.limited:
                self.events.append("saturated:mixer")
        spooled = self.authority.spooled(now)
        self._believed.drive((self.mixed if spooled else self._rest).thrust, now)

    def _send_sticks(self, now: Ns) -> None:
        """All six axes, every time: a channel that is left out would keep its last value."""
        if self.stage != "accepted" or not self.authority.sends_sticks:
            return
        self._due["sticks"] = now + STICKS_NS
        pulses = {f"chan{n}_raw": pulse for n, pulse in enumerate(self.mixed.pulses, 1)}
        self.out.append(
            MavlinkPacket(
                "RC_CHANNELS_OVERRIDE",
                {
                    "target_system": self._settings.board,
                    "target_component": AUTOPILOT,
                    **pulses,
                    "chan7_raw": UNUSED,
                    "chan8_raw": self._tilt_pulse(),
                    "chan9_raw": 0 if parameters.is_new(self._version) else _light(self._light),
                },
            )
        )

    def _tilt_pulse(self) -> int:
        limit = self._settings.tilt_range
        if limit is None:
            return UNUSED
        return round(NEUTRAL + 400.0 * max(-1.0, min(1.0, self._tilt / limit)))

    def _light_by_servo(self, light: float) -> None:
        if self.stage == "accepted" and self._settings.light_servo is not None:
            number = self._settings.light_servo
            self.out.append(command(self._settings.board, SET_SERVO, number, _light(light)))

    def disarm(self) -> None:
        """The service ends in order: neutral, and disarmed if it was armed by Lindy."""
        if self.authority.ours and not self.authority.taken:
            self.mixed = self._rest
            self._send_sticks(self._now)
            self.out.append(command(self._settings.board, ARM_DISARM, 0))

    # Words.

    def _is_due(self, what: str, period: Ns, now: Ns) -> bool:
        if now < self._due.get(what, now):
            return False
        self._due[what] = now + period
        return True

    def _refuse(self, sentence: str) -> None:
        """It is introduced again after a while: what is wrong may have been put right."""
        if self.authority.ours:
            self.disarm()
            self.authority.rebooted()
        self.stage = "refused"
        self._due["again"] = self._now + REFUSED_NS
        self.events.append("refused:board")
        self._say("error", sentence)

    def _say(self, level: Level, sentence: str) -> None:
        """Once, until the board is introduced again or said something else of the kind."""
        if sentence not in self._said:
            self._said.add(sentence)
            self.lines.append((level, sentence))


def _light(share: float) -> int:
    """[µs] For a brightness 0 … 1."""
    return round(1100 + 800 * max(0.0, min(1.0, share)))
