"""The page in a real browser flies the simulated drone; skipped where there is no Chromium."""

import socket
from collections.abc import Callable
from contextlib import ExitStack

import pytest

pytest.importorskip("websockets", reason="the extra cockpit is not installed")

from messages import topics
from messages.pilot import TTL_MS, PilotCommand
from messages.vehicle import VehicleStatus
from tests.support.docs.chromium import Browser, BrowserPage, Size, insist
from tests.support.docs.cockpit_dive import CockpitDive, arm, hold
from tests.support.patience import until

pytestmark = pytest.mark.system
PHONE = Size(360, 640, touch=True)

CONNECTED = "document.getElementById('activity').textContent.length > 8"
PAD = """
window.virtualPad = {
  id: 'virtual', index: 0, connected: true, mapping: 'standard', timestamp: 1,
  axes: [0, 0, 0, 0],
  buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })),
};
navigator.getGamepads = () => [window.virtualPad];
"""
OVERFLOWS = """
[...document.querySelectorAll('header > *, button:not([hidden]), #stop, .stick')]
  .filter((e) => e.offsetParent !== null && !e.closest('#drones'))
  .filter((e) => {
    const box = e.getBoundingClientRect();
    return box.left < -1 || box.top < -1 || box.right > innerWidth + 1
      || box.bottom > innerHeight + 1
      || (e.tagName === 'BUTTON' && e.scrollWidth > e.clientWidth + 1);
  })
  .map((e) => e.id || e.textContent).join()
"""


class Flight:
    def __init__(self, browser: Browser, exits: ExitStack, *, camera: bool = False) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        self.commands: list[PilotCommand] = []
        self.statuses: list[VehicleStatus] = []
        self.dive = exits.enter_context(CockpitDive(port, camera=camera))
        observer = self.dive.host.node("observer", ["drone"])
        observer.each(topics.PILOT_COMMAND, lambda m, _: self.commands.append(m))
        observer.each(topics.STATUS, lambda m, _: self.statuses.append(m))
        self.browser = browser

    def page(self, size: Size, path: str = "") -> BrowserPage:
        return self.browser.open(self.dive.url + path, size)

    def is_so(self, true: str) -> bool:
        return bool(eval(true, {"self": self, "now": self.statuses, "said": self.commands}))

    def until(self, true: str) -> None:
        until(lambda: self.is_so(true), lambda: true)


@pytest.fixture
def flight(browser: Browser, exits: ExitStack) -> Flight:
    return Flight(browser, exits)


@pytest.fixture
def filmed_flight(browser: Browser, exits: ExitStack) -> Flight:
    pytest.importorskip("av", reason="the extra camera is not installed")
    return Flight(browser, exits, camera=True)


@pytest.mark.slow
def test_a_phone_arms_dives_by_thumb_stops_and_is_lost_when_it_is_locked(filmed_flight: Flight):
    flight = filmed_flight
    page = flight.page(PHONE)
    arm(page)
    page.wait("!document.getElementById('picture').hidden")
    assert page.look(OVERFLOWS) == ""
    left = page.middle("#left")

    def push() -> None:
        page.touch("touchStart", left)
        page.touch("touchMove", (left[0], left[1] + 40.0))

    insist(lambda: flight.is_so("said[-1].heave > 0.2"), push, lambda: page.touch("touchEnd"))
    page.look("Object.defineProperty(document, 'hidden', { value: true, configurable: true })")
    page.look("document.dispatchEvent(new Event('visibilitychange'))")
    flight.until("said[-1].pilot == 'lost' and now[-1].failsafe == 'pilot_lost'")
    assert flight.dive.counts["lost:page_hidden"] == 1
    assert flight.statuses[-1].failsafe == "pilot_lost"
    page.touch("touchEnd")
    page.look("delete document.hidden")
    page.wait("document.getElementById('arm').textContent === 'Hold to resume'")
    resumed = "now[-1].failsafe == 'none' and said[-1].pilot == 'present'"
    hold(page, lambda: flight.is_so(resumed))
    assert flight.commands[-1].ttl_ms <= TTL_MS
    page.close()
    flight.until("said[-1].pilot == 'lost'")
    assert flight.dive.counts["lost:page_closed"] + flight.dive.counts["lost:page_hidden"] >= 2


@pytest.mark.slow
def test_a_phone_that_is_twenty_times_slower_still_lets_go_of_a_stick(flight: Flight):
    page = flight.page(PHONE)
    arm(page)
    page.call("Emulation.setCPUThrottlingRate", rate=20)
    left = page.middle("#left")

    def push() -> None:
        page.touch("touchStart", left)
        page.touch("touchMove", (left[0], left[1] + 40.0))

    insist(lambda: flight.is_so("said[-1].heave > 0.2"), push, lambda: page.touch("touchEnd"))
    page.touch("touchEnd")
    flight.until("said[-1].heave == 0.0")
    page.look("document.getElementById('stop').dispatchEvent(new PointerEvent('pointerdown'))")
    flight.until("now[-1].activity == 'stopping' or now[-1].failsafe != 'none'")


@pytest.mark.slow
def test_a_pad_and_keys_fly_and_a_frozen_pad_is_lost_and_space_never_arms(flight: Flight):
    page = flight.page(Size(1280, 800))
    page.look(PAD)
    page.wait(CONNECTED)
    assert page.look(OVERFLOWS) == ""
    page.look("document.getElementById('take').click()")
    page.wait("document.getElementById('who').textContent.startsWith('you have')")
    flies = "now[-1].armed and now[-1].failsafe == 'none' and said[-1].pilot == 'present'"
    hold_key(page, "Enter", "Enter", lambda: flight.is_so(flies))
    goes = "said[-1].surge > 0.3 and said[-1].source == 'cockpit'"
    hold_key(page, "KeyW", "w", lambda: flight.is_so(goes))
    flight.until("said[-1].surge == 0.0")

    def push() -> None:
        page.look("void (virtualPad.axes[1] = -1, virtualPad.timestamp += 1)")

    def centre() -> None:  # of a page that a busy computer has lost, sticks count again after that
        page.look("void (virtualPad.axes[1] = 0, virtualPad.timestamp += 1)")
        flight.until("said[-1].pilot == 'present'")

    insist(lambda: flight.is_so("any(each.heave < -0.3 for each in said)"), push, centre)
    # It stays connected, deflected, and says nothing.
    flight.until("self.dive.counts['lost:page_frozen'] >= 1 and said[-1].pilot == 'lost'")
    page.wait("document.getElementById('now').textContent.includes('pad holds a stick')")
    page.look("document.getElementById('arm').focus()")
    page.key("keyDown", "Space", " ")
    page.key("keyUp", "Space", " ")
    centre()
    page.key("keyDown", "Backspace", "Backspace")
    flight.until("not now[-1].armed")
    page.key("keyUp", "Backspace", "Backspace")
    page.close()


@pytest.mark.slow
def test_a_watcher_sees_the_same_numbers_and_has_no_button_to_command_with(flight: Flight):
    page = flight.page(Size(1280, 800), "watch")
    page.wait(CONNECTED)
    assert page.look("document.getElementById('who').textContent").startswith("watching")
    hidden = (
        "['arm', 'stop', 'left', 'take'].every((i) => !document.getElementById(i).offsetParent)"
    )
    assert page.look(hidden)
    page.key("keyDown", "Space", " ")
    flight.until("self.dive.counts['refused:watcher'] == 1")
    assert page.look("document.getElementById('no-picture').textContent") == "no picture"
    page.close()


def hold_key(page: BrowserPage, code: str, key: str, happens: Callable[[], bool]) -> None:
    def let_go() -> None:
        page.key("keyUp", code, key)

    insist(happens, lambda: page.key("keyDown", code, key), let_go)
    let_go()


def press(page: BrowserPage, selector: str) -> None:
    """As a finger does: at its place on the screen, whatever lies there."""
    page.touch("touchStart", page.middle(selector))
    page.touch("touchEnd")
