"""The drone as a submarine on MAVLink: what ground stations are told, and what they may ask."""

import ipaddress
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from math import isfinite
from typing import Annotated

import msgspec

from messages import events
from messages.events import Level
from messages.health import LogLine
from messages.pilot import PilotAnswer, PilotRequest
from messages.units import Ns
from messages.vehicle import Failsafe, VehicleStatus
from services.mavlink import commands
from services.mavlink.parameters import Parameters
from services.mavlink.pilot import (
    Addressed,
    GroundPilot,
    Reaction,
    Texts,
)
from services.mavlink.sticks import ButtonReader, StickInput
from services.mavlink.telemetry import (
    DEFAULT_HZ,
    OFF,
    STREAMS,
    LinkStreams,
    Snapshot,
    choosable,
    made,
    period_ns,
)
from services.mavlink_io.packet import (
    AUTOPILOT,
    FORCE,
    MESSAGE_IDS,
    SET_MODE,
    GroundStation,
    MavCommand,
    MavlinkPacket,
    MavResult,
    MavSeverity,
)
from services.piloting.pilot import Pilot
from services.piloting.pilot_intents import ModeIntent

Url = Annotated[str, msgspec.Meta(pattern=r"^(udpout|udpin|tcpin):[^:/\s]+:[0-9]{1,5}$")]
Handler = Callable[[MavlinkPacket, Ns, Reaction], None]


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

    def received(self, packet: MavlinkPacket, now: Ns) -> Reaction:
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

    def _is_for_us(self, packet: MavlinkPacket) -> bool:
        """Addressed to this system or to all, and not said under its own id."""
        fields = packet.fields
        if packet.sender.system == self._system:
            return False
        if "target" in fields:  # MANUAL_CONTROL is for one vehicle
            return fields["target"] == self._system
        here = fields.get("target_system", 0) in (0, self._system)
        return here and fields.get("target_component", 0) in (0, AUTOPILOT)

    def _command(self, packet: MavlinkPacket, now: Ns, out: Reaction) -> None:
        """COMMAND_LONG or COMMAND_INT: acknowledged at once, or once the drone has answered."""
        number = int(packet.fields["command"])
        out.acknowledge(packet.sender, number, self._obeyed(packet, number, now, out))

    def _obeyed(
        self, packet: MavlinkPacket, number: int, now: Ns, out: Reaction
    ) -> MavResult | None:
        """None: the drone decides."""
        sender = packet.sender
        first, second = float(packet.fields["param1"]), float(packet.fields["param2"])
        match number:
            case MavCommand.COMPONENT_ARM_DISARM:
                return self._arm(sender, first, second, now, out)
            case MavCommand.DO_SET_MODE:
                base = int(first) if isfinite(first) else 0
                return self._choose_mode(sender, number, base, second, now, out)
            case MavCommand.DO_PAUSE_CONTINUE if first == 0.0:
                return self._pilot.ask(sender, number, "stop", now, out)
            case MavCommand.NAV_RETURN_TO_LAUNCH:
                return self._pilot.ask(sender, number, "home", now, out)
            case MavCommand.SET_MESSAGE_INTERVAL if name := commands.message_named(first):
                return self._set_interval(sender, name, second, now, out)
            case MavCommand.GET_MESSAGE_INTERVAL if name := commands.message_named(first):
                return self._tell_interval(sender, name, out)
            case _ if name := commands.message_asked(number, first):
                return self._show(sender, name, out)
            case _ if why := commands.REFUSED.get(number):  # type: ignore[call-overload]
                return self._refuse(sender, MavResult.DENIED, out, why)
            case _:
                return self._refuse(sender, MavResult.UNSUPPORTED, out)

    def _refuse(
        self, sender: GroundStation, result: MavResult, out: Reaction, why: str = ""
    ) -> MavResult:
        """`why`: for people."""
        self._outbox.tell(events.REFUSED_COMMAND())
        if why:
            out.say(sender.link, MavSeverity.WARNING, why)
        return result

    def _arm(
        self, sender: GroundStation, arm: float, force: float, now: Ns, out: Reaction
    ) -> MavResult | None:
        """What forbids arming cannot be forced, and disarming needs no force: a forced disarm
        disarms for who has the sticks. Anybody else may only stop the drone."""
        number = MavCommand.COMPONENT_ARM_DISARM
        if arm == 1.0 and force == FORCE:
            why = "arming cannot be forced: see why it is refused"
            return self._refuse(sender, MavResult.DENIED, out, why)
        if arm not in (0.0, 1.0):
            return self._refuse(sender, MavResult.DENIED, out, "arm with 1, disarm with 0")
        if arm == 0.0 and force == FORCE and not self._pilot.holder.may_take(sender, now):
            out.say(sender.link, MavSeverity.WARNING, "stopping: only who has the sticks disarms")
            return self._pilot.ask(sender, number, "stop", now, out)
        return self._pilot.ask(sender, number, "arm" if arm else "disarm", now, out)

    def _choose_mode(
        self, sender: GroundStation, number: int, base: int, custom: float, now: Ns, out: Reaction
    ) -> MavResult | None:
        """DO_SET_MODE, and the message SET_MODE."""
        if (mode := commands.flight_mode(base, custom)) is not None:
            return self._pilot.ask(sender, number, ModeIntent(mode), now, out)
        why = f"no such mode here; there are {choosable()}"
        return self._refuse(sender, MavResult.FAILED, out, why)

    def _set_mode(self, packet: MavlinkPacket, now: Ns, out: Reaction) -> None:
        base, custom = packet.fields["base_mode"], packet.fields["custom_mode"]
        result = self._choose_mode(packet.sender, SET_MODE, base, custom, now, out)
        out.acknowledge(packet.sender, SET_MODE, result)

    def _show(self, sender: GroundStation, name: str, out: Reaction) -> MavResult:
        """Send a message once."""
        packets = made(name, self._known)
        out.packets += [Addressed(sender.link, packet) for packet in packets]
        return MavResult.ACCEPTED if packets else MavResult.FAILED

    def _tell_interval(self, sender: GroundStation, name: str, out: Reaction) -> MavResult:
        period = self._streams_of(sender.link).period(name)
        us = -1 if period == OFF else period // 1000
        out.send(sender.link, "MESSAGE_INTERVAL", message_id=MESSAGE_IDS[name], interval_us=us)
        return MavResult.ACCEPTED

    def _set_interval(
        self, sender: GroundStation, name: str, us: float, now: Ns, out: Reaction
    ) -> MavResult:
        """Send a message every so many µs; 0: as by default; negative: never."""
        if not (isfinite(us) and (us >= 0.0 or us == commands.NEVER)):
            why = "an interval is in µs: 0 as by default, -1 never"
            return self._refuse(sender, MavResult.DENIED, out, why)
        period = round(min(us, 1e9) * 1e3) if us > 0.0 else OFF
        period = period_ns(DEFAULT_HZ[name]) if us == 0.0 else period
        self._streams_of(sender.link).every(name, period, now)
        return MavResult.ACCEPTED

    def _data_stream(self, packet: MavlinkPacket, now: Ns, _out: Reaction) -> None:
        fields = packet.fields
        hz = float(fields["req_message_rate"]) if fields["start_stop"] else 0.0
        names = STREAMS.get(fields["req_stream_id"], ())
        if not names:
            self._outbox.tell(events.IGNORED("data_stream"))
        for name in names:
            self._streams_of(packet.sender.link).every(name, period_ns(hz), now)

    def _set_parameter(self, packet: MavlinkPacket, now: Ns, out: Reaction) -> None:
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
        self._pilot.answered(request, answer, now, out := Reaction())
        return self._finished(out, now)

    def given_up(self, request: PilotRequest, now: Ns) -> Reaction:
        self._pilot.given_up(request, now, out := Reaction())
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
