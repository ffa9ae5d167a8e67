"""A replay sends every message once, and repeats itself where it is asked to."""

from services.runtime.bus.envelope import Envelope
from services.runtime.bus.memory_bus import MemoryBus, MemoryBusPort
from tests.golden.dives import golden
from tools.replay.play import Replay, Wish
from tools.replay.source import open_source

SECOND = 1_000_000_000


def played(
    begin_s: float, end_s: float, *, loop: bool = False, most: int = 10**9
) -> list[Envelope]:
    """What is heard of a replay until its end, or until so many messages were heard."""
    source, hub, heard = open_source(golden("pioneer")), MemoryBus(), list[Envelope]()
    MemoryBusPort(hub).hear("**", heard.append)
    first = source.span[0]
    span = first + round(begin_s * SECOND), first + round(end_s * SECOND)
    replay = Replay(source, Wish(span, loop=loop), MemoryBusPort(hub))
    assert replay.play(lambda: len(heard) >= most) == 0
    return heard


def in_recording(begin_s: float, end_s: float) -> int:
    source = open_source(golden("pioneer"))
    first = source.span[0]
    return sum(begin_s * SECOND <= raw.log_ns - first <= end_s * SECOND for raw in source.raw())


def test_to_the_end_every_message_once() -> None:
    heard = played(5.0, 5.1)
    assert len(heard) == in_recording(5.0, 5.1)
    assert all(envelope.encoding.endswith(";replayed") for envelope in heard)


def test_it_repeats_itself() -> None:
    once = in_recording(5.0, 5.05)
    heard = played(5.0, 5.05, loop=True, most=3 * once)
    assert [e.key for e in heard[:once]] == [e.key for e in heard[once : 2 * once]]
