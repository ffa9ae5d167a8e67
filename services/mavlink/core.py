"""The drone as a submarine on MAVLink: what ground stations are told, and what they may ask."""

import ipaddress
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Annotated

import msgspec

from messages import events
from messages.events import Level
from messages.health import LogLine
from messages.pilot import PilotAnswer, PilotRequest
from messages.units import Ns
from messages.vehicle import Failsafe, VehicleStatus
from services.mavlink import commands
from services.mavlink.commands import Ask, Meaning, Refusal, SetStream, Show, TellInterval
from services.mavlink.parameters import Parameters
from services.mavlink.pilot import (
    Addressed,
    GroundPilot,
    GroundStation,
    Reaction,
    ReceivedPacket,
    Texts,
)
from services.mavlink.sticks import ButtonReader, StickInput
from services.mavlink.telemetry import (
    DEFAULT_HZ,
    OFF,
    STREAMS,
    LinkStreams,
    Snapshot,
    made,
    period_ns,
)
from services.mavlink_io.packet import (
    AUTOPILOT,
    FORCE,
    MESSAGE_IDS,
    SET_MODE,
    MavCommand,
    MavlinkPacket,
    MavResult,
    MavSeverity,
)
from services.piloting.pilot import Pilot

Url = Annotated[str, msgspec.Meta(pattern=r"^(udpout|udpin|tcpin):[^:/\s]+:[0-9]{1,5}$")]
Handler = Callable[[ReceivedPacket, Ns, Reaction], None]


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    # udpout sends to a ground station that listens there, as QGroundControl does on 14550; udpin
    # and tcpin wait for ground stations.
    links: Annotated[tuple[Url, ...], msgspec.Meta(min_length=1, max_length=8)] = (
        "udpout:127.0.0.1:14550",
        "tcpin:127.0.0.1:5760",
    )
    system_id: Annotated[int, msgspec.Meta(ge=1, le=254)] = 1  # [-] MAVLink's, of the drone
    insecure: bool = False  # also links that other machines can reach: MAVLink has no keys

    def __post_init__(self) -> None:
        for url in self.links:
            _, host, port = url.split(":")
            if not 0 < int(port) < 65536:
                raise ValueError(f"{url}: the port is not between 1 and 65535")
            if not self.insecure and not _is_local(host):
                raise ValueError(
                    f"{url} goes over the network and MAVLink has no keys: whoever reaches it may "
                    f"fly; set mavlink.insecure = true to allow that"
                )


SEVERITIES: dict[Level, MavSeverity] = {
    "info": MavSeverity.INFO,
    "warning": MavSeverity.WARNING,
    "error": MavSeverity.ERROR,
}


class Submarine:
    """The state machine."""

    def __init__(self, settings: Settings, pilot: Pilot, boot_ns: Ns) -> None:
        self._system = settings.system_id
        self._known = Snapshot(boot_ns, boot_ns, 0)
        self._streams: dict[str, LinkStreams] = {}  # by link
        self._outbox = pilot.outbox
        self._outbox.also = self._overhear
        self._said: deque[tuple[Level, str]] = deque()  # to the log; for all ground stations too
        self._parameters = Parameters(settings.system_id, self._outbox)
        self._pilot = GroundPilot(pilot, events.LOST_STICKS, events.NOT_THE_HOLDER("sticks"))
        self._sticks = StickInput(self._pilot, ButtonReader(self._parameters, pilot.has))
        self._texts = Texts()
        self._failsafe: Failsafe = "none"
        self._handlers: Mapping[str, Handler] = {
            "MANUAL_CONTROL": self._sticks.manual_control,
            "RC_CHANNELS_OVERRIDE": self._sticks.rc_override,
            "COMMAND_LONG": self._command,
            "COMMAND_INT": self._command,
            "SET_MODE": self._set_mode,
            "REQUEST_DATA_STREAM": self._data_stream,
            "PARAM_REQUEST_LIST": lambda p, _n, _o: self._parameters.begin_list(p),
            "PARAM_REQUEST_READ": lambda p, _n, out: self._parameters.answer(p, out),
            "PARAM_SET": self._set_parameter,
        }

    @property
    def gain(self) -> float:
        """[-] Of MANUAL_CONTROL."""
        return self._sticks.buttons.gain

    # From ground stations.

    def received(self, packet: ReceivedPacket, now: Ns) -> Reaction:
        out = Reaction()
        if not self._is_for_us(packet):
            self._outbox.tell(events.WRONG_TARGET("mavlink"))
        elif handler := self._handlers.get(packet.name):
            handler(packet, now, out)
        elif packet.name in commands.ANSWERED:
            if (answer := commands.answer(packet, now)) is not None:
                out.packets.append(Addressed(packet.sender.link, answer))
        elif packet.name not in commands.EXPECTED:
            self._outbox.tell(events.IGNORED("mavlink"))
        return self._finished(out, now)

    def _is_for_us(self, packet: ReceivedPacket) -> bool:
        """Addressed to this system or to all, and not said under its own id."""
        fields = packet.fields
        if packet.sender.system == self._system:
            return False
        if "target" in fields:  # MANUAL_CONTROL is for one vehicle
            return fields["target"] == self._system
        here = fields.get("target_system", 0) in (0, self._system)
        return here and fields.get("target_component", 0) in (0, AUTOPILOT)

    def _command(self, packet: ReceivedPacket, now: Ns, out: Reaction) -> None:
        fields, what = packet.fields, commands.meaning(packet.fields)
        number: int = fields["command"]
        forced = number == MavCommand.COMPONENT_ARM_DISARM and fields["param2"] == FORCE
        if forced and what == Ask("disarm"):
            what = self._emergency_stop(packet.sender, now, out)
        self._do(packet.sender, number, what, now, out)

    def _emergency_stop(self, sender: GroundStation, now: Ns, out: Reaction) -> Ask:
        """A forced disarm disarms for who has the sticks. Anybody else may only stop the drone."""
        if self._pilot.holder.may_take(sender, now):
            return Ask("disarm")
        out.say(sender.link, MavSeverity.WARNING, "stopping: only who has the sticks disarms")
        return Ask("stop")

    def _do(
        self,
        sender: GroundStation,
        number: int,
        what: Meaning,
        now: Ns,
        out: Reaction,
    ) -> None:
        streams, link = self._streams_of(sender.link), sender.link
        match what:
            case Ask(intent):
                self._pilot.ask(sender, number, intent, now, out)
                return
            case Refusal(result, text):
                self._outbox.tell(events.REFUSED_COMMAND())
                if text:
                    out.say(link, MavSeverity.WARNING, text)
            case Show(name):
                packets = self._made(name)
                out.packets += [Addressed(link, packet) for packet in packets]
                result = MavResult.ACCEPTED if packets else MavResult.FAILED
            case SetStream(name, period_us):
                result = self._stream(streams, name, period_us, now)
            case TellInterval(name):
                result = MavResult.ACCEPTED
                period = streams.period(name) if name in DEFAULT_HZ else OFF
                out.send(
                    link,
                    "MESSAGE_INTERVAL",
                    message_id=MESSAGE_IDS[name],
                    interval_us=-1 if period == OFF else period // 1000,
                )
        out.acknowledge(sender, number, result)

    def _stream(self, streams: LinkStreams, name: str, period_us: float, now: Ns) -> MavResult:
        if name not in DEFAULT_HZ:
            return MavResult.UNSUPPORTED  # by request only
        period = round(min(period_us, 1e9) * 1e3) if period_us > 0.0 else OFF
        streams.every(name, period_ns(DEFAULT_HZ[name]) if period_us == 0.0 else period, now)
        return MavResult.ACCEPTED

    def _set_mode(self, packet: ReceivedPacket, now: Ns, out: Reaction) -> None:
        what = commands.mode(packet.fields["base_mode"], packet.fields["custom_mode"])
        self._do(packet.sender, SET_MODE, what, now, out)

    def _data_stream(self, packet: ReceivedPacket, now: Ns, _out: Reaction) -> None:
        fields = packet.fields
        hz = float(fields["req_message_rate"]) if fields["start_stop"] else 0.0
        names = STREAMS.get(fields["req_stream_id"], ())
        if not names:
            self._outbox.tell(events.IGNORED("data_stream"))
        for name in names:
            self._streams_of(packet.sender.link).every(name, period_ns(hz), now)

    def _set_parameter(self, packet: ReceivedPacket, now: Ns, out: Reaction) -> None:
        """Buttons and gain belong to who has the sticks."""
        self._parameters.set(packet, out, is_holder=self._pilot.holder.may_take(packet.sender, now))

    # From the drone.

    def status(self, status: VehicleStatus, now: Ns) -> Reaction:
        out = Reaction()
        self._sticks.status = status
        if status.failsafe not in (self._failsafe, "none"):
            name = events.FAILSAFE_ACTED(status.failsafe).name
            out.say(None, MavSeverity.CRITICAL, f"failsafe: {events.short(name)}")
        self._failsafe = status.failsafe
        self._pilot.follow(status, now, out)
        return self._finished(out, now)

    def log(self, line: LogLine, now: Ns) -> Reaction:
        """Warnings and errors of all services."""
        out = Reaction()
        if line.level != "info":
            out.say(None, SEVERITIES[line.level], f"{line.service}: {line.text}")
        return self._finished(out, now)

    def answered(self, request: PilotRequest, answer: PilotAnswer, now: Ns) -> Reaction:
        out = Reaction()
        self._pilot.answered(request, answer, now, out)
        return self._finished(out, now)

    def given_up(self, request: PilotRequest, now: Ns) -> Reaction:
        out = Reaction()
        self._pilot.given_up(request, now, out)
        return self._finished(out, now)

    # Regularly.

    def tick(self, links: Iterable[str], known: Snapshot, now: Ns) -> Reaction:
        """What is due on each link."""
        out, self._known = Reaction(), known
        self._sticks.status = known.status
        self._pilot.tick(now, out)
        self._parameters.tick(out)
        known_of: dict[str, list[MavlinkPacket]] = {}  # packets, by the message's name
        present = set(links)
        for gone in self._streams.keys() - present:
            del self._streams[gone]
            self._parameters.forget(gone)
        for link in present:
            for name in self._streams_of(link).due(now):
                if name not in known_of:
                    known_of[name] = made(name, known)
                out.packets += [Addressed(link, packet) for packet in known_of[name]]
        return self._finished(out, now)

    def _streams_of(self, link: str) -> LinkStreams:
        return self._streams.setdefault(link, LinkStreams())

    def _made(self, name: str) -> list[MavlinkPacket]:
        if name in commands.ASKED_FOR:
            return [commands.ASKED_FOR[name]()]
        return made(name, self._known)

    def _finished(self, out: Reaction, now: Ns) -> Reaction:
        while self._said:
            level, text = self._said.popleft()
            out.say(None, SEVERITIES[level], text)
        self._texts.pack(out, self._outbox, now)
        return out

    def _overhear(self, level: Level, text: str, _name: str) -> None:
        self._said.append((level, text))


def _is_local(host: str) -> bool:
    """Can only this machine reach it?"""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
