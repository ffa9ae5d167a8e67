"""Who has the sticks: commands of another authority epoch never move the drone."""

from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from messages import topics
from messages.pilot import Course, PilotAnswer, PilotCommand, PilotRequest
from messages.reference import Reference
from messages.vehicle import VehicleStatus
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost

SECOND = 1_000_000_000
ON_BOARD = ("simulator", "estimation", "reference", "control")


class Rival:
    """A second pilot in the same realm, who says what the test wants."""

    def __init__(self, host: VirtualHost, name: str, heave: float) -> None:
        node = host.node(name, ["drone"])
        self.epoch, self.heave, self._name = 0, heave, name
        self.speaks = True
        self.answers: list[PilotAnswer] = []
        self._commands = node.publisher(topics.PILOT_COMMAND)
        self._requests = node.publisher(topics.PILOT_REQUEST)
        node.every(topics.PILOT_COMMAND.hz, self._speak)
        node.each(topics.PILOT_ANSWER, self._hear)

    def ask(self, kind: str, now: int, **more: Any) -> None:
        request = PilotRequest(stamp_ns=now, id=f"{self._name}-{kind}-{now}", kind=kind)  # type: ignore[arg-type]
        self._requests.put(msgspec.structs.replace(request, epoch=self.epoch, **more))

    def _hear(self, answer: PilotAnswer, _: int) -> None:
        if answer.id.startswith(self._name):
            self.answers.append(answer)
            if answer.epoch is not None:
                self.epoch = answer.epoch

    def _speak(self, now: int) -> None:
        if self.speaks:
            self._commands.put(
                PilotCommand(
                    stamp_ns=now, surge=0.0, sway=0.0, heave=self.heave, yaw=0.0,
                    source=self._name, epoch=self.epoch,
                )
            )  # fmt: skip


def on_board(folder: Path) -> tuple[VirtualHost, list[Reference], list[VehicleStatus]]:
    host, rows, stack = VirtualHost(), Registry.read(), Stack(out=str(folder), arm=False)
    for name in ON_BOARD:
        host.add(name, rows[name], stack)
    references: list[Reference] = []
    statuses: list[VehicleStatus] = []
    port = host.node("ear", ["drone"])
    port.each(topics.REFERENCE, lambda m, _: references.append(m))
    port.each(topics.STATUS, lambda m, _: statuses.append(m))
    return host, references, statuses


def test_the_sticks_go_from_hand_to_hand_without_a_gap_and_the_first_hand_moves_nothing_more(
    tmp_path: Path,
) -> None:
    host, references, statuses = on_board(tmp_path)
    first, second = Rival(host, "first", 0.0), Rival(host, "second", 0.0)
    second.speaks = False
    host.run(12 * SECOND)
    first.ask("lease", host.now)
    host.run(12 * SECOND + SECOND // 5)
    assert first.epoch == 1
    first.ask("arm", host.now)
    host.run(13 * SECOND)
    assert statuses[-1].armed

    second.ask("lease", host.now)
    host.run(13 * SECOND + SECOND // 5)
    assert (second.epoch, statuses[-1].epoch) == (2, 2)
    assert statuses[-1].failsafe == "none", "the first goes on until the second speaks"
    second.speaks = True
    host.run(14 * SECOND)
    first.heave = 1.0  # and nothing happens
    host.run(16 * SECOND)
    assert all(abs(r.depth.velocity) < 1e-9 for r in references[-100:])
    assert host.nodes["reference"].counts["wrong_epoch:pilot/command"] > 50
    assert {s.failsafe for s in statuses} == {"none"}

    second.heave = 0.5
    host.run(18 * SECOND)
    assert references[-1].depth.velocity > 0.2
    first.ask("lease", host.now)
    host.run(18 * SECOND + SECOND // 5)
    assert not first.answers[-1].accepted
    assert first.answers[-1].reason == "another pilot is moving the sticks"


@settings(
    max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(epochs=st.lists(st.integers(-5, 50).filter(lambda e: e != 1), min_size=1, max_size=5))
def test_no_epoch_that_was_not_given_is_ever_obeyed(tmp_path: Path, epochs: list[int]) -> None:
    host, references, _ = on_board(tmp_path)
    first, thief = Rival(host, "first", 0.0), Rival(host, "thief", 1.0)
    thief.speaks = False
    host.run(12 * SECOND)
    first.ask("lease", host.now)
    host.run(12 * SECOND + SECOND // 5)
    first.ask("arm", host.now)
    host.run(13 * SECOND)
    thief.speaks = True
    for epoch in epochs:
        thief.epoch = epoch
        host.run(host.now + SECOND // 2)
    assert all(r.depth.velocity == 0.0 for r in references)


WISHES: dict[str, dict[str, Any]] = {
    "arm": {},
    "goto": {"depth": 2.0},
    "follow": {"course": Course(waypoints=((0.0, 0.0), (30.0, 0.0)))},
    "mode": {"hold": "depth_hold"},
    "light": {"value": 1.0},
}


@pytest.fixture
def hand_over(tmp_path: Path) -> tuple[VirtualHost, list[VehicleStatus], Rival, Rival]:
    """The first pilot has armed, the second one has taken the sticks; both still talk."""
    host, _, statuses = on_board(tmp_path)
    first, second = Rival(host, "first", 0.0), Rival(host, "second", 0.0)
    second.speaks = False
    for pilot in (first, second):
        host.run(max(host.now, 12 * SECOND))
        pilot.ask("lease", host.now)
        host.run(host.now + SECOND // 5)
        pilot.speaks = True
        pilot.ask("arm", host.now)
        host.run(host.now + SECOND)
    assert [len(first.answers), len(second.answers)] == [2, 2]
    assert all(answer.accepted for answer in first.answers + second.answers)
    assert statuses[-1].epoch == 2
    return host, statuses, first, second


Scene = tuple[VirtualHost, list[VehicleStatus], Rival, Rival]


@pytest.mark.parametrize("kind", WISHES)
def test_an_ousted_pilot_is_told_that_another_one_has_the_sticks(
    hand_over: Scene, kind: str
) -> None:
    host, statuses, first, second = hand_over
    if kind == "arm":
        second.ask("disarm", host.now)
        host.run(host.now + SECOND // 5)
    before = statuses[-1]
    first.ask(kind, host.now, **WISHES[kind])
    host.run(host.now + SECOND // 2)
    assert not first.answers[-1].accepted
    assert first.answers[-1].reason == "another pilot has the sticks; ask for them first (lease)"
    after = statuses[-1]
    assert (after.mode, after.armed, after.hold, after.light) == (
        (before.mode, before.armed, before.hold, before.light)
    )
    second.ask(kind, host.now, **WISHES[kind])
    host.run(host.now + SECOND // 5)
    assert second.answers[-1].accepted


@pytest.mark.parametrize("kind", ["stop", "disarm"])
def test_an_ousted_pilot_can_still_stop_the_drone(hand_over: Scene, kind: str) -> None:
    host, statuses, first, second = hand_over
    second.heave = 0.5
    host.run(host.now + SECOND)
    first.ask(kind, host.now)
    host.run(host.now + SECOND // 5)
    assert first.answers[-1].accepted
    assert statuses[-1].mode == ("stopping" if kind == "stop" else "ready")


def test_an_epoch_that_was_never_given_opens_no_door(hand_over: Scene) -> None:
    host, _, first, _ = hand_over
    first.epoch = 7
    first.ask("light", host.now, value=1.0)
    host.run(host.now + SECOND // 5)
    assert not first.answers[-1].accepted
    assert "has not given you the sticks" in first.answers[-1].reason
