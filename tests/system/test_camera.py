"""The drone's picture on virtual time: through the link, its age measured."""

from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import pytest

from messages import topics
from messages.link import LinkRequest
from messages.video import PictureAge, VideoPart
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost

pytest.importorskip("av")

S = 1_000_000_000
LEFT_OUT = ("recorder", "visualizer", "gamepad", "predictor")
WORSE, BETTER, END = 3 * S, 8 * S, 12 * S  # [ns] when the link changes


class Flown:
    """A camera's dive over `tether`, then `congested`, then `tether` again."""

    def __init__(self) -> None:
        stack = Stack(seed=1, virtual=True, overrides=["simulator.floor_depth=4"])
        services = Registry.read("camera")
        host = VirtualHost()
        kept = {name: spec for name, spec in services.items() if name not in LEFT_OUT}
        host.add_all(services.only(kept), stack)
        self.host = host
        self.sent: list[tuple[int, VideoPart]] = []  # on board
        self.arrived: list[tuple[int, VideoPart]] = []  # topside
        self.ages: list[tuple[int, PictureAge]] = []
        self._keep("drone", topics.VIDEO, self.sent)
        self._keep("topside", topics.VIDEO, self.arrived)
        self._keep("topside", topics.PICTURE_AGE, self.ages)
        ask = host.side("topside").say(topics.LINK_REQUEST)
        for until, profile in ((WORSE, "congested"), (BETTER, "tether"), (END, "")):
            host.run(until)
            if profile:
                change = LinkRequest(stamp_ns=until, id=profile, kind="profile", profile=profile)
                ask(msgspec.msgpack.encode(change))

    def _keep(self, side: str, topic: Any, into: list[Any]) -> None:
        decode: Callable[[bytes], Any] = msgspec.msgpack.Decoder(topic.message).decode
        self.host.side(side).hear(
            topic.key, lambda e: into.append((self.host.now, decode(e.payload)))
        )


@pytest.fixture(scope="module")
def flown() -> Flown:
    return Flown()


def kbit(parts: list[tuple[int, VideoPart]], begin: int, end: int) -> float:
    """[kbit/s]"""
    size = sum(len(part.data) for at, part in parts if begin <= at < end)
    return size * 8e6 / (end - begin)


@pytest.mark.slow
def test_the_age_is_said_stage_by_stage(flown: Flown) -> None:
    good = [age for at, age in flown.ages if S < at < WORSE]
    assert all(age.exact and not age.words for age in good)
    assert np.mean([age.per_second for age in good]) > 23.0
    for age in good:
        assert age.stages is not None
        assert age.total is not None
        assert age.total.p50_ms == pytest.approx(sum(s.p50_ms for s in age.stages), abs=1.0)


@pytest.mark.slow
def test_the_bitrate_follows_the_link_down_within_two_seconds_and_up_again(flown: Flown) -> None:
    before = kbit(flown.sent, WORSE - S, WORSE)
    after = kbit(flown.sent, WORSE + 2 * S, BETTER)
    assert before > 150.0
    assert 80.0 < after < 0.85 * 384.0  # [kbit/s] of the link; the picture goes before telemetry
    again = [part.budget_kbit for at, part in flown.sent if at > BETTER + 3 * S]
    assert max(again) > 1000.0


def test_what_arrives_is_never_late_and_what_is_not_is_said(flown: Flown) -> None:
    """On any link: a part waits for 1 s at most, and takes 30 ms and its time to be sent."""
    assert max(at - part.encoded_ns for at, part in flown.arrived) < 1.4 * S
    for _, age in flown.ages:
        assert (age.age_ms is None or age.age_ms > 500.0) == bool(age.words)


def test_nothing_else_is_held_up_and_no_part_is_lost_in_silence(flown: Flown) -> None:
    tether = flown.host.nodes["tether"].counts
    on_the_way = 20
    missing = len(flown.sent) - len(flown.arrived)
    assert 0 <= missing - tether["no_room:camera/video"] <= on_the_way
