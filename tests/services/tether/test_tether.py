"""The tether: late by what its profile says, in order, byte for byte, and nothing else."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.link import LinkStatus
from messages.topic import Way
from services.runtime.bus import Envelope
from services.runtime.errors import LindyError
from services.runtime.stack import Row, Stack
from services.runtime.virtual_host import VirtualHost
from services.tether.core import Leg, Line

MS = 1_000_000
GATEWAY = Row(realms=["topside", "drone"], gateway=True)


def line(delay_ms: float = 5.0, jitter_ms: float = 2.0, seed: int = 1, capacity: int = 4096):
    return Line[int](Leg(delay_ms, jitter_ms), np.random.default_rng(seed), capacity)


def passage(link: Line[int], entries: list[int]) -> list[tuple[int, int]]:
    """(item, out [ns]) of all that comes out."""
    for item, entered in enumerate(entries):
        link.enter(item, entered)
    out: list[tuple[int, int]] = []
    while (due := link.due()) is not None:
        item = link.leave(due)
        assert item is not None
        out.append((item, due))
    return out


@settings(max_examples=50, deadline=None)
@given(
    st.floats(0, 100),
    st.floats(0, 50),
    st.integers(0, 99),
    st.lists(st.integers(0, 10**9), min_size=1, max_size=40),
)
def test_nothing_overtakes_nothing_is_early_and_nothing_is_lost(
    delay: float, jitter: float, seed: int, entries: list[int]
) -> None:
    entries.sort()
    out = passage(line(delay, jitter, seed), entries)
    assert [item for item, _ in out] == list(range(len(entries)))
    times = [at for _, at in out]
    assert times == sorted(times)
    assert all(at >= t + round(delay * MS) for t, at in zip(entries, times, strict=True))


def test_the_same_seed_gives_every_message_the_same_fate() -> None:
    entries = list(range(0, 10**9, 10**7))
    assert passage(line(seed=3), entries) == passage(line(seed=3), entries)
    assert passage(line(seed=3), entries) != passage(line(seed=4), entries)


def test_jitter_has_the_mean_the_profile_states() -> None:
    link, delays = line(5.0, 2.0), list[int]()
    for k in range(20_000):
        entered = k * 10**9  # far apart, so that keeping the order does not shift the statistics
        link.enter(k, entered)
        delays.append((link.due() or 0) - entered)
        link.leave(entered + 10**9)
    mean = sum(delays) / len(delays) / MS
    assert mean == pytest.approx(7.0, abs=4 * 2.0 / np.sqrt(len(delays)))


def test_a_full_line_drops_what_comes_and_counts_it() -> None:
    link = line(delay_ms=1000.0, capacity=3)
    assert [link.enter(k, 0) for k in range(5)] == [True, True, True, False, False]
    assert link.report().dropped == 2


def crossing(row_key: str, source: str, target: str) -> list[tuple[Envelope, int]]:
    """Put one envelope on a key of one realm; what arrives in the other, and when."""
    host = VirtualHost()
    tether = host.add("tether", GATEWAY, Stack(link="tether", seed=5))
    assert tether is not None
    arrived: list[tuple[Envelope, int]] = []
    host.realm(target).hear(row_key, lambda e: arrived.append((e, host.now)))
    envelope = Envelope(row_key, b"\x00 any bytes \xff", "some/encoding", attachment=b"note")
    host.realm(source).forward(envelope)
    host.nodes["tether"].step()
    host.run(100 * MS)
    return arrived


@pytest.mark.parametrize("topic", topics.ALL, ids=lambda t: t.key)
def test_each_row_crosses_in_its_own_direction_only(topic: topics.AnyTopic) -> None:
    key = topic.key.replace("*", "somebody")
    down = crossing(key, "topside", "drone")
    up = crossing(key, "drone", "topside")
    own = topic in (topics.LINK, topics.LINK_ANSWER)  # the tether says it itself, in both realms
    assert bool(down) == (topic.way in (Way.DOWN, Way.BOTH)) or own
    assert bool(up) == (topic.way in (Way.UP, Way.BOTH)) or own


def test_an_envelope_arrives_byte_for_byte_and_late() -> None:
    ((envelope, at),) = crossing("pilot/command", "topside", "drone")
    assert envelope.payload == b"\x00 any bytes \xff"
    assert envelope.encoding == "some/encoding"
    assert envelope.attachment == b"note"
    assert at >= 1 * MS


def test_status_is_heard_in_both_realms_and_tells_the_delay() -> None:
    host = VirtualHost()
    host.add("tether", GATEWAY, Stack(link="remote"))
    pilot, drone = host.node("pilot", ["topside"]), host.node("drone", ["drone"])
    heard: dict[str, LinkStatus] = {}
    pilot.each(topics.LINK, lambda m, now: heard.update(topside=m))  # noqa: ARG005
    drone.each(topics.LINK, lambda m, now: heard.update(drone=m))  # noqa: ARG005
    host.run(3_000 * MS)
    assert heard.keys() == {"topside", "drone"}
    # Health of `pilot` and `drone` cross once a second, so there is something to time.
    assert heard["topside"].up_link.forwarded > 0


def test_an_unknown_profile_is_refused_with_a_suggestion() -> None:
    with pytest.raises(LindyError, match="unknown link 'tehter'; did you mean 'tether'"):
        VirtualHost().add("tether", GATEWAY, Stack(link="tehter"))
