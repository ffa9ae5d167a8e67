"""What the keys do to a replay, and that it repeats itself where it is asked to."""

import os
from collections.abc import Sequence

import pytest

from services.runtime.bus.envelope import Envelope
from services.runtime.bus.memory_bus import MemoryBus, MemoryBusPort
from services.runtime.os import system
from tests.golden.dives import golden
from tools.replay.onto_bus import Replay, Wish
from tools.replay.source import open_source
from tools.replay.terminal import Key, Terminal

SECOND = 1_000_000_000


class Pressed(Terminal):
    """Keys as they were planned, one list for each time that the replay waits."""

    def __init__(self, plan: list[list[Key]]) -> None:
        super().__init__(None, shows=False)
        self.plan = plan

    def wait(self, seconds: float) -> Sequence[Key]:
        super().wait(seconds)
        return self.plan.pop(0) if self.plan else []


def played(
    begin_s: float, end_s: float, plan: list[list[Key]], *, loop: bool = False, most: int = 10**9
) -> list[Envelope]:
    """What is heard of a replay until its end, or until so many messages were heard."""
    source, hub, heard = open_source(golden("pioneer")), MemoryBus(), list[Envelope]()
    MemoryBusPort(hub).hear("**", heard.append)
    first = source.span[0]
    span = first + round(begin_s * SECOND), first + round(end_s * SECOND)
    replay = Replay(source, Wish(span, loop=loop), MemoryBusPort(hub), Pressed(plan))
    assert replay.play(lambda: len(heard) >= most) == 0
    return heard


def in_recording(begin_s: float, end_s: float) -> int:
    source = open_source(golden("pioneer"))
    first = source.span[0]
    return sum(begin_s * SECOND <= raw.log_ns - first <= end_s * SECOND for raw in source.raw())


def test_to_the_end_every_message_once() -> None:
    heard = played(5.0, 5.1, [])
    assert len(heard) == in_recording(5.0, 5.1)
    assert all(envelope.encoding.endswith(";replayed") for envelope in heard)


def test_it_repeats_itself() -> None:
    once = in_recording(5.0, 5.05)
    heard = played(5.0, 5.05, [], loop=True, most=3 * once)
    assert [e.key for e in heard[:once]] == [e.key for e in heard[once : 2 * once]]


def test_a_jump_passes_over_what_is_between(capsys: pytest.CaptureFixture[str]) -> None:
    heard = played(1.0, 9.0, [["on"], ["on"]])  # twice 5 s: to its end
    assert 0 < len(heard) < in_recording(1.0, 9.0) / 20
    assert "messages of" in capsys.readouterr().out


def test_a_jump_back_repeats_and_q_ends_it() -> None:
    heard = played(5.0, 9.0, [["back"], ["back"], ["quit"]])
    first = [k for k, envelope in enumerate(heard) if envelope.payload == heard[0].payload]
    assert len(heard) < in_recording(5.0, 9.0)
    assert len(first) <= 1  # its stamps are others each time
    assert [e.key for e in heard].count(heard[0].key) >= 2


def test_a_pause_sends_nothing() -> None:
    many: list[list[Key]] = [["pause"], *[[]] * 5, ["quit"]]
    assert len(played(5.0, 9.0, many)) < in_recording(5.0, 9.0) / 20


def test_keys_come_one_by_one_from_a_terminal() -> None:
    here, there = os.openpty()
    with system.keys_of(there) as read:
        shown = Terminal(read, shows=False)
        assert shown.interactive
        assert shown.wait(0.0) == []
        os.write(here, b" \x1b[C")
        assert shown.wait(1.0) == ["pause", "on"]
    os.close(here)
    os.close(there)
