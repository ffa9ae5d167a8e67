"""The page's map in a real browser: a tap sends the simulated drone there. Skipped where there is
no Chromium."""

import socket
from contextlib import ExitStack
from math import cos, dist, hypot, radians, sin

import pytest
from msgspec import UNSET

pytest.importorskip("websockets", reason="the extra cockpit is not installed")

from messages import topics
from messages.pilot import PilotRequest
from messages.vehicle import Truth, VehicleStatus
from tests.support.docs.chromium import Browser, BrowserPage, Size
from tests.support.docs.cockpit_dive import CockpitDive, arm
from tests.support.page_screen import CONTRAST, FINGER, SIZES, UNPRESSED, Served
from tests.support.patience import until

pytestmark = pytest.mark.system
PHONE = Size(390, 844, touch=True)
POSITION = ("simulator.dvl.rate=5", "simulator.usbl.rate=1", "simulator.usbl.std=0.1")
TAPPED = (0.58, 0.45)  # [-] of the map's width and height
MOST_OFF = 0.5  # [m] of a position with fixes of 0.1 m
SAID = "document.getElementById('map-said').textContent"
OPEN = "document.getElementById('map-open').click()"
BOX = """(() => { const b = document.querySelector('#map canvas').getBoundingClientRect();
  return [b.left, b.top, b.width, b.height]; })()"""
# Whether the map has the reference's colour so far [m] from the drone.
PINK = """(() => {
  const canvas = document.querySelector('#map canvas'), ratio = devicePixelRatio;
  const metre = Math.min(canvas.clientWidth, canvas.clientHeight) / 30 * ratio;
  const [x, y] = [canvas.width / 2 + EAST * metre, canvas.height / 2 - NORTH * metre];
  const [r, g, b] = canvas.getContext('2d').getImageData(x, y, 1, 1).data;
  return Number(r > 200 && g < 180 && b > 180);
})()"""
LEGS = (("3", "0"), ("5", "2.5"), ("3", "3"))  # on the first leg, on the second, on none
PLACE: dict[str, object] = {
    "place": [3.0, 4.0, 0.4, True], "compass_deg": 10.0, "home": [0.0, 0.0], "goal": [9.0, 9.0],
    "current": [0.1, -0.1], "altitude_m": 2.1, "altitude_wanted_m": 2.0,
}  # fmt: skip
RECKONED = {**PLACE, "place": [3.0, 4.0, 2.0, False], "goal": None}
NOWHERE: dict[str, object] = {"compass_deg": 10.0}


class MappedDive:
    """A drone, and who watches it."""

    def __init__(self, browser: Browser, exits: ExitStack, *settings: str) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        self.asked: dict[str, PilotRequest] = {}  # by id: they are repeated until answered
        self.truth: Truth | None = None
        self.status: VehicleStatus | None = None
        dive = exits.enter_context(CockpitDive(port, settings=settings))
        observer = dive.host.node("observer", ["drone"])
        observer.each(topics.PILOT_REQUEST, lambda m, _: self.asked.update({m.id: m}))
        observer.each(topics.TRUTH, self._see)
        observer.each(topics.STATUS, self._hear)
        self.page = browser.open(dive.url, PHONE)
        exits.callback(self.page.close)
        arm(self.page)
        self.page.look(OPEN)

    def _see(self, truth: Truth, _: int) -> None:
        self.truth = truth

    def _hear(self, status: VehicleStatus, _: int) -> None:
        self.status = status

    def goes_on(self, seconds: float) -> None:
        """For so long by the drone's own clock: whatever was on its way has arrived."""
        assert self.truth is not None
        end_ns = self.truth.stamp_ns + seconds * 1e9
        until(lambda: self.truth is not None and self.truth.stamp_ns > end_ns, lambda: self.truth)

    @property
    def gone_to(self) -> list[tuple[float, float]]:
        return [
            (m.north, m.east)
            for m in self.asked.values()
            if m.kind == "goto" and m.north is not None and m.east is not None
        ]


def tap(page: BrowserPage, share: tuple[float, float]) -> None:
    left, top, width, height = page.look(BOX)
    page.touch("touchStart", (left + share[0] * width, top + share[1] * height))
    page.touch("touchEnd")


def hold(page: BrowserPage, button: str, gone: str) -> None:
    page.touch("touchStart", page.middle(button))
    page.wait(gone)
    page.touch("touchEnd")


@pytest.mark.slow
def test_a_tap_and_a_held_button_send_the_drone_there(browser: Browser, exits: ExitStack) -> None:
    dive = MappedDive(browser, exits, *POSITION)
    page = dive.page
    page.wait(f"{SAID}.startsWith('±')")
    tap(page, TAPPED)
    page.wait(f"/ go \\d/.test({SAID})")
    page.touch("touchStart", page.middle("#map-go"))
    page.touch("touchEnd")  # a touch is not enough
    dive.goes_on(1.0)
    assert dive.gone_to == []
    said = set[str]()

    def arrived() -> bool:
        """A page that a busy computer holds up is a lost pilot: his hold is void, and his drone
        stops on its way. He asks again."""
        assert dive.truth is not None
        assert dive.status is not None
        if dive.gone_to and dist(dive.truth.position[:2], dive.gone_to[-1]) < MOST_OFF:
            return True
        if dive.status.goal is not UNSET:
            assert dive.status.goal == dive.gone_to[-1]
            said.add(page.look(SAID))
        elif dive.status.activity == "piloted":
            tap(page, TAPPED)
            page.wait("!document.getElementById('map-go').disabled")
            hold(page, "#map-go", "document.getElementById('map-go').disabled")
            dive.goes_on(0.5)
        return False

    until(arrived, lambda: f"{dive.gone_to}: {dive.truth}")
    assert any(" goes " in text for text in said)
    page.look("window.before = true; location.reload()")
    page.wait("window.before === undefined && document.getElementById('map-said') !== null")
    page.wait(f"{SAID}.includes('home ')")  # kept by the service, and so is the track
    page.look("void import('/main.js').then((main) => { window.video = main.video; })")
    page.wait("window.video && video.connection.track.length >= 9")


@pytest.mark.slow
def test_without_a_measured_position_it_says_why_it_cannot_go(
    browser: Browser, exits: ExitStack
) -> None:
    dive = MappedDive(browser, exits)
    page = dive.page
    page.wait(f"{SAID}.startsWith('this drone does not know its position')")
    tap(page, TAPPED)
    own = "document.getElementById('own').textContent"
    page.wait(f"{own} === 'this drone does not know its position'")
    assert page.look("document.getElementById('map-go').disabled")
    assert dive.gone_to == []


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size.width}x{size.height}")
def test_what_is_on_the_map_can_be_pressed_and_read(
    browser: Browser, served: Served, size: Size
) -> None:
    page = served.open(browser, size, before="localStorage.setItem('map', 'shut');")
    page.look(FINGER if size.touch else "0")
    page.look(OPEN)
    for place in (PLACE, RECKONED, NOWHERE):
        served.becomes(page, **place)
        assert page.look(UNPRESSED) == ""
        contrast, where = page.look(CONTRAST)
        assert contrast >= 4.5, where
    if size.touch:
        served.becomes(page, **PLACE)
        tap(page, TAPPED)
        page.wait("!document.getElementById('map-go').disabled")
        assert page.look(UNPRESSED) == ""
    page.close()


def test_home_is_one_more_place_to_go_to(browser: Browser, served: Served) -> None:
    page = served.open(browser, PHONE, before="localStorage.setItem('map', 'shut');")
    page.look(OPEN)
    served.becomes(page, **PLACE)
    page.look("document.getElementById('map-home').click()")
    hold(page, "#map-go", "document.getElementById('map-go').disabled")
    until(lambda: bool(served.wishes), lambda: "no wish")
    (wish,) = served.wishes
    assert (wish.what, wish.north, wish.east) == ("goto", 0.0, 0.0)
    page.close()


def test_the_next_way_points_of_a_path_are_on_the_map(browser: Browser, served: Served) -> None:
    page = served.open(browser, PHONE, before="localStorage.setItem('map', 'open');")
    ahead = [[8.0, 4.0], [8.0, 9.0]]  # 5 m north of the drone, then 5 m east
    shown = list[int]()
    for places in (None, ahead):
        served.becomes(page, **{**PLACE, "goal": None, "current": None, "waypoints": places})
        shown += [page.look(PINK.replace("NORTH", n).replace("EAST", e)) for n, e in LEGS]
    assert shown == [0, 0, 0, 1, 1, 0]
    page.close()


@pytest.mark.parametrize(
    ("up", "heading", "where", "course"),
    [
        ("north", 90.0, (0.5, 0.2), 0),
        ("north", 90.0, (0.9, 0.5), 90),
        ("heading", 90.0, (0.5, 0.2), 90),
        ("heading", 200.0, (0.1, 0.5), 110),
    ],
)
def test_a_place_is_where_it_was_tapped(
    browser: Browser,
    served: Served,
    up: str,
    heading: float,
    where: tuple[float, float],
    course: int,
) -> None:
    kept = f"localStorage.setItem('map', 'open'); localStorage.setItem('up', '{up}');"
    page = served.open(browser, PHONE, before=kept)
    served.becomes(page, **{**PLACE, "compass_deg": heading})
    tap(page, where)
    page.wait("!document.getElementById('map-go').disabled")
    said = str(page.look(SAID))
    assert abs(int(said.rpartition(", ")[2].rstrip("°")) - course) <= 1
    hold(page, "#map-go", "document.getElementById('map-go').disabled")
    until(lambda: bool(served.wishes), lambda: "no wish")
    (wish,) = served.wishes
    assert wish.north is not None
    assert wish.east is not None
    ahead = cos(radians(course)), sin(radians(course))
    north, east = wish.north - 3.0, wish.east - 4.0
    assert north * ahead[0] + east * ahead[1] == pytest.approx(hypot(north, east), rel=1e-3)
    page.close()


def test_a_drag_moves_the_map_and_the_button_brings_it_back(
    browser: Browser, served: Served
) -> None:
    page = served.open(browser, PHONE, before="localStorage.setItem('map', 'shut');")
    page.look(OPEN)
    served.becomes(page, **PLACE)
    left, top, width, height = page.look(BOX)
    middle = (left + width / 2, top + height / 2)
    page.touch("touchStart", middle)
    page.touch("touchMove", (middle[0] + 60.0, middle[1]))
    page.touch("touchEnd")
    served.becomes(page, **PLACE)
    assert page.look("document.getElementById('map-go').disabled")  # a drag is no tap
    back = "document.getElementById('map-centre')"
    assert not page.look(f"{back}.disabled")
    page.look(f"{back}.click()")
    served.becomes(page, **PLACE)
    assert page.look(f"{back}.disabled")
    page.close()
