"""`lindy topic` and `lindy top`: figures that are true, and one sentence where there are none."""

import json
import os
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from statistics import median

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.health import Health
from messages.sensors import BatterySample, ImuSample
from services.runtime.bus.spaces import namespace
from services.runtime.bus.zenoh_bus import ZenohBus, connected, listening
from services.runtime.config.errors import LindyError
from services.runtime.config.running import RUNNING, Running
from tools.__main__ import main
from tools.topic.command import SILENT_NS, HeardStream, table
from tools.topic.listening import named, side_of

S = 1_000_000_000  # [ns]
BOTH_SIDES = Running("rov1", {"topside": "a", "drone": "b"}, 1, {})
TOPSIDE = Running("rov1", {"topside": "a"}, 1, {})


@given(st.lists(st.integers(1, S), min_size=1, max_size=50), st.integers(1, 2000))
def test_rate_pauses_and_amount_are_those_of_what_came(gaps: list[int], size: int) -> None:
    figures, now = HeardStream(), 7
    figures.hear(size, 0, now)
    for gap in gaps:
        now += gap
        figures.hear(size, 0, now)
    hz = len(gaps) * 1e9 / sum(gaps)
    cells = figures.cells(topics.STATE)
    count, rate, wanted, middle, most, *_, kbit, mean, largest = cells
    assert (count, wanted) == (str(len(gaps) + 1), "100")
    assert float(rate) == pytest.approx(hz, abs=0.051)
    assert float(middle) == pytest.approx(median(gaps) / 1e6, abs=0.051)
    assert float(most) == pytest.approx(max(gaps) / 1e6, abs=0.051)
    assert float(kbit) == pytest.approx(hz * size * 8e-3, abs=0.051)
    assert (mean, largest) == (str(size), str(size))


def test_a_stream_is_named_as_in_the_table_or_as_one_of_a_family() -> None:
    assert [topic.key for topic in named(["state", "health/*", "log/control"])] == [
        "state", "health/*", "log/control",
    ]  # fmt: skip
    for wrong in ("stat", "health", "health/", "health/a/b", ""):
        with pytest.raises(LindyError, match="no topic is called"):
            named([wrong])


def test_what_never_leaves_the_drone_is_listened_to_there() -> None:
    imu, state = named(["sensor/imu"]), named(["state"])
    assert side_of(BOTH_SIDES, imu) == side_of(BOTH_SIDES, [*state, *imu]) == "drone"
    assert side_of(BOTH_SIDES, state) == side_of(BOTH_SIDES, []) == "topside"
    with pytest.raises(LindyError, match="never leaves the drone; on this machine is only"):
        side_of(TOPSIDE, imu)


def health(service: str, cpu: float, **more: object) -> Health:
    given: dict[str, object] = {
        "stamp_ns": 0, "service": service, "loop_hz": 100.0, "lateness_p50_ms": 0.1,
        "lateness_p99_ms": 0.5, "cpu_percent": cpu, "rss_mb": 50.0, "sent": 1, "received": 2,
        "counts": {},
    }  # fmt: skip
    return Health(**(given | more))  # type: ignore[arg-type]


def test_top_ranks_and_says_who_is_late_or_silent_and_what_was_counted_in_the_last_second() -> None:
    heard = {
        "a": (health("a", 1.0, counts={"dropped": 5, "resting": 9}), None, 10 * S),
        "b": (
            health("b", 9.0, counts={"dropped": 7}, lateness_p99_ms=80.0),
            health("b", 9.0, counts={"dropped": 4}),
            10 * S,
        ),
        "c": (health("c", 4.0), None, 10 * S - SILENT_NS - 1),
    }
    lines = [line.split() for line in table(heard, 10 * S)[1:]]
    assert [line[0] for line in lines] == ["b", "c", "a"]
    assert lines[0][-2:] == ["3", "late"]
    assert " ".join(lines[1][-4:]) == "silent for 3 s"
    assert lines[2][-1] == "–"


@contextmanager
def dive(folder: Path) -> Generator[Path]:
    """Both hubs of a dive, a battery at 50 a second on the topside, an IMU on the drone's."""
    ends = {side: f"unixsock-stream/{folder}/{side}.sock" for side in ("topside", "drone")}
    (folder / RUNNING).write_bytes(msgspec.json.encode(Running("rov1", ends, os.getpid(), {})))
    over = threading.Event()
    with listening(ends["topside"]), listening(ends["drone"]):
        sessions = {side: connected(end, namespace("rov1")) for side, end in ends.items()}
        battery = ZenohBus(sessions["topside"]).say(topics.BATTERY)
        imu = ZenohBus(sessions["drone"]).say(topics.IMU)

        def speak() -> None:
            while not over.wait(0.02):
                now = time.monotonic_ns()
                sample = BatterySample(stamp_ns=now, voltage=16.0, current=1.0, used_wh=1.0)
                battery(msgspec.msgpack.encode(sample))
                gravity = (0.0, 0.0, -9.81)
                imu(
                    msgspec.msgpack.encode(
                        ImuSample(
                            stamp_ns=now, specific_force=gravity, angular_rate=(0.0, 0.0, 0.0)
                        )
                    )
                )

        thread = threading.Thread(target=speak)
        thread.start()
        try:
            yield folder
        finally:
            over.set()
            thread.join()
            for session in sessions.values():
                session.close()


@pytest.mark.slow
def test_streams_of_a_real_session_are_shown_timed_and_weighed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def said(*words: str) -> list[str]:
        assert main(["topic", *words, "--dive", str(tmp_path)]) == 0
        return capsys.readouterr().out.splitlines()

    with dive(tmp_path):
        shown = [json.loads(line) for line in said("echo", "sensor/battery", "--count", "3")]
        assert [each["topic"] for each in shown] == ["sensor/battery"] * 3
        assert {each["message"]["voltage"] for each in shown} == {16.0}
        (heading, row) = said("hz", "sensor/battery", "--count", "60")
        assert heading.split()[:4] == ["topic", "messages", "1/s", "table"]
        key, count, hz, wanted, *_ = row.split()
        assert (key, count, wanted) == ("sensor/battery", "60", "1")
        assert 0.0 < float(hz) <= 55.0
        (_, row) = said("hz", "sensor/imu", "--count", "20")
        assert row.split()[:2] == ["sensor/imu", "20"]
        age, _, oldest, kbits, size, _ = map(float, row.split()[-6:])
        assert 0.0 <= age <= oldest
        assert kbits == pytest.approx(size * 8e-3 * 50.0, rel=0.9)
        assert said("hz", "state", "--seconds", "0.2")[1].split()[:2] == ["state", "0"]


def test_what_cannot_be_read_is_no_message_of_the_count(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    over = threading.Event()

    def junk(endpoint: str) -> None:
        with connected(endpoint, namespace("rov1")) as session:
            while not over.wait(0.002):
                session.put("sensor/battery", b"junk")

    with dive(tmp_path):
        running = msgspec.json.decode((tmp_path / RUNNING).read_bytes(), type=Running)
        thread = threading.Thread(target=junk, args=(running.endpoints["topside"],))
        thread.start()
        try:
            words = ["topic", "echo", "sensor/battery", "--count", "3", "--dive", str(tmp_path)]
            assert main(words) == 1
        finally:
            over.set()
            thread.join()
    shown = capsys.readouterr()
    assert len(shown.out.splitlines()) == 3
    assert "messages on sensor/battery could not be read" in shown.err


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        (("top",), "control"),
        (("topic", "hz", "health/*"), "health/control"),
        (("topic", "echo", "health/*"), '"service":"control'),
    ],
)
def test_what_cannot_be_read_is_counted_and_the_rest_is_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], shown: str
) -> None:
    ends = {"topside": f"unixsock-stream/{tmp_path}/hub.sock"}
    (tmp_path / RUNNING).write_bytes(msgspec.json.encode(Running("rov1", ends, os.getpid(), {})))
    encode, over = msgspec.msgpack.encode, threading.Event()
    with listening(ends["topside"]):
        session = connected(ends["topside"], namespace("rov1"))
        say = ZenohBus(session).say

        def speak() -> None:
            while not over.wait(0.02):
                say(topics.HEALTH.of("control"))(encode(health("control", 1.0)))
                say(topics.HEALTH.of("x"))(encode({"seq": 1, "stamp_ns": 1, "service": "x"}))
                say(topics.HEALTH.of("y"))(encode(health("control", 1.0)))  # in its name
                session.put("health/z\u202e", b"\xc1")
                session.put("health/u", encode(health("u", 1.0)))  # of no type

        thread = threading.Thread(target=speak)
        thread.start()
        try:
            assert main([*words, "--dive", str(tmp_path), "--seconds", "1"]) == 1
        finally:
            over.set()
            thread.join()
            session.close()
    out, err = capsys.readouterr()
    assert shown in out
    for forged in ("health/x", "health/y", "health/z\N{REPLACEMENT CHARACTER}", "health/u"):
        assert f" messages on {forged}" in err
        assert forged not in out
    assert err.count("\n") == 1


def test_the_list_is_the_topic_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["topic", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()[1:]
    assert [line.split()[0] for line in lines] == [topic.key for topic in topics.ALL]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("topic", "echo", "stat"), "no topic is called 'stat'; did you mean 'state'?"),
        (("topic", "hz", "state", "--count", "0"), "--count is 0, expected a number above 0"),
        (("top", "--seconds", "nan"), "--seconds is nan, expected a number above 0"),
    ],
)
def test_what_cannot_be_done_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], said: str
) -> None:
    running = Running("rov1", {"topside": "unixsock-stream/x"}, os.getpid(), {})
    (tmp_path / RUNNING).write_bytes(msgspec.json.encode(running))
    assert main([*words, "--dive", str(tmp_path)]) == 1
    answer = capsys.readouterr().err
    assert answer.startswith(f"lindy: {said}")
    assert answer.count("\n") == 1
