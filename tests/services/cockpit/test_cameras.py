"""Which camera is large: who says so, how long it lasts, and what pages are shown of it."""

import json
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.video import CameraChoice, CameraShares
from services.cockpit.cameras import ANSWERED_NS, REPEAT_NS, Cameras
from services.cockpit.core import Settings
from services.cockpit.page_messages import PageOpened, PageSaid, parsed
from services.cockpit.service import CockpitPages
from services.marine.field_of_view import FieldOfView
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.runtime.hosts.virtual_host import VirtualHost
from tests.support.pilots import Browsers

S = 1_000_000_000
STEP_S = 0.1  # [s]
ANN, BOB, WATCHER = 1, 2, 3
VIEWS = {
    "front": FieldOfView(tilt=0.1),
    "down": FieldOfView(angle=1.0, tilt=-1.5, yaw=0.5),
    "aft": FieldOfView(),
}
names = st.sampled_from(sorted(VIEWS))
# Something happens: who, and which camera.
happens = st.lists(
    st.tuples(
        st.sampled_from(["choose", "told", "control", "nothing"]), names, st.integers(0, 3 * S)
    ),
    max_size=30,
)


def said(large: str, now: int = 0, **kbit: float) -> CameraShares:
    return CameraShares(stamp_ns=now, large=large, total_kbit=100.0, kbit=kbit)


@given(happens)
def test_the_choice_lasts_until_somebody_in_control_makes_another(
    history: list[tuple[str, str, int]],
) -> None:
    """And it is repeated only while this pilot has control, or no camera says that it is large; at
    most once a second."""
    cameras, now, in_control = Cameras(VIEWS, "ann"), 0, False
    told_ns: int | None = None
    wanted, known, chosen_ns, sent_ns = "front", False, -ANSWERED_NS, -REPEAT_NS
    for what, camera, later in history:
        now += later
        match what:
            case "choose":
                choice = cameras.choose(camera, now)
                assert isinstance(choice, CameraChoice)
                assert (choice.camera, choice.source) == (camera, "ann")
                wanted, known, chosen_ns, sent_ns = camera, True, now, now
            case "told":
                cameras.told(said(camera), now, in_control=in_control)
                told_ns = now
                if not (known and (in_control or now < chosen_ns + ANSWERED_NS)):
                    wanted, known = camera, True
            case "control":
                in_control = not in_control
            case _:
                repeated = cameras.repeated(now, in_control=in_control)
                silent = told_ns is not None and now >= told_ns + ANSWERED_NS
                if repeated is not None:
                    assert in_control or silent
                    assert repeated.camera == wanted
                    assert now >= sent_ns + REPEAT_NS
                    sent_ns = now
                else:
                    assert (
                        not (known and (in_control or silent)) or now < max(sent_ns, 0) + REPEAT_NS
                    )
        assert cameras.large == wanted


class Deck:
    """The cockpit's service, with two pages that may fly and one that watches."""

    def __init__(self) -> None:
        self.host, self.pages = VirtualHost(), Browsers()
        self.pages.hear = self.pages.waiting.append
        self.node = self.host.node("cockpit", ["topside"])
        vehicle = Stack(vehicle="pioneer").section("vehicle", Vehicle)
        self._service = CockpitPages(
            self.node, Settings(pilot="ann"), vehicle, self.pages, "", Cameras(VIEWS, "ann")
        )
        self.chosen: list[str] = []
        decode = msgspec.msgpack.Decoder(CameraChoice).decode
        bus = self.host.side("topside")
        bus.hear(topics.CAMERA_CHOICE.key, lambda e: self.chosen.append(decode(e.payload).camera))
        self._shares = bus.say(topics.CAMERA_SHARES.of("down"))
        for page in (ANN, BOB, WATCHER):
            self.pages.waiting.append(PageOpened(page, page == WATCHER))
        self.run(0.2)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self._service.receive(self.host.now)
            self.host.run(self.host.now + round(STEP_S * S))

    def wish(self, page: int, what: str, held_ms: float = 0.0, **more: str) -> None:
        """`held_ms`: ago it was made."""
        seen = self.pages.pictures[page]["n"] - round(held_ms / 40.0)
        message = {"kind": "wish", "seen": seen, "held_ms": 0.0, "what": what, **more}
        self.pages.waiting.append(PageSaid(page, parsed(json.dumps(message))))
        self.run(0.1)

    def told(self, large: str, **kbit: float) -> None:
        self._shares(msgspec.msgpack.encode(said(large, self.host.now, **kbit)))
        self.run(0.1)

    def views(self) -> list[dict[str, Any]]:
        return [self.pages.pictures[page]["view"] for page in (ANN, BOB, WATCHER)]


def test_any_page_may_choose_while_nobody_has_the_sticks_and_every_page_shows_it() -> None:
    deck = Deck()
    assert {view["large"] for view in deck.views()} == {"front"}
    deck.wish(BOB, "camera", camera="down")
    assert deck.chosen == ["down"]
    assert {view["large"] for view in deck.views()} == {"down"}
    deck.wish(WATCHER, "camera", camera="aft")
    assert deck.chosen == ["down"]
    assert deck.node.counts["refused:watcher"] == 1


def test_with_the_sticks_one_page_decides() -> None:
    deck = Deck()
    deck.wish(ANN, "take")
    deck.wish(BOB, "camera", camera="down")
    assert deck.chosen == []
    assert deck.node.counts["not_the_holder:page"] == 1
    deck.wish(ANN, "camera", camera="down")
    assert deck.chosen == ["down"]


@pytest.mark.parametrize(("held_ms", "camera"), [(1500.0, "down"), (0.0, "sonar")])
def test_what_comes_too_late_or_is_no_camera_is_refused_and_said(
    held_ms: float, camera: str
) -> None:
    deck = Deck()
    deck.run(2.0)
    deck.wish(ANN, "camera", held_ms, camera=camera)
    assert deck.chosen == []
    assert sum(deck.node.counts[name] for name in ("expired:wish", "refused_here:camera")) == 1
    assert any("camera" in line[3] for line in deck.pages.pictures[ANN]["log"])


def test_what_another_pilot_chose_is_shown_and_which_camera_has_no_room() -> None:
    deck = Deck()
    deck.told("down", front=20.0, down=80.0, aft=0.0)
    view = deck.views()[0]
    assert view["large"] == "down"
    assert view["cameras"] == [["front", False], ["down", False], ["aft", True]]
    deck.run(2.0)  # nobody says so any more
    assert deck.views()[0]["cameras"][2] == ["aft", False]


def test_the_overlay_is_of_the_large_camera() -> None:
    deck = Deck()
    assert deck.views()[0]["fov_deg"] == 80.0
    assert deck.views()[0]["looks_deg"] == [5.7, 0.0]
    deck.wish(ANN, "camera", camera="down")
    assert deck.views()[0]["fov_deg"] == 57.3
    assert deck.views()[0]["looks_deg"] == [-85.9, 28.6]
    cameras = Cameras(VIEWS)
    assert cameras.looks(-20.0) == (-14.3, 0.0)  # the pilot tilts the first one …
    cameras.choose("down", 0)
    assert cameras.looks(-20.0) == (-85.9, 28.6)  # … and no other
