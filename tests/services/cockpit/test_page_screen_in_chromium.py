"""What is on the page's screen, in a real browser. Skipped where there is no Chromium."""

import pytest

pytest.importorskip("websockets", reason="the extra cockpit is not installed")

from tests.support.docs.chromium import Browser, Size
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
    SIZES,
    STATES,
    UNPRESSED,
    WATCHED,
    Served,
)  # fmt: skip
from tests.support.patience import until

NOW = "document.getElementById('now').textContent"
PLACE = "document.getElementById('disarm').getBoundingClientRect()"
OVERLAP = """(() => {
  const [a, b] = ['SHEET', 'SEEN'].map((id) => document.getElementById(id).getBoundingClientRect());
  return Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1
    && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
})()"""
pytestmark = pytest.mark.system


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size.width}x{size.height}")
def test_the_picture_fills_the_screen_and_everything_can_be_pressed(
    browser: Browser, served: Served, size: Size
):
    page = served.open(browser, size)
    shares = list[float]()
    for state in STATES.values():
        served.becomes(page, **state)
        page.look(FINGER if size.touch else "0")
        assert page.look(UNPRESSED) == "", state
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
    assert page.look(UNPRESSED) == ""
    page.close()


@pytest.mark.parametrize(
    "size",
    [pytest.param(size, marks=[] if size.width == 360 else pytest.mark.slow) for size in SIZES],
    ids=lambda size: f"{size.width}x{size.height}",
)
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
    served.becomes(page, notices=[{"code": "notice:battery_low", "numbers": {"left": 0.2}}])
    assert page.look(NOW) == "Die Batterie ist schwach (20 %)."
    assert "15,9 V, 80 %" in page.look("document.getElementById('numbers').textContent")
    resume = "document.getElementById('arm').checkVisibility({ visibilityProperty: true })"
    for control, word in ((True, "Fortsetzen"), (False, "nehmen")):
        served.you = {**PILOT, "in_control": control}
        served.becomes(page, **ACTING, resumable=True)
        assert word in page.look(NOW)
        assert page.look(resume)
    served.becomes(page, **ACTING, resumable=True, returns="centre")
    assert not page.look(resume)  # centred sticks are enough
    page.close()


def test_a_long_alarm_is_whole_on_a_low_screen(browser: Browser, served: Served):
    page = served.open(browser, Size(780, 437))
    served.becomes(page, **{**ACTING, "doing": "not obeyed", "failsafe": "state_lost"})
    page.look("document.getElementById('now').append(' And once more, for three lines of it.')")
    box = "document.getElementById('%s').getBoundingClientRect()"
    top, now = box % "top", box % "now"
    assert page.look(f"{now}.height > 50 && {now}.top >= 0 && {now}.bottom <= {top}.bottom - 15")
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
        said = page.look(NOW)
        assert said.count(".") == 3
        assert "lost" not in said
        page.close()


@pytest.mark.slow
@pytest.mark.parametrize("theme", ["dark", "bright", "contrast"])
def test_every_text_can_be_read_in_every_state(browser: Browser, served: Served, theme: str):
    page = served.open(browser, Size(844, 390, touch=True), theme)
    page.look(FINGER)
    for opened in ("", "menu", "keys", "pad", "drawer"):
        if opened:
            page.look(f"document.getElementById('{opened}-open').click()")
        for name, state in STATES.items():
            for taken in (False, True):
                served.you = {**PILOT, "taken": True, "in_control": False} if taken else dict(PILOT)
                served.becomes(page, **state)
                contrast, where = page.look(CONTRAST)
                assert contrast >= 4.5, (name, opened, where)
    page.close()


@pytest.mark.parametrize(
    "size",
    [
        pytest.param(size, marks=[] if size.width == 180 else pytest.mark.slow)
        for size in (Size(640, 360), Size(333, 188), Size(180, 320), Size(320, 180))
    ],
)
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


def test_no_key_acts_with_ctrl_and_one_that_does_nothing_says_so(browser: Browser, served: Served):
    page = served.open(browser, Size(1280, 720))

    def pressed(code: str, key: str, modifiers: int = 0) -> None:
        for kind in ("keyDown", "keyUp"):
            page.call("Input.dispatchKeyEvent", type=kind, code=code, key=key, modifiers=modifiers)

    pressed("KeyL", "l", modifiers=2)  # Ctrl
    pressed("KeyL", "l", modifiers=1)  # Alt
    assert served.wishes == []
    pressed("KeyL", "l")
    until(lambda: served.wishes)
    assert [wish.what for wish in served.wishes] == ["light"]
    own = "document.getElementById('own').textContent"
    pressed("KeyZ", "z")
    page.wait(f"{own} === 'Z does nothing. ? shows the keys'")
    pressed("Slash", "?")
    assert page.look("document.getElementById('keys').innerText.includes('STOP')")
    served.becomes(page, **READY)
    pressed("KeyW", "w")
    page.wait(f"{own} === 'The drone is disarmed: hold Enter first'")
    page.close()


def test_the_first_visit_shows_what_steers_until_the_first_arming(browser: Browser, served: Served):
    served.view = {**served.view, **READY}
    page = served.open(browser, Size(1280, 800), before=f"localStorage.removeItem('flown'); {PAD}")
    shown = "document.getElementById('card').checkVisibility()"
    assert page.look(shown)
    assert page.look(NOW) == "Hold Enter to arm."
    page.wait("document.getElementById('card-pad').textContent === 'unknown'")  # a pad, at once
    page.wait("document.getElementById('own').textContent.startsWith('unknown is not known')")
    served.becomes(page)
    assert not page.look(shown)
    assert page.look("localStorage.getItem('flown')") == "yes"  # remembered
    served.becomes(page, **READY)
    assert not page.look(shown)
    page.close()


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size.width}x{size.height}")
def test_no_sheet_covers_depth_heading_or_what_stops(browser: Browser, served: Served, size: Size):
    page = served.open(browser, size)
    page.look(FINGER if size.touch else "0")
    for sheet in ("menu", "drawer", "keys", "pad"):
        page.look(f"document.getElementById('{sheet}-open').click()")
        for state in ({}, ACTING):
            served.becomes(page, **state)
            for seen in ("heading", "depth", "stop", "disarm", "now"):
                covered = OVERLAP.replace("SHEET", sheet).replace("SEEN", seen)
                assert not page.look(covered), (sheet, seen)
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
    place = """void import('/picture.js').then(({ placePicture }) => {
      const canvas = document.getElementById('picture');
      window.axis = placePicture(canvas, { stripe: 18, fov: 80, whole: true, free: [0, 375] });
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
        page.wait(f"{button}.className !== 'waits' && {button}.textContent !== '–'")
        page.look(f"void ({let}, pad.timestamp++)")

    down = "pad.buttons[37] = { pressed: true, value: 1 }"
    up = "pad.buttons[37] = { pressed: false, value: 0 }"
    given("stop", down, up)
    given("ahead", "pad.axes[1] = -1", "pad.axes[1] = 0")
    assert served.wishes == []
    assert all(each.surge == 0.0 for each in served.sticks)
    page.look("document.querySelector('#pad .close').click()")
    looked()
    page.look("void (pad.axes[1] = -1, pad.timestamp++)")
    until(lambda: served.stick.surge > 0.4)
    page.look(f"void ({down}, pad.timestamp++)")
    until(lambda: {wish.what for wish in served.wishes} == {"stop"})  # repeated until it is heard
    page.close()


def test_an_alarm_is_heard_and_spoken_once_until_one_tap_ends_the_sound(
    browser: Browser, served: Served
):
    page = served.open(browser, SIZES[0], before=HEARD)
    page.touch("touchStart", (300.0, 150.0))
    page.touch("touchEnd")
    page.look("document.getElementById('speech').click()")  # on
    served.becomes(page, **ACTING)
    page.wait("heard.said.length > 0 && heard.tones > 0")
    for seconds in (56, 55, 54):
        served.becomes(page, **{**ACTING, "next_s": seconds})
    said = "Pilot lost. It has stopped and holds; it rises in 57 s. Centre the sticks and resume."
    assert page.look("heard.said") == [said]
    tones = page.look("heard.tones")
    page.touch("touchStart", page.middle("#silence"))
    page.touch("touchEnd")
    page.wait("document.getElementById('silence').offsetParent === null")
    served.becomes(page)
    served.becomes(page, **ACTING)
    assert page.look("heard.tones") == tones
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
    stopped = "Stopped and holding. Still armed."
    until(lambda: "STOP has not arrived yet" in page.look(NOW))
    page.look("window.deaf = false")
    until(lambda: "stop" in [wish.what for wish in served.wishes])
    served.you = {**PILOT, "stops": 1, "stop_waits": True}
    until(lambda: "has not answered STOP" in page.look(NOW))
    served.you = {**PILOT, "stops": 1}
    until(lambda: page.look(NOW) == stopped)
    served.becomes(page, sticks=[0.2, 0.0, 0.0, 0.0])
    assert page.look(NOW) == ""
    page.close()


def test_what_is_grave_is_red(browser: Browser, served: Served):
    page = served.open(browser, SIZES[5])
    colour = "getComputedStyle(document.getElementById('now')).backgroundColor"
    close = {"code": "notice:near_floor"}
    served.becomes(page, notices=[close])
    before = page.look(colour)
    served.becomes(page, notices=[close, {"code": "notice:leak"}])
    assert page.look(colour) != before
    assert page.look(NOW).startswith("Water in the enclosure. Bring the drone up")
    assert page.look("document.getElementById('drawer-open').textContent") == "1"
    page.close()


@pytest.mark.slow
def test_a_menu_does_not_move_when_a_notice_comes(browser: Browser, served: Served):
    for size in SIZES[:4]:
        page = served.open(browser, size)
        page.look("document.getElementById('menu-open').click()")
        row = "JSON.stringify(document.getElementById('goto').getBoundingClientRect())"
        served.becomes(page)
        before = page.look(row)
        for state in (WATCHED, {**ACTING, **WATCHED}):
            served.becomes(page, **state)
            assert page.look(row) == before
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
