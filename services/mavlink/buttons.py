"""Buttons in MANUAL_CONTROL: what each does is a parameter, BTNn_FUNCTION, as in ArduSub."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from services.marine.outputs import OUTPUTS, Output, meant
from services.mavlink.parameters import BUTTONS, Parameters
from services.piloting.pilot_intents import Intent, ModeIntent, OutputIntent

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
        if function in (LIGHTS2_CYCLE, LIGHTS2_BRIGHTER, LIGHTS2_DIMMER):
            name = meant(self.has, "light_2")
            first = function - LIGHTS2_CYCLE + LIGHTS_CYCLE
            return (
                None
                if name is None
                else OutputIntent(name, self._lit(first, outputs.get(name, 0.0)))
            )
        if function in (RELAY_ON, RELAY_OFF, RELAY_TOGGLE):
            name = meant(self.has, "laser")
            on = None if function == RELAY_TOGGLE else float(function == RELAY_ON)
            return None if name is None else OutputIntent(name, on)
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
