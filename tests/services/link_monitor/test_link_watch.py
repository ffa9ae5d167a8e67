"""What the pilot is told of the link: risen delays, silence, floods of junk; and both of its
ends."""

from collections import Counter
from collections.abc import Sequence
from random import Random

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.events import note
from messages.health import Health
from messages.link import Clock
from messages.notice import Notice
from services.link_monitor.core import JunkWatch, LinkAlarm
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import Skew, VirtualHost
from services.runtime.node.loop_stats import LoopStats
from tools.up import on_side

MS, SECOND = 1_000_000, 1_000_000_000
PING = SECOND // 5


def sound(rtts_ms: Sequence[float | None]) -> list[tuple[int, str]]:
    """The alarm's text every 50 ms, for pings that take this long (None: never come back)."""
    alarm, texts = LinkAlarm(), list[tuple[int, str]]()
    back = sorted(
        (k * PING + round(rtt * MS), rtt) for k, rtt in enumerate(rtts_ms) if rtt is not None
    )
    for now in range(0, len(rtts_ms) * PING, 50 * MS):
        while back and back[0][0] <= now:
            alarm.answered(back.pop(0)[1])
        if now % PING == 0:
            alarm.sent(now)
        texts.append((now, note(filter(None, [alarm.notice(now)]))))
    return texts


@given(rtt=st.floats(0.1, 400.0), jitter=st.floats(0.0, 40.0), random=st.randoms())
def test_a_link_as_it_always_is_raises_no_alarm(rtt: float, jitter: float, random: Random) -> None:
    pings: list[float | None] = [rtt + jitter * random.random() for _ in range(60)]
    assert {text for now, text in sound(pings) if now > rtt * MS + PING} == {""}


@given(before=st.floats(0.1, 100.0), rise=st.floats(2.0, 50.0))
def test_a_rise_is_told_within_a_second_beyond_the_new_delay(before: float, rise: float) -> None:
    after = before * rise + 60.0
    texts = sound([before] * 50 + [after] * 50)
    limit = 50 * PING + SECOND
    assert all(text == "" for now, text in texts if now < 50 * PING)
    told = next(now for now, text in texts if text)
    assert told <= limit


def test_silence_is_told_and_its_end_too() -> None:
    texts = sound([20.0] * 20 + [None] * 20 + [20.0] * 20)
    told = [now for now, text in texts if text]
    assert 20 * PING + 500 * MS <= told[0] <= 20 * PING + SECOND
    assert told[-1] <= 40 * PING + 100 * MS


def test_before_the_first_answer_nothing_is_known_and_that_is_said() -> None:
    assert sound([None] * 20)[-1][1] == "no answer from the drone yet"


S = 1_000_000_000  # [ns]


def health(counts: dict[str, int], service: str = "control", instance: int = 0) -> Health:
    told = LoopStats().report(service, 0, 0, 0, Counter(counts), None, "drone")
    return msgspec.structs.replace(told, instance=instance)


@given(st.lists(st.integers(0, 60), min_size=2, max_size=20))
def test_more_than_so_many_in_a_second_are_a_flood(more: list[int]) -> None:
    """Of one process, at any time since its start; not what it could read, and no sensor."""
    watch, total = JunkWatch(), 5000
    watch.health(health({"malformed:state": total}), 0)
    for second, number in enumerate(more, 1):
        total += number
        others = {"expired:x": 9**9 * second, "malformed:sensor/imu": 9**9 * second}
        watch.health(health({"malformed:state": total, **others}), second * S)
        floods = [n > 20 for n in more[max(0, second - 3) : second]]
        assert bool(watch.notice(second * S)) == any(floods)
    watch.health(health({"malformed:state": 3}), (len(more) + 4) * S)  # it has started again
    assert watch.notice((len(more) + 4) * S) is None


@given(st.lists(st.tuples(st.integers(0, 1), st.integers(0, 5)), max_size=30))
def test_two_topsides_of_one_drone_are_no_flood(reports: list[tuple[int, int]]) -> None:
    watch, counted = JunkWatch(), [0, 30]  # since their starts
    for at, (topside, more) in enumerate(reports):
        counted[topside] += more
        watch.health(
            health({"malformed:state": counted[topside]}, "recorder_topside", topside), at * S // 2
        )
        assert watch.notice(at * S // 2) is None


def test_however_many_processes_there_were_a_flood_is_noticed() -> None:
    watch = JunkWatch()
    for number in range(1000):
        watch.health(health({}, instance=number), number * S)
    for second in range(3):
        watch.health(health({"malformed:x": 100 * second}, "new"), (1000 + second) * S)
    assert watch.notice(1002 * S) == Notice("alarm:junk", {"hz": 100}, ("new",))


def test_the_pilot_reads_of_a_flood_and_of_its_end_and_of_no_other_lindy() -> None:
    host = VirtualHost()
    rows, stack = Registry.read(), Stack()
    for name in ("link_monitor", "gamepad"):
        host.add(name, rows[name], stack)
    alarms: list[str] = []
    told: list[str] = []
    screen = host.node("screen", ["topside"])
    screen.each(topics.LATENCY, lambda budget, _: alarms.append(note(budget.alarms)))
    screen.each(topics.LOG, lambda line, _: told.append(line.text))
    port = host.side("topside")

    def spit(_: int) -> None:
        for topic in topics.ALL:
            key = topic.key.replace("*", "stranger")
            port.forward(Envelope(key, b"\xc1junk", topic.encoding))
            port.forward(Envelope(key, b"\x81\xa6source\xa1\xff", topic.encoding))

    junk = host.node("junk", ["topside"])
    junk.every(50.0, spit)
    host.run(4 * S)
    assert "a second, gamepad)" in alarms[-1]
    assert [text for text in told if "another Lindy" in text or "unknown version" in text] == []
    host.kill("junk")
    host.run(9 * S)
    assert "cannot read" not in alarms[-1]
    assert sum("cannot read" in text for text in told) == 1


EVERY = Registry.read()
ROWS = EVERY.only({name: EVERY[name] for name in ("tether", "link_monitor")})


@pytest.mark.parametrize("ahead", [None, 0, 3_600 * S])
def test_pings_are_answered_from_the_other_realm(ahead: int | None) -> None:
    host = VirtualHost(None if ahead is None else {"drone": Skew(ahead)})
    rows = ROWS if ahead is None else ROWS.apart()
    host.add_all(rows, Stack(link="remote", apart=ahead is not None))
    clocks, health = list[Clock](), dict[str, Health]()
    ears = host.node("ears", ["topside"])
    ears.each(topics.CLOCK, lambda m, _: clocks.append(m))
    ears.each(topics.HEALTH, lambda m, _: health.update({m.service: m}))
    host.run(3 * S)
    assert clocks[-1].rtt_ms is not None
    assert clocks[-1].rtt_ms >= 100.0  # over the link and back, not from neighbour to neighbour
    assert clocks[-1].offset_ns is not None
    assert clocks[-1].bound_ns is not None
    assert abs(clocks[-1].offset_ns - (ahead or 0)) <= clocks[-1].bound_ns
    assert set(rows) <= set(health)


def test_once_the_drone_has_answered_the_topside_says_again_who_it_is_and_its_clock() -> None:
    """What was said before the two have met was heard by nobody."""
    host = VirtualHost({"drone": Skew(5 * S)})
    host.add_all(ROWS.apart(), Stack(link="remote", apart=True))
    said, answered, known = list[int](), list[int](), list[int]()
    ears = host.node("ears", ["topside"])
    ears.each(topics.IDENTITY.of("topside"), lambda _, now: said.append(now))
    ears.each(topics.CLOCK_PONG, lambda _, now: answered.append(now))
    ears.each(topics.CLOCK, lambda m, now: known.append(now) if m.offset_ns is not None else None)
    host.run(3 * S)
    assert said.count(answered[0]) == 1
    assert known[0] == answered[0]


def test_on_two_machines_no_name_is_there_twice() -> None:
    topside, drone = (on_side(EVERY, side, gateway=False) for side in ("topside", "drone"))
    assert set(topside) & set(drone) == set()
    assert topside["link_monitor"] == ServiceSpec(sides=["topside"], service="link_monitor")
    assert drone["link_monitor_drone"] == ServiceSpec(sides=["drone"], service="link_monitor")
