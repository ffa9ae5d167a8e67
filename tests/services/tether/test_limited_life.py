"""What is useless later does not wait, and takes nothing from what does."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from messages import events, topics
from messages.topic import Qos
from services.tether.core import Link
from services.tether.io.profile_file import named
from services.tether.link_model import LinkDirection
from services.tether.priority_queue import RANK
from services.tether.profile import DirectionProfile, Queue

MS, S = 1_000_000, 1_000_000_000
LIFE = 400 * MS
BULK, LIVE = RANK[Qos.BULK], RANK[Qos.LIVE]
SLOW = DirectionProfile(delay_ms=30.0, rate_kbit=100.0, queue=Queue(limit_bytes=50_000))


def emptied(line: LinkDirection[int], until: int) -> dict[int, int]:
    """[ns] Arrival of each message by `until`."""
    arrived: dict[int, int] = {}
    while (due := line.due()) is not None and due <= until:
        while (arrival := line.leave(due)) is not None:
            arrived[arrival.item] = due
    return arrived


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(100, 5000)), min_size=1, max_size=60))
def test_none_is_sent_after_its_life_and_each_is_sent_or_counted(
    entered: list[tuple[int, int]],
) -> None:
    line: LinkDirection[int] = LinkDirection(SLOW, np.random.default_rng(1))
    now, times, arrived = 0, list[int](), dict[int, int]()
    for number, (gap, size) in enumerate(entered):
        now += gap * MS
        arrived |= emptied(line, now)
        times.append(now)
        line.enter(number, now, size, BULK, LIFE)
    arrived |= emptied(line, now + 100 * S)
    for number, at in arrived.items():
        to_send = entered[number][1] * 8e6 / SLOW.rate_kbit
        assert at <= times[number] + LIFE + to_send + 30 * MS + 1
    assert len(arrived) + line.lost[events.NO_ROOM.name] == len(entered)


def state_delays(link: Link[tuple[str, int]], until: int) -> list[int]:
    """[ns] Of every state that arrives by `until`."""
    delays = list[int]()
    while (due := link.up.due()) is not None and due <= until:
        while (arrival := link.up.leave(due)) is not None:
            if arrival.item[0] == topics.STATE.key:
                delays.append(due - arrival.item[1])
    return delays


def test_the_picture_has_its_room_first_and_the_state_its_floor() -> None:
    def flown(video_bytes: int) -> tuple[list[int], Link[tuple[str, int]]]:
        link: Link[tuple[str, int]] = Link("congested", named("congested").profile, 1)
        states = list[int]()
        for tick in range(2000):
            now = tick * 10 * MS
            states.extend(state_delays(link, now))
            if tick % 20 == 0:
                link.judge(now)
            for topic in (topics.STATE, topics.TRUTH, topics.WRENCH, topics.REFERENCE):
                if link.admits_up(topic.key, 300, now):
                    link.up.enter((topic.key, now), now, 300, RANK[topic.qos])
            if video_bytes and tick % 4 == 0 and link.admits_up(topics.VIDEO.key, 600, now):
                for _ in range(video_bytes // 600):
                    link.up.enter((topics.VIDEO.key, now), now, 600, BULK, LIFE)
        return states, link

    alone, link = flown(0)
    beside, shared = flown(6000)  # 1200 kbit/s on a link of 384
    floor = round(20 * topics.STATE.floor_hz)
    assert len(alone) > 2 * floor
    assert floor - 2 <= len(beside) <= floor + 5
    telemetry = sum(shared.thinned[key] * 400 * 8e-3 for key in ("state", "reference"))
    assert shared.up.carried_bytes * 8e-3 / 20.0 > 0.9 * 384.0  # the rest of it is the picture's
    assert telemetry < 0.15 * 384.0
    assert link.thinned[topics.STATE.key] > shared.thinned[topics.STATE.key]
    # Behind one part that is on the wire already: 700 bytes take 14.6 ms.
    assert float(np.percentile(beside, 99)) <= float(np.percentile(alone, 99)) + 15 * MS
