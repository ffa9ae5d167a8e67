"""Today's estimation, reference and control on a recorded dive of each vehicle: nothing changed
that nobody wanted to change. Where it was wanted: `python -m tests.golden.update`."""

import pytest

from services.control.axis.axis import Axis, Motion
from services.runtime.bus.envelope import Envelope
from services.runtime.node.ports import Inbox
from tests.golden.dives import CHAIN, TOLERANCES, VEHICLES, golden
from tools.replay.differences import in_words
from tools.replay.source import open_source
from tools.replay.through import ThroughResult, through

LARGEST = 320_000  # [bytes] of a golden file


def replayed(vehicle: str) -> ThroughResult:
    source = open_source(golden(vehicle))
    return through(source, CHAIN, tolerances=TOLERANCES)


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_todays_code_does_as_it_did(vehicle: str) -> None:
    found = replayed(vehicle)
    assert [in_words(one, found.begin_ns) for one in found.differences] == []
    assert found.seconds > 10.0
    for key in ("state", "reference", "control/wrench", "control/thrusters"):
        assert found.compared[key] >= 50
    assert found.compared["pilot/answer"] == 2  # control was taken and the drone armed


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_a_golden_dive_moves_and_is_small(vehicle: str) -> None:
    assert golden(vehicle).stat().st_size < LARGEST
    source = open_source(golden(vehicle))
    moved = [raw for raw in source.raw() if raw.key == "control/thrusters"]
    thrusts = [source.recording.decode(raw) for raw in moved]
    assert len({getattr(command, "thrust") for command in thrusts}) > 20  # noqa: B009


def test_a_flipped_sign_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    rightly = Axis.feed_forward

    def wrongly(law: Axis, reference: Motion, water: float = 0.0) -> float:
        return -rightly(law, reference, water)

    monkeypatch.setattr(Axis, "feed_forward", wrongly)
    found = replayed("bluerov2_heavy")
    assert {one.key for one in found.differences} >= {"control/wrench", "control/thrusters"}


def test_a_dropped_message_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    rightly = Inbox.store
    dropped: list[Envelope] = []

    def without_one(inbox: Inbox, envelope: Envelope) -> None:
        if envelope.key == "pilot/command" and not dropped and inbox.stored == 200:
            dropped.append(envelope)
        else:
            rightly(inbox, envelope)

    monkeypatch.setattr(Inbox, "store", without_one)
    found = replayed("minerva")
    assert len(dropped) == 1
    assert "health/reference" in {one.key for one in found.differences}
