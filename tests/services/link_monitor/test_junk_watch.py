"""A flood of messages that cannot be read is said, a damaged one now and then is not."""

from collections import Counter

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.health import Health
from services.link_monitor.core import MOST_HZ, RECENT_NS, SERVICES, JunkWatch
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.loop_stats import LoopStats

S = 1_000_000_000  # [ns]


def health(counts: dict[str, int], service: str = "control") -> Health:
    return LoopStats().report(service, 0, 0, 0, Counter(counts), None, "drone")


@given(st.lists(st.integers(0, 60), min_size=2, max_size=20))
def test_more_than_so_many_in_a_second_are_a_flood(more: list[int]) -> None:
    watch, total = JunkWatch(), 0
    watch.health(health({"malformed:state": 5000}), 0)
    for second, number in enumerate(more, 1):
        total += number
        watch.health(health({"malformed:state": 5000 + total, "expired:x": 9**9}), second * S)
        floods = [n > MOST_HZ for n in more[max(0, second - 3) : second]]
        assert bool(watch.words(second * S)) == any(floods)


def test_a_flood_is_over_some_seconds_after_the_last_health_that_tells_of_it() -> None:
    watch = JunkWatch()
    watch.health(health({}), 0)
    watch.health(health({"wrong_type:state": 100, "malformed:pilot/request": 7}), S)
    assert watch.words(S) == (
        "control cannot read 107 messages a second (state …): "
        "somebody else speaks on this network, or the sender is broken"
    )
    assert watch.words(S + RECENT_NS) == ""


def test_a_service_that_has_started_again_counts_anew_and_is_no_flood() -> None:
    watch = JunkWatch()
    watch.health(health({"malformed:state": 900}), 0)
    watch.health(health({"malformed:state": 3}), S)
    assert watch.words(S) == ""


@given(st.lists(st.tuples(st.integers(0, 1), st.integers(0, 5)), max_size=30))
def test_two_topsides_of_one_drone_are_no_flood_whatever_each_has_counted(
    reports: list[tuple[int, int]],
) -> None:
    watch, counted = JunkWatch(), [0, 30]  # since their starts
    for at, (topside, more) in enumerate(reports):
        counted[topside] += more
        told = health({"malformed:state": counted[topside]}, "recorder_topside")
        watch.health(msgspec.structs.replace(told, instance=topside + 1), at * S // 2)
        assert watch.words(at * S // 2) == ""


def test_restarted_services_leave_room_for_others() -> None:
    watch = JunkWatch()
    for second in range(3 * SERVICES):
        told = msgspec.structs.replace(health({}), instance=second)
        watch.health(told, second * S)
    for second in range(3):
        watch.health(health({"malformed:x": 100 * second}, "new"), (4 * SERVICES + second) * S)
    assert watch.words((4 * SERVICES + 2) * S).startswith("new cannot read")


def test_a_broken_sensor_is_no_flood() -> None:
    watch = JunkWatch()
    for second in range(3):
        watch.health(health({"malformed:sensor/imu": 100 * second}), second * S)
    assert watch.words(2 * S) == ""


def test_only_so_many_services_are_watched() -> None:
    watch = JunkWatch()
    for second in range(3):
        for number in range(10 * SERVICES):
            watch.health(health({"malformed:x": 100 * second}, f"s{number}"), second * S)
    assert watch.words(2 * S).startswith("s0 cannot read 100 messages")
    for second in range(3, 6):
        watch.health(health({"malformed:x": 100 * second}, "one more"), second * S)
    assert watch.words(6 * S) == ""


def test_the_pilot_reads_of_a_flood_and_of_its_end_and_of_no_other_lindy() -> None:
    host = VirtualHost()
    rows, stack = Registry.read(), Stack()
    for name in ("link_monitor", "gamepad"):
        host.add(name, rows[name], stack)
    alarms: list[str] = []
    told: list[str] = []
    screen = host.node("screen", ["topside"])
    screen.each(topics.LATENCY, lambda budget, _: alarms.append(budget.alarm))
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
    assert alarms[-1].startswith("gamepad cannot read")
    assert [text for text in told if "another Lindy" in text or "unknown version" in text] == []
    host.kill("junk")
    host.run(9 * S)
    assert "somebody else" not in alarms[-1]
    assert sum("somebody else" in text for text in told) == 1
