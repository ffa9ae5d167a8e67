"""The pilot's page with a drone whose state is made up, and what is on its screen: how much of it
is picture, what can be read, and what can be pressed. For any browser."""

import json
import threading
import time
from contextlib import ExitStack
from typing import Any, Protocol, TypeVar

import msgspec

from messages.events import Outbox
from services.cockpit.core import Settings
from services.cockpit.io.access import access_to
from services.cockpit.io.server import PageServer
from services.cockpit.page_messages import PageAbsence, PageOpened, PageSaid, PageSticks, PageWish
from services.cockpit.page_view import AGES_MS
from tests.support.docs.chromium import Size
from tests.support.doors import free_port


class Looked(Protocol):
    """A page in a browser."""

    def look(self, script: str) -> Any: ...
    def wait(self, script: str) -> Any: ...


P = TypeVar("P", bound=Looked, covariant=True)


class Opens(Protocol[P]):
    """A browser."""

    def open(self, url: str, size: Size, before: str = "") -> P: ...


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
    "battery_v": 15.9, "charge": 0.8,
    "fov_deg": 80.0, "dive_s": 754, "left_min": 47, "turns": 2, "water_c": 7.6,
    "tools": [["light", "dimmer", 0.5], ["lasers", "switch", 0.0], ["gripper", "gripper", 0.0]],
}  # fmt: skip
ACTING: dict[str, Any] = {
    "doing": "holding", "failsafe": "pilot_lost", "since_s": 2.0, "next_s": 57.0,
}  # fmt: skip
READY: dict[str, Any] = {"activity": "ready", "doing": "ready", "armed": False}
OLD: dict[str, Any] = {"age_ms": 2300.0}
SILENT: dict[str, Any] = {"silent_s": 9.0, "depth_m": None, "heading_deg": None, "age_ms": None}
SAID: dict[str, Any] = {
    "alarms": [{"code": "link.silent", "numbers": {"s": 3.0}}],
    "notices": [{"code": "notice:near_floor"}],
}
WATCHED: dict[str, Any] = {  # the second camera, small
    "cameras": [["front", False], ["down", False]], "large": "front", "looks_deg": [-20.0, 0.0],
    "notices": [{"code": "notice:service_late", "about": ["ardusub"]}],
}  # fmt: skip
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
      const hit = document.elementFromPoint(...middle(e));
      if (!panel || e.contains(hit)) return true;
      return panel.contains(hit) && hit !== panel && !hit.closest('header');
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
# What lies over something else that is to be read or pressed.
OVER = """(() => {
  const all = [...document.querySelectorAll(`#top, #heading, #depth, #aids, #stop, #left,
    #right, #card, .panel, .camera, #buttons button, #buttons select`)]
    .filter((e) => e.checkVisibility({ visibilityProperty: true }))
    .filter((e) => e.offsetWidth && (e.textContent || e.classList.contains('stick')));
  const wrong = [];
  all.forEach((e, k) => {
    const a = e.getBoundingClientRect();
    for (const other of all.slice(k + 1)) {
      const b = other.getBoundingClientRect();
      const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
      if (wide > 1 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1)
        wrong.push(`${e.id || e.textContent} and ${other.id || other.textContent}`);
    }
  });
  return wrong.join('; ');
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
        settings = Settings(port=free_port())
        self.url = f"http://127.0.0.1:{settings.port}/"
        self.you, self.view, self.wishes = dict(PILOT), dict[str, Any](FLOWN), list[PageWish]()
        self.sticks, self.absences = list[PageSticks](), list[str]()
        self.stops = 0  # of the newest page
        self._server = PageServer(settings, access_to(settings), Outbox())
        self._pages, self._number, self._stop = set[int](), 0, threading.Event()
        self._server.start(lambda: None)
        thread = threading.Thread(target=self._run, daemon=True)
        thread.start()
        exits.callback(self._server.close)
        exits.callback(thread.join)
        exits.callback(self._stop.set)

    @property
    def stick(self) -> PageSticks:
        """The newest position; none yet: the middle."""
        middle = PageSticks(seen=0, held_ms=0.0, surge=0.0, sway=0.0, heave=0.0, yaw=0.0)
        return self.sticks[-1] if self.sticks else middle

    def becomes(self, page: Looked, **state: Any) -> None:
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
                    self.stops = 0
                elif isinstance(event, PageSaid) and isinstance(event.message, PageWish):
                    self.wishes.append(event.message)
                    self.stops += event.message.what == "stop"
                elif isinstance(event, PageSaid) and isinstance(event.message, PageSticks):
                    self.sticks.append(event.message)
                elif isinstance(event, PageSaid) and isinstance(event.message, PageAbsence):
                    self.absences.append(event.message.why)
            you = {"stops": self.stops, **self.you}
            text = (
                f'{{"n":{self._number},"t":{time.monotonic_ns() / 1e6},"ages":{AGES},'
                f'"you":{json.dumps(you)},"view":{json.dumps(self.view)}}}'
            )
            self._server.show(dict.fromkeys(self._pages, text))

    def open(self, browser: Opens[P], size: Size, theme: str = "dark", before: str = "") -> P:
        stored = {"theme": theme, "language": "en", "flown": "yes"}
        chosen = "".join(f"localStorage.setItem('{key}', '{to}');" for key, to in stored.items())
        page = browser.open(self.url, size, f"try {{ {chosen} }} catch {{}} {before}")
        page.look(INSIDE)
        page.wait("window.video && document.getElementById('activity').textContent.length > 8")
        page.look(FILMED)
        # What is drawn is known by two frames after its message, words a tenth of a second later.
        page.look(
            "void (async () => { const { connection } = video; for (;;) {"
            " const mark = connection.picture?.view.mark ?? -1;"
            " await new Promise((go) => setTimeout(go, 160));"
            " for (let k = 0; k < 2; k++) await new Promise(requestAnimationFrame);"
            " window.drawnMark = mark; } })()"
        )
        return page
