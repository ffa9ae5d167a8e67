"""A node on virtual time: its ports, timers and memory."""

import threading
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import events, topics
from messages.health import Health, LogLine
from messages.sensors import ImuSample
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node import checkpoint as checkpoints
from services.runtime.node.checkpoint import CheckpointFile, VolatileCheckpoint, write_safely
from services.runtime.node.node import FORGETS, Node
from tests.support.messages import enveloped, example
from tests.support.patience import PATIENCE_S
from tests.support.said import imu

MS = 1_000_000
DRONE = ["drone"]


def talker(host: VirtualHost, hz: float = 100.0) -> Node:
    node = host.node("talker", DRONE)
    says = node.publisher(topics.IMU)
    node.every(hz, lambda now: says.put(imu(now)))
    return node


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


@given(st.integers(0, 500), st.integers(1, 9))
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


@pytest.mark.parametrize("torn", [b'{"words": "\xff"}', b'{"words": 3}', b'{"words": "de'])
def test_a_memory_that_is_damaged_is_counted_and_treated_as_none(torn: bytes) -> None:
    class Torn(VolatileCheckpoint):
        def restore_checkpoint(self) -> bytes:
            return torn

    node = Node("worker", {"drone": VirtualHost().side("drone")}, lambda: 0, Torn())
    assert node.restore_checkpoint(msgspec.defstruct("Words", [("words", str)])) is None
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


def test_nobody_speaks_in_the_name_of_another_service_than_that_of_his_key() -> None:
    """Who may say health/camera, by his certificate, says nothing of control."""
    host = VirtualHost()
    listener, heard = host.node("listener", DRONE), list[Health]()
    listener.each(topics.HEALTH, lambda m, _: heard.append(m))
    for name in ("control", "camera"):
        said = example(Health, service=name)
        host.side("drone").forward(enveloped(topics.HEALTH, said, "health/camera"))
        listener.step()
    assert [each.service for each in heard] == ["camera"]
    assert listener.counts == {"misnamed:health/*": 1}


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


# Checkpoints on disk: whole, the newest, off the handlers' thread, and never somebody else's.


S = 1_000_000_000  # [ns]


def test_a_checkpoint_is_there_for_the_next_run(tmp_path: Path):
    path = tmp_path / "worker.json"
    before = CheckpointFile(path)
    assert before.restore_checkpoint() is None
    for depth in range(20):
        before.save_checkpoint(f"{depth}".encode())
    before.close()
    after = CheckpointFile(path)
    assert after.restore_checkpoint() == b"19"
    after.close()
    assert [file.name for file in tmp_path.iterdir()] == ["worker.json"]


def test_while_the_disk_is_busy_nobody_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    begun, may_go_on, written = threading.Semaphore(0), threading.Semaphore(0), list[bytes]()

    def write_slowly(_: Path, data: bytes) -> None:
        begun.release()
        assert may_go_on.acquire(timeout=PATIENCE_S)
        written.append(data)

    monkeypatch.setattr(checkpoints, "write_safely", write_slowly)
    checkpoint = CheckpointFile(tmp_path / "worker.json")
    checkpoint.save_checkpoint(b"first")
    assert begun.acquire(timeout=PATIENCE_S)
    for number in range(100):  # would never come to an end if any of them waited
        checkpoint.save_checkpoint(f"{number}".encode())
    may_go_on.release(2)
    checkpoint.close()
    assert written == [b"first", b"99"]


def test_a_write_that_is_cut_short_leaves_the_checkpoint_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = tmp_path / "worker.json"
    write_safely(path, b"whole")

    def power_cut(_: int) -> None:
        raise OSError("no power")

    monkeypatch.setattr(checkpoints.os, "fsync", power_cut)
    with pytest.raises(OSError, match="no power"):
        write_safely(path, b"half of it")
    assert path.read_bytes() == b"whole"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("failure", [OSError(30, "Read-only file system"), MemoryError()])
def test_after_a_checkpoint_that_failed_the_next_one_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failure: Exception
) -> None:
    checkpoint, tried = CheckpointFile(tmp_path / "worker.json"), threading.Semaphore(0)

    def refuse(_: Path, __: bytes) -> None:
        tried.release()
        raise failure

    with monkeypatch.context() as full:
        full.setattr(checkpoints, "write_safely", refuse)
        checkpoint.save_checkpoint(b"first")
        assert tried.acquire(timeout=PATIENCE_S)
    checkpoint.save_checkpoint(b"second")
    checkpoint.close()
    assert checkpoint.failures() == 1
    assert (tmp_path / "worker.json").read_bytes() == b"second"


def test_checkpoints_that_fail_are_said_once_for_as_long_as_that_lasts() -> None:
    """Seconds 1 to 20, and once more long after."""
    now, lines = [0], list[LogLine]()

    class Failing(VolatileCheckpoint):
        def failures(self) -> int:
            return 2 if now[0] <= 20 * S or now[0] == 40 * S else 0

    node = Node("worker", {"drone": VirtualHost().side("drone")}, lambda: now[0], Failing())
    node.show = lines.append
    for second in range(1, 51):
        now[0] = second * S
        node.step()
    said = [(line.level, line.text, line.stamp_ns // S) for line in lines]
    assert said == [("warning", FORGETS, 1), ("warning", FORGETS, 40)]
    assert node.counts[events.NOT_REMEMBERED.name] == 2 * 21
