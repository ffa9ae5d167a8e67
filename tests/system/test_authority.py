"""Who has the sticks: commands of another authority epoch never move the drone."""

from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from messages import topics
from messages.pilot import PilotAnswer, PilotCommand, PilotRequest
from messages.reference import Reference
from messages.vehicle import VehicleStatus
from services.runtime.registry import Registry
from services.runtime.stack import Stack
from services.runtime.virtual_host import VirtualHost

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

    def ask(self, kind: str, now: int) -> None:
        request = PilotRequest(stamp_ns=now, id=f"{self._name}-{kind}-{now}", kind=kind)  # type: ignore[arg-type]
        self._requests.put(request)

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
    ear = host.node("ear", ["drone"])
    ear.each(topics.REFERENCE, lambda m, _: references.append(m))
    ear.each(topics.STATUS, lambda m, _: statuses.append(m))
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
