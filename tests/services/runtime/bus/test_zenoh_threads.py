"""One Zenoh thread per process: what is published in one go still arrives, and processes end."""

import os
import signal
import subprocess
import sys
from collections.abc import Generator
from contextlib import ExitStack
from itertools import count
from pathlib import Path

import msgspec
import pytest

from messages import topics
from messages.topic import AnyTopic, Qos
from services.runtime.bus.zenoh_bus import PRIORITIES, QOS_PROFILES, VARIABLE, open_bus
from services.runtime.hosts.process_host import HubLaunch
from tests.support.patience import PATIENCE_S, until

PLAN = topics.LOG.of("plan")  # what the talker is to say
# On "COUNT SIZE WHERE" it publishes COUNT messages of SIZE bytes, either in the subscriber's call,
# on Zenoh's thread, or on its main thread; on "mark NUMBER" it says the same.
TALKER = """
import sys
import time
from messages import topics
from services.runtime.bus.zenoh_bus import open_bus
with open_bus(sys.argv[1], "pioneer") as bus:
    say, todo = bus.say(topics.find(sys.argv[2])), []
    def speak(payload):
        if payload.startswith(b"mark"):
            return say(payload)
        count, size, _ = payload.split()
        for _ in range(int(count)):
            say(bytes(int(size)))
    def hear(envelope):
        (speak if envelope.payload.endswith(b"zenoh") else todo.append)(envelope.payload)
    bus.hear("log/plan", hear)
    while todo[:1] != [b"end"]:
        if todo:
            speak(todo.pop(0))
        else:
            time.sleep(0.005)
"""
THREADS = """
import os, sys
from services.runtime.bus.zenoh_bus import open_bus
with open_bus(sys.argv[1], "pioneer"):
    tasks = os.listdir("/proc/self/task")
    print(*(open(f"/proc/self/task/{task}/comm").read().strip() for task in tasks))
"""


@pytest.fixture
def hub(tmp_path: Path) -> Generator[str]:
    """Endpoint of a hub process."""
    endpoint = f"unixsock-stream/{tmp_path}/hub.sock"
    launch = msgspec.json.encode(HubLaunch(listen=[endpoint])).decode()
    process = subprocess.Popen([sys.executable, "-P", "-m", "services", "hub", launch])
    yield endpoint
    process.terminate()
    assert process.wait(PATIENCE_S) in {0, -signal.SIGTERM}  # the latter: it had just been started


def run(code: str, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-P", "-c", code, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | environment,
    )


def topic_of(qos: Qos) -> AnyTopic:
    return next(topic for topic in topics.ALL if topic.qos is qos and not topic.is_family)


FIRST, *_, LAST = Qos


@pytest.mark.parametrize("qos", [FIRST, LAST])
def test_large_messages_and_bursts_arrive_at_any_priority(hub: str, qos: Qos) -> None:
    topic, heard, numbers = topic_of(qos), list[bytes](), count()
    with ExitStack() as exits:
        talker = run(TALKER, hub, topic.key)
        exits.callback(talker.kill)
        bus = exits.enter_context(open_bus(hub, "pioneer"))
        bus.hear(topic.key, lambda envelope: heard.append(envelope.payload))
        ask = bus.say(PLAN)

        def until_marked() -> None:
            """Until everything said before has arrived; what is missing never comes. A mark right
            behind 1 MB may be dropped, so it is asked for again, but not so often that marks fill
            the queues."""
            mark, looks = b"mark %d" % next(numbers), count()

            def marked() -> bool:
                if next(looks) % 30 == 0:
                    ask(mark)
                return mark in heard

            until(marked)

        def met() -> bool:
            ask(b"mark")
            return b"mark" in heard

        def arrived(times: int, size: int, where: str) -> int:
            heard.clear()
            ask(f"{times} {size} {where}".encode())
            until_marked()
            return sum(len(payload) == size for payload in heard)

        until(met)  # the talker is there
        until_marked()
        for where in ("main", "zenoh"):
            for size in (1_000, 300_000, 1_000_000):
                assert [arrived(1, size, where) for _ in range(3)] == [1, 1, 1], (where, size)
        assert arrived(400, 900, "zenoh") == 400
        ask(b"end")
        said, shown = talker.communicate(timeout=PATIENCE_S)
    # It has received on Zenoh's thread, whose Python state was kept.
    assert (talker.returncode, said, shown) == (0, "", "")


def test_every_priority_in_use_has_its_queue() -> None:
    in_use = {str(profile.priority).rpartition(".")[2].lower() for profile in QOS_PROFILES.values()}
    assert in_use <= set(PRIORITIES)


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="needs /proc")
def test_zenoh_has_one_thread_unless_the_environment_says_otherwise(hub: str) -> None:
    ours = run(THREADS, hub, **{VARIABLE: ""}).communicate(timeout=PATIENCE_S)[0]
    zenohs = run(THREADS, hub, **{VARIABLE: "()"}).communicate(timeout=PATIENCE_S)[0]
    assert {name.partition("-")[0] for name in ours.split()} <= {"python", "rx"}
    assert "app-0" in zenohs.split()


def test_a_variable_that_zenoh_cannot_read_is_one_sentence(hub: str) -> None:
    process = run(THREADS, hub, **{VARIABLE: "one"})
    _, shown = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert shown.splitlines()[-1].endswith(
        "LindyError: ZENOH_RUNTIME is 'one', and Zenoh does not start with it; "
        "without it, one thread is used"
    )
