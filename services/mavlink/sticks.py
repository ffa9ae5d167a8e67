"""Stick positions and buttons in MANUAL_CONTROL and RC_CHANNELS_OVERRIDE, of the ground station
that has the sticks. What each button does is a parameter, BTNn_FUNCTION, as in ArduSub."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from messages import events
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.marine.outputs import OUTPUTS, Output, meant
from services.mavlink.parameters import BUTTONS, Parameters
from services.mavlink.pilot import GroundPilot, Reaction
from services.mavlink_io.packet import (
    NO_AXIS,
    NO_CHANNEL,
    GroundStation,
    MavlinkPacket,
    MavSeverity,
)
from services.piloting.guest_pilot import TTL_NS
from services.piloting.pilot_intents import Intent, ModeIntent, OutputIntent
from services.piloting.sticks import Sticks

# [-] so close to the middle a stick counts as centred: pads of ground stations rest beside it, and
# the drone arms with centred sticks only.
DEAD_BAND = 0.03
HALF = 400.0  # [µs] from the middle of a channel to full stick
MIDDLE = 1500.0  # [µs]
DARK, RANGE = 1100.0, 800.0  # [µs] channel of the lights: off, and from there to full brightness
# ArduSub's channels, counted from 1 (ArduSub/radio.cpp).
HEAVE, YAW, SURGE, SWAY, TILT, LIGHT = 3, 4, 5, 6, 8, 9
MOVING = (HEAVE, YAW, SURGE, SWAY)
READ = (*MOVING, TILT, LIGHT)


class StickPacket(NamedTuple):
    """What one packet says."""

    sticks: Sticks
    clipped: bool  # a value was beyond full stick
    light: float | None = None  # [-] 0 … 1; None: it says none
    moves: bool = True  # it says something of the sticks


def manual_control(fields: Mapping[str, Any], gain: float) -> StickPacket:
    """x forward, y right, r clockwise: -1000 … 1000; z upwards: 0 … 1000 with 500 in the middle.
    An axis that is not there is centred.

    Args:
        gain: [-] command at full stick.
    """
    travels = [
        _travel(fields["x"], 0.0, 1000.0),
        _travel(fields["y"], 0.0, 1000.0),
        -_travel(fields["z"], 500.0, 500.0),
        _travel(fields["r"], 0.0, 1000.0),
    ]
    surge, sway, heave, yaw = (gain * _shaped(travel) for travel in travels)
    return StickPacket(Sticks(surge, sway, heave, yaw), any(abs(travel) > 1 for travel in travels))


@dataclass(slots=True)
class Channels:
    """What one ground station has said of each channel with RC_CHANNELS_OVERRIDE: 1100 … 1900 µs. A
    channel that a packet ignores (65535; beyond channel 8 also 0) stays as it was, for as long as
    any stick position counts; one that is released (0; beyond channel 8 65534) is centred."""

    _said: dict[int, tuple[float, Ns]] = field(default_factory=dict[int, tuple[float, Ns]])

    def hear(self, fields: Mapping[str, Any], now: Ns) -> StickPacket | None:
        """None: no channel is known."""
        for number in READ:
            raw = fields[f"chan{number}_raw"]
            if raw == (0 if number <= 8 else NO_CHANNEL - 1):
                self._said.pop(number, None)
            elif raw not in (0, NO_CHANNEL):
                self._said[number] = float(raw), now
        known = {n: us for n, (us, at) in self._said.items() if now - at <= TTL_NS}
        if not known:
            return None
        travel = {n: (known.get(n, MIDDLE) - MIDDLE) / HALF for n in READ}
        sticks = Sticks(
            surge=_shaped(travel[SURGE]),
            sway=_shaped(travel[SWAY]),
            heave=-_shaped(travel[HEAVE]),
            yaw=_shaped(travel[YAW]),
            tilt=_shaped(travel[TILT]),
        )
        lamp = known.get(LIGHT)
        light = None if lamp is None else min(1.0, max(0.0, (lamp - DARK) / RANGE))
        clipped = any(abs(travel[n]) > 1 for n in READ)
        return StickPacket(sticks, clipped, light, moves=not known.keys().isdisjoint(MOVING))

    def tilt(self, now: Ns) -> float:
        """[-] Of the camera, beside MANUAL_CONTROL, which has none."""
        us, at = self._said.get(TILT, (MIDDLE, now))
        return _shaped((us - MIDDLE) / HALF) if now - at <= TTL_NS else 0.0


def lets_go(fields: Mapping[str, Any]) -> bool:
    """Whether a packet releases all sticks."""
    return all(fields[f"chan{number}_raw"] == 0 for number in (*MOVING, TILT))


def _travel(raw: int, middle: float, half: float) -> float:
    return 0.0 if raw == NO_AXIS else (raw - middle) / half


def _shaped(travel: float) -> float:
    """Clipped to ±1, 0 around the middle, and continuous."""
    beyond = (min(abs(travel), 1.0) - DEAD_BAND) / (1.0 - DEAD_BAND)
    return 0.0 if beyond <= 0.0 else beyond if travel > 0.0 else -beyond


# Numbers of libraries/AP_JSButton/AP_JSButton.h in ArduPilot; the others do nothing here.
ARM_TOGGLE, ARM, DISARM = 2, 3, 4
MODES = {
    5: ModeIntent("manual"),
    6: ModeIntent("heading_hold"),
    7: ModeIntent("stabilised"),
    8: ModeIntent("station_keeping"),
    13: ModeIntent("altitude_hold"),
}
TILT_UP, TILT_DOWN = 22, 23
LIGHTS_CYCLE, LIGHTS_BRIGHTER, LIGHTS_DIMMER = 31, 32, 33
LIGHTS2_CYCLE, LIGHTS2_BRIGHTER, LIGHTS2_DIMMER = 34, 35, 36  # the second dimmer
GAIN_TOGGLE, GAIN_UP, GAIN_DOWN = 41, 42, 43
RELAY_ON, RELAY_OFF, RELAY_TOGGLE = 51, 52, 53  # of relay 1: the first switch
SERVO_MIN, SERVO_MAX = 76, 77  # of servo 1, momentary: the gripper closes, opens


class Pressed(NamedTuple):
    """What the buttons of one packet ask for."""

    intents: tuple[Intent, ...] = ()  # of buttons that just went down
    tilt: float = 0.0  # [-] of buttons that are down
    gripper: float = 0.0  # [-] of buttons that are down: + opens
    gain: float = 1.0  # [-] of the sticks, from now on
    light: float | None = None  # [-] to be set; None: as it is


@dataclass(slots=True)
class ButtonReader:
    """Which of them are down, and the gain of the sticks."""

    parameters: Parameters
    has: tuple[Output, ...] = OUTPUTS  # outputs of the vehicle
    gain: float = 0.5  # [-] command at full stick
    _down: int = 0  # bits

    def __post_init__(self) -> None:
        self.gain = self.parameters["JS_GAIN_DEFAULT"]

    def forget(self, down: int) -> None:
        """Another ground station has the sticks now: what is down already was not pressed."""
        self._down = down

    def read(
        self, down: int, *, armed: bool, light: float, outputs: Mapping[str, float]
    ) -> Pressed:
        """
        Args:
            down: a bit for each button.
            light: [-] as it is.
            outputs: [-] the same of all, by name.
        """
        new, self._down = down & ~self._down, down
        held = {self._function(k) for k in range(BUTTONS) if down >> k & 1}
        pressed = [self._function(k) for k in range(BUTTONS) if new >> k & 1]
        intents: list[Intent] = []
        level = light
        for function in pressed:
            if function in (ARM_TOGGLE, ARM, DISARM):
                arms = function == ARM or (function == ARM_TOGGLE and not armed)
                intents.append("arm" if arms else "disarm")
            elif function in MODES:
                intents.append(MODES[function])
            elif (tool := self._tool(function, outputs)) is not None:
                intents.append(tool)
            self._change_gain(function)
            level = self._lit(function, level)
        tilt = float(TILT_UP in held) - float(TILT_DOWN in held)
        gripper = float(SERVO_MAX in held) - float(SERVO_MIN in held)
        lit = None if level == light else level
        return Pressed(tuple(intents), tilt, gripper, self.gain, lit)

    def _tool(self, function: int, outputs: Mapping[str, float]) -> Intent | None:
        """The second light or the lasers; None: another function, or the vehicle has none such."""
        dims = function in (LIGHTS2_CYCLE, LIGHTS2_BRIGHTER, LIGHTS2_DIMMER)
        switches = function in (RELAY_ON, RELAY_OFF, RELAY_TOGGLE)
        if dims and (name := meant(self.has, "light_2")) is not None:
            first = function - LIGHTS2_CYCLE + LIGHTS_CYCLE
            return OutputIntent(name, self._lit(first, outputs.get(name, 0.0)))
        if switches and (name := meant(self.has, "laser")) is not None:
            on = None if function == RELAY_TOGGLE else float(function == RELAY_ON)
            return OutputIntent(name, on)
        return None

    def _function(self, button: int) -> int:
        return round(self.parameters[f"BTN{button}_FUNCTION"])

    def _change_gain(self, function: int) -> None:
        low, high = sorted((self.parameters["JS_GAIN_MIN"], self.parameters["JS_GAIN_MAX"]))
        step = (high - low) / max(1.0, self.parameters["JS_GAIN_STEPS"] - 1.0)
        if function == GAIN_TOGGLE:
            self.gain = low if self.gain > (low + high) / 2 else high
        elif function in (GAIN_UP, GAIN_DOWN):
            change = step if function == GAIN_UP else -step
            self.gain = min(high, max(low, self.gain + change))

    def _lit(self, function: int, light: float) -> float:
        step = 1.0 / self.parameters["JS_LIGHTS_STEPS"]
        if function == LIGHTS_CYCLE:
            return 0.0 if light >= 1.0 else min(1.0, light + step)
        if function == LIGHTS_BRIGHTER:
            return min(1.0, light + step)
        return max(0.0, light - step) if function == LIGHTS_DIMMER else light


SAME_TEXT_NS = 5_000_000_000  # [ns] between two warnings that another one has the sticks


@dataclass(slots=True)
class StickInput:
    pilot: GroundPilot
    buttons: ButtonReader
    status: VehicleStatus | None = None  # newest of the drone
    _channels: Channels = field(default_factory=Channels)  # of who has the sticks
    _lamp: float | None = None  # [-] as RC channel 9 last said
    _warned_ns: Ns | None = None

    def manual_control(self, packet: MavlinkPacket, now: Ns, out: Reaction) -> None:
        holder, gain = self.pilot.holder, self.buttons.gain
        down = int(packet.fields["buttons"]) | int(packet.fields.get("buttons2") or 0) << 16
        if packet.sender != holder.sender:
            self.buttons.forget(down)
            self._channels = Channels()
        said = manual_control(packet.fields, gain)
        said = said._replace(sticks=said.sticks._replace(tilt=self._channels.tilt(now)))
        if not self._steer(packet.sender, said, now, out):
            return
        armed = self.status is not None and self.status.armed
        outputs = {} if self.status is None else self.status.outputs
        light = 0.0 if self.status is None else max(0.0, self.status.light)
        pressed = self.buttons.read(down, armed=armed, light=light, outputs=outputs)
        holder.tilt, holder.gripper = pressed.tilt, pressed.gripper
        self.pilot.press(pressed.intents, now, out)
        if pressed.gain != gain:
            out.say(None, MavSeverity.INFO, f"#Gain is {100 * pressed.gain:.0f}%")
        if pressed.light is not None:
            self._light(pressed.light, out)

    def rc_override(self, packet: MavlinkPacket, now: Ns, out: Reaction) -> None:
        holder = self.pilot.holder
        has_them = packet.sender == holder.sender
        if not has_them:
            self._channels = Channels()
        said = self._channels.hear(packet.fields, now)
        if has_them and lets_go(packet.fields):
            holder.release()
            return
        if said is None:
            return
        if said.moves or not (has_them and holder.fresh(now)):
            if not self._steer(packet.sender, said, now, out):
                return
            holder.tilt = holder.gripper = 0.0
        if said.light not in (None, self._lamp) and self._light(said.light, out):
            self._lamp = said.light

    def _light(self, share: float | None, out: Reaction) -> bool:
        """Ask for a brightness [-] 0 … 1, unless an answer is waited for."""
        free = "light" not in self.pilot.waiting
        out.requests += [self.pilot.request("light", share)] if free else []
        return free

    def _steer(self, station: GroundStation, said: StickPacket, now: Ns, out: Reaction) -> bool:
        if said.clipped:
            self.pilot.pilot.outbox.tell(events.CLAMPED("sticks"))
        if self.pilot.steer(station, said.sticks, now, out):
            return True
        if self._warned_ns is None or now >= self._warned_ns + SAME_TEXT_NS:
            self._warned_ns = now
            text = f"{self.pilot.name} has the sticks: yours are not obeyed"
            out.say(station.link, MavSeverity.WARNING, text)
        return False
