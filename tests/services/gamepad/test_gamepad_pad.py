"""A real pad as far as SDL can tell: its own virtual joystick, driven through SDL's C interface."""

import ctypes
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar

import pytest

from messages.events import Outbox
from services.gamepad.core import PadProfile
from services.gamepad.io import sdl
from services.piloting.pilot_intents import Held
from services.piloting.sticks import CENTRED, StickReading, Sticks
from services.runtime.config.errors import LindyError

sdl.load()

import pygame  # noqa: E402

from services.gamepad.io.pad import Pad  # noqa: E402

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="finds SDL through /proc")

CONTROLLER, WHEEL = 1, 2  # SDL_JoystickType
MS = 1_000_000  # [ns]
LEFT_Y, RIGHT_X, RIGHT_TRIGGER = 1, 2, 5
B, Y, BACK, START = 1, 3, 4, 6
DPAD_UP = 11


class VirtualJoystick(ctypes.Structure):
    """SDL_VirtualJoystickDesc."""

    _fields_ = (
        *((name, ctypes.c_uint16) for name in (
            "version", "type", "naxes", "nbuttons", "nhats", "vendor_id", "product_id", "padding",
        )),
        ("button_mask", ctypes.c_uint32),
        ("axis_mask", ctypes.c_uint32),
        ("name", ctypes.c_char_p),
        *((name, ctypes.c_void_p) for name in (
            "userdata", "update", "player", "rumble", "triggers", "led", "effect",
        )),
    )  # fmt: skip


class VirtualPad:
    """A pad that a test plugs in, moves and pulls; else it is pulled at the end."""

    plugged: ClassVar[list["VirtualPad"]] = []

    def __init__(self, kind: int = CONTROLLER, name: bytes | None = None) -> None:
        """`name`: None: as SDL calls it."""
        sdl2 = self._sdl2 = _sdl2()
        if name is None:
            index = sdl2.SDL_JoystickAttachVirtual(kind, 6, 21, 0)
        else:
            said = VirtualJoystick(version=1, type=kind, naxes=6, nbuttons=21, name=name)
            index = sdl2.SDL_JoystickAttachVirtualEx(ctypes.byref(said))
        assert index >= 0
        self._joystick = sdl2.SDL_JoystickOpen(index)
        self._id = sdl2.SDL_JoystickInstanceID(self._joystick)
        self.plugged.append(self)

    def axis(self, axis: int, travel: float) -> None:
        value = max(-32768, min(32767, round(travel * 32768)))
        self._sdl2.SDL_JoystickSetVirtualAxis(self._joystick, axis, value)

    def button(self, button: int, *, down: bool = True) -> None:
        self._sdl2.SDL_JoystickSetVirtualButton(self._joystick, button, int(down))

    def pull(self) -> None:
        self.plugged.remove(self)
        self._sdl2.SDL_JoystickClose(self._joystick)
        every = range(self._sdl2.SDL_NumJoysticks())
        [index] = [k for k in every if self._sdl2.SDL_JoystickGetDeviceInstanceID(k) == self._id]
        self._sdl2.SDL_JoystickDetachVirtual(index)


def _sdl2() -> ctypes.CDLL:
    """The SDL that pygame has loaded."""
    maps = Path("/proc/self/maps").read_text().splitlines()
    library = ctypes.CDLL(next(line.split()[-1] for line in maps if "/libSDL2-" in line))
    library.SDL_JoystickOpen.restype = ctypes.c_void_p
    library.SDL_JoystickClose.argtypes = [ctypes.c_void_p]
    library.SDL_JoystickInstanceID.argtypes = [ctypes.c_void_p]
    library.SDL_JoystickSetVirtualAxis.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int16]
    library.SDL_JoystickSetVirtualButton.argtypes = [
        ctypes.c_void_p,
        ctypes.c_int,
        ctypes.c_uint8,
    ]
    return library


class Pilot:
    """Reads the pad every 20 ms."""

    def __init__(self) -> None:
        self.outbox = Outbox()
        self.pad = Pad(PadProfile(), self.outbox)
        self.now = 0

    def read(self) -> StickReading:
        self.now += 20 * MS
        return self.pad.read(self.now, None)

    def lines(self) -> list[str]:
        """Of the log, since the last time."""
        taken = [text for _, text, _ in self.outbox.said]
        self.outbox.said.clear()
        return taken


@pytest.fixture
def pilot(monkeypatch: pytest.MonkeyPatch) -> Iterator[Pilot]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pilot = Pilot()
    yield pilot
    for plugged in VirtualPad.plugged[:]:
        plugged.pull()
    pilot.pad.close()


@pytest.fixture
def first(pilot: Pilot) -> VirtualPad:
    """It is plugged in and was read once."""
    plugged = VirtualPad()
    assert pilot.read().present
    return plugged


def test_a_stick_a_trigger_and_a_button_reach_the_reading(pilot: Pilot, first: VirtualPad):
    first.axis(LEFT_Y, -1.0)
    assert pilot.read().sticks == Sticks(heave=-0.6)
    first.axis(RIGHT_TRIGGER, 1.0)
    assert pilot.read().sticks == Sticks(heave=-1.0)
    first.button(START)
    pressed = [pilot.read().presses for _ in range(60)]
    assert [each for each in pressed if each] == [(Held("arm", 80 * MS),)]  # once, after a second
    assert pressed[50]
    first.button(START, down=False)
    first.button(B)
    first.button(Y)
    assert pilot.read().presses == ("stop", "light")


def test_a_pad_that_was_there_first_is_found(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    sdl.start_events()
    pygame.joystick.init()
    plugged = VirtualPad()
    pilot = Pilot()
    assert pilot.read().present
    assert pilot.pad.name == "gamepad Virtual Controller"
    plugged.pull()
    pilot.read()
    pilot.pad.close()


def test_a_pulled_pad_is_lost_not_centred_and_its_age_grows(pilot: Pilot, first: VirtualPad):
    first.axis(RIGHT_X, 1.0)
    steady = [pilot.read() for _ in range(5)][-1]
    assert steady.sticks.sway == 0.6
    assert steady.age_ms == 0.0  # a still stick is not an old one
    first.pull()
    gone = [pilot.read() for _ in range(3)]
    assert not any(reading.present or reading.at_rest for reading in gone)
    assert all(reading.sticks == CENTRED for reading in gone)
    assert [reading.age_ms for reading in gone] == [20.0, 40.0, 60.0]
    assert pilot.outbox.counts == {"unplugged:pad": 1}
    assert [event for _, _, event in pilot.outbox.said][-1:] == ["unplugged:pad"]


def test_a_pad_plugged_in_again_moves_nothing_until_centred_once(pilot: Pilot, first: VirtualPad):
    first.pull()
    assert not pilot.read().present
    again = VirtualPad()
    again.axis(LEFT_Y, 1.0)
    held = [pilot.read() for _ in range(3)]
    assert all(reading.present and not reading.at_rest for reading in held)
    assert all(reading.sticks == CENTRED for reading in held)
    again.axis(LEFT_Y, 0.0)
    assert pilot.read().at_rest
    again.axis(LEFT_Y, 1.0)
    assert pilot.read().sticks == Sticks(heave=0.6)
    again.pull()
    VirtualPad().axis(LEFT_Y, 1.0)  # between two readings
    assert pilot.read().sticks == CENTRED
    assert pilot.outbox.counts == {"unplugged:pad": 2}


def test_a_d_pad_that_is_held_does_not_make_the_sticks_wait(pilot: Pilot):
    plugged = VirtualPad()
    plugged.button(DPAD_UP)
    assert pilot.read().at_rest
    plugged.axis(LEFT_Y, 1.0)
    assert pilot.read().sticks == Sticks(heave=0.6, tilt=1.0)


def test_until_the_sticks_were_centred_only_stop_and_disarm_are_heard(pilot: Pilot):
    plugged = VirtualPad()
    plugged.axis(LEFT_Y, 1.0)
    assert not pilot.read().at_rest
    for button in (START, Y, B, BACK):
        plugged.button(button)
    assert pilot.read().presses == ("stop",)
    held = [press for _ in range(60) for press in pilot.read().presses]
    assert held == [Held("disarm", 40 * MS)]
    plugged.axis(LEFT_Y, 0.0)  # and start, which was held since before, does nothing
    assert not any(pilot.read().presses for _ in range(60))


@pytest.mark.parametrize("name", [None, b"Another Pad"])
def test_a_second_pad_is_left_alone_while_the_first_is_moved(pilot: Pilot, name: bytes | None):
    first = VirtualPad()
    pilot.read()
    second = VirtualPad(name=name)
    pilot.lines()
    pilot.read()
    assert ("another pad, " if name else "a second ") in pilot.lines()[0]
    second.axis(LEFT_Y, 1.0)
    for button in (START, B, BACK):
        second.button(button)
    for k in range(100):
        first.axis(RIGHT_X, 0.5 + k / 1000)
        reading = pilot.read()
        assert reading.sticks.heave == 0.0
        assert reading.sticks.sway > 0.0
        assert reading.presses == ()
    second.pull()
    assert pilot.read().present


def test_a_pad_back_as_another_device_has_the_sticks_at_once(pilot: Pilot, first: VirtualPad):
    """The system still repeats the last state of the first device: its stick no longer acts."""
    first.axis(LEFT_Y, 0.5)
    assert [pilot.read() for _ in range(50)][-1].sticks.heave > 0.0
    again = VirtualPad()
    assert pilot.read() == StickReading(present=True, at_rest=True, age_ms=0.0)
    assert "has the sticks now" in (said := pilot.lines()[-1])
    assert said.endswith("; centre its sticks once")
    again.axis(RIGHT_X, 1.0)
    again.button(B)
    reading = pilot.read()
    assert (reading.sticks, reading.presses) == (Sticks(sway=0.6), ("stop",))
    first.pull()  # at last
    assert pilot.read().sticks == Sticks(sway=0.6)
    assert pilot.outbox.counts == {}
    for _ in range(20):
        pilot.read()
    held = VirtualPad()  # with a stick in a hand, which must be let go first
    held.axis(LEFT_Y, 0.5)
    kept = [pilot.read() for _ in range(10)]
    assert all(reading.sticks == CENTRED and not reading.at_rest for reading in kept)
    held.axis(LEFT_Y, 0.0)
    pilot.read()
    held.axis(LEFT_Y, 1.0)
    assert pilot.read().sticks == Sticks(heave=0.6)


def test_of_two_pads_of_one_name_the_moved_one_has_the_sticks(pilot: Pilot, first: VirtualPad):
    second = VirtualPad()
    for _ in range(50):
        pilot.read()  # the second one has the sticks, as it came last
    for moved, still in ((first, second), (second, first), (first, second)):
        moved.axis(LEFT_Y, 0.5)
        pilot.read()
        moved.axis(LEFT_Y, 0.0)
        pilot.read()
        moved.axis(LEFT_Y, 1.0)
        assert pilot.read().sticks == Sticks(heave=0.6)
        moved.axis(LEFT_Y, 0.0)
        assert [pilot.read() for _ in range(50)][-1].sticks == CENTRED
        assert still


def test_another_pad_is_taken_when_the_first_is_gone_or_silent(pilot: Pilot, first: VirtualPad):
    other = VirtualPad(name=b"Another Pad")
    for _ in range(100):
        pilot.read()
    assert pilot.pad.name == "gamepad Virtual Controller"
    first.axis(LEFT_Y, 0.5)
    readings = [pilot.read() for _ in range(252)]
    assert pilot.outbox.counts == {"silent:pad": 1}
    assert readings[-1].at_rest
    assert pilot.pad.name == "gamepad Another Pad"
    other.pull()
    pilot.read()
    assert pilot.pad.name == "gamepad Virtual Controller"
    first.pull()
    VirtualPad()
    assert pilot.read().present


def test_a_pad_sdl_does_not_know_is_named_in_one_line(pilot: Pilot):
    pilot.read()
    VirtualPad(WHEEL)
    pilot.lines()
    reading = pilot.read()
    assert not reading.present
    (line,) = pilot.lines()
    assert "SDL_GAMECONTROLLERCONFIG" in line


def test_a_pad_needs_no_display(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "x11")
    monkeypatch.setenv("DISPLAY", ":93")
    pilot = Pilot()
    assert os.environ["SDL_VIDEODRIVER"] == "dummy"
    assert not pilot.read().present
    pilot.pad.close()


def test_a_frozen_pad_is_lost_and_must_be_centred_afterwards(pilot: Pilot, first: VirtualPad):
    first.axis(LEFT_Y, 0.5)
    held = [pilot.read() for _ in range(249)]
    assert all(reading.present and reading.age_ms == 0.0 for reading in held)
    gone = [pilot.read() for _ in range(3)][1:]
    assert not any(reading.present or reading.at_rest for reading in gone)
    assert all(reading.sticks == CENTRED for reading in gone)
    assert [reading.age_ms for reading in gone] == [5000.0, 5020.0]
    assert pilot.outbox.counts == {"silent:pad": 1}
    assert pilot.lines()[-1].endswith("no answer for 5.0 s")
    first.axis(LEFT_Y, 0.7)
    first.button(START)
    first.button(B)
    back = pilot.read()
    assert (back.present, back.sticks, back.presses) == (True, CENTRED, ("stop",))
    assert "answers again" in pilot.lines()[0]
    first.axis(LEFT_Y, 0.0)
    pilot.read()
    first.axis(LEFT_Y, 1.0)
    assert pilot.read().sticks == Sticks(heave=0.6)


def test_a_pad_is_shown_as_it_is_and_its_loss_is_one_sentence(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    from tools.pad.device import Device

    with pytest.raises(LindyError, match="no pad is plugged in"):
        Device()
    sdl.start_events()
    pygame.joystick.init()
    plugged = VirtualPad()
    with Device() as device:
        assert device.name == "Virtual Controller"
        device.read(0.0)
        plugged.axis(RIGHT_X, -1.0)
        plugged.button(B)
        controls = device.read(0.5)
        assert {name for name, value in controls.items() if value} == {"rightx", "b"}
        assert controls["rightx"] <= -1.0
        assert device.events_hz == 2.0
        device.read(2.0)
        assert device.events_hz == 0.0
        plugged.pull()
        with pytest.raises(LindyError, match="Virtual Controller was unplugged"):
            device.read(3.0)
