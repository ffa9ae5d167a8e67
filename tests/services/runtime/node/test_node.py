"""A node's ports and timers, on virtual time."""

import re
from collections import Counter
from collections.abc import Callable

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import events, topics
from messages.health import Health, LogLine
from messages.payload import MEMBERS
from messages.pilot import PilotCommand
from messages.sensors import ImuSample
from services.runtime.bus.envelope import Envelope
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.node import RING, Node

MS = 1_000_000
DRONE = ["drone"]


def imu(now: int) -> ImuSample:
    return ImuSample(stamp_ns=now, specific_force=(0.0, 0.0, -9.81), angular_rate=(0.0, 0.0, 0.0))


def command(now: int, heave: float = 0.0) -> PilotCommand:
    return PilotCommand(stamp_ns=now, surge=0.0, sway=0.0, heave=heave, yaw=0.0)


def talker(host: VirtualHost, hz: float = 100.0) -> Node:
    node = host.node("talker", DRONE)
    says = node.publisher(topics.IMU)
    node.every(hz, lambda now: says.put(imu(now)))
    return node


def test_each_hears_every_message_in_order() -> None:
    host = VirtualHost()
    talker(host)
    heard: list[int] = []
    host.node("listener", DRONE).each(topics.IMU, lambda m, _: heard.append(m.seq))
    host.run(1000 * MS)
    assert heard == list(range(100))


def test_a_trigger_is_driven_by_messages_and_goes_on_in_silence() -> None:
    host = VirtualHost()
    talker(host)
    calls: list[tuple[int, bool]] = []
    listener = host.node("listener", DRONE)
    listener.trigger(topics.IMU, lambda m, now: calls.append((now, m is not None)), 0.03)
    host.run(100 * MS)
    host.kill("talker")
    host.run(200 * MS)
    assert [now for now, heard in calls if heard] == [k * 10 * MS for k in range(1, 11)]
    silent = [now for now, heard in calls if not heard]
    assert silent == [k * 10 * MS for k in range(13, 21)]
    assert listener.counts["silent:sensor/imu"] == len(silent)


def test_a_trigger_that_never_heard_anything_counts_no_silence() -> None:
    host = VirtualHost()
    listener = host.node("listener", DRONE)
    listener.trigger(topics.IMU, lambda _, __: None, 0.03)
    host.run(1000 * MS)
    assert listener.counts == {}


@given(st.integers(0, 500), st.integers(1, 9))
@settings(max_examples=30, deadline=None)
def test_what_waited_until_it_was_stale_drives_nothing_and_is_counted(
    late_ms: int, messages: int
) -> None:
    """As in a process that the computer does not run for a while."""
    host, drove, seen = VirtualHost(), list[int](), list[int]()
    says = host.node("talker", DRONE).publisher(topics.IMU)
    late, thorough = host.node("late", DRONE), host.node("thorough", DRONE)

    def noted(heard: list[int]) -> Callable[[ImuSample | None, int], None]:
        return lambda message, _: heard.append(message.seq) if message is not None else None

    late.trigger(topics.IMU, noted(drove), 10.0)
    thorough.trigger(topics.IMU, noted(seen), 10.0, earlier=lambda _m, _n: None)
    for _ in range(messages):
        says.put(imu(0))
    late.wake = thorough.wake = lambda: None  # the computer does not run them
    host.run(late_ms * MS)
    for node in (late, thorough):
        node.step()
    assert seen == [messages - 1]  # what is integrated is never thrown away
    stale = late_ms > 100
    assert drove == ([] if stale else [messages - 1])
    assert late.counts["stale:sensor/imu"] == stale


def test_the_latest_value_goes_stale_and_that_is_counted_once_per_passage() -> None:
    host = VirtualHost()
    pilot, listener = host.node("pilot", DRONE), host.node("listener", DRONE)
    says, hears = pilot.publisher(topics.PILOT_COMMAND), listener.latest(topics.PILOT_COMMAND)
    assert hears.fresh(host.now) is None
    says.put(command(0, heave=0.5))
    assert hears.fresh(300 * MS) is not None
    assert hears.fresh(301 * MS) is None
    assert hears.fresh(400 * MS) is None
    assert hears.newest(400 * MS) is not None
    assert listener.counts == {"stale:pilot/command": 1}


def test_a_latest_port_cannot_queue() -> None:
    host = VirtualHost()
    pilot, listener = host.node("pilot", DRONE), host.node("listener", DRONE)
    says, hears = pilot.publisher(topics.PILOT_COMMAND), listener.latest(topics.PILOT_COMMAND)
    for k in range(1000):
        says.put(command(k, heave=k / 1000))
    newest = hears.fresh(1000)
    assert newest is not None
    assert newest.heave == 0.999
    assert listener.counts["overflowed:pilot/command"] == 1000 - RING


def test_garbage_between_good_messages_disturbs_nothing() -> None:
    host = VirtualHost()
    talker(host)
    listener, heard = host.node("listener", DRONE), list[int]()
    listener.each(topics.IMU, lambda m, _: heard.append(m.seq))
    foreign = host.side("drone")
    node = host.node("foreign", DRONE)
    node.every(50, lambda _: foreign.forward(Envelope("sensor/imu", b"\xff", "text/plain")))
    host.run(1000 * MS)
    assert heard == list(range(100))
    assert listener.counts["wrong_type:sensor/imu"] == 50


def test_ticks_do_not_drift_and_long_stalls_are_counted_not_caught_up() -> None:
    now = 0
    host = VirtualHost()
    node = host.node("worker", DRONE)
    rang: list[int] = []
    node.every(100, rang.append)
    host.run(50 * MS)
    assert rang == [k * 10 * MS for k in range(1, 6)]
    host.now = now = 1_003 * MS  # the process was stopped for a second
    node.step()
    assert len(rang) == 6
    assert node.counts["missed_deadline"] == 94
    host.run(1_011 * MS)
    assert rang[-1] == 1_010 * MS
    assert now < rang[-1]


def test_an_alarm_rings_once_each_time_it_is_set() -> None:
    host = VirtualHost()
    node = host.node("worker", DRONE)
    rang: list[int] = []
    alarm = node.alarm(rang.append)
    alarm.set(5 * MS)
    host.run(20 * MS)
    alarm.set(30 * MS)
    alarm.set(None)
    host.run(50 * MS)
    assert rang == [5 * MS]


def test_health_tells_rate_counts_and_traffic_once_a_second() -> None:
    host = VirtualHost()
    talker(host)
    listener, reports = host.node("listener", DRONE), list[Health]()
    listener.each(topics.HEALTH, lambda m, _: reports.append(m))
    host.nodes["talker"].tell(events.CLAMPED("something"), 3)
    host.run(2_500 * MS)
    (first, second) = reports
    assert first.service == "talker"
    assert second.sent == pytest.approx(200, abs=2)
    assert second.loop_hz == pytest.approx(100, abs=2)
    assert second.counts == {"clamped:something": 3}
    assert second.cpu_percent is None


def test_a_visitor_has_no_health_and_so_never_looks_like_a_service_that_was_started_again() -> None:
    host = VirtualHost()
    listener, reports = host.node("listener", DRONE), list[Health]()
    listener.each(topics.HEALTH, lambda m, _: reports.append(m))
    port = host.node("neighbour", DRONE).sides  # on which a listener hears the visitor
    visitor = Node("ask", port, lambda: host.now, VolatileCheckpoint(), visitor=True)
    host.run(1)
    for _ in range(3):
        visitor.step()
        host.run(host.now + 1_000 * MS)
    assert {health.service for health in reports} == {"neighbour"}


def test_a_log_line_is_said_on_the_bus_and_shown() -> None:
    host = VirtualHost()
    node, listener = host.node("worker", DRONE), host.node("listener", DRONE)
    heard, shown = list[LogLine](), list[LogLine]()
    node.show = shown.append
    listener.each(topics.LOG, lambda m, _: heard.append(m))
    node.log("warning", "deep water")
    listener.step()
    assert [line.text for line in heard] == [line.text for line in shown] == ["deep water"]


class Note(msgspec.Struct):
    depth: float


def test_what_was_remembered_survives_a_kill() -> None:
    host = VirtualHost()
    node = host.node("worker", DRONE)
    assert node.restore_checkpoint(Note) is None
    node.save_checkpoint(Note(3.5))
    host.kill("worker")
    again = host.node("worker", DRONE)
    assert again.restore_checkpoint(Note) == Note(3.5)


def test_a_damaged_memory_is_counted_and_treated_as_none() -> None:
    host = VirtualHost()
    host.node("worker", DRONE).save_checkpoint(msgspec.defstruct("Other", [("depth", str)])("deep"))
    again = host.node("worker", DRONE)
    assert again.restore_checkpoint(Note) is None
    assert again.counts == {"malformed:memory": 1}


def test_a_memory_that_is_no_text_is_treated_as_none() -> None:
    class Torn:
        def restore_checkpoint(self) -> bytes:
            return b'{"depth": "\xff"}'

        def save_checkpoint(self, data: bytes) -> None: ...

    node = VirtualHost().node("worker", DRONE)
    node._checkpoint = Torn()  # pyright: ignore[reportPrivateUsage, reportAttributeAccessIssue]
    kind = msgspec.defstruct("Words", [("depth", str)])
    assert node.restore_checkpoint(kind) is None
    assert node.counts == {"malformed:memory": 1}


def test_two_services_that_answer_each_other_for_ever_are_found_out() -> None:
    host = VirtualHost()
    ping, pong = host.node("ping", DRONE), host.node("pong", DRONE)
    serve, back = ping.publisher(topics.IMU), pong.publisher(topics.LOG.of("back"))
    pong.each(
        topics.IMU,
        lambda _, now: back.put(LogLine(stamp_ns=now, service="", level="info", text="")),
    )
    ping.each(topics.LOG.of("back"), lambda _, now: serve.put(imu(now)))
    ping.alarm(lambda now: serve.put(imu(now))).set(1 * MS)
    with pytest.raises(RuntimeError, match="keep waking each other"):
        host.run(2 * MS)


def test_what_is_collected_waits_for_the_next_timer_and_for_the_end() -> None:
    host = VirtualHost()
    talker(host)
    listener = host.node("listener", DRONE)
    collected: list[tuple[int, int]] = []  # arrival, and the moment it was handed over
    listener.collect("drone", "**", lambda _, at: collected.append((at, host.now)), 100)
    listener.every(10.0, lambda _: None)
    host.run(250 * MS)
    # Said at the very instant of a timer: before it or after it, as the nodes were started.
    assert collected == [(k * 10 * MS, 100 * MS) for k in range(1, 11)] + [
        (k * 10 * MS, 200 * MS) for k in range(11, 21)
    ]
    host.close()
    assert collected[20:] == [(k * 10 * MS, 250 * MS) for k in range(21, 26)]


def test_what_is_collected_is_as_late_as_the_timer_that_takes_it() -> None:
    host, now = VirtualHost(), 0
    listener = Node("listener", {"drone": host.side("drone")}, lambda: now, VolatileCheckpoint())
    listener.collect("drone", topics.IMU.key, lambda _, __: None, 100)
    listener.every(2.0, lambda _: None)
    host.node("talker", DRONE).publisher(topics.IMU).put(imu(0))
    now = 700 * MS  # the timer was due at 500 ms
    listener.step()
    health = listener.loop_stats.report("listener", now, 0, 0, Counter[str](), None)
    assert (health.lateness_p50_ms, health.lateness_p99_ms, health.loop_hz) == (200.0, 200.0, 2.0)


def test_more_than_can_be_collected_is_counted() -> None:
    host = VirtualHost()
    talker(host)
    listener = host.node("listener", DRONE)
    listener.collect("drone", topics.IMU.key, lambda _, __: None, 60)
    host.run(999 * MS)
    assert listener.counts == {"overflowed:sensor/imu": 39}


def invented(
    host: VirtualHost, names: list[str], payload: bytes | None, own: str | None = None
) -> None:
    """Somebody says these bytes as health under these names; None: what such a service says, or
    the service `own` in its place."""
    stranger, encoding = host.side("drone"), topics.HEALTH.encoding
    for name in names:
        said = healthy(own or name[:64]) if payload is None else payload
        stranger.forward(Envelope(f"health/{name}", said, encoding))
        host.nodes["listener"].step()


def healthy(service: str) -> bytes:
    return msgspec.msgpack.encode(
        Health(
            stamp_ns=0, service=service, loop_hz=1.0, lateness_p50_ms=None, lateness_p99_ms=None,
            cpu_percent=None, rss_mb=None, sent=0, received=0, counts={},
        )
    )  # fmt: skip


@given(
    st.lists(
        st.tuples(
            st.lists(st.text(st.characters(exclude_characters="/"), min_size=1), max_size=5),
            st.sampled_from([None, healthy("x"), b"", b"garbage"]),
        ),
        max_size=5,
    )
)
@settings(max_examples=50, deadline=None)
def test_what_is_counted_never_carries_a_name_that_no_member_may_have(
    said: list[tuple[list[str], bytes | None]],
) -> None:
    host = VirtualHost()
    listener = host.node("listener", DRONE)
    listener.each(topics.HEALTH, lambda _, __: None)
    for names, payload in said:
        invented(host, names, payload)
    for name in listener.counts:
        assert re.fullmatch(r"[a-z_]+:health/(\*|[a-z0-9_]{1,64})", name)


def test_a_flood_of_invented_members_is_heard_up_to_a_limit_and_counted_under_one_name() -> None:
    host = VirtualHost()
    listener, heard = host.node("listener", DRONE), list[Health]()
    listener.each(topics.HEALTH, lambda m, _: heard.append(m))
    names = [f"s{k}" for k in range(3 * MEMBERS)]
    invented(host, names, b"garbage")  # takes up no place
    assert listener.counts == {"malformed:health/*": 3 * MEMBERS}
    listener.outbox.counts.clear()
    invented(host, names, None)
    assert len(heard) == MEMBERS
    assert listener.counts == {"too_many_keys:health/*": 2 * MEMBERS}
    invented(host, ["s0"], b"garbage")
    assert listener.counts["malformed:health/s0"] == 1
    invented(host, ["My ROV!", "x" * 65], None)
    assert listener.counts["unknown_key:health/*"] == 2


def test_nobody_speaks_in_the_name_of_another_service_than_that_of_his_key() -> None:
    """Who may say health/camera, by his certificate, says nothing of control."""
    host = VirtualHost()
    listener, heard = host.node("listener", DRONE), list[Health]()
    listener.each(topics.HEALTH, lambda m, _: heard.append(m))
    invented(host, ["camera"], None, own="control")
    assert not heard
    assert listener.counts == {"misnamed:health/*": 1}
    invented(host, ["camera"], None)
    assert [each.service for each in heard] == ["camera"]


def test_what_comes_from_outside_is_handled_once_for_however_many_calls() -> None:
    host, at = VirtualHost(), list[int]()
    node = host.node("listener", DRONE)
    notify = node.from_outside(at.append)
    for _ in range(1000):
        notify()
    host.run(5 * MS)
    assert at == []  # nobody has stepped it yet on virtual time
    node.step()
    assert at == [5 * MS]
    node.step()
    assert len(at) == 1
    notify()
    node.step()
    assert len(at) == 2


def test_what_comes_from_outside_while_it_is_handled_is_handled_again() -> None:
    host, left = VirtualHost(), [3]
    node = host.node("listener", DRONE)

    def handle(_: int) -> None:
        left[0] -= 1
        if left[0]:
            notify()

    notify = node.from_outside(handle)
    notify()
    for _ in range(3):
        node.step()
    assert left == [0]
