"""What is on the page's screen, in a real browser: how much of it is picture, what can be read, and
what can be pressed. The drone's state is made up here. Skipped where there is no Chromium."""

import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import msgspec
import pytest

pytest.importorskip("websockets", reason="the extra cockpit is not installed")

from messages.events import Outbox
from services.cockpit.core import Settings
from services.cockpit.io.access import access_to
from services.cockpit.io.server import PageServer
from services.cockpit.page_messages import PageOpened, PageSaid, PageSticks, PageWish
from services.cockpit.page_view import AGES_MS
from tests.support.docs.chromium import Browser, BrowserPage, Size, chromium
from tests.support.patience import until

PROGRAM = chromium()
pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(PROGRAM is None, reason="no Chromium on the path (.ci/run installs it)"),
]
SIZES = (
    Size(667, 375, touch=True), Size(844, 390, touch=True), Size(360, 640, touch=True),
    Size(390, 844, touch=True), Size(768, 1024, touch=True), Size(1280, 720), Size(1920, 1080),
    Size(3840, 2160),
)  # fmt: skip
AGES = msgspec.json.encode(AGES_MS).decode()
PILOT = {"has_sticks": True, "in_control": True, "who": "you have the sticks", "delay_ms": 4.0}
FLOWN = {
    "activity": "piloted", "doing": "piloted", "armed": True, "flight_mode": "stabilised",
    "drone": "rov1", "light": 0.5, "depth_m": 12.34, "depth_wanted_m": 12.5, "depth_rate": -0.12,
    "heading_deg": 271.0, "heading_wanted_deg": 280.0, "roll_deg": 2.0, "pitch_deg": -3.0,
    "tilt_deg": -20.0, "age_ms": 20.0, "rtt_ms": 41.0, "link_up": True, "stick_ms": 62.0,
    "numbers": [["battery", "15.9 V, 80 %"], ["light", "50 %"]], "thrust": [0.1, -0.5, 1.0, 0.0],
    "fov_deg": 80.0, "dive_s": 754, "left_min": 47, "turns": 2,
    "lines": [["warning", 61.0, 2, "reference: the battery is low", "notice:battery_low"]],
}  # fmt: skip
ACTING: dict[str, Any] = {
    "doing": "holding", "failsafe": "pilot_lost", "resumable": True, "acting": [
        ["failsafe:pilot_lost.short", {}], ["failsafe:pilot_lost", {"s": 2}],
        ["does.holding", {"s": 57}], ["failsafe:pilot_lost.do", {}],
    ],
}  # fmt: skip
READY: dict[str, Any] = {"activity": "ready", "doing": "ready", "armed": False}
OLD: dict[str, Any] = {"age_ms": 2300.0}
SILENT: dict[str, Any] = {"silent_s": 9.0, "depth_m": None, "heading_deg": None, "age_ms": None}
SAID: dict[str, Any] = {
    "said": [["LINK down for 3 s", "alarm"], ["the bottom is close", "warning"]]
}
STATES = {"flown": {}, "ready": READY, "acting": {**ACTING, **SAID}, "old": OLD, "silent": SILENT}

INSIDE = "void import('/main.js').then((main) => { window.video = main.video; })"
FILMED = """(() => {
  const canvas = document.getElementById('picture');
  [canvas.width, canvas.height, canvas.hidden] = [640, 360, false];
  video.draw = () => true;
  video.stripe = 18;
})()"""
# [-] of the screen on which a pixel of the picture is, whatever lies over it.
SHARE = """(() => {
  const canvas = document.getElementById('picture'), box = canvas.getBoundingClientRect();
  const cut = parseFloat(canvas.style.clipPath.slice(6));
  const over = (a, b, most) => Math.max(0, Math.min(b, most) - Math.max(a, 0));
  return over(box.left, box.right, innerWidth) * over(box.top + cut, box.bottom, innerHeight)
    / (innerWidth * innerHeight);
})()"""
# Of every text that is seen: the smallest contrast (WCAG) to what is behind it. Behind what is not
# opaque lies the picture, of which every part may be black or white.
CONTRAST = """(() => {
  const parse = (text) => (text.match(/[\\d.]+/g) ?? [0, 0, 0, 0]).map(Number);
  const over = ([r, g, b, a = 1], under) => [r, g, b].map((x, k) => a * x + (1 - a) * under[k]);
  const light = (rgb) => {
    const linear = (x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
    const [r, g, b] = rgb.map((x) => linear(x / 255));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const apart = (a, b) => (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  const behind = (element, picture) => {
    const layers = [];
    for (let e = element; e && e !== document.body; e = e.parentElement) layers.push(e);
    const paint = (under, e) => over(parse(getComputedStyle(e).backgroundColor), under);
    return layers.reverse().reduce(paint, picture);
  };
  let worst = [Infinity, ''];
  for (const element of document.body.querySelectorAll('*')) {
    const own = [...element.childNodes].some((n) => n.nodeType === 3 && n.data.trim());
    if (!own || !element.checkVisibility({ visibilityProperty: true })) continue;
    let alpha = 1;
    for (let e = element; e; e = e.parentElement) alpha *= Number(getComputedStyle(e).opacity);
    for (const picture of [[0, 0, 0], [255, 255, 255]]) {
      const under = behind(element, picture);
      const [r, g, b, a = 1] = parse(getComputedStyle(element).color);
      const found = apart(light(over([r, g, b, a * alpha], under)), light(under));
      const name = element.id || element.parentElement.id || element.textContent;
      if (found < worst[0]) worst = [found, name];
    }
  }
  const c = Object.fromEntries(['paper', 'ink', 'dim', 'bug', 'warn'].map((name) => {
    const probe = document.createElement('i');
    probe.style.color = `var(--${name})`;
    document.body.append(probe);
    const rgb = parse(getComputedStyle(probe).color);
    probe.remove();
    return [name, light(rgb)];
  }));
  for (const name of ['ink', 'dim', 'bug', 'warn']) // drawn with an outline of the paper
    if (apart(c[name], c.paper) < worst[0]) worst = [apart(c[name], c.paper), name];
  return worst;
})()"""
# What can be pressed and is too small, too near to another one, covered, or off the screen.
UNPRESSED = """(() => {
  const all = [...document.querySelectorAll('button, select, input')]
    .filter((e) => e.checkVisibility({ visibilityProperty: true }))
    .filter((e) => {
      const panel = e.closest('.panel'); // of a panel what has been scrolled to
      return !panel || panel.contains(document.elementFromPoint(...middle(e)));
    });
  function middle(e) {
    const box = e.getBoundingClientRect();
    return [box.left + box.width / 2, box.top + box.height / 2];
  }
  const wrong = [];
  all.forEach((e, k) => {
    const a = e.getBoundingClientRect(), name = e.id || e.textContent;
    if (a.width < 47.9 || a.height < 47.9) wrong.push(`${name} is ${a.width} x ${a.height}`);
    if (a.left < 0 || a.top < 0 || a.right > innerWidth || a.bottom > innerHeight)
      wrong.push(`${name} is off the screen`);
    if (!e.contains(document.elementFromPoint(...middle(e)))) wrong.push(`${name} is covered`);
    if (e.tagName === 'BUTTON' && e.scrollWidth > e.clientWidth + 1) wrong.push(`${name} is cut`);
    for (const other of all.slice(k + 1)) {
      const b = other.getBoundingClientRect();
      const gap = Math.max(a.left - b.right, b.left - a.right, a.top - b.bottom, b.top - a.bottom);
      if (gap < 7.9 && e.closest('.panel') === other.closest('.panel'))
        wrong.push(`${name} and ${other.id || other.textContent} are ${gap} apart`);
    }
  });
  return wrong.join('; ');
})()"""
REACHED = """(() => {
  const e = document.getElementById('BUTTON'), b = e.getBoundingClientRect();
  return b.left >= 0 && b.top >= 0 && b.right <= innerWidth && b.bottom <= innerHeight
    && e.contains(document.elementFromPoint(b.left + b.width / 2, b.top + b.height / 2));
})()"""
APART = """(() => {
  const [a, b] = ['arm', 'disarm'].map((id) => document.getElementById(id).getBoundingClientRect());
  return Math.max(a.left - b.right, b.left - a.right, a.top - b.bottom, b.top - a.bottom);
})()"""
PAD = """
window.pad = { id: 'unknown', index: 0, connected: true, mapping: '', timestamp: 1, axes: [0.1, 0],
  buttons: Array.from({ length: 40 }, () => ({ pressed: false, value: 0 })) };
navigator.getGamepads = () => [window.pad];
"""
HEARD = """
window.heard = { tones: 0, said: [] };
window.AudioContext = class {
  currentTime = 0;
  createOscillator() {
    window.heard.tones++;
    return { frequency: {}, connect: (next) => next, start() {}, stop() {} };
  }
  createGain() {
    const gain = { setValueAtTime() {}, exponentialRampToValueAtTime() {} };
    return { gain, connect() {} };
  }
};
speechSynthesis.speak = (words) => window.heard.said.push(words.text);
"""
FINGER = "document.body.classList.add('touch')"


class Served:
    """The page's server, and a drone in the state that a test gives it."""

    def __init__(self, exits: ExitStack) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            settings = Settings(port=free.getsockname()[1])
        self.url = f"http://127.0.0.1:{settings.port}/"
        self.you, self.view, self.wishes = dict(PILOT), dict[str, Any](FLOWN), list[PageWish]()
        self.sticks = list[PageSticks]()
        self._server = PageServer(settings, access_to(settings), Outbox())
        self._pages, self._number, self._stop = set[int](), 0, threading.Event()
        self._server.start(lambda: None)
        thread = threading.Thread(target=self._run, daemon=True)
        thread.start()
        exits.callback(self._server.close)
        exits.callback(thread.join)
        exits.callback(self._stop.set)

    def becomes(self, page: BrowserPage, **state: Any) -> None:
        """And it is drawn. None: the drone does not say it."""
        view = {**FLOWN, **state}
        self.view = {name: value for name, value in view.items() if value is not None}
        mark = self.view["mark"] = self._number
        page.wait(f"window.drawnMark >= {mark}")

    def _run(self) -> None:
        while not self._stop.wait(0.04):
            self._number += 1
            for event in self._server.received():
                if isinstance(event, PageOpened):
                    self._pages.add(event.page)
                elif isinstance(event, PageSaid) and isinstance(event.message, PageWish):
                    self.wishes.append(event.message)
                elif isinstance(event, PageSaid) and isinstance(event.message, PageSticks):
                    self.sticks.append(event.message)
            text = (
                f'{{"n":{self._number},"t":{time.monotonic_ns() / 1e6},"ages":{AGES},'
                f'"you":{json.dumps(self.you)},"view":{json.dumps(self.view)}}}'
            )
            self._server.show(dict.fromkeys(self._pages, text))

    def open(
        self, browser: Browser, size: Size, theme: str = "dark", before: str = ""
    ) -> BrowserPage:
        chosen = f"localStorage.setItem('theme', '{theme}'); localStorage.setItem('language', 'en')"
        page = browser.open(self.url, size, f"try {{ {chosen} }} catch {{}} {before}")
        page.look(INSIDE)
        page.wait("window.video && document.getElementById('activity').textContent.length > 8")
        page.look(FILMED)
        # What is drawn is known by two frames after its message.
        page.look(
            "void (async () => { const { connection } = video; for (;;) {"
            " const mark = connection.picture?.view.mark ?? -1;"
            " for (let k = 0; k < 2; k++) await new Promise(requestAnimationFrame);"
            " window.drawnMark = mark; } })()"
        )
        return page


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    assert PROGRAM is not None
    with Browser(PROGRAM) as opened:
        yield opened


@pytest.fixture
def served() -> Iterator[Served]:
    with ExitStack() as exits:
        yield Served(exits)


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


@pytest.mark.parametrize("theme", ["dark", "bright", "contrast"])
def test_every_text_can_be_read_in_every_state(browser: Browser, served: Served, theme: str):
    page = served.open(browser, Size(844, 390, touch=True), theme)
    page.look(FINGER)
    for opened in ("", "menu", "keys", "pad"):
        if opened:
            page.look(f"document.getElementById('{opened}-open').click()")
        for name, state in STATES.items():
            for taken in (False, True):
                served.you = {**PILOT, "taken": True, "in_control": False} if taken else dict(PILOT)
                served.becomes(page, **state)
                contrast, where = page.look(CONTRAST)
                assert contrast >= 4.5, (name, opened, where)
    page.close()


@pytest.mark.parametrize("size", [Size(640, 360), Size(333, 188), Size(180, 320), Size(320, 180)])
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
            assert page.look(REACHED.replace("BUTTON", button)), (button, state)
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
    until(lambda: served.sticks[-1].surge > 0.5)
    page.look(f"void ({down}, pad.timestamp++)")
    until(lambda: [wish.what for wish in served.wishes] == ["stop"])
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
    for seconds in (3, 4, 5):
        acting = [[key, {"s": seconds} if "s" in more else more] for key, more in ACTING["acting"]]
        served.becomes(page, **{**ACTING, "acting": acting})
    assert page.look("heard.said") == ["Pilot lost. Centre the sticks and resume."]
    tones = page.look("heard.tones")
    page.touch("touchStart", page.middle("#silence"))
    page.touch("touchEnd")
    page.wait("document.getElementById('silence').offsetParent === null")
    served.becomes(page)
    served.becomes(page, **ACTING)
    assert page.look("heard.tones") == tones
    page.close()


def test_the_first_touch_shows_the_sticks_and_moves_none(browser: Browser, served: Served):
    page = served.open(browser, SIZES[0])
    assert page.look("document.getElementById('left').offsetParent === null")
    page.touch("touchStart", page.middle("#lamp"))
    page.touch("touchEnd")
    page.wait("document.getElementById('left').offsetParent !== null")
    until(lambda: [wish.what for wish in served.wishes] == ["light"])
    assert all(each.heave == each.surge == 0.0 for each in served.sticks)
    x, y = page.middle("#left")
    page.touch("touchStart", (x, y))
    page.touch("touchMove", (x, y + 40.0))
    until(lambda: served.sticks[-1].heave > 0.2)
    page.touch("touchEnd")
    page.look("document.getElementById('menu-open').click()")
    page.look("document.getElementById('goto-depth').value = '3,5'")
    page.look("document.getElementById('goto-heading').value = ''")
    page.look("document.getElementById('go').click()")
    until(lambda: any(wish.what == "goto" for wish in served.wishes))
    assert [wish.depth for wish in served.wishes if wish.what == "goto"] == [3.5]
    page.close()
