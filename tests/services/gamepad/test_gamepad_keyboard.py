"""The keyboard's window, fed with key events under SDL's dummy video driver."""

import re
from collections.abc import Iterator

import pytest

from messages.events import Outbox
from services.gamepad.core import StickGain
from services.gamepad.io import sdl
from services.piloting.keys import KEYS
from services.piloting.pilot_intents import Held, Press
from services.piloting.sticks import CENTRED, StickReading, Sticks
from services.runtime.config.errors import LindyError

sdl.load()

import pygame  # noqa: E402

from services.gamepad.io.keyboard import Keyboard  # noqa: E402

MS = 1_000_000  # [ns]


@pytest.fixture
def outbox() -> Outbox:
    return Outbox()


@pytest.fixture
def keyboard(monkeypatch: pytest.MonkeyPatch, outbox: Outbox) -> Iterator[Keyboard]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    keyboard = Keyboard(StickGain(), outbox)
    keyboard.read(0, None)  # what the window says when it opens
    yield keyboard
    keyboard.close()


def press(keyboard: Keyboard, *keys: int) -> StickReading:
    for key in keys:
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, scancode=key, mod=0))
    return keyboard.read(0, None)


def release(keyboard: Keyboard, *keys: int) -> StickReading:
    for key in keys:
        pygame.event.post(pygame.event.Event(pygame.KEYUP, scancode=key))
    return keyboard.read(0, None)


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        ("W", Sticks(surge=0.6)), ("S", Sticks(surge=-0.6)),
        ("D", Sticks(sway=0.6)), ("A", Sticks(sway=-0.6)),
        ("DOWN", Sticks(heave=0.6)), ("UP", Sticks(heave=-0.6)),
        ("RIGHT", Sticks(yaw=0.6)), ("LEFT", Sticks(yaw=-0.6)),
        ("R", Sticks(tilt=1.0)), ("F", Sticks(tilt=-1.0)),
        ("G", Sticks(gripper=1.0)), ("B", Sticks(gripper=-1.0)),
    ],
)  # fmt: skip
def test_a_key_acts_while_it_is_down(keyboard: Keyboard, key: str, expected: Sticks):
    """Camera and gripper in full, without a gain, and they do not unrest the hands."""
    code = getattr(pygame, f"KSCAN_{key}")
    assert press(keyboard, code).sticks == expected
    held = keyboard.read(0, None)
    assert held.sticks == expected
    assert held.at_rest == (expected.tilt != 0.0 or expected.gripper != 0.0)
    released = release(keyboard, code)
    assert released.sticks == CENTRED
    assert released.at_rest


def test_shift_boosts_and_c_slows(keyboard: Keyboard):
    assert press(keyboard, pygame.KSCAN_W, pygame.KSCAN_LSHIFT).sticks == Sticks(surge=1.0)
    release(keyboard, pygame.KSCAN_LSHIFT)
    assert press(keyboard, pygame.KSCAN_C).sticks == pytest.approx(Sticks(surge=0.25))


def test_a_request_is_made_once_when_its_key_goes_down(keyboard: Keyboard):
    for key, kind in (("SPACE", "stop"), ("L", "light"), ("J", "light_2"), ("I", "laser")):
        code = getattr(pygame, f"KSCAN_{key}")
        assert press(keyboard, code).presses == (kind,)
        assert keyboard.read(0, None).presses == ()
        assert release(keyboard, code).presses == ()


@pytest.mark.parametrize(
    ("key", "kind"), [(pygame.KSCAN_RETURN, "arm"), (pygame.KSCAN_BACKSPACE, "disarm")]
)
def test_what_is_deliberate_is_held_for_a_second(keyboard: Keyboard, key: int, kind: Press):
    assert press(keyboard, key).presses == ()
    assert keyboard.read(999 * MS, None).presses == ()
    assert keyboard.read(1000 * MS, None).presses == (Held(kind, 0),)
    assert keyboard.read(3000 * MS, None).presses == ()
    release(keyboard, key)
    press(keyboard, key)
    assert release(keyboard, key).presses == ()
    assert keyboard.read(5000 * MS, None).presses == ()


@pytest.mark.parametrize("mod", [pygame.KMOD_LCTRL, pygame.KMOD_RALT, pygame.KMOD_LMETA])
def test_with_ctrl_alt_or_meta_only_a_stop_is_heard(keyboard: Keyboard, mod: int):
    press(keyboard, pygame.KSCAN_D)
    for code in (pygame.KSCAN_W, pygame.KSCAN_L, pygame.KSCAN_SPACE):
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, scancode=code, mod=mod))
    reading = keyboard.read(0, None)
    assert (reading.sticks, reading.presses) == (CENTRED, ("stop",))


def test_no_key_of_the_table_has_two_meanings_or_is_one_that_browsers_own():
    codes = [code for key in KEYS for code in key.codes]
    assert len(set(codes)) == len(codes)
    assert not [code for code in codes if re.match(r"Control|Alt|Meta|OS|F\d|Tab|Escape", code)]


def test_space_never_arms_whatever_was_pressed_before(keyboard: Keyboard):
    press(keyboard, pygame.KSCAN_RETURN)
    for _ in range(3):
        assert press(keyboard, pygame.KSCAN_SPACE).presses == ("stop",)
        assert release(keyboard, pygame.KSCAN_SPACE).presses == ()


def test_losing_the_focus_releases_all_keys_and_the_pilot_stays(keyboard: Keyboard):
    press(keyboard, pygame.KSCAN_W, pygame.KSCAN_LSHIFT, pygame.KSCAN_G)
    pygame.event.post(pygame.event.Event(pygame.WINDOWFOCUSLOST))
    reading = keyboard.read(0, None)
    assert reading.sticks == CENTRED
    assert reading.present
    assert press(keyboard, pygame.KSCAN_W).sticks == Sticks(surge=0.6)  # and shift is not down


def test_keys_held_while_the_window_opens_do_nothing_until_let_go(keyboard: Keyboard):
    """… and a stop always acts."""

    def happened(kind: int, at_ms: int, **more: int) -> StickReading:
        pygame.event.post(pygame.event.Event(kind, {"mod": 0, **more}))
        return keyboard.read(at_ms * MS, None)

    happened(pygame.WINDOWFOCUSGAINED, 0)
    for at_ms in (40, 70, 2000):  # as the system repeats it
        assert happened(pygame.KEYDOWN, at_ms, scancode=pygame.KSCAN_W).sticks == CENTRED
    assert happened(pygame.KEYDOWN, 100, scancode=pygame.KSCAN_RETURN).presses == ()
    assert happened(pygame.KEYDOWN, 110, scancode=pygame.KSCAN_SPACE).presses == ("stop",)
    happened(pygame.KEYUP, 2100, scancode=pygame.KSCAN_W)
    assert happened(pygame.KEYDOWN, 2200, scancode=pygame.KSCAN_W).sticks == Sticks(surge=0.6)


def test_closing_the_window_loses_the_pilot(keyboard: Keyboard, outbox: Outbox):
    press(keyboard, pygame.KSCAN_W)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    closing, later = keyboard.read(20 * MS, None), keyboard.read(60 * MS, None)
    assert not closing.present
    assert outbox.counts == {"closed:keyboard": 1}
    assert later == StickReading(present=False, at_rest=False, age_ms=40.0)


@pytest.mark.parametrize(
    ("display", "sentence"),
    [(None, "there is no display"), (":93", "cannot open the keyboard's window")],
)
def test_without_a_display_the_sentence_says_what_to_do_instead(
    monkeypatch: pytest.MonkeyPatch, display: str | None, sentence: str
):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    if display is not None:
        monkeypatch.setenv("SDL_VIDEODRIVER", "x11")
        monkeypatch.setenv("DISPLAY", display)
    with pytest.raises(LindyError, match=f"{sentence}.*; use a pad or --pilot script:FILE"):
        Keyboard(StickGain(), Outbox())
