"""What is on the page's screen, in a real browser. Skipped where there is no Chromium."""

from typing import Any

import pytest

pytest.importorskip("websockets", reason="the extra cockpit is not installed")

from tests.support.docs.chromium import Browser, BrowserPage, Size
from tests.support.page_screen import (
    ACTING,
    APART,
    CONTRAST,
    FINGER,
    HEARD,
    OVER,
    PAD,
    PILOT,
    REACHED,
    READY,
    SHARE,
    SILENT,
    SIZES,
    STATES,
    UNPRESSED,
    WATCHED,
    Served,
)  # fmt: skip
from tests.support.patience import until

MANY = [
    ["light", "dimmer", 0.5], ["light_2", "dimmer", 0.0], ["lasers", "switch", 1.0],
    ["gripper", "gripper", 0.0],
]  # fmt: skip
MAPPED: dict[str, Any] = {
    "place": [3.0, 4.0, 0.4, True], "compass_deg": 10.0, "home": [0.0, 0.0], "goal": [9.0, 9.0],
    "current": [0.1, -0.1], "altitude_m": 2.1, "altitude_wanted_m": 2.0,
}  # fmt: skip
FOUR: dict[str, Any] = {
    "cameras": [["front", False], ["down", False], ["gripper", False], ["aft", True]],
    "large": "front",
}
PLACE = "document.getElementById('disarm').getBoundingClientRect()"
pytestmark = pytest.mark.system


def for_sizes(sizes: tuple[Size, ...], fast: int) -> pytest.MarkDecorator:
    """Each size, of which one [px wide] is tried each time and the others by `make slow`."""
    return pytest.mark.parametrize(
        "size",
        [
            pytest.param(each, marks=[] if each.width == fast else pytest.mark.slow)
            for each in sizes
        ],
        ids=lambda size: f"{size.width}x{size.height}",
    )


def require_usable(page: BrowserPage, what: object) -> None:
    assert page.look(UNPRESSED) == "", what
    contrast, where = page.look(CONTRAST)
    assert contrast >= 4.5, (what, where)


@for_sizes(SIZES, 360)
def test_the_picture_fills_the_screen_and_everything_can_be_pressed_and_read(
    browser: Browser, served: Served, size: Size
):
    page = served.open(browser, size)
    shares = list[float]()
    for state in STATES.values():
        served.becomes(page, **state)
        page.look(FINGER if size.touch else "0")
        require_usable(page, state)
        shares.append(page.look(SHARE))
    assert max(shares) - min(shares) < 1e-3  # no alarm takes anything from the picture
    aspect, whole = size.width / size.height, 640 / 342
    most = min(1.0, 1.25**2 * min(aspect / whole, whole / aspect), 1.25 * aspect / whole)
    assert shares[0] >= (0.9 if aspect > 1.0 else most - 0.01)
    served.becomes(page, **ACTING)
    assert page.look(APART) >= 48  # resume and disarm are not neighbours
    for digits in ("depth", "heading"):
        style = f"getComputedStyle(document.getElementById('{digits}'))"
        assert page.look(f"parseFloat({style}.fontSize)") >= 24
    page.look("document.getElementById('menu-open').click()")
    served.becomes(page)
    require_usable(page, "menu")
    page.close()


@for_sizes(SIZES, 360)
def test_so_can_every_tool_the_map_and_four_cameras(browser: Browser, served: Served, size: Size):
    page = served.open(browser, size, before="localStorage.setItem('map', 'shut');")
    page.look(FINGER if size.touch else "0")
    page.look("document.getElementById('tools-open').click()")
    for state in ({}, READY):
        served.becomes(page, **state, tools=MANY)
        require_usable(page, state)
    assert page.look("document.querySelectorAll('#tools button').length") == 7
    page.look("document.getElementById('tools-open').click()")
    page.look("document.getElementById('map-open').click()")
    for place in (MAPPED, {**MAPPED, "place": [3.0, 4.0, 2.0, False], "goal": None}, {}):
        served.becomes(page, **place)
        require_usable(page, place)
    page.look("document.getElementById('map-open').click()")
    for state in STATES.values():
        served.becomes(page, **state, **FOUR)
        page.look("document.getElementById('silence').click()")  # it gives way to what is urgent
        served.becomes(page, **state, **FOUR)
        seen = "document.querySelectorAll('.camera:not([hidden])')"
        assert page.look(f"[...{seen}].filter((e) => e.checkVisibility()).length") == 3
        require_usable(page, state)
    page.close()


@for_sizes(SIZES, 360)
def test_nothing_lies_over_anything_and_what_disarms_keeps_its_place(
    browser: Browser, served: Served, size: Size
):
    shut = "try { localStorage.removeItem('map') } catch {}"
    page = served.open(browser, size, before=shut)
    page.look(FINGER if size.touch else "0")
    places = set[str]()
    for state in ({}, {"filming_s": 75.0}, ACTING, {"doing": "stopping"}):
        for control in (True, False):
            served.you = {**PILOT, "in_control": control}
            served.becomes(page, **{**WATCHED, **state})
            assert page.look(OVER) == "", (state, control)
            places.add(page.look(f"JSON.stringify({PLACE})"))
    assert len(places) == 1
    page.close()


def test_a_note_is_said_in_the_pilots_language_and_who_lacks_the_sticks_is_told_to_take_them(
    browser: Browser, served: Served
):
    page = served.open(browser, SIZES[5])
    choice = "document.getElementById('language')"
    page.look(f"{choice}.value = 'de'; {choice}.dispatchEvent(new Event('change'))")
    page.wait("document.documentElement.lang === 'de'")
    late = [["a service on board is late (ardusub); the battery is low", "warning"]]
    served.becomes(page, said=late)
    said = page.look("document.getElementById('note').textContent")
    assert said == "ein Dienst an Bord ist verspätet (ardusub); die Batterie ist schwach"
    assert "15,9 V, 80 %" in page.look("document.getElementById('numbers').textContent")
    served.becomes(page, said=[["LINK no answer from the drone for 1.1 s", "alarm"]])
    note = page.look("document.getElementById('note').textContent")
    assert note == "VERBINDUNG seit 1.1 s keine Antwort der Drohne"
    resume = "document.getElementById('arm').checkVisibility({ visibilityProperty: true })"
    for control, word in ((True, "fortsetzen."), (False, "nehmen")):
        served.you = {**PILOT, "in_control": control}
        served.becomes(page, **ACTING)
        assert word in page.look("document.querySelector('#failsafe p:last-child').textContent")
        assert page.look(resume)
    served.becomes(page, **ACTING, returns="centre")
    assert not page.look(resume)  # centred sticks are enough
    page.close()


@pytest.mark.slow
@pytest.mark.parametrize("language", ["no", "sv", "de", "es", "zh"])
def test_in_every_language_nothing_is_cut(browser: Browser, served: Served, language: str):
    for size in (SIZES[2], SIZES[0]):
        page = served.open(browser, size)
        page.look(FINGER)
        choice = "document.getElementById('language')"
        page.look(f"{choice}.value = '{language}'; {choice}.dispatchEvent(new Event('change'))")
        page.wait(f"document.documentElement.lang === '{language}'")
        for state in (READY, {}, ACTING):
            served.becomes(page, **state)
            assert page.look(UNPRESSED) == "", state
        said = page.look("document.getElementById('failsafe').textContent")
        assert said.count(".") >= 4
        assert "lost" not in said
        page.close()


@pytest.mark.slow
@pytest.mark.parametrize("theme", ["dark", "bright", "contrast"])
def test_every_text_can_be_read_in_every_state(browser: Browser, served: Served, theme: str):
    page = served.open(browser, Size(844, 390, touch=True), theme)
    page.look(FINGER)
    for opened in ("", "tools", "menu", "keys", "pad"):
        if opened:
            page.look(f"document.getElementById('{opened}-open').click()")
        for name, state in STATES.items():
            for taken in (False, True):
                served.you = {**PILOT, "taken": True, "in_control": False} if taken else dict(PILOT)
                served.becomes(page, **state, tools=MANY)
                contrast, where = page.look(CONTRAST)
                assert contrast >= 4.5, (name, opened, where)
    page.close()


@for_sizes((Size(640, 360), Size(333, 188), Size(180, 320), Size(320, 180)), 180)
def test_twice_as_large_what_arms_and_stops_can_be_reached(
    browser: Browser, served: Served, size: Size
):
    """A browser that enlarges a page halves the screen that the page has."""
    page = served.open(browser, size)
    for state, there in (
        (READY, ("arm", "stop")),
        ({}, ("disarm", "stop")),
        (ACTING, ("arm", "stop")),
    ):
        served.becomes(page, **state)
        for button in there:
            page.wait(REACHED.replace("BUTTON", button))
    page.close()


def test_a_hold_is_void_once_its_meaning_has_changed(browser: Browser, served: Served):
    page = served.open(browser, Size(667, 375, touch=True))
    served.becomes(page, **READY)
    page.touch("touchStart", page.middle("#arm"))
    page.wait("parseFloat(document.getElementById('arm').style.getPropertyValue('--held')) > 0.1")
    served.becomes(page, **ACTING)
    page.wait("document.getElementById('own').textContent.includes('nothing was done')")
    page.touch("touchEnd")
    assert "arm" not in [wish.what for wish in served.wishes]
    page.touch("touchStart", page.middle("#arm"))
    until(lambda: "resume" in [wish.what for wish in served.wishes])
    page.touch("touchEnd")
    assert "arm" not in [wish.what for wish in served.wishes]
    served.becomes(page)
    page.key("keyDown", "Backspace", "Backspace")
    page.key("keyUp", "Backspace", "Backspace")
    page.key("keyDown", "Space", " ")
    until(lambda: "stop" in [wish.what for wish in served.wishes])
    assert "disarm" not in [wish.what for wish in served.wishes]
    page.close()


def test_no_key_acts_with_ctrl_and_a_pilot_gives_keys_of_his_own(browser: Browser, served: Served):
    page = served.open(browser, Size(1280, 720))

    def pressed(code: str, key: str, modifiers: int = 0) -> None:
        for kind in ("keyDown", "keyUp"):
            page.call("Input.dispatchKeyEvent", type=kind, code=code, key=key, modifiers=modifiers)

    pressed("KeyL", "l", modifiers=2)  # Ctrl
    pressed("KeyL", "l", modifiers=1)  # Alt
    page.look("document.getElementById('keys-open').click()")
    rows = "[...document.querySelectorAll('#keys li')]"
    row = f"{rows}.find((row) => row.textContent.startsWith('light on'))"
    page.look(f"{row}.querySelector('button').click()")
    pressed("ControlLeft", "Control")
    page.wait("document.getElementById('own').textContent.includes('belongs to the browser')")
    page.look(f"{row}.querySelector('button').click()")
    pressed("KeyJ", "j")
    assert served.wishes == []
    pressed("KeyL", "l")  # has nothing any more
    pressed("KeyJ", "j")
    until(lambda: served.wishes)
    assert [wish.what for wish in served.wishes] == ["light"]
    page.close()


def test_what_lies_abeam_of_the_axis_is_there_on_the_tape_and_the_horizon(
    browser: Browser, served: Served
):
    """With the tilt and the field of view of the camera, as the simulated sea is drawn."""
    page = served.open(browser, SIZES[0])
    look = "import('/hud.js').then(({ lookout }) => { window.seen = lookout(0.1, 0.2, -0.5); })"
    page.look(f"void {look}")
    found = page.wait("window.seen")
    assert found["elevation"] == pytest.approx(-0.3, abs=0.01)  # pitch and tilt, hardly rolled
    place = """void import('/picture.js').then(({ Picture }) => {
      const canvas = document.getElementById('picture');
      window.axis = new Picture(canvas).place({ stripe: 18, fov: 80, whole: true, free: [0, 375] });
    })"""
    page.look(place)
    axis = page.wait("window.axis")
    # The edge of the picture is 40° from its axis.
    edge = axis["perRadian"] * 0.8390996
    box = page.look(
        "(b => [b.left, b.right])(document.getElementById('picture').getBoundingClientRect())"
    )
    shown = 640 * min(667 / 640, 375 / 342)
    assert edge == pytest.approx(shown / 2, abs=0.5)
    assert (box[0] + box[1]) / 2 == pytest.approx(axis["x"], abs=0.5)
    page.close()


def test_any_pad_is_mapped_in_the_page_by_pressing_what_is_wanted(browser: Browser, served: Served):
    """One of two axes and forty buttons, of which the browser knows nothing."""
    page = served.open(browser, Size(1280, 720), before=PAD)
    page.look("document.getElementById('menu-open').click()")
    page.look("document.getElementById('pad-open').click()")
    page.wait("document.getElementById('pad-name').textContent === 'unknown'")

    def looked() -> None:
        """The page has read the pad as it is: it does so before every message."""
        before = len(served.sticks)
        until(lambda: len(served.sticks) > before + 5)

    def given(action: str, push: str, let: str) -> None:
        button = f"document.querySelector('#pad [data-action={action}]')"
        page.look(f"{button}.click()")
        page.wait(f"{button}.className === 'waits'")
        looked()
        page.look(f"void ({push}, pad.timestamp++)")
        page.wait(f"{button}.className === '' && {button}.textContent !== '–'")
        page.look(f"void ({let}, pad.timestamp++)")

    down = "pad.buttons[37] = { pressed: true, value: 1 }"
    up = "pad.buttons[37] = { pressed: false, value: 0 }"
    given("stop", down, up)
    given("ahead", "pad.axes[1] = -1", "pad.axes[1] = 0")
    assert served.wishes == []
    assert all(each.surge == 0.0 for each in served.sticks)
    assert page.look("document.querySelectorAll('#pad-picture circle').length") == 40
    page.look("document.querySelector('#pad .close').click()")
    looked()
    page.look("void (pad.axes[1] = -1, pad.timestamp++)")
    until(lambda: served.stick.surge > 0.4)
    page.look(f"void ({down}, pad.timestamp++)")
    until(lambda: {wish.what for wish in served.wishes} == {"stop"})  # repeated until it is heard
    page.close()


def test_an_alarm_is_heard_and_spoken_once_until_one_tap_ends_the_sound_and_water_always(
    browser: Browser, served: Served
):
    page = served.open(browser, SIZES[0], before=HEARD)
    page.touch("touchStart", (300.0, 150.0))
    page.touch("touchEnd")
    page.look("document.getElementById('speech').click()")  # on

    def beeps_at(*said: str) -> list[int]:
        """How often it beeped by then, at each."""
        found = list[int]()
        for each in said:
            served.becomes(page, said=[[each, "alarm"]] if each else [])
            found.append(page.look("heard.beeps"))
        return found

    served.becomes(page, **ACTING)
    page.wait("heard.said.length > 0 && heard.tones > 0")
    acting = [[key, {"s": 3} if "s" in more else more] for key, more in ACTING["acting"]]
    served.becomes(page, **{**ACTING, "acting": acting})
    assert page.look("heard.said") == ["Pilot lost. Centre the sticks and resume."]
    served.becomes(page)
    page.look("heard.beeps = 0")
    link = "LINK delayed, up to 40 ms"
    assert beeps_at(link, link.replace("40", "220"), "", link) == [1, 1, 1, 2]  # it had ended
    page.touch("touchStart", page.middle("#silence"))
    page.touch("touchEnd")
    page.wait("document.getElementById('silence').offsetParent === null")
    tones = page.look("heard.tones")
    assert beeps_at("", link) == [2, 2]
    served.becomes(page, **ACTING)
    assert page.look("heard.tones") == tones
    assert beeps_at("water inside the drone") == [3]
    page.close()


def test_a_page_that_is_loaded_anew_says_that_it_was_closed(browser: Browser, served: Served):
    page = served.open(browser, SIZES[5])
    for _ in range(5):  # a busy browser may drop what a page sends as it leaves
        page.look("location.reload()")
        page.wait("document.getElementById('activity')?.textContent.length > 8")
        if served.absences:
            break
    until(lambda: bool(served.absences))
    assert set(served.absences) == {"closed"}
    page.close()


def test_a_stop_that_does_not_arrive_is_said_and_sent_again(browser: Browser, served: Served):
    deaf = """const send = WebSocket.prototype.send; window.deaf = true;
      WebSocket.prototype.send = function (text) {
        if (!(window.deaf && text.includes('"stop"'))) send.call(this, text); };"""
    page = served.open(browser, SIZES[0], before=deaf)
    page.look(FINGER)
    page.touch("touchStart", page.middle("#stop"))
    page.touch("touchEnd")
    lost, own = (f"document.getElementById('{name}').textContent" for name in ("lost", "own"))
    until(lambda: "STOP has not arrived yet" in page.look(lost))
    assert page.look(own) != "STOP was sent"
    page.look("window.deaf = false")
    until(lambda: "stop" in [wish.what for wish in served.wishes])
    served.you = {**PILOT, "stops": 1, "stop_waits": True}
    until(lambda: page.look(own) == "STOP was sent")
    until(lambda: "has not answered STOP" in page.look(lost))
    served.you = {**PILOT, "stops": 1}
    until(lambda: page.look(lost) == "")
    page.close()


def test_a_link_that_is_cut_is_red_and_says_what_the_drone_does(browser: Browser, served: Served):
    page = served.open(browser, SIZES[5])
    served.becomes(page, **SILENT)
    said = "document.getElementById('lost').textContent"
    assert page.look(said).startswith("nothing from the drone for 9 s: by itself it stops")
    assert page.look("document.getElementById('who').textContent").startswith("last known: ")
    served.becomes(page, **SILENT, armed=False)
    assert page.look(said) == ""
    page.close()


def test_who_arms_by_key_steers_by_keyboard(browser: Browser, served: Served):
    page = served.open(browser, SIZES[5])
    served.becomes(page, **READY)
    device = "document.getElementById('who').textContent"
    assert page.look(device).endswith("touch")
    for kind in ("keyDown", "keyUp"):
        page.call("Input.dispatchKeyEvent", type=kind, code="Enter", key="Enter")
    until(lambda: page.look(device).endswith("keyboard"))
    page.close()


def test_the_first_touch_shows_the_sticks_and_moves_none(browser: Browser, served: Served):
    page = served.open(browser, SIZES[0])
    left = "document.getElementById('left').checkVisibility({ visibilityProperty: true })"
    stop = "document.getElementById('stop').getBoundingClientRect().left"
    assert not page.look(left)
    before = page.look(stop)
    page.touch("touchStart", page.middle("#film"))
    page.touch("touchEnd")
    page.wait(left)
    assert page.look(stop) == before  # nothing moves away under a finger
    until(lambda: [wish.what for wish in served.wishes] == ["film"])
    assert all(each.heave == each.surge == 0.0 for each in served.sticks)
    x, y = page.middle("#left")
    page.touch("touchStart", (x, y))
    page.touch("touchMove", (x, y + 40.0))
    until(lambda: served.stick.heave > 0.2)
    page.touch("touchEnd")
    page.look("document.getElementById('menu-open').click()")
    page.look("document.getElementById('goto-depth').value = '3,5'")
    page.look("document.getElementById('goto-heading').value = ''")
    page.look("document.getElementById('go').click()")
    until(lambda: any(wish.what == "goto" for wish in served.wishes))
    assert [wish.depth for wish in served.wishes if wish.what == "goto"] == [3.5]
    page.close()
