"""The head-up numbers in a window, and that they never delay the sticks."""

from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from messages import topics
from messages.events import Outbox
from messages.message import Notice
from messages.vehicle import VehicleStatus
from services.gamepad.io import sdl
from services.gamepad.service import Connected
from services.piloting.pilot import Pilot, Progress
from services.piloting.sticks import StickReading
from services.runtime.hosts.virtual_host import VirtualHost
from services.vehicle_view.view import VehicleView

sdl.load()

import pygame  # noqa: E402

from services.gamepad.io.keyboard import (  # noqa: E402
    HELP,
    SIZE,
    PilotWindow,
)

S = 1_000_000_000  # [ns]
LONG = VehicleView(
    failsafe="leak", acting=(Notice("leak"),) * 20, alarms=(Notice("x" * 300),), depth_m=-12345.678
)


class Still:
    """Sticks that nobody touches."""

    name, played = "still", 0

    def read(self, now: int, began: int | None) -> StickReading:  # noqa: ARG002
        return StickReading()

    def next_ns(self, now: int, began: int) -> int | None:  # noqa: ARG002
        return None


@pytest.fixture
def surface(monkeypatch: pytest.MonkeyPatch) -> Iterator[pygame.Surface]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame.display.init()
    yield pygame.display.set_mode(SIZE)
    pygame.display.quit()


def test_numbers_are_drawn_ten_times_a_second_after_the_sticks_were_sent(
    surface: pygame.Surface, monkeypatch: pytest.MonkeyPatch
):
    host = VirtualHost()
    node = host.node("gamepad", ["topside"])
    done: list[tuple[str, int]] = []
    Connected(node, Still(), Pilot(Progress(), Outbox(), False))
    window = PilotWindow(surface, HELP)

    def draw(view: VehicleView, *, focused: bool) -> None:  # noqa: ARG001
        done.append((view.activity or "–", host.now))

    monkeypatch.setattr(window, "draw", draw)
    window.look(node)
    other = host.node("other", ["topside"])
    other.each(topics.PILOT_COMMAND, lambda command, _: done.append(("", command.stamp_ns)))
    status = other.publisher(topics.STATUS)
    other.every(
        topics.STATUS.hz,
        lambda now: status.put(VehicleStatus(stamp_ns=now, activity="piloted", armed=True)),
    )
    host.run(2 * S)
    drawn = [at for what, at in done if what]
    sent = [at for what, at in done if not what]
    assert {what for what, at in done if at > S and what} == {"piloted"}
    assert 12 <= len(drawn) <= 20
    assert len(sent) >= 99
    assert set(drawn) <= set(sent)  # always in an instant in which the sticks were sent


def test_a_sentence_for_every_row_fits_into_its_width(surface: pygame.Surface):
    window = PilotWindow(surface, HELP)
    window.draw(LONG)
    edge = surface.subsurface((SIZE[0] - 4, 0, 4, 300))
    assert pygame.transform.average_color(edge)[:3] == (8, 14, 22)  # nothing but paper


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.text(st.characters(categories=None), max_size=600))
@example("\0")
@example("\ud800")
@example("\U0001f99e")
@example("\u0301")
@example("W" * 100_000)
def test_no_text_from_the_bus_ends_the_drawing(surface: pygame.Surface, text: str):
    view = VehicleView(
        activity=text, flight_mode=text, doing=text, notices=(Notice(text),), alarms=(Notice(text),)
    )
    PilotWindow(surface, HELP).draw(view)
