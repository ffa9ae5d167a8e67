"""A dive in real processes whose link is bad, gets worse, goes away and comes back."""

import time
from collections.abc import Callable
from pathlib import Path

import pytest

from messages.control import THRUST_TTL_MS
from messages.link import LinkAnswer, LinkStatus
from messages.message import Message
from messages.pilot import TTL_MS
from messages.reference import Reference
from messages.vehicle import Actuation, VehicleStatus
from tests.support.patience import PATIENCE_S
from tests.support.started import Started
from tools import link
from tools.recordings.recording import open_recording

pytestmark = [pytest.mark.system, pytest.mark.slow]

MS = 1_000_000  # [ns]
SCRIPT = "t,surge,sway,heave,yaw\n" + "".join(
    f"{0.5 * k:g},{0.3 * (-1) ** k:g},0,{0.5 * (-1) ** (k // 4):g},0.3\n" for k in range(18)
)


def fly(folder: Path, meanwhile: Callable[[Path], None]) -> list[Message]:
    """A dive over `severe`, with something done to it as soon as the pilot has the sticks.

    Returns:
        What the drone recorded, in order.
    """
    words = ("dive", "--headless", "--link", "severe")
    with Started(folder / "out", *words, script=f"{SCRIPT}9,0,0,0,0\n") as dive:
        dive.until_armed()
        meanwhile(dive.out)
        assert dive.process.wait(PATIENCE_S) in (0, 3), dive.said  # 3: data were lost
    return [entry.message for entry in open_recording(dive.out)]


def worse_away_and_back(out: Path) -> None:
    """The pauses are what the dive shall live through, each long enough to be seen."""
    time.sleep(1.0)
    link.set_("down.delay_ms=150", "down.corrupt=0.05", dive=out)
    time.sleep(1.5)
    link.set_("down", dive=out)
    time.sleep(1.5)
    link.set_("up", dive=out)
    time.sleep(1.0)
    link.set_("congested", dive=out)


def test_a_link_that_changes_under_way_lets_nothing_old_act(tmp_path: Path) -> None:
    recorded = fly(tmp_path, worse_away_and_back)

    answers = {m.id: m for m in recorded if isinstance(m, LinkAnswer)}.values()
    assert [answer.kind for answer in answers] == ["set", "down", "up", "profile"]
    assert all(answer.accepted and answer.change for answer in answers)
    cut, joined = (next(m.stamp_ns for m in answers if m.kind == kind) for kind in ("down", "up"))

    references = [m for m in recorded if isinstance(m, Reference)]
    ages = [m.stamp_ns - m.pilot_ns for m in references if m.pilot_ns is not None]
    assert len(ages) > 200
    assert max(ages) <= TTL_MS * MS
    away = range(cut + round(TTL_MS * MS), joined)
    assert not [m for m in references if m.stamp_ns in away and m.pilot_ns is not None]
    moved = [m for m in recorded if isinstance(m, Actuation) and m.pilot_ns is not None]
    ages = [m.actuated_ns - (m.pilot_ns or 0) for m in moved if m.actuated_ns is not None]
    assert max(ages) <= (TTL_MS + THRUST_TTL_MS) * MS  # a command pushes on while its thrust lives

    statuses = [m for m in recorded if isinstance(m, VehicleStatus) and m.armed]
    assert {m.failsafe for m in statuses if m.stamp_ns in away} <= {"pilot_lost", "link_lost"}
    assert "none" in {m.failsafe for m in statuses if m.stamp_ns > joined}

    links = [m for m in recorded if isinstance(m, LinkStatus)]
    assert not [m for m in links if m.stamp_ns in away and m.up]
    assert [m for m in links if m.stamp_ns > joined and m.up]
    assert list(dict.fromkeys(m.profile for m in links)) == ["severe", "congested"]
    assert links[-1].changes == 4
