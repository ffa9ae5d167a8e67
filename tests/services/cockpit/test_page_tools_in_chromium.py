"""Lights, lasers, gripper and speed limit on the page, in a real browser. Skipped where there is no
Chromium."""

import pytest

pytest.importorskip("websockets", reason="the extra cockpit is not installed")

from tests.support.docs.chromium import Browser, BrowserPage, Size
from tests.support.page_screen import CONTRAST, FINGER, PILOT, READY, SIZES, UNPRESSED, Served
from tests.support.patience import until

pytestmark = pytest.mark.system
PHONE = Size(844, 390, touch=True)
OPENS, CLOSES = '#tools [data-way="1"]', '#tools [data-way="-1"]'
MANY = [
    ["light", "dimmer", 0.5], ["light_2", "dimmer", 0.0], ["lasers", "switch", 1.0],
    ["gripper", "gripper", 0.0],
]  # fmt: skip
PAD = """
window.pad = { id: 'standard pad', index: 0, connected: true, mapping: 'standard', timestamp: 1,
  axes: [0, 0, 0, 0],
  buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })) };
navigator.getGamepads = () => [window.pad];
"""


def opened(browser: Browser, served: Served, size: Size = PHONE, before: str = "") -> BrowserPage:
    page = served.open(browser, size, before=before)
    page.look("document.getElementById('tools-open').click()")
    served.becomes(page)
    return page


def gripper(served: Served, moves: float) -> None:
    until(lambda: served.stick.gripper == moves)


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size.width}x{size.height}")
def test_every_tool_can_be_pressed_on_every_screen(
    browser: Browser, served: Served, size: Size
) -> None:
    page = opened(browser, served, size)
    for state in ({}, READY):
        served.becomes(page, **state, tools=MANY)
        page.look(FINGER if size.touch else "0")
        assert page.look(UNPRESSED) == "", state
    assert page.look("document.querySelectorAll('#tools button').length") == 7
    page.close()


@pytest.mark.parametrize("theme", ["dark", "bright", "contrast"])
def test_every_text_of_the_tools_can_be_read(browser: Browser, served: Served, theme: str) -> None:
    page = served.open(browser, PHONE, theme)
    page.look("document.getElementById('tools-open').click()")
    for you in (PILOT, {**PILOT, "taken": True, "in_control": False}):
        served.you = dict(you)
        served.becomes(page, tools=MANY)
        contrast, where = page.look(CONTRAST)
        assert contrast >= 4.5, where
    page.close()


def test_a_gripper_moves_while_its_button_is_held_and_not_longer(
    browser: Browser, served: Served
) -> None:
    page = opened(browser, served)
    for button, moves in ((OPENS, 1.0), (CLOSES, -1.0)):
        page.touch("touchStart", page.middle(button))
        gripper(served, moves)
        page.touch("touchEnd")
        gripper(served, 0.0)
    page.touch("touchStart", page.middle(OPENS))
    gripper(served, 1.0)
    page.touch("touchCancel")
    gripper(served, 0.0)
    page.close()


@pytest.mark.parametrize(
    ("ends", "again"),
    [
        ("dispatchEvent(new Event('blur'))", ""),
        ("document.getElementById('tools-open').click()", ""),
        (
            "Object.defineProperty(document, 'hidden', { value: true, configurable: true });"
            "document.dispatchEvent(new Event('visibilitychange'))",
            "delete document.hidden; document.dispatchEvent(new Event('visibilitychange'))",
        ),
    ],
    ids=["blur", "closed", "hidden"],
)
def test_what_is_held_ends_when_the_page_loses_the_pilot(
    browser: Browser, served: Served, ends: str, again: str
) -> None:
    """Although the finger stays where it is; and it does not begin again by itself."""
    page = opened(browser, served)
    page.touch("touchStart", page.middle(OPENS))
    gripper(served, 1.0)
    page.look(f"void ({{}}, (() => {{ {ends} }})())")
    held = len(served.sticks)
    page.look(f"void (() => {{ {again} }})()")
    until(lambda: len(served.sticks) > held + 20)
    assert {each.gripper for each in served.sticks[held + 1 :]} == {0.0}
    page.close()


def test_whoever_loses_the_sticks_holds_nothing(browser: Browser, served: Served) -> None:
    page = opened(browser, served)
    page.touch("touchStart", page.middle(OPENS))
    gripper(served, 1.0)
    served.you = {**PILOT, "in_control": False}
    served.becomes(page)
    gripper(served, 0.0)
    assert page.look("[...document.querySelectorAll('#tools button')].every((b) => b.disabled)")
    page.close()


def test_a_switch_and_a_dimmer_ask_for_what_they_are_not(browser: Browser, served: Served) -> None:
    page = opened(browser, served)
    served.becomes(page, tools=MANY)
    for at in (1, 2, 4):  # lighter, second light darker: it is dark already; lasers
        page.look(f"document.querySelectorAll('#tools button')[{at}].click()")
    until(lambda: len(served.wishes) == 2)
    asked = [(wish.what, wish.output, wish.value) for wish in served.wishes]
    assert asked == [("output", "light", 0.75), ("output", "lasers", 0.0)]
    shown = "document.querySelector('#tools .value[aria-pressed]').textContent"
    assert page.look(shown) == "on"
    served.becomes(page)
    assert page.look(shown) == "off"
    page.close()


def test_keys_and_pad_hold_the_gripper_and_neither_takes_the_sticks_from_a_thumb(
    browser: Browser, served: Served
) -> None:
    page = opened(browser, served, before=PAD)
    page.key("keyDown", "KeyG", "g")
    gripper(served, 1.0)
    assert served.stick.device == "touch"
    page.key("keyUp", "KeyG", "g")
    gripper(served, 0.0)
    page.key("keyDown", "KeyB", "b")
    gripper(served, -1.0)
    page.look("dispatchEvent(new Event('blur'))")
    gripper(served, 0.0)
    page.key("keyUp", "KeyB", "b")
    page.look("void (pad.buttons[5] = { pressed: true, value: 1 }, pad.timestamp++)")
    gripper(served, 1.0)
    page.look("void (navigator.getGamepads = () => [])")
    gripper(served, 0.0)
    page.look("void (pad.buttons[5] = pad.buttons[0], navigator.getGamepads = () => [pad])")
    sent = len(served.sticks)
    until(lambda: len(served.sticks) > sent + 20)  # it is seen with no button down
    page.look("void (pad.buttons[2] = { pressed: true, value: 1 }, pad.timestamp++)")
    page.key("keyDown", "KeyJ", "j")
    until(lambda: {"laser", "light_2"} <= {wish.what for wish in served.wishes})
    page.close()


def test_a_button_that_a_pilot_has_mapped_does_nothing_else(
    browser: Browser, served: Served
) -> None:
    """Also of a map that was stored before there were tools."""
    stored = """try { localStorage.setItem('pads', JSON.stringify({ 'standard pad':
      { ahead: [3, -1], stop: 1, film: 5, tilt_up: 12 } })); } catch {}"""
    page = opened(browser, served, before=PAD + stored)
    page.look("void (pad.buttons[5] = { pressed: true, value: 1 }, pad.timestamp++)")
    sent = len(served.sticks)
    until(lambda: len(served.sticks) > sent + 20)
    assert {each.gripper for each in served.sticks} == {0.0}
    page.close()


def test_a_vehicle_without_outputs_has_no_tools(browser: Browser, served: Served) -> None:
    page = opened(browser, served)
    served.becomes(page, tools=[])
    hidden = "['tools', 'tools-open'].every((id) => document.getElementById(id).hidden)"
    assert page.look(hidden)
    page.close()


@pytest.mark.slow
def test_the_speed_limit_scales_full_stick_is_always_said_and_is_remembered(
    browser: Browser, served: Served
) -> None:
    page = served.open(browser, Size(1366, 768))
    said = "document.getElementById('aids').textContent.match(/speed(\\d+) %/i)?.[1] ?? ''"
    button = "document.getElementById('gain').textContent"
    for percent in ("50", "75", "100", "25"):
        page.wait(f"{button} === 'Speed {percent} %'")
        page.key("keyDown", "KeyW", "w")
        until(lambda wanted=percent: served.stick.surge == float(wanted) / 100.0)
        page.key("keyUp", "KeyW", "w")
        served.becomes(page)
        assert page.look(said) == ("" if percent == "100" else percent)
        if percent != "25":
            page.key("keyDown", "KeyX", "x")
            page.key("keyUp", "KeyX", "x")
    page.look("location.reload()")
    loaded = "document.getElementById('gain')?.textContent === 'Speed 25 %'"
    page.wait(loaded)
    # Whoever takes over is told what was left.
    page.wait("document.getElementById('own')?.textContent.includes('25 %')")
    page.close()


def test_the_speed_limit_scales_touch_sticks_and_pads_too(browser: Browser, served: Served) -> None:
    page = served.open(browser, PHONE, before=PAD)
    page.look(FINGER)
    x, y = page.middle("#left")
    page.touch("touchStart", (x, y))
    page.touch("touchMove", (x, y + 300.0))
    until(lambda: served.stick.heave == 0.5)
    page.touch("touchEnd")
    until(lambda: served.stick.heave == 0.0)
    page.look("void (pad.axes[1] = -1, pad.timestamp++)")
    until(lambda: served.stick.heave == -0.5)
    page.look("void (pad.buttons[7] = { pressed: true, value: 1 }, pad.timestamp++)")  # boost
    until(lambda: served.stick.heave == -1.0)
    page.look("void (pad.buttons[7] = pad.buttons[0], pad.timestamp++)")
    page.look("void (pad.buttons[6] = { pressed: true, value: 1 }, pad.timestamp++)")  # slow
    until(lambda: served.stick.heave == -0.2)
    page.close()
